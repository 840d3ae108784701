"""Spectral bands, solar irradiance and digital numbers; directions of the sun and sensor."""

from pathlib import Path

import numpy as np
import pandas as pd
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
from fifesim.base.geometry import Geometry, angle_between, relative_azimuth, scattering_angle_cosine, sun_geometry

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


def test_bands_are_equal_by_content():
    assert hash(Band("a", [0.5, 0.6], [1, 1])) == hash(Band("a", (0.5, 0.6), (1.0, 1.0)))


def test_noise_below_zero_is_set_to_zero_with_its_size():
    """Published responses scatter around zero outside of the band, such as those of ETM+."""
    wavelength = (1.5, 1.6, 1.7, 1.8)
    with pytest.warns(UserWarning, match=r"band B5: the response is -0\.0001 at 1\.8 um, 0\.0002 of its peak"):
        noisy = Band("B5", wavelength, (0.0, 0.5, 0.5, -0.0001))
    assert noisy == Band("B5", wavelength, (0.0, 0.5, 0.5, 0.0))


def test_solar_irradiance_agrees_with_the_solar_constant_and_the_landsat_handbook():
    """
    1361 W m-2 (Kopp & Lean 2011), of which 1 to 2 % lie outside 0.28 to 4 um.

    Chander, Markham & Helder (2009), Table 4, use another solar spectrum (Thuillier 2003): within 4 %.
    """
    wavelength, irradiance = solar_spectrum()
    assert np.trapezoid(irradiance, wavelength) == pytest.approx(0.985 * 1361, rel=0.01)
    published = {"1": 1983, "2": 1796, "3": 1536, "4": 1031, "5": 220.0, "7": 83.44}
    for key, response in RSR_reader("Landsat-5", "TM").items():
        if key in published:
            assert solar_irradiance(Band(f"TM{key}", *response.T)) == pytest.approx(published[key], rel=0.04)


def test_solar_irradiance_steps_conserve_energy():
    wavelength = np.linspace(0.4, 2.5, 841)
    width = np.gradient(wavelength)
    width[[0, -1]] /= 2
    fine, irradiance = solar_spectrum()
    inside = (fine >= 0.4) & (fine <= 2.5)
    expected = np.trapezoid(irradiance[inside], fine[inside])
    assert np.sum(solar_irradiance_steps(wavelength) * width) == pytest.approx(expected, rel=1e-9)


def test_band_nearest_to_the_best_wavelength_within_the_window_is_taken():
    for window, wavelengths, number in (
        (RED, (0.61, 0.64, 0.69, 0.76), 1),
        (NEAR_INFRARED, (0.705, 0.75, 1.0, 1.24), 1),
        (NEAR_INFRARED, (0.95, 0.86), 1),
        (GREEN, (0.49, 0.60), 1),
        (RED, (0.599, 0.701, np.nan), None),
        (RED, (), None),
    ):
        assert nearest_band(wavelengths, window) == number


def test_common_names_agree_with_pystac():
    """Pystac has a narrower blue band."""
    eo = pytest.importorskip("pystac.extensions.eo")
    known = {name: eo.Band.band_range(name) for name in COMMON_NAMES if name != "blue"}
    found = {name: COMMON_NAMES[name][1:3] for name, limits in known.items() if limits}
    assert len(found) == 10 and found == {name: known[name] for name in found}


def test_counts_are_kept_and_no_data_becomes_0():
    np.testing.assert_array_equal(counts(np.array([-9999, 7, 255], np.int16), -9999, 255, ""), [0, 7, 255])
    np.testing.assert_array_equal(counts(np.array([7, 254, 255]), 0, 255, "", saturated=255), [7, 254, 0])
    check_counts(np.array([np.nan, 0.0, 255.0]), 255, "")
    assert counts(np.array([300]), 0, 65535, "").dtype == np.uint16
    assert counts(np.array([30]), 0, 255, "").dtype == np.uint8


def test_sun_agrees_with_the_almanac():
    for case in pd.read_csv(Path(__file__).parents[1] / "data" / "almanac_sun.csv", comment="#").itertuples():
        sun = sun_geometry(case.time, case.latitude, case.longitude)
        assert sun.sza == pytest.approx(case.zenith, abs=0.02)
        assert sun.saa == pytest.approx(case.azimuth, abs=0.03)


def test_sun_of_the_paper_case():
    """In the morning the sun is in the southeast; in June the Earth is near aphelion."""
    case = fifesim.fife_geometry()
    assert (round(case.sza, 1), round(case.saa, 1), case.vza, case.vaa) == (28.5, 117.0, 0.0, 0.0)
    assert case.earth_sun_distance == pytest.approx(1.0148, abs=5e-4)
    assert Geometry(60.0, 0.0, 0.0).mu_s == pytest.approx(0.5, abs=1e-15)


def test_relative_azimuth_is_symmetric_and_folded():
    azimuths = np.linspace(-360, 720, 37)
    raa = relative_azimuth(azimuths[:, None], azimuths)
    np.testing.assert_allclose(raa, raa.T, rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.cos(np.radians(raa)), np.cos(np.radians(azimuths[:, None] - azimuths)), atol=1e-12)
    assert raa.min() >= 0 and raa.max() <= 180
    assert Geometry(30, 117, 20, 117).raa == 0 and Geometry(30, 117, 20, 297).raa == 180


def test_angles_between_directions_match_the_unit_vectors():
    """Light travels away from the sun and toward the sensor."""
    zenith, azimuth = np.random.default_rng(6).uniform(0, [[[90.0]], [[360.0]]], (2, 2, 50))
    theta, phi = np.radians(zenith), np.radians(azimuth)
    vectors = np.array([np.sin(theta) * np.sin(phi), np.sin(theta) * np.cos(phi), np.cos(theta)])
    cosine = np.prod(vectors, axis=1).sum(axis=0)
    found = angle_between(zenith[0], azimuth[0], zenith[1], azimuth[1])
    np.testing.assert_allclose(found, np.degrees(np.arccos(cosine)), rtol=0, atol=1e-9)
    assert angle_between(33.0, 10.0, 33.0, 370.0) < 1e-12
    scattered = scattering_angle_cosine(zenith[0], zenith[1], relative_azimuth(azimuth[0], azimuth[1]))
    np.testing.assert_allclose(scattered, -cosine, rtol=0, atol=1e-12)
