import numpy as np
import pytest
from pyrsr.rsr import RSR_reader

import fifesim
from fifesim.base.bands import (
    COMMON_NAMES,
    GREEN,
    NEAR_INFRARED,
    RED,
    Band,
    nearest_band,
    solar_irradiance,
    solar_irradiance_steps,
    solar_spectrum,
)

BOX = Band("box", (0.6, 0.6001, 0.6999, 0.7), (0.0, 1.0, 1.0, 0.0))


def test_mean_of_a_constant_is_the_constant():
    assert BOX.mean(np.full(3, 0.25), [0.5, 0.65, 0.8]) == pytest.approx(0.25, rel=1e-14)


def test_mean_of_a_line_is_its_value_at_the_center():
    wavelength = np.array([0.5, 0.8])
    assert BOX.mean(2 * wavelength, wavelength) == pytest.approx(2 * BOX.center, rel=1e-12)
    assert BOX.center == pytest.approx(0.65, abs=1e-12)


def test_weight_draws_the_mean_toward_it():
    wavelength = np.linspace(0.5, 0.8, 301)
    assert BOX.mean(wavelength, wavelength, weight=wavelength**-4) < BOX.center


def test_mean_keeps_leading_dimensions():
    assert BOX.mean(np.ones((2, 3, 4)), [0.5, 0.6, 0.7, 0.8]).shape == (2, 3)


def test_spectrum_that_misses_the_band_is_refused():
    with pytest.raises(ValueError, match=r"band box spans 0.6 to 0.7 um, the spectrum only 0.65 to 0.8 um"):
        BOX.mean([1.0, 1.0], [0.65, 0.8])


@pytest.mark.parametrize("wavelength, response", [((0.5, 0.5), (1, 1)), ((0.5, 0.6), (1, -1)), ((0.5, 0.6), (0, 0))])
def test_impossible_response_is_refused(wavelength, response):
    with pytest.raises(ValueError, match="band odd"):
        Band("odd", wavelength, response)


def test_bands_are_hashable_and_equal_by_content():
    assert hash(Band("a", [0.5, 0.6], [1, 1])) == hash(Band("a", (0.5, 0.6), (1.0, 1.0)))


def test_solar_irradiance_over_all_wavelengths_is_the_solar_constant():
    """1361 W m-2 (Kopp & Lean 2011), of which 1 to 2 % lie outside 0.28 to 4 um."""
    wavelength, irradiance = solar_spectrum()
    assert np.trapezoid(irradiance, wavelength) == pytest.approx(0.985 * 1361, rel=0.01)


def test_steps_of_the_sun_conserve_its_energy():
    wavelength = np.linspace(0.4, 2.5, 841)
    steps = solar_irradiance_steps(wavelength)
    width = np.gradient(wavelength)
    width[[0, -1]] /= 2
    fine, irradiance = solar_spectrum()
    inside = (fine >= 0.4) & (fine <= 2.5)
    assert np.sum(steps * width) == pytest.approx(np.trapezoid(irradiance[inside], fine[inside]), rel=1e-9)


def test_thematic_mapper_irradiance_agrees_with_landsat_handbook():
    """Chander, Markham & Helder (2009), Table 4, another solar spectrum (Thuillier 2003): within 4 %."""
    published = {"1": 1983, "2": 1796, "3": 1536, "4": 1031, "5": 220.0, "7": 83.44}
    for key, response in RSR_reader("Landsat-5", "TM").items():
        if key in published:
            assert solar_irradiance(Band(f"TM{key}", *response.T)) == pytest.approx(published[key], rel=0.04)


@pytest.mark.parametrize(
    ("window", "wavelengths", "number"),
    [
        (RED, (0.61, 0.64, 0.69, 0.76), 1),
        (RED, (0.64, 0.66, 0.67), 1),
        (NEAR_INFRARED, (0.705, 0.75, 1.0, 1.24), 1),
        (NEAR_INFRARED, (0.95, 0.86), 1),
        (GREEN, (0.49, 0.60), 1),
        (RED, (0.599, 0.701, np.nan), None),
        (RED, (), None),
    ],
)
def test_the_band_nearest_to_the_best_place_of_a_window_is_taken(window, wavelengths, number):
    """Limits belong to a window; what lies outside is not taken, however near to the best place."""
    assert nearest_band(wavelengths, window) == number


def test_thematic_mapper_shows_red_in_its_third_and_near_infrared_in_its_fourth_band():
    centers = [Band(f"TM{key}", *response.T).center for key, response in RSR_reader("Landsat-5", "TM").items()]
    assert [nearest_band(centers, window) for window in (GREEN, RED, NEAR_INFRARED)] == [1, 2, 3]


def test_a_quadrature_is_the_mean_of_any_spectrum_on_its_wavelengths():
    band, wavelength = Band("red", (0.6, 0.63, 0.66), (0.2, 1.0, 0.4)), np.linspace(0.55, 0.7, 31)
    spectra, weight = np.random.default_rng(1).random((3, 31)), np.linspace(1, 2, 31)
    found = band.quadrature(wavelength, weight)
    for spectrum in spectra:
        assert found.mean(spectrum) == band.mean(spectrum, wavelength, weight)
    assert found.mean(np.ones(31)) == pytest.approx(1, rel=1e-14)


def test_common_names_are_those_of_catalogues():
    """Pystac has the table of an earlier version, whose blue is narrower."""
    eo = pytest.importorskip("pystac.extensions.eo")
    known = {name: eo.Band.band_range(name) for name in COMMON_NAMES if name != "blue"}
    found = {name: COMMON_NAMES[name][1:3] for name, limits in known.items() if limits}
    assert len(found) == 10 and found == {name: known[name] for name in found}


def test_common_names_have_their_middle_where_landsat_and_sentinel_2_have_a_band():
    """Within 3 nm; neither has yellow."""
    centres = np.array(
        [band.response.center for name in ("MSI", "OLI", "TM") for band in fifesim.instrument(name).bands]
    )
    for name in set(COMMON_NAMES) - {"yellow"}:
        assert np.abs(centres - COMMON_NAMES[name].best).min() < 3e-3
