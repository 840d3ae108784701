"""SAIL against other solutions of its equations, and against what must hold for any canopy."""

import numpy as np
import pytest
from oracles_canopy import four_streams, sunlit_and_seen, turned_leaves

from fifesim.ground.canopy.leaf_angles import LeafAngles, leaf_angle_classes, leaf_projection
from fifesim.ground.canopy.sail_model import sail, volume_scattering, with_background

SHAPES = ["spherical", "planophile", "erectophile", "plagiophile", "extremophile", "uniform", "90: 1", "0: 1"]
LAI = np.array([0, 1e-6, 0.01, 0.5, 2, 8, 20, 100])[:, None, None, None]
RHO = np.linspace(0, 1, 6)[:, None, None]
SZA = np.array([0, 28.5, 60, 85, 89.9])[:, None]
VZA = np.array([0, 30, 75, 89.9])


def test_sail_agrees_with_prosail_without_a_hot_spot():
    """Same leaf angle fractions; 1e-11 leaves room for prosail's subtraction of nearly equal squares."""
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
        np.testing.assert_allclose(
            [surface.rdd, surface.rsd, surface.rdo, surface.rso],
            [theirs[12], theirs[13], theirs[14], theirs[17]],
            rtol=0,
            atol=1e-11,
        )


OPTICS = [(0.5, 0.5), (1.0, 0.0), (0.0, 1.0), (0.07, 0.04), (0.45, 0.42), (0.4999999, 0.5)]
CASES = [(1.0, 28.5, 0, 0), (3.0, 60, 45, 120), (0.01, 89.9, 80, 30), (5.0, 0, 0, 0)]


@pytest.mark.parametrize("rho, tau", OPTICS)
@pytest.mark.parametrize("lai, sza, vza, raa", CASES)
def test_sail_solves_the_four_stream_equations(rho, tau, lai, sza, vza, raa):
    """A matrix exponential over leaves turned one by one; their sum over azimuth is good to 1e-9."""
    canopy = sail(lai, rho, tau, sza=sza, vza=vza, raa=raa, leaf_angles="35: 1")
    expected = four_streams(lai, rho, tau, sza, vza, raa, 35.0)
    for name, value in expected.items():
        np.testing.assert_allclose(getattr(canopy, name), value, rtol=1e-7, atol=1e-8, err_msg=name)


@pytest.mark.parametrize("inclination", [0, 5, 45, 70, 89.5, 90])
@pytest.mark.parametrize("sza, vza, raa", [(0, 0, 0), (28.5, 0, 77), (60, 45, 0), (60, 45, 180), (85, 70, 110)])
def test_leaf_projection_and_scattering_match_leaves_turned_one_by_one(inclination, sza, vza, raa):
    sun, view, reflected, transmitted = turned_leaves(inclination, sza, vza, raa)
    np.testing.assert_allclose(leaf_projection(inclination, [sza, vza]), [sun, view], atol=1e-9)
    scattered = np.pi * np.array(volume_scattering(inclination, sza, vza, raa))
    np.testing.assert_allclose(scattered, [reflected, transmitted], atol=1e-9)


@pytest.mark.parametrize("sza, vza, raa", [(28.5, 0, 0), (60, 45, 90), (75, 75, 180), (30, 30, 0)])
def test_spherical_leaves_scatter_by_ross_closed_form(sza, vza, raa):
    """Ross (1981), by the angle between sun and view; 900 classes of inclination are good to 1e-5."""
    leaves = leaf_angle_classes("spherical", classes=900)
    reflected, transmitted = volume_scattering(np.array(leaves.inclination), sza, vza, raa) @ np.array(leaves.fraction)
    s, v, azimuth = np.radians([sza, vza, raa])
    between = np.arccos(np.clip(np.cos(s) * np.cos(v) + np.sin(s) * np.sin(v) * np.cos(azimuth), -1, 1))
    ross = np.sin(between) - between * np.cos(between)
    np.testing.assert_allclose(np.pi * transmitted, ross / (3 * np.pi), atol=1e-5)
    np.testing.assert_allclose(np.pi * reflected, (ross + np.pi * np.cos(between)) / (3 * np.pi), atol=1e-5)


def test_hot_spot_matches_the_converged_integral():
    """It changes single scattering alone; 1e-9 of the integral is what the quadrature is good to."""
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
    canopy = sail(3.0, 0.1, 0.05, sza=40, vza=40, raa=0, hotspot=0.1)
    np.testing.assert_allclose(canopy.tsstoo, canopy.tss, rtol=1e-12)


def test_a_small_hot_spot_parameter_approaches_none():
    small, none = (sail(2.0, 0.1, 0.05, sza=40, vza=10, raa=50, hotspot=h).rso for h in (1e-9, 0.0))
    np.testing.assert_allclose(small, none, rtol=1e-8)


@pytest.mark.parametrize("shape", SHAPES)
def test_conservative_leaves_lose_no_light(shape):
    canopy = sail(LAI, RHO, 1 - RHO, sza=SZA, vza=VZA, raa=50, leaf_angles=shape)
    np.testing.assert_allclose(canopy.rdd + canopy.tdd, 1, atol=1e-9)
    np.testing.assert_allclose(canopy.rsd + canopy.tsd + canopy.tss, 1, atol=1e-9)
    np.testing.assert_allclose(canopy.rdo + canopy.tdo + canopy.too, 1, atol=1e-9)


@pytest.mark.parametrize("shape", SHAPES)
def test_conservative_leaves_over_a_white_background_reflect_everything(shape):
    surface = with_background(sail(LAI, RHO, 1 - RHO, sza=SZA, vza=VZA, leaf_angles=shape), 1.0)
    for reflectance in (surface.rdd, surface.rsd, surface.rdo):
        np.testing.assert_allclose(reflectance, 1, atol=1e-9)


@pytest.mark.parametrize("hotspot", [0.0, 0.05])
@pytest.mark.parametrize("shape", SHAPES)
def test_bidirectional_reflectance_is_reciprocal(shape, hotspot):
    given = {"raa": 50, "leaf_angles": shape, "hotspot": hotspot}
    there = with_background(sail(LAI, RHO, 0.9 - 0.9 * RHO, sza=SZA, vza=VZA, **given), 0.2)
    back = with_background(sail(LAI, RHO, 0.9 - 0.9 * RHO, sza=VZA, vza=SZA, **given), 0.2)
    np.testing.assert_allclose(there.rso, back.rso, rtol=1e-12)


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


def test_nothing_singular_happens_where_extinction_meets_the_eigenvalue():
    """Black-to-white steps of leaf optics sweep m through ks and ko; neighbours differ by no more than the step."""
    rho = np.linspace(0, 0.5, 20_001)
    canopy = sail(3.0, rho, rho, sza=60, vza=20, raa=30, leaf_angles="50: 1")
    for values in canopy[:4]:
        assert np.abs(np.diff(values, 2)).max() < 1e-6 and np.all(np.isfinite(values))


def test_everything_broadcasts_at_once():
    lai, rho = np.ones((4, 1, 1, 1)), np.full((3, 1, 1), 0.1)
    canopy = sail(lai, rho, 0.1, sza=[[10.0], [20.0]], vza=[0, 5, 9, 20, 30], hotspot=0.1)
    assert with_background(canopy, 0.1).rso.shape == (4, 3, 2, 5)
    alone = sail(1.0, 0.1, 0.1, sza=20, vza=9, hotspot=0.1)
    np.testing.assert_allclose(canopy.rso[2, 1, 1, 2], alone.rso, rtol=1e-14)


def test_relative_azimuth_is_folded():
    first, second = (sail(1.0, 0.1, 0.1, sza=20, vza=40, raa=raa).rso for raa in (50, 310))
    np.testing.assert_allclose(first, second, rtol=1e-14)
