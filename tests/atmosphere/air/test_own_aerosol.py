"""Tables of one's own: what is read from them, and what is refused."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from fifesim.atmosphere import aerosols
from fifesim.atmosphere.aerosols import Aerosol, known_aerosol, phase_of_moments
from fifesim.atmosphere.models import Atmosphere

ANGLE = np.linspace(0, 180, 361)
WAVELENGTH = np.array([0.44, 0.675, 0.87, 1.02])


def henyey_greenstein(asymmetry, cosine):
    return (1 - asymmetry**2) / (1 + asymmetry**2 - 2 * asymmetry * cosine) ** 1.5


PHASE = np.repeat(henyey_greenstein(0.6, np.cos(np.radians(ANGLE)))[:, None], 4, axis=1)


@pytest.fixture
def haze():
    """Extinction by a power of the wavelength."""
    return Aerosol(WAVELENGTH, WAVELENGTH**-1.3, np.full(4, 0.9), ANGLE, PHASE, name="haze")


def test_extinction_goes_on_by_its_power_law_where_tables_end(haze):
    at = np.array([0.36, 0.44, 0.6, 1.02, 3.0])
    extinction, albedo, asymmetry = aerosols.aerosol_optics(haze, at)
    np.testing.assert_allclose(extinction, (at / 0.55) ** -1.3, rtol=1e-12)
    np.testing.assert_allclose(albedo, 0.9, rtol=1e-12)
    np.testing.assert_allclose(asymmetry, 0.6, atol=1e-4)


def test_phase_function_and_moments_are_those_of_the_formula(haze):
    """The mean of a table every half degree is 1 within 1e-4."""
    cosine = np.array([-1.0, -0.3, 0.5, 0.99])
    found = aerosols.aerosol_phase(haze, cosine, 0.7)
    np.testing.assert_allclose(found, henyey_greenstein(0.6, cosine), rtol=2e-4)
    np.testing.assert_allclose(aerosols.phase_moments(haze, 0.7, 8)[0], 0.6 ** np.arange(8), atol=1e-4)
    assert not aerosols.aerosol_polarization(haze, cosine, 0.7).any()


def test_phase_function_that_is_a_little_off_is_made_to_keep_energy():
    """And by the same factor at all angles."""
    bright = Aerosol(WAVELENGTH, WAVELENGTH**-1.3, np.full(4, 0.9), ANGLE, 1.015 * PHASE)
    assert aerosols.phase_moments(bright, 0.7, 1)[0, 0] == pytest.approx(1, rel=1e-12)
    found = aerosols.aerosol_phase(bright, np.array([-0.5, 0.5]), 0.44)
    np.testing.assert_allclose(found, henyey_greenstein(0.6, np.array([-0.5, 0.5])), rtol=2e-4)


def test_components_add_up_by_what_they_scatter():
    """Against the sums by hand at a tabulated wavelength."""
    extinction, albedo = np.array([[3.0, 1.0], [1.0, 1.0]]), np.array([[0.9, 0.9], [0.3, 0.3]])
    even, forward = np.ones((361, 2)), PHASE[:, :2]
    two = Aerosol([0.5, 0.6], extinction, albedo, ANGLE, np.stack([even, forward]))
    _, found, asymmetry = aerosols.aerosol_optics(two, 0.5)
    assert found == pytest.approx((3 * 0.9 + 0.3) / 4, rel=1e-12)
    assert asymmetry == pytest.approx(0.3 * 0.6 / 3, rel=1e-3)
    expected = (2.7 * 1 + 0.3 * henyey_greenstein(0.6, 0.5)) / 3
    assert aerosols.aerosol_phase(two, 0.5, 0.5) == pytest.approx(expected, rel=1e-4)


def test_series_of_moments_is_the_phase_function():
    angle, phase = phase_of_moments(0.6 ** np.arange(60))
    np.testing.assert_allclose(phase, henyey_greenstein(0.6, np.cos(np.radians(angle))), rtol=1e-9)


def test_equal_tables_are_equal_and_travel_by_their_text(haze):
    air = Atmosphere(aerosol=haze, aot=0.3)
    assert Atmosphere.parse(air.text) == air == pickle.loads(pickle.dumps(air))
    assert known_aerosol(str(haze)) is haze
    assert replace(haze) == haze != replace(haze, scale_height=3.0)
    assert hash(replace(haze)) == hash(haze)
    with pytest.raises(ValueError, match=r"not been read in this session.*read_aerosol\('other.nc'\)"):
        known_aerosol("other#0123")


def changed(values, place, value):
    values = np.array(values, float)
    values[place] = value
    return values


WRONG = {
    "albedo above 1": ({"single_scattering_albedo": [0.9, 1.2, 0.9, 0.9]}, "from 0 to 1, got 1.2 at 0.675 um"),
    "albedo below 0": ({"single_scattering_albedo": [0.9, 0.9, -0.1, 0.9]}, "from 0 to 1, got -0.1 at 0.87 um"),
    "missing extinction": ({"extinction": [1, np.nan, 1, 1]}, "extinction must be above 0, got nan at 0.675 um"),
    "no extinction": ({"extinction": [1, 1, 1, 0]}, "extinction must be above 0, got 0 at 1.02 um"),
    "missing phase": ({"phase": changed(PHASE, (5, 1), np.nan)}, "phase must be above 0, got nan at 0.675 um"),
    "phase per steradian": ({"phase": PHASE / 4 / np.pi}, "1 within 2 %, got 0.07958 at .*'sr-1'"),
    "phase 5 % off": ({"phase": changed(PHASE, (slice(None), 2), 1.05 * PHASE[:, 0])}, "got 1.05 at 0.87 um"),
    "nanometres": ({"wavelength": 1000 * WAVELENGTH}, "from 0.1 to 50 um, got 1020: divide nanometres by 1000"),
    "decreasing": ({"wavelength": WAVELENGTH[::-1]}, "wavelength must be increasing, got 0.87 um after 1.02"),
    "missing wavelength": ({"wavelength": changed(WAVELENGTH, 1, np.nan)}, "wavelength must be increasing, got nan"),
    "red alone": ({"wavelength": WAVELENGTH + 0.2}, "both sides of 0.55 um.*got 0.64 to 1.22 um"),
    "radians": ({"angle": np.radians(ANGLE)}, "angle must be from 0 to 180 degrees, got 0 to 3.14159"),
    "shape": ({"extinction": np.ones(3)}, r"extinction must be of shape \(1, 4\), got \(1, 3\)"),
    "polarization": ({"polarization": 2 * PHASE}, "polarization must be from -1 to 1"),
    "metres": ({"scale_height": 2000.0}, "scale_height must be from 0.1 to 8 km, got 2000: divide metres"),
    "layer upside down": ({"layer": (3, 1)}, "the top above the bottom, got"),
    "two verticals": ({"layer": (0, 2), "scale_height": 2.0}, "give one of the two"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_cannot_be_is_refused(case):
    fine = {"wavelength": WAVELENGTH, "extinction": WAVELENGTH**-1.3, "single_scattering_albedo": np.full(4, 0.9)}
    wrong, message = WRONG[case]
    with pytest.raises(ValueError, match=f"aerosol mine: .*{message}"):
        Aerosol(**{**fine, "angle": ANGLE, "phase": PHASE, "name": "mine", **wrong})


@pytest.mark.parametrize("albedo", [0.0, 1.0])
def test_particles_may_absorb_all_or_nothing(albedo):
    black_or_white = Aerosol(WAVELENGTH, WAVELENGTH**-1.3, np.full(4, albedo), angle=ANGLE, phase=PHASE)
    assert black_or_white.single_scattering_albedo.tolist() == [[albedo] * 4]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"visibility": 23}, "must be given as aot, from 0 to 2, got visibility=23: give for example aot=0.2"),
        ({}, "must be given as aot, from 0 to 2, got nothing"),
        ({"aot": 0.2, "engine": "6S"}, "got '6S'.*use engine='successive-orders'"),
    ],
)
def test_amount_is_an_optical_thickness_and_6s_takes_no_tables(haze, options, message):
    with pytest.raises(ValueError, match=message):
        Atmosphere(aerosol=haze, **options)


def test_atmosphere_in_words_tells_the_bands_that_the_tables_hold(haze):
    assert str(Atmosphere(aerosol=haze, aot=0.3)).count("0.63-0.69") == 1
    assert "2.08-2.35" not in str(Atmosphere(aerosol=haze, aot=0.3))
