"""What successive orders say of an atmosphere."""

import numpy as np
import pytest
from oracles_atmosphere import mixed_stokes

from fifesim.atmosphere.engines import _quadrature, mixed_scattering, whole_scattering
from fifesim.atmosphere.models import Atmosphere

WAVELENGTH = np.array([0.47, 0.86])
SZA, VZA, RAA = 50.0, np.array([0.0, 35.0]), np.array([60.0])
MU_S, MU_V = np.cos(np.radians(SZA)), np.cos(np.radians(VZA))[:, None, None]
HAZE = Atmosphere(visibility=10.0)


@pytest.fixture(scope="module")
def hazy():
    return mixed_scattering(HAZE, WAVELENGTH, SZA, VZA, RAA)


def test_the_whole_alone_is_that_beside_its_parts(hazy):
    whole = whole_scattering(HAZE, WAVELENGTH, SZA, VZA, RAA)
    for name, values in whole._asdict().items():
        np.testing.assert_array_equal(values, getattr(hazy, name))


def test_gauss_points_are_those_of_a_full_matrix():
    points, weights = np.polynomial.legendre.leggauss(500)
    found = _quadrature()
    np.testing.assert_allclose(found[0], points, rtol=0, atol=1e-15)
    # Weights of numpy before 2.2 are wrong by 3e-15 at the ends, where they are smallest.
    np.testing.assert_allclose(found[1], weights, rtol=0, atol=1e-14)
    for power in (0, 2, 998):
        assert np.sum(found[1] * found[0] ** power) == pytest.approx(2 / (power + 1), rel=1e-13)


def test_light_that_is_not_scattered_falls_off_with_the_depth_of_both(hazy):
    """It decides the share of skylight in canopy, terrain and adjacency."""
    depth = HAZE.rayleigh_optical_depth(WAVELENGTH) + HAZE.aerosol_optical_depth(WAVELENGTH)
    np.testing.assert_allclose(hazy.optical_depth, depth, rtol=1e-14)
    np.testing.assert_allclose(hazy.direct_transmittance_down, np.exp(-depth / MU_S), rtol=1e-14)
    np.testing.assert_allclose(hazy.direct_transmittance_up, np.exp(-depth / MU_V), rtol=1e-14)


def test_light_goes_straight_or_is_scattered(hazy):
    """What comes through is more than the beam and less than all; of the molecules alone it is as without aerosol."""
    assert np.all(hazy.direct_transmittance_up < hazy.transmittance_up) and np.all(hazy.transmittance_up < 1)
    clear = mixed_scattering(Atmosphere(aerosol="none"), WAVELENGTH, SZA, VZA, RAA)
    np.testing.assert_allclose(
        clear.diffuse_up_molecules, clear.transmittance_up - clear.direct_transmittance_up, rtol=1e-12
    )
    np.testing.assert_allclose(clear.diffuse_up_molecules, hazy.diffuse_up_molecules, rtol=1e-12)
    np.testing.assert_allclose(clear.molecules_reflectance, hazy.molecules_reflectance, rtol=1e-12)
    np.testing.assert_allclose(clear.diffuse_up_aerosol, 0, atol=1e-11)


def test_aerosol_scatters_forward(hazy):
    """More of its light arrives than of as thin a layer of molecules: by the closed forms of 5S within .003."""
    tau = HAZE.aerosol_optical_depth(WAVELENGTH)
    scattered = 1 - np.exp(-tau / MU_V)
    assert np.all(hazy.diffuse_up_aerosol > 0.6 * scattered) and np.all(hazy.diffuse_up_aerosol < scattered)


def test_light_that_is_polarized_is_another(hazy):
    """By some percent of the path, and nothing of the beam."""
    scalar = mixed_scattering(HAZE, WAVELENGTH, SZA, VZA, RAA, polarized=False)
    assert 0.003 < np.abs(scalar.reflectance / hazy.reflectance - 1).max() < 0.1
    np.testing.assert_array_equal(scalar.direct_transmittance_up, hazy.direct_transmittance_up)


def test_polarized_light_is_that_of_the_terms():
    """I at the top is the path reflectance, the ground adds what the fluxes say, and straight up the sky is even."""
    air, at = Atmosphere(visibility=23), np.array([0.45, 0.86])
    views = np.array([0.0, 40.0]), np.array([20.0, 130.0])
    terms, black = mixed_scattering(air, at, 35.0, *views), mixed_stokes(air, at, 35.0, *views)
    np.testing.assert_allclose(black[0], terms.reflectance, rtol=1e-9)
    added = mixed_stokes(air, at, 35.0, *views, ground=0.3)[0] - black[0]
    expected = 0.3 * terms.transmittance_down * terms.transmittance_up / (1 - 0.3 * terms.spherical_albedo)
    np.testing.assert_allclose(added, np.broadcast_to(expected, added.shape), rtol=1e-8)
    sky = mixed_stokes(air, at, 35.0, *views, at_ground=True)
    np.testing.assert_allclose(sky[0, 0, 0], sky[0, 0, 1], rtol=1e-9)
    assert (np.abs(sky[1:]) < sky[0]).all()
