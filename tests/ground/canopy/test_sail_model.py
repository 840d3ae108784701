"""Tests of SAIL against other solutions of its equations, of invariants, and of upright plants on slopes."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from oracles_canopy import four_streams, sunlit_and_seen, turned_leaves
from scipy.linalg import expm
from scipy.optimize import brentq

import fifesim
from fifesim.atmosphere.labels import diffuse_fraction
from fifesim.ground.canopy import sail_model
from fifesim.ground.canopy.leaf_angles import LeafAngles, leaf_angle_classes, leaf_projection
from fifesim.ground.canopy.sail_model import (
    bidirectional_gap,
    exponential_chain,
    leaf_scattering,
    over_background,
    reflectance_factor,
    sail,
    upright_reflectance,
    volume_scattering,
    with_background,
)

SHAPES = ["spherical", "planophile", "erectophile", "plagiophile", "extremophile", "uniform", "90: 1", "0: 1"]
LAI = np.array([0, 1e-6, 0.01, 0.5, 2, 8, 20, 100])[:, None, None, None]
RHO = np.linspace(0, 1, 6)[:, None, None]
SZA = np.array([0, 28.5, 60, 85, 89.9])[:, None]
VZA = np.array([0, 30, 75, 89.9])


def test_sail_agrees_with_prosail_without_a_hot_spot():
    """Layer terms and surface reflectances agree to 1e-11; prosail loses digits in differences of equal squares."""
    oracle = pytest.importorskip("prosail.FourSAIL")
    layer = ["tss", "too", "tsstoo", "rdd", "tdd", "rsd", "tsd", "rdo", "tdo", "rso"]
    rng = np.random.default_rng(20)
    for _ in range(500):
        a = rng.uniform(-1, 1)
        b = rng.uniform(-1, 1) * (1 - abs(a))
        leaf_angles = LeafAngles((np.arange(18) + 0.5) * 5, oracle.verhoef_bimodal(a, b, 18))
        rho, tau = rng.dirichlet([1, 1, 0.5])[:2] * 0.98
        (sza, vza), raa, lai, r = rng.uniform(0, 85, 2), rng.uniform(0, 180), rng.uniform(0, 10), rng.uniform()
        theirs = oracle.foursail(np.array([rho]), np.array([tau]), a, b, 1, lai, 0.0, sza, vza, raa, np.array([r]))
        theirs = [np.squeeze(value) for value in theirs]
        canopy = sail(lai, rho, tau, sza=sza, vza=vza, raa=raa, leaf_angles=leaf_angles, hotspot=0.0)
        np.testing.assert_allclose([getattr(canopy, name) for name in layer], theirs[:10], rtol=0, atol=1e-11)
        surface = with_background(canopy, r)
        found = [surface.rdd, surface.rsd, surface.rdo, surface.rso]
        np.testing.assert_allclose(found, [*theirs[12:15], theirs[17]], rtol=0, atol=1e-11)


OPTICS = [(0.5, 0.5), (1.0, 0.0), (0.0, 1.0), (0.07, 0.04), (0.45, 0.42), (0.4999999, 0.5)]
CASES = [(1.0, 28.5, 0, 0), (3.0, 60, 45, 120), (0.01, 89.9, 80, 30), (5.0, 0, 0, 0)]


@pytest.mark.parametrize("rho, tau", OPTICS)
@pytest.mark.parametrize("lai, sza, vza, raa", CASES)
def test_sail_solves_the_four_stream_equations(rho, tau, lai, sza, vza, raa):
    """Compare with a matrix exponential whose coefficients are sums over leaf azimuth, accurate to 1e-9."""
    canopy = sail(lai, rho, tau, sza=sza, vza=vza, raa=raa, leaf_angles="35: 1")
    expected = four_streams(lai, rho, tau, sza, vza, raa, 35.0)
    for name, value in expected.items():
        np.testing.assert_allclose(getattr(canopy, name), value, rtol=1e-7, atol=1e-8, err_msg=name)


@pytest.mark.parametrize("inclination", [0, 5, 45, 70, 89.5, 90])
@pytest.mark.parametrize("sza, vza, raa", [(0, 0, 0), (28.5, 0, 77), (60, 45, 0), (60, 45, 180), (85, 70, 110)])
def test_leaf_projection_and_scattering_match_sums_over_leaf_azimuth(inclination, sza, vza, raa):
    sun, view, reflected, transmitted = turned_leaves(inclination, sza, vza, raa)
    np.testing.assert_allclose(leaf_projection(inclination, [sza, vza]), [sun, view], atol=1e-9)
    scattered = np.pi * np.array(volume_scattering(inclination, sza, vza, raa))
    np.testing.assert_allclose(scattered, [reflected, transmitted], atol=1e-9)


def test_hot_spot_matches_the_converged_integral():
    """The hot spot changes single scattering only; the reference quadrature is accurate to 1e-9."""
    rng = np.random.default_rng(4)
    leaves = leaf_angle_classes("spherical")
    inclination, fraction = np.array(leaves.inclination), np.array(leaves.fraction)
    for _ in range(150):
        sza, vza = rng.choice([0, 10, 28.5, 45, 60, 80, 89, 89.9], 2)
        raa, hotspot = rng.choice([0, 0.01, 5, 90, 180]), 10 ** rng.uniform(-3, 0.3)
        lai = rng.choice([0, 0.01, 0.5, 2, 8, 20])
        mu_s, mu_v = np.cos(np.radians([sza, vza]))
        ks, ko = (leaf_projection(inclination, a) @ fraction / mu for a, mu in ((sza, mu_s), (vza, mu_v)))
        w = [0.5, 0.3] @ (np.pi / (mu_s * mu_v) * (volume_scattering(inclination, sza, vza, raa) @ fraction))
        tan_s, tan_v = np.tan(np.radians([sza, vza]))
        distance = abs(tan_s - tan_v * np.exp(1j * np.radians(raa)))
        area = sunlit_and_seen(lai, ks, ko, 2 * distance / (hotspot * (ks + ko)))
        plain = -np.expm1(-(ks + ko) * lai) / (ks + ko)
        spot, none = (sail(lai, 0.5, 0.3, sza=sza, vza=vza, raa=raa, hotspot=h).rso for h in (hotspot, 0.0))
        np.testing.assert_allclose(spot, none + w * (area - plain), rtol=1e-9, atol=1e-10)


def test_sun_and_observer_share_every_gap_in_the_hot_spot():
    """If the sun is behind the observer, every sunlit gap is visible."""
    canopy = sail(3.0, 0.1, 0.05, sza=40, vza=40, raa=0, hotspot=0.1)
    np.testing.assert_allclose(canopy.tsstoo, canopy.tss, rtol=1e-12)


@pytest.mark.parametrize("shape", SHAPES)
def test_conservative_leaves_lose_no_light(shape):
    canopy = sail(LAI, RHO, 1 - RHO, sza=SZA, vza=VZA, raa=50, leaf_angles=shape)
    np.testing.assert_allclose(canopy.rdd + canopy.tdd, 1, atol=1e-9)
    np.testing.assert_allclose(canopy.rsd + canopy.tsd + canopy.tss, 1, atol=1e-9)
    np.testing.assert_allclose(canopy.rdo + canopy.tdo + canopy.too, 1, atol=1e-9)


@pytest.mark.parametrize("hotspot", [0.0, 0.05])
@pytest.mark.parametrize("shape", SHAPES)
def test_bidirectional_reflectance_is_reciprocal(shape, hotspot):
    given = {"raa": 50, "leaf_angles": shape, "hotspot": hotspot}
    there = with_background(sail(LAI, RHO, 0.9 - 0.9 * RHO, sza=SZA, vza=VZA, **given), 0.2)
    back = with_background(sail(LAI, RHO, 0.9 - 0.9 * RHO, sza=VZA, vza=SZA, **given), 0.2)
    np.testing.assert_allclose(there.rso, back.rso, rtol=1e-12)


@pytest.mark.parametrize("r", [0.0, 0.15, 1.0])
def test_reflectance_without_leaves_equals_the_background(r):
    for reflectance in with_background(sail(0.0, RHO, 1 - RHO, sza=SZA, vza=VZA, hotspot=0.05), r):
        assert np.all(reflectance == r)
    assert (reflectance_factor(0.3, 0.5, 0.0), reflectance_factor(0.3, 0.5, 1.0)) == (0.3, 0.5)


@pytest.mark.parametrize("r", [0.0, 0.15, 0.6, 1.0])
def test_over_background_sums_reflections_between_leaves_and_ground(r):
    """Compare with the sum over orders of reflection."""
    c = sail(2.0, RHO, 0.9 - 0.9 * RHO, sza=SZA, vza=VZA, raa=20, hotspot=0.1)
    terms = c.rso, c.tsstoo - c.tss * c.too, (c.tss + c.tsd) * (c.too + c.tdo), c.rdd
    found = over_background(*terms, r)
    np.testing.assert_allclose(found, with_background(c, r).rso, rtol=1e-13)
    alone, hot, through, rdd = terms
    orders = sum(through * r * (r * rdd) ** n for n in range(4000))
    converged = r * np.broadcast_to(rdd, found.shape) < 0.99
    np.testing.assert_allclose(found[converged], (alone + hot * r + orders)[converged], rtol=1e-12)


def test_black_leaves_reflect_nothing():
    canopy = sail(LAI, 0.0, 0.0, sza=SZA, vza=VZA, hotspot=0.1)
    for scattered in (canopy.rso, canopy.rdo, canopy.rsd, canopy.rdd, canopy.tsd, canopy.tdo):
        np.testing.assert_array_equal(scattered, 0)


@pytest.mark.filterwarnings("error")
def test_nan_stays_in_its_cell_and_nothing_warns():
    lai = np.array([1.0, np.nan, 3.0, 0.0])
    surface = with_background(sail(lai, 0.5, 0.5, sza=30, hotspot=0.1), 0.2)
    np.testing.assert_array_equal(np.isnan(surface.rso), np.isnan(lai))
    np.testing.assert_array_equal(surface.rso[2], with_background(sail(3.0, 0.5, 0.5, sza=30, hotspot=0.1), 0.2).rso)


def test_results_are_smooth_where_the_eigenvalue_equals_the_extinction():
    """Small steps from black to white leaves sweep the eigenvalue m through ks and ko."""
    rho = np.linspace(0, 0.5, 20_001)
    canopy = sail(3.0, rho, rho, sza=60, vza=20, raa=30, leaf_angles="50: 1")
    for values in canopy[:4]:
        assert np.abs(np.diff(values, 2)).max() < 1e-6 and np.all(np.isfinite(values))


def test_arguments_broadcast():
    lai, rho = np.ones((4, 1, 1, 1)), np.full((3, 1, 1), 0.1)
    canopy = sail(lai, rho, 0.1, sza=[[10.0], [20.0]], vza=[0, 5, 9, 20, 30], hotspot=0.1)
    assert with_background(canopy, 0.1).rso.shape == (4, 3, 2, 5)
    alone = sail(1.0, 0.1, 0.1, sza=20, vza=9, hotspot=0.1)
    np.testing.assert_allclose(canopy.rso[2, 1, 1, 2], alone.rso, rtol=1e-14)


@pytest.mark.parametrize("alpha", [0.0, 1e-3, 1.0, 40.0, np.inf])
@pytest.mark.parametrize("lai", [0.01, 2.0, 30.0])
def test_gap_and_sunlit_visible_leaf_area_match_quadrature(lai, alpha):
    ks, ko = 0.7, 0.55
    tsstoo, seen = bidirectional_gap(lai, ks, ko, alpha)
    if np.isinf(alpha):
        expected, gap = -np.expm1(-(ks + ko) * lai) / (ks + ko), np.exp(-(ks + ko) * lai)
    else:
        expected = sunlit_and_seen(lai, ks, ko, alpha)
        overlap = 1.0 if alpha == 0 else -np.expm1(-alpha) / alpha
        gap = np.exp(-(ks + ko) * lai + np.sqrt(ks * ko) * lai * overlap)
    np.testing.assert_allclose([seen, tsstoo], [expected, gap], rtol=1e-9)


FIELDS = ("rso", "rdo", "rsd", "rdd", "tss", "too", "tsd", "tdo", "tdd")


def check_slab(monkeypatch, *args, **options):
    """Check that the closed form of the slab equals the sum of exponential chains, which is never singular."""
    found = sail(*args, **options)
    with monkeypatch.context() as patch:
        patch.setattr(sail_model, "_slabs", lambda *given: given[-1].fill(True))
        expected = sail(*args, **options)
    for name in FIELDS:
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=0, atol=1e-14, err_msg=name)


@pytest.mark.parametrize("leaf_angles", ["spherical", "planophile", "campbell(80)", "0: 1", "90: 1"])
@pytest.mark.parametrize("angles", [(28.5, 10, 40), (0, 0, 0), (60, 60, 0), (75, 50, 180)])
def test_closed_form_of_the_slab_equals_exponential_chains(leaf_angles, angles, monkeypatch):
    """LAI from 1e-8 to 60, black to non-absorbing leaves."""
    random = np.random.default_rng(7)
    lai = np.concatenate([random.uniform(0, 8, 200), 10 ** random.uniform(-8, 1.8, 200), [0.0]])
    absorbed = 10 ** random.uniform(-9, 0, lai.size)
    absorbed[:40], absorbed[40:80] = 0, 1
    rho = (1 - absorbed) * random.uniform(0, 1, lai.size)
    tau = np.maximum(1 - absorbed - rho, 0)
    given = dict(zip(("sza", "vza", "raa"), angles, strict=True), leaf_angles=leaf_angles)
    check_slab(monkeypatch, lai, rho, tau, **given)


def test_nearly_equal_attenuation_rates_are_not_singular(monkeypatch):
    """Attenuation rates of sun, view and diffuse light differ relatively by 1e-14 to 0.01."""
    classes = leaf_angle_classes("spherical")
    angles = 40.0, 40.0, 30.0
    rate = float(leaf_scattering(0.1, 0.1, *angles, classes).ks)
    leaf = brentq(lambda each: float(leaf_scattering(each, each, *angles, classes).m) - rate, 0, 0.49)
    random = np.random.default_rng(8)
    rho = leaf + 10 ** random.uniform(-14, -2, 2000) * random.choice([-1, 1], 2000)
    lai = 10 ** random.uniform(-4, 1.5, 2000)
    given = {"sza": 40.0, "vza": 40.0 + 10 ** random.uniform(-12, -1, 2000), "raa": 30.0}
    check_slab(monkeypatch, lai, rho, rho, **given)


def test_angles_by_cell_equal_separate_calls_with_folded_azimuth():
    """Repeated angles are grouped; results stay in their cells."""
    sza = np.array([[30.0, 50.0], [50.0, np.nan]])
    found = sail(1.0, 0.07, 0.04, sza=sza, vza=20.0, raa=200.0, hotspot=0.1)
    for place in np.ndindex(2, 2):
        one = sail(1.0, 0.07, 0.04, sza=sza[place], vza=20.0, raa=160.0, hotspot=0.1)
        np.testing.assert_array_equal(found.rso[place], one.rso)


@pytest.mark.parametrize("gap", [0, 1e-12, 1e-6, 0.01, 0.66, 0.67, 0.68, 1, 10, 1000])
def test_chain_matches_a_bidiagonal_matrix_exponential(gap):
    """Opitz' theorem: the corner of the exponential of a bidiagonal matrix is the divided difference."""
    rates = np.array([0.3, 0.3 + gap, 0.1, 0.3, 0.2 + 2 * gap])
    corner = expm(3.0 * (np.diag(-rates) + np.diag(np.ones(4), 1)))[0, -1]
    np.testing.assert_allclose(exponential_chain(3.0, *rates), corner, rtol=1e-11)


@pytest.mark.parametrize("gap", [0, 0.01, 10])
def test_recursion_stays_within_its_arrays(gap):
    """Plain Python raises IndexError where compiled code would read beyond an array."""
    x, difference, homogeneous = np.sort([-0.9, -0.9 - 3 * gap, -0.3, -0.9]), np.empty(4), np.empty(4)
    sail_model._recursion.py_func(x, difference, homogeneous)
    assert 3.0**3 * difference[0] == pytest.approx(exponential_chain(3.0, *(-x / 3)), rel=1e-12)


GREEN = 0.45, 0.42


def on(slope, sza, vza, raa, aspect=0.0):
    """Geometry of a slope that faces the azimuth `aspect`, with the sun at azimuth 0 and the sensor at `raa`."""
    tilt, sun, view = np.radians([slope, sza, vza])
    local = [
        np.cos(z) * np.cos(tilt) + np.sin(z) * np.sin(tilt) * np.cos(np.radians(azimuth - aspect))
        for z, azimuth in ((sun, 0.0), (view, raa))
    ]
    given = {"cosine": np.cos(tilt), "mu_s_local": local[0], "mu_v_local": local[1], "sky_view": 1.0}
    return {"sza": sza, "vza": vza, "raa": raa} | given


@pytest.mark.parametrize("hotspot", [0.0, 0.1])
@pytest.mark.parametrize("leaf_angles", ["spherical", "planophile"])
def test_upright_canopy_on_level_ground_equals_sail(hotspot, leaf_angles):
    canopy = {"leaf_angles": leaf_angles, "hotspot": hotspot}
    lai = np.array([0.0, 0.5, 3.0])
    surface = with_background(sail(lai, *GREEN, sza=40.0, vza=25.0, raa=60.0, **canopy), 0.15)
    found = upright_reflectance(lai, *GREEN, 0.15, **on(0.0, 40.0, 25.0, 60.0), diffuse_fraction=0.2, **canopy)
    np.testing.assert_allclose(found, reflectance_factor(surface.rso, surface.rdo, 0.2), rtol=1e-12)


def test_slope_seen_along_its_normal_equals_level_canopy():
    """Spherical leaves have no preferred axis: a slope is a rotated level canopy."""
    slope = on(30.0, 30.0, 30.0, 0.0)
    level = with_background(sail(2.0 * np.cos(np.radians(30.0)), *GREEN, sza=0.0), 0.15)
    found = upright_reflectance(2.0, *GREEN, 0.15, **slope)
    # The 90 classes of leaf angles approximate spherical leaves.
    assert found == pytest.approx(level.rso / np.cos(np.radians(30.0)), rel=2e-6)


def test_dark_leaves_have_the_path_length_of_the_slope():
    """Closed form of single scattering by horizontal leaves over the paths of both beams."""
    slope = on(35.0, 50.0, 10.0, 120.0, aspect=40.0)
    rho, lai = 1e-7, 1.7
    k = [np.cos(np.radians(z)) / slope[mu] * slope["cosine"] for z, mu in ((50.0, "mu_s_local"), (10.0, "mu_v_local"))]
    mu_v = np.cos(np.radians(10.0))
    # Integral along the slant path of the slope; the projection of horizontal leaves is the cosine of the zenith angle.
    expected = rho * mu_v * slope["cosine"] / slope["mu_v_local"] * -np.expm1(-sum(k) * lai) / sum(k)
    found = upright_reflectance(lai, rho, 0.0, 0.0, **slope, leaf_angles="0: 1")
    assert found == pytest.approx(expected, rel=1e-5)


BOWLS = pd.read_csv(Path(__file__).parents[2] / "data" / "bowl_radiosity.csv", comment="#")


def test_bare_bowl_has_the_exact_radiosity():
    for row in BOWLS.itertuples():
        given = on(row.slope, row.sza, 0.0, 0.0, row.azimuth_from_sun)
        assert given["mu_s_local"] == pytest.approx(row.cos_i, abs=1e-7)
        given["sky_view"] = 1 - row.wall_view
        assert upright_reflectance(0.0, *GREEN, row.albedo, **given) == pytest.approx(row.reflectance, rel=1e-6)
        # Under a uniform sky, the radiosity of a bowl is even and returns what neither ground nor sky takes.
        sky = upright_reflectance(0.0, *GREEN, row.albedo, **given, diffuse_fraction=1.0)
        assert sky == pytest.approx(row.albedo * (given["sky_view"] + row.wall_view * sky), rel=1e-12)


def test_bowl_on_a_dem_has_the_exact_radiosity():
    """Bowl in level ground with walls of 45 degrees: land in view is 1 - Vd, and its light is even."""
    sza, albedo, size, cell = 30.0, 0.45, 161, 10.0
    lai = 0 * fifesim.lai_scene(fifesim.fife_site(cell, window=((0, size), (0, size))), seed=7)
    distance = np.hypot(*(np.mgrid[:size, :size] - size // 2)) * cell
    rim = 0.45 * size * cell
    radius = rim * np.sqrt(2)
    dem = lai.copy(data=500 + rim - np.sqrt(radius**2 - np.minimum(distance, rim) ** 2))
    dem.attrs = {"units": "m"}
    inside, share = distance < 0.9 * rim, (1 - np.sqrt(0.5)) / 2
    np.testing.assert_allclose(dem.fifesim.terrain_view().values[inside], share, rtol=0, atol=0.003)
    given = {"dem": dem, "slopes": "upright", "geometry": fifesim.Geometry(sza, 180.0)}
    air = fifesim.Atmosphere(visibility=100.0)
    rho = lai.fifesim.surface_reflectance(
        "TM", bands=["TM4"], canopy=fifesim.Canopy(background=albedo), atmosphere=air, **given
    )[0]
    sky = diffuse_fraction(air, [fifesim.instrument("TM").select(["TM4"])[0].response], given["geometry"])[0]
    both = BOWLS[(BOWLS.alpha == 45) & (BOWLS.sza == sza) & (BOWLS.albedo == albedo)]
    # The sun adds to the light of the walls, which is even, in proportion to the cosine.
    slope, floor = np.polyfit(both.cos_i, both.reflectance, 1)
    sun = floor + slope * dem.fifesim.illumination(given["geometry"])
    skylit = albedo * (1 - share) / (1 - albedo * share)
    expected = (1 - sky) * sun + sky * skylit
    np.testing.assert_allclose(rho.values[inside], expected.values[inside], rtol=1e-3)


def test_shaded_slopes_get_skylight_and_hidden_slopes_are_black():
    given = on(20.0, 40.0, 0.0, 0.0)
    dark = upright_reflectance(1.0, *GREEN, 0.1, **given | {"mu_s_local": 0.0}, diffuse_fraction=0.2)
    sky = upright_reflectance(1.0, *GREEN, 0.1, **given, diffuse_fraction=1.0)
    assert dark == pytest.approx(0.2 * sky, rel=1e-12)
    assert upright_reflectance(1.0, *GREEN, 0.1, **given | {"mu_v_local": 0.0}) == 0


GRID = fifesim.fife_site(10.0, window=((0, 300), (0, 300)))
DEM, HILL_LAI = fifesim.flint_hills(GRID, seed=7), fifesim.lai_scene(GRID, seed=7)


def scene(dem, lai=HILL_LAI, slopes="upright", **canopy):
    return lai.fifesim.surface_reflectance(
        "TM", bands=["TM3", "TM4"], dem=dem, slopes=slopes, canopy=fifesim.Canopy(**canopy)
    )


def test_upright_canopy_on_a_dem():
    """A flat DEM gives the level result, chunks change nothing, a class equals its canopy; invalid input raises."""
    level = HILL_LAI.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    upright, kt = scene(DEM), scene(DEM, slopes="kt")
    np.testing.assert_allclose(scene(0 * DEM + 400.0), level, rtol=0, atol=1e-6)
    assert 0.9 < float(np.corrcoef((upright / level).values.ravel(), (kt / level).values.ravel())[0, 1]) < 1
    lazy = scene(DEM.chunk(y=70), HILL_LAI.chunk(y=50, x=90))
    assert lazy.chunks is not None and "upright" in lazy.history
    np.testing.assert_allclose(lazy.compute(), upright, rtol=1e-12)
    gap = HILL_LAI.copy()
    gap[3, 5] = np.nan
    expected = upright.where(gap.notnull())
    np.testing.assert_allclose(scene(DEM, gap).transpose(*upright.dims), expected, rtol=1e-12)
    with pytest.raises(ValueError, match="upright"):
        scene(DEM, brown=0.3)
    sizes = {"grass": 0.0, "wood": 0.1}
    classes = [fifesim.CoverClass(name, lai=1.0, canopy=fifesim.Canopy(hotspot=h)) for name, h in sizes.items()]
    land = fifesim.landscape(GRID, cover=fifesim.ground.Patches("voronoi", 80), classes=classes, seed=2)
    land = land.assign(lai=HILL_LAI)
    both = land.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"], dem=DEM, slopes="upright")
    for code, size in enumerate(sizes.values(), 1):
        inside = land.cover == code
        assert inside.any()
        np.testing.assert_array_equal(both.where(inside), scene(DEM, hotspot=size).where(inside))
    with pytest.raises(ValueError, match="needs an elevation"):
        scene(None)
