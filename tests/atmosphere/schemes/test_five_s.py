"""The closed forms of 5S put together."""

import numpy as np
import pytest

from fifesim.atmosphere.five_s import five_s_scattering
from fifesim.atmosphere.models import Atmosphere

WAVELENGTH = np.array([0.45, 0.65, 0.85, 1.65])
SZA, VZA, RAA = 50.0, np.array([0.0, 35.0]), np.array([0.0, 90.0, 180.0])
MU_S, MU_V = np.cos(np.radians(SZA)), np.cos(np.radians(VZA))[:, None, None]
HAZE = Atmosphere(visibility=8.0)


def scattering(atmosphere):
    return five_s_scattering(atmosphere, WAVELENGTH, SZA, VZA, RAA)


def test_light_that_is_not_scattered_falls_off_with_the_depth():
    light = scattering(HAZE)
    depth = HAZE.rayleigh_optical_depth(WAVELENGTH) + HAZE.aerosol_optical_depth(WAVELENGTH)
    np.testing.assert_allclose(light.optical_depth, depth, rtol=1e-14)
    np.testing.assert_allclose(light.direct_transmittance_down, np.exp(-depth / MU_S), rtol=1e-14)
    np.testing.assert_allclose(light.direct_transmittance_up, np.exp(-depth / MU_V), rtol=1e-14)


def test_air_without_aerosol_has_the_molecules_alone():
    light = scattering(Atmosphere(aerosol="none"))
    np.testing.assert_array_equal(light.reflectance, light.molecules_reflectance)
    np.testing.assert_allclose(light.diffuse_up_aerosol, 0, atol=1e-15)
    np.testing.assert_allclose(
        light.diffuse_up_molecules, light.transmittance_up - light.direct_transmittance_up, rtol=1e-12
    )


def test_molecules_and_aerosol_are_added_without_a_cross_term():
    both, air = scattering(HAZE), scattering(Atmosphere(aerosol="none"))
    assert np.all(both.reflectance > air.reflectance) and np.all(both.spherical_albedo > air.spherical_albedo)
    np.testing.assert_array_equal(both.molecules_reflectance, air.molecules_reflectance)
    ratio = both.transmittance_up / air.transmittance_up
    tau = HAZE.aerosol_optical_depth(WAVELENGTH)
    np.testing.assert_allclose(both.diffuse_up_aerosol, ratio - np.exp(-tau / MU_V), rtol=1e-9)


def test_sun_and_view_may_be_exchanged():
    """The transmittance knows one angle."""
    there, back = (
        five_s_scattering(HAZE, WAVELENGTH, sza, np.array([vza]), RAA) for sza, vza in ((20.0, 55.0), (55.0, 20.0))
    )
    np.testing.assert_allclose(there.transmittance_down, back.transmittance_up[0, 0], rtol=1e-14)
    assert there.molecules_reflectance == pytest.approx(back.molecules_reflectance, rel=1e-12)
