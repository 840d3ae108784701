"""Light that the aerosol scatters once."""

import numpy as np
import pytest

from fifesim.atmosphere.aerosols import aerosol_phase
from fifesim.atmosphere.lookup import Once, once_on_nodes, once_reflectance, scattered_once
from fifesim.atmosphere.models import Atmosphere
from fifesim.atmosphere.successive_orders import path_reflectance
from fifesim.base.bands import Band
from fifesim.base.geometry import scattering_angle_cosine

RED, NIR = Band("red", (0.63, 0.69), (1, 1)), Band("nir", (0.76, 0.9), (1, 1))
ANGLES = [(30.0, 0.0, 0.0), (55.0, 40.0, 20.0), (20.0, 60.0, 175.0), (40.0, 40.0, 0.0)]


@pytest.mark.parametrize("sza, vza, raa", ANGLES)
def test_thin_aerosol_scatters_as_successive_orders_say(sza, vza, raa):
    """A depth of 1e-5 leaves a second order of about as much; the phase function is read at quarters of a degree."""
    air = Atmosphere(aot=1e-5)
    once = scattered_once(air, (RED, NIR))
    for number, band in enumerate((RED, NIR)):
        at = np.array([band.center])
        phase = aerosol_phase(air.aerosol, scattering_angle_cosine(sza, vza, raa), at)
        column = 0.0, float(once.depth[number]), float(once.albedo[number])
        expected = path_reflectance(*column, [1.0], [phase], sza, [vza], [raa], polarized=False)[0, 0]
        assert once_reflectance(sza, vza, raa, once, number) == pytest.approx(expected, rel=3e-4)


def test_molecules_above_dim_it_both_ways():
    clear, hazy = (Once(np.ones(1), np.full(1, 0.2), np.full(1, tau), np.ones((1, 721))) for tau in (0.0, 0.3))
    slant = 1 / np.cos(np.radians(50.0)) + 1 / np.cos(np.radians(20.0))
    there, here = (once_reflectance(50.0, 20.0, 70.0, once, 0) for once in (hazy, clear))
    assert there / here == pytest.approx(np.exp(-0.3 * slant), rel=1e-12)


def test_closed_forms_know_of_no_molecules_above():
    engines = "5S", "successive-orders"
    none, above = (scattered_once(Atmosphere(engine=engine), (RED,)).overlying[0] for engine in engines)
    assert none == 0
    assert above == pytest.approx(Atmosphere(altitude=0.0).rayleigh_optical_depth(RED.center))


def test_thick_aerosol_scatters_once_what_it_stops():
    r""":math:`\omega P / 4 (\mu_s + \mu_v)`, all of which is stopped."""
    once = Once(np.full(1, 0.9), np.full(1, 100.0), np.zeros(1), np.full((1, 721), 1.3))
    expected = 0.9 * 1.3 / (4 * (np.cos(np.radians(35.0)) + np.cos(np.radians(10.0))))
    assert once_reflectance(35.0, 10.0, 90.0, once, 0) == pytest.approx(expected, rel=1e-12)


def test_nodes_are_single_places():
    once = scattered_once(Atmosphere(), (RED, NIR))
    sza, vza, raa = np.array([10.0, 50.0]), np.array([0.0, 20.0, 60.0]), np.array([0.0, 120.0])
    found = once_on_nodes(sza, vza, raa, once)
    for s, v, r, band in np.ndindex(found.shape):
        assert found[s, v, r, band] == once_reflectance(sza[s], vza[v], raa[r], once, band)


def test_air_without_aerosol_scatters_nothing():
    once = scattered_once(Atmosphere(aerosol="none"), (RED,))
    assert once_reflectance(30.0, 0.0, 0.0, once, 0) == 0
