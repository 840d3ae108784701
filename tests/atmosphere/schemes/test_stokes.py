import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss, legval
from oracles_atmosphere import SIEWERT

from fifesim.atmosphere.successive_orders import flux_transmittance, path_reflectance, stokes_reflectance
from fifesim.base.geometry import scattering_angle_cosine

SPHERES = SIEWERT[:9]
MOMENTS = SPHERES / (2 * np.arange(9) + 1)[:, None]
SZA, VZA, RAA = 50.0, np.array([0.0, 30.0, 70.0]), np.array([-120.0, -30.0, 0.0, 30.0, 120.0, 180.0])


def spheres(tau_molecules, tau_aerosol, vza=VZA, raa=RAA, at_ground=False, **options):
    cosine = scattering_angle_cosine(SZA, np.asarray(vza)[:, None], np.asarray(raa)) * (-1 if at_ground else 1)
    phase = legval(cosine, SPHERES[:, 0])
    # d^l_02 of degree 2 on: Legendre functions of order 2 by their norm.
    degree = np.arange(2, 9)
    second = [legval(cosine, np.polynomial.legendre.legder(np.eye(9)[n], 2)) * (1 - cosine**2) for n in degree]
    norm = 1 / np.sqrt((degree - 1.0) * degree * (degree + 1) * (degree + 2))
    polarization = np.tensordot(SPHERES[2:, 3] * norm, second, 1) / phase
    air = tau_molecules, tau_aerosol, 0.97, MOMENTS, phase, polarization
    return stokes_reflectance(*air, SZA, vza, raa, at_ground=at_ground, **options)


def molecules(tau, sza, vza, raa, **options):
    none = np.zeros((len(vza), len(raa)))
    return stokes_reflectance(tau, 0.0, 0.0, [1.0], none, none, sza, vza, raa, **options)


def test_intensity_at_the_top_is_the_path_reflectance():
    phase = legval(scattering_angle_cosine(SZA, VZA[:, None], RAA), SPHERES[:, 0])
    expected = path_reflectance(0.1, 0.3, 0.97, MOMENTS, phase, SZA, VZA, RAA)
    np.testing.assert_allclose(spheres(0.1, 0.3)[0], expected, rtol=1e-12)


def test_ground_adds_what_fluxes_say():
    transmittance, albedo = flux_transmittance(0.1, 0.3, 0.97, MOMENTS, [SZA, *VZA])
    added = spheres(0.1, 0.3, ground=0.4)[0] - spheres(0.1, 0.3)[0]
    expected = 0.4 * transmittance[0] * transmittance[1:, None] / (1 - 0.4 * albedo)
    np.testing.assert_allclose(added, np.broadcast_to(expected, added.shape), rtol=1e-9)


@pytest.mark.parametrize("ground", [0.0, 0.5])
def test_flux_of_the_sky_is_what_comes_through_less_the_beam(ground):
    points, weights = leggauss(24)
    mu, raa = (points + 1) / 2, np.arange(4.5, 180, 9)
    sky = spheres(0.1, 0.3, np.degrees(np.arccos(mu)), raa, at_ground=True, ground=ground)[0]
    (through,), albedo = flux_transmittance(0.1, 0.3, 0.97, MOMENTS, [SZA])
    beam = np.exp(-0.4 / np.cos(np.radians(SZA)))
    assert (weights * mu * sky.mean(axis=1)).sum() == pytest.approx(through / (1 - ground * albedo) - beam, abs=1e-4)


@pytest.mark.parametrize("at_ground", [False, True])
def test_sides_of_the_sun_are_mirrors(at_ground):
    """I and Q are even in the azimuth, U is odd and none where sun and view are in one plane."""
    found = spheres(0.1, 0.3, at_ground=at_ground, ground=0.2)
    np.testing.assert_allclose(found[:, :, [1, 0]], found[:, :, [3, 4]] * [[[1]], [[1]], [[-1]]], atol=1e-12)
    np.testing.assert_allclose(found[2][:, [2, 5]], 0, atol=1e-12)


@pytest.mark.parametrize("at_ground", [False, True])
def test_nothing_depends_on_the_direction_of_the_zenith(at_ground):
    """Straight up or down the meridian is the azimuth's: polarization turns with it and keeps its degree."""
    intensity, along, aslant = spheres(0.1, 0.3, [0.0], RAA, at_ground)[:, 0]
    np.testing.assert_allclose(intensity, intensity[0], rtol=1e-12)
    np.testing.assert_allclose(np.hypot(along, aslant), np.hypot(along, aslant)[0], rtol=1e-6)
    np.testing.assert_allclose(along, along[2] * np.cos(2 * np.radians(RAA)), atol=1e-6)


@pytest.mark.parametrize("at_ground", [False, True])
def test_thin_air_polarizes_across_the_plane_of_scattering(at_ground):
    """All orders of a depth of 1e-4 beside Rayleigh's matrix."""
    delta, sza = 0.1, 50.0
    cosine = scattering_angle_cosine(sza, VZA[:, None], np.array([0.0, 180.0]))
    found = molecules(1e-4, sza, VZA, [0.0, 180.0], at_ground=at_ground, depolarization=delta)
    expected = (1 - delta) * (1 - cosine**2) / (1 + delta + (1 - delta) * cosine**2)
    np.testing.assert_allclose(-found[1] / found[0], expected, atol=1e-3)


def test_depolarization_is_that_at_a_right_angle():
    """What shakes across the plane over what shakes along it, once scattered by 90 degrees."""
    found = molecules(1e-5, 60.0, [30.0], [0.0], at_ground=True, depolarization=0.06)
    turned = molecules(1e-5, 60.0, [30.0], [180.0], at_ground=True, depolarization=0.06)[:, 0, 0]
    assert (turned[0] + turned[1]) / (turned[0] - turned[1]) == pytest.approx(0.06, rel=2e-3)
    assert found[0, 0, 0] > turned[0]


def test_light_of_the_sky_below_the_sun_is_finite():
    """The ways in and out are alike there: the integral over the depth is a limit."""
    values = spheres(0.1, 0.3, [SZA - 1e-6, SZA, SZA + 1e-6], [0.0], at_ground=True)
    np.testing.assert_allclose(values[:, 0], values[:, 2], rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(values[:, 1], (values[:, 0] + values[:, 2]) / 2, rtol=1e-6, atol=1e-9)
