"""Tests of leaf angles, of SAIL against other solutions of its equations, and of upright plants on slopes."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from oracles_canopy import four_streams, sunlit_and_seen, turned_leaves
from scipy.integrate import quad
from scipy.optimize import brentq

import fifesim
from fifesim.atmosphere.labels import diffuse_fraction
from fifesim.ground.canopy import sail_model
from fifesim.ground.canopy.leaf_angles import leaf_angle_classes, leaf_projection
from fifesim.ground.canopy.sail_model import (
    bidirectional_gap,
    exponential_chain,
    leaf_scattering,
    sail,
    upright_reflectance,
    volume_scattering,
    with_background,
)

DENSITY = {
    "spherical": np.sin,
    "planophile": lambda t: 2 / np.pi * (1 + np.cos(2 * t)),
    "erectophile": lambda t: 2 / np.pi * (1 - np.cos(2 * t)),
    "plagiophile": lambda t: 2 / np.pi * (1 - np.cos(4 * t)),
    "extremophile": lambda t: 2 / np.pi * (1 + np.cos(4 * t)),
    "uniform": lambda t: 2 / np.pi,
}


@pytest.mark.parametrize("name", DENSITY)
def test_leaf_angle_classes_integrate_the_density(name):
    """Compare with the published densities, integrated by quadrature."""
    edges = np.radians(np.arange(0, 91, 10))
    expected = [quad(DENSITY[name], a, b)[0] for a, b in pairwise(edges)]
    np.testing.assert_allclose(leaf_angle_classes(name, classes=9).fraction, expected, atol=1e-14)


@pytest.mark.parametrize("b", [-1, -1 + 1e-12, -0.7, 0.4, 1])
def test_verhoef_with_a_of_0_is_symmetric_about_45_degrees(b):
    """Exact to rounding, also at b = -1, where the equation has a triple root."""
    fraction = np.array(leaf_angle_classes(("verhoef", 0, b)).fraction)
    assert abs(fraction[:45].sum() - 0.5) < 1e-14
    np.testing.assert_allclose(fraction, fraction[::-1], atol=1e-14)


@pytest.mark.parametrize("mean", [5, 57, 88])
def test_ellipsoidal_leaves_have_the_given_mean(mean):
    """Classes of 0.01 degrees determine the mean to 1e-4 degrees."""
    leaves = leaf_angle_classes(("campbell", mean), classes=9000)
    assert abs(np.dot(leaves.inclination, leaves.fraction) - mean) < 1e-4


@pytest.mark.parametrize("given", ["Uniform", "verhoef(-0.35,-0.15)", ("campbell", 57), "30: 0.5, 60: 0.5"])
def test_text_of_a_leaf_angle_distribution_recreates_it(given):
    leaves = leaf_angle_classes(given)
    assert leaf_angle_classes(str(leaves)) == leaves and hash(leaves) == hash(leaf_angle_classes(str(leaves)))


def test_fractions_of_leaf_angles_are_of_equal_classes_and_normalised():
    """Only rounding is corrected."""
    assert leaf_angle_classes(np.array([0.5, 0.5])).inclination == (22.5, 67.5)
    assert abs(sum(leaf_angle_classes([0.3333333, 0.3333333, 0.3333334]).fraction) - 1) < 1e-15
    for wrong, message in (([0.5, 0.4], "got a sum of 0.9"), ([-0.5, 1.5], "not be negative"), ([], "give one")):
        with pytest.raises(ValueError, match=message):
            leaf_angle_classes(wrong)


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


@pytest.mark.filterwarnings("error")
def test_nan_stays_in_its_cell_and_nothing_warns():
    lai = np.array([1.0, np.nan, 3.0, 0.0])
    surface = with_background(sail(lai, 0.5, 0.5, sza=30, hotspot=0.1), 0.2)
    np.testing.assert_array_equal(np.isnan(surface.rso), np.isnan(lai))
    np.testing.assert_array_equal(surface.rso[2], with_background(sail(3.0, 0.5, 0.5, sza=30, hotspot=0.1), 0.2).rso)


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
    found = sail(lai, rho, rho, **given)
    # The sum of exponential chains is never singular.
    monkeypatch.setattr(sail_model, "_slabs", lambda *options: options[-1].fill(True))
    expected = sail(lai, rho, rho, **given)
    for name in ("rso", "rdo", "rsd", "rdd", "tss", "too", "tsd", "tdo", "tdd"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=0, atol=1e-14, err_msg=name)


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
    air, sun = fifesim.Atmosphere(visibility=100.0), fifesim.Geometry(sza, 180.0)
    given = {"dem": dem, "slopes": "upright", "geometry": sun, "canopy": fifesim.Canopy(background=albedo)}
    rho = lai.fifesim.surface_reflectance("TM", bands=["TM4"], atmosphere=air, **given)[0]
    sky = diffuse_fraction(air, [fifesim.instrument("TM").select(["TM4"])[0].response], sun)[0]
    both = BOWLS[(BOWLS.alpha == 45) & (BOWLS.sza == sza) & (BOWLS.albedo == albedo)]
    # The sun adds to the light of the walls, which is even, in proportion to the cosine.
    slope, floor = np.polyfit(both.cos_i, both.reflectance, 1)
    sunlit = floor + slope * dem.fifesim.illumination(sun)
    skylit = albedo * (1 - share) / (1 - albedo * share)
    expected = (1 - sky) * sunlit + sky * skylit
    np.testing.assert_allclose(rho.values[inside], expected.values[inside], rtol=1e-3)


def test_shaded_slopes_get_skylight_and_hidden_slopes_are_black():
    given = on(20.0, 40.0, 0.0, 0.0)
    dark = upright_reflectance(1.0, *GREEN, 0.1, **given | {"mu_s_local": 0.0}, diffuse_fraction=0.2)
    sky = upright_reflectance(1.0, *GREEN, 0.1, **given, diffuse_fraction=1.0)
    assert dark == pytest.approx(0.2 * sky, rel=1e-12)
    assert upright_reflectance(1.0, *GREEN, 0.1, **given | {"mu_v_local": 0.0}) == 0


GRID = fifesim.fife_site(10.0, window=((0, 90), (0, 100)))
DEM, HILL_LAI = fifesim.flint_hills(GRID, seed=7), fifesim.lai_scene(GRID, seed=7)


def scene(dem, lai=HILL_LAI, hotspot=0.0):
    canopy = fifesim.Canopy(hotspot=hotspot)
    return lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"], dem=dem, slopes="upright", canopy=canopy)


def test_upright_canopy_on_a_dem():
    """A flat DEM gives the level result, chunks change nothing, and a class equals its canopy."""
    spot = fifesim.Canopy(hotspot=0.1)
    level = HILL_LAI.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"], canopy=spot)
    np.testing.assert_allclose(scene(0 * DEM + 400.0, hotspot=0.1), level, rtol=0, atol=1e-6)
    upright = scene(DEM)
    gap = HILL_LAI.copy()
    gap[3, 5] = np.nan
    lazy = scene(DEM.chunk(y=40), gap.chunk(y=50, x=30))
    assert lazy.chunks is not None and "upright" in lazy.history
    np.testing.assert_allclose(lazy.compute().transpose(*upright.dims), upright.where(gap.notnull()), rtol=1e-12)
    sizes = {"grass": 0.0, "wood": 0.1}
    classes = [fifesim.CoverClass(name, lai=1.0, canopy=fifesim.Canopy(hotspot=h)) for name, h in sizes.items()]
    land = fifesim.landscape(GRID, cover=fifesim.ground.Patches("voronoi", 80), classes=classes, seed=2)
    both = land.assign(lai=HILL_LAI).fifesim.surface_reflectance("TM", bands=["TM3", "TM4"], dem=DEM, slopes="upright")
    for code, size in enumerate(sizes.values(), 1):
        inside = land.cover == code
        assert inside.any()
        np.testing.assert_array_equal(both.where(inside), scene(DEM, hotspot=size).where(inside))
