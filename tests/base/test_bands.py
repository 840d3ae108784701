"""Bands: spectral means, solar irradiance, nearest bands and digital numbers."""

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
    check_counts,
    counts,
    nearest_band,
    solar_irradiance,
    solar_irradiance_steps,
    solar_spectrum,
)

BOX = Band("box", (0.6, 0.6001, 0.6999, 0.7), (0.0, 1.0, 1.0, 0.0))


def test_band_means_of_constant_and_linear_spectra():
    wavelength = np.linspace(0.5, 0.8, 301)
    assert BOX.center == pytest.approx(0.65, abs=1e-12)
    assert BOX.mean(np.full(3, 0.25), [0.5, 0.65, 0.8]) == pytest.approx(0.25, rel=1e-14)
    assert BOX.mean(2 * wavelength[::300], wavelength[::300]) == pytest.approx(2 * BOX.center, rel=1e-12)
    # The integral of 1 / w over 0.6 to 0.7 um, compared with the integral of w^-2.
    expected = np.log(0.7 / 0.6) / (1 / 0.6 - 1 / 0.7)
    assert BOX.mean(wavelength, wavelength, weight=wavelength**-2) == pytest.approx(expected, rel=1e-4)
    assert BOX.mean(np.ones((2, 3, 4)), [0.5, 0.6, 0.7, 0.8]).shape == (2, 3)
    with pytest.raises(ValueError, match=r"band box spans 0.6 to 0.7 um, the spectrum only 0.65 to 0.8 um"):
        BOX.mean([1.0, 1.0], [0.65, 0.8])


def test_bands_are_equal_by_content_and_refuse_impossible_responses():
    assert hash(Band("a", [0.5, 0.6], [1, 1])) == hash(Band("a", (0.5, 0.6), (1.0, 1.0)))
    for wavelength, response in (((0.5, 0.5), (1, 1)), ((0.5, 0.6), (1, -1)), ((0.5, 0.6), (0, 0))):
        with pytest.raises(ValueError, match="band odd"):
            Band("odd", wavelength, response)


def test_solar_irradiance_over_all_wavelengths_is_the_solar_constant():
    """1361 W m-2 (Kopp & Lean 2011), of which 1 to 2 % lie outside 0.28 to 4 um."""
    wavelength, irradiance = solar_spectrum()
    assert np.trapezoid(irradiance, wavelength) == pytest.approx(0.985 * 1361, rel=0.01)


def test_solar_irradiance_steps_conserve_energy():
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
def test_band_nearest_to_the_best_wavelength_is_taken(window, wavelengths, number):
    """Only wavelengths within the limits of the window qualify."""
    assert nearest_band(wavelengths, window) == number


def test_quadrature_gives_the_mean_of_any_spectrum_on_its_wavelengths():
    band, wavelength = Band("red", (0.6, 0.63, 0.66), (0.2, 1.0, 0.4)), np.linspace(0.55, 0.7, 31)
    spectra, weight = np.random.default_rng(1).random((3, 31)), np.linspace(1, 2, 31)
    found = band.quadrature(wavelength, weight)
    for spectrum in spectra:
        assert found.mean(spectrum) == band.mean(spectrum, wavelength, weight)
    assert found.mean(np.ones(31)) == pytest.approx(1, rel=1e-14)


def test_common_names_agree_with_pystac():
    """Pystac uses an earlier version of the table with a narrower blue band."""
    eo = pytest.importorskip("pystac.extensions.eo")
    known = {name: eo.Band.band_range(name) for name in COMMON_NAMES if name != "blue"}
    found = {name: COMMON_NAMES[name][1:3] for name, limits in known.items() if limits}
    assert len(found) == 10 and found == {name: known[name] for name in found}


def test_centres_of_common_names_match_landsat_and_sentinel_2():
    """Centres agree to 3 nm; neither mission has a yellow band."""
    centres = np.array(
        [band.response.center for name in ("MSI", "OLI", "TM") for band in fifesim.instrument(name).bands]
    )
    for name in set(COMMON_NAMES) - {"yellow"}:
        assert np.abs(centres - COMMON_NAMES[name].best).min() < 3e-3


@pytest.mark.parametrize(("dn", "said"), [(-1.0, "-1"), (256, "256"), (1.5, "1.5"), (-1, "-1"), (np.inf, "inf")])
def test_impossible_digital_numbers_are_rejected(dn, said):
    with pytest.raises(ValueError, match=f"digital number of {said} is not a whole number from 0 to 255: give nodata="):
        counts(np.array([dn]), 0, 255, "give nodata=")


def test_counts_are_kept_and_no_data_becomes_0():
    np.testing.assert_array_equal(counts(np.array([-9999, 7, 255], np.int16), -9999, 255, ""), [0, 7, 255])
    np.testing.assert_array_equal(counts(np.array([7, 254, 255]), 0, 255, "", saturated=255), [7, 254, 0])
    check_counts(np.array([np.nan, 0.0, 255.0]), 255, "")
    assert counts(np.array([300]), 0, 65535, "").dtype == np.uint16
    assert counts(np.array([30]), 0, 255, "").dtype == np.uint8


def test_noise_below_zero_is_set_to_zero_with_its_size():
    """Published responses scatter around zero outside of the band, such as those of ETM+."""
    wavelength = (1.5, 1.6, 1.7, 1.8)
    with pytest.warns(UserWarning, match=r"band B5: the response is -0\.0001 at 1\.8 um, 0\.0002 of its peak"):
        noisy = Band("B5", wavelength, (0.0, 0.5, 0.5, -0.0001))
    assert noisy == Band("B5", wavelength, (0.0, 0.5, 0.5, 0.0))
    for response in ((0.0, 0.5, 0.5, -0.006), (0.0, 0.5, np.nan, 0.0), (0.0, -0.0, 0.0, 0.0)):
        with pytest.raises(ValueError, match=r"band B5: the response must not .* numpy\.clip\(response, 0, None\)"):
            Band("B5", wavelength, response)


@pytest.mark.parametrize("wavelength", [(620.0, 650.0, 690.0), (6.2e-7, 6.5e-7, 6.9e-7), (0.62, np.nan, 0.69)])
def test_wavelengths_of_a_band_are_in_micrometres(wavelength):
    with pytest.raises(ValueError, match=r"band red: wavelengths (are in um, got|must increase)"):
        Band("red", wavelength, (0.0, 1.0, 0.0))
