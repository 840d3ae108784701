"""Default and given optics, and what is refused."""

import numpy as np
import pytest

from fifesim.ground.canopy.leaf_area import check_lai
from fifesim.ground.canopy.optics import band_background, band_leaf_optics, check_background, check_leaf_optics

TM = ["TM1", "TM2", "TM3", "TM4", "TM5", "TM7"]


def test_defaults_of_the_paper_are_those_calibrated_to_table_2():
    reflectance, transmittance = band_leaf_optics(["TM4", "TM3"])
    np.testing.assert_array_equal(reflectance, [0.45, 0.07])
    np.testing.assert_array_equal(transmittance, [0.42, 0.04])
    np.testing.assert_array_equal(band_background(["TM3", "TM4"]), [0.15, 0.19])


def test_modelled_bands_look_like_a_green_leaf_over_dry_soil():
    """A green peak, a near infrared plateau, water in the short-wave infrared; soil brightens with wavelength."""
    reflectance, _ = band_leaf_optics(TM)
    blue, green, red, near, short, shorter = reflectance
    assert red < green < near and blue < green and shorter < short < near
    assert np.all(np.diff(band_background(TM)[:5]) > 0)


def test_given_optics_are_taken_by_band_or_in_order():
    given = {"B3": (0.1, 0.05), "B4": (0.5, 0.4)}
    np.testing.assert_array_equal(band_leaf_optics(["B4"], given), [[0.5], [0.4]])
    np.testing.assert_array_equal(band_leaf_optics(["a", "b"], ([0.1, 0.5], [0.05, 0.4])), [[0.1, 0.5], [0.05, 0.4]])
    np.testing.assert_array_equal(band_background(["B4"], {"B4": 0.2}), [0.2])
    np.testing.assert_array_equal(band_background(["a", "b"], 0.2), [0.2, 0.2])


def test_results_are_free_to_change():
    reflectance, _ = band_leaf_optics(["TM3"])
    reflectance[:] = 0
    assert band_leaf_optics(["TM3"])[0] == 0.07


@pytest.mark.parametrize("function", [band_leaf_optics, band_background])
def test_unknown_bands_are_told_what_to_pass(function):
    with pytest.raises(ValueError, match=r"band 'TM33', did you mean 'TM3'\? There are TM1, .*pass its own as {'TM33'"):
        function(["TM33"])


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: band_leaf_optics(["a", "b"], ([0.1, 0.2, 0.3], 0.1)), "shape \\(3,\\) for 2 bands"),
        (
            lambda: band_leaf_optics(["a"], {"a": (7, 0.1)}),
            r"leaf reflectance must be in \[0, 1\], got 7: .* not percent",
        ),
        (lambda: check_leaf_optics([0.1, 0.6], [0.1, 0.5]), "more than 1, got 1.1"),
        (lambda: check_leaf_optics(0.1, -0.1), "leaf transmittance must be in"),
        (lambda: check_leaf_optics(np.nan, 0.1), "got nan"),
        (lambda: check_background([0.1, np.nan, 15]), r"background reflectance must be in \[0, 1\], got 15"),
        (
            lambda: check_lai([0, 100, np.nan, -9999, -1]),
            "nor above 100, got -9999 in 2 of 5 cells: set cells without data",
        ),
        (lambda: check_lai(255), "nor above 100, got 255"),
        (lambda: check_lai([90, 240, np.nan]), r"got 240 in 1 of 3 cells: .* scaled, type lai \* 0.01, or gdal_edit"),
        (lambda: check_lai([900, 2400]), r"type lai \* 0.001, or gdal_edit.py -a_scale 0.001 for a file"),
        (lambda: check_lai(np.inf), "got inf"),
    ],
)
def test_impossible_values_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_possible_values_pass():
    check_leaf_optics([0.0, 0.7, 1.0], [0.0, 0.3, 0.0])
    check_background([0.0, np.nan, 1.0])
    check_lai([0.0, np.nan, 100.0])
