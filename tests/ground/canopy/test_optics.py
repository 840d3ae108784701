"""Tests of leaf and background optics by band: defaults, given values, tables over leaf contents, and errors."""

from dataclasses import replace

import numpy as np
import pytest

import fifesim
from fifesim.base.arrays import distinct_columns
from fifesim.ground.canopy import optics
from fifesim.ground.canopy.leaf_area import check_lai
from fifesim.ground.canopy.optics import (
    LEAF_TOLERANCE,
    band_background,
    band_leaf_optics,
    check_background,
    check_leaf_optics,
    leaf_means,
)
from fifesim.ground.canopy.prospect import CONTENTS, LEAF_RANGES, Leaf


def test_defaults_are_calibrated_to_table_2_of_the_paper():
    """Changing a result does not change the defaults."""
    reflectance, transmittance = band_leaf_optics(["TM4", "TM3"])
    np.testing.assert_array_equal(reflectance, [0.45, 0.07])
    np.testing.assert_array_equal(transmittance, [0.42, 0.04])
    np.testing.assert_array_equal(band_background(["TM3", "TM4"]), [0.15, 0.19])
    reflectance[:] = 0
    assert band_leaf_optics(["TM3"])[0] == 0.07


def test_given_optics_are_matched_by_band_name_or_order():
    given = {"B3": (0.1, 0.05), "B4": (0.5, 0.4)}
    np.testing.assert_array_equal(band_leaf_optics(["B4"], given), [[0.5], [0.4]])
    np.testing.assert_array_equal(band_leaf_optics(["a", "b"], ([0.1, 0.5], [0.05, 0.4])), [[0.1, 0.5], [0.05, 0.4]])
    np.testing.assert_array_equal(band_background(["B4"], {"B4": 0.2}), [0.2])
    np.testing.assert_array_equal(band_background(["a", "b"], 0.2), [0.2, 0.2])


@pytest.mark.parametrize("function", [band_leaf_optics, band_background])
def test_unknown_bands_are_refused_with_the_remedy(function):
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


BANDS = tuple(band.response for band in fifesim.instrument("TM").select(["TM3", "TM4"]))


def one_by_one(leaf, name, values):
    """Leaf optics for each value of one content, by PROSPECT without a table."""
    return np.stack(
        [optics.band_leaf_optics(BANDS, replace(leaf, **{name: float(value)})) for value in values], axis=-1
    )


@pytest.mark.parametrize("name", list(LEAF_RANGES))
def test_table_over_a_content_is_within_its_tolerance(name):
    """Over the whole range with its ends, and small contents, where optics change fastest."""
    low, high = LEAF_RANGES[name].lowest, LEAF_RANGES[name].highest
    share = np.concatenate([[0, 1], np.random.default_rng(5).uniform(0, 1, 20) ** 4])
    values = np.minimum(low + share * (high - low), high)
    found = leaf_means(BANDS, Leaf(**{name: values}))
    np.testing.assert_allclose(found, one_by_one(Leaf(), name, values), rtol=0, atol=LEAF_TOLERANCE)


def test_exact_leaves_equal_prospect():
    values = np.array([[5.0, 20.0, 20.0], [80.0, 5.0, 0.0]])
    found = leaf_means(BANDS, Leaf(chlorophyll=values), exact=True)
    expected = one_by_one(Leaf(), "chlorophyll", values.ravel()).reshape(2, 2, 2, 3)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_nan_content_gives_nan_optics():
    for leaf in (
        Leaf(water=np.array([0.01, np.nan])),
        Leaf(water=np.array([0.01, np.nan]), brown=np.array([0.1, 0.2])),
    ):
        found = leaf_means(BANDS, leaf)
        assert np.isfinite(found[..., 0]).all() and np.isnan(found[..., 1]).all()
    assert np.isnan(leaf_means(BANDS, Leaf(water=np.full(2, np.nan), brown=np.zeros(2)))).all()


def test_nearly_transparent_leaves_conserve_energy():
    """The error of the table is larger than rounding, and SAIL refuses leaves that scatter more than 1."""
    coastal = fifesim.instrument("MSI").select(["MSI1"])[0].response
    clear = dict.fromkeys(CONTENTS, 0.0) | {"brown": np.geomspace(1e-15, 0.1, 3000)}
    assert leaf_means((coastal,), Leaf(structure=1.0, **clear)).sum(axis=0).max() <= 1 + 1e-15


def test_distinct_columns_finds_equal_columns():
    rows = np.array([[1.0, 2.0, 1.0, np.nan, 2.0, np.nan], [5.0, 5.0, 5.0, 1.0, 6.0, 1.0]])
    first, kind = distinct_columns(rows)
    assert first.tolist() == [0, 1, 3, 4] and kind.tolist() == [0, 1, 0, 2, 3, 2]
    np.testing.assert_array_equal(rows[:, first][:, kind], rows)
    assert [each.tolist() for each in distinct_columns(np.empty((2, 0)))] == [[], []]
