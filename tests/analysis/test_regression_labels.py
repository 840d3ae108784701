"""Regression of labelled rasters: pairs of pixels, relative equivalent noise, and inverted maps."""

import numpy as np
import pytest
import xarray as xr
from lazy import CHUNKS, ODD_CHUNKS, in_chunks

import fifesim
from fifesim.grids import grid as grids


def test_regression_is_identical_in_any_chunks(pair):
    y, x = pair
    y[3:5, 2] = np.nan
    whole = fifesim.regress(y, x)
    for one, other in [(CHUNKS, CHUNKS), (ODD_CHUNKS, CHUNKS), (ODD_CHUNKS, {}), ({}, {"y": 1, "x": 54})]:
        assert fifesim.regress(in_chunks(y, one), in_chunks(x, other)) == whole
    y[0] = x[0] = np.nan
    assert fifesim.regress(y, x).n == 44 * 54 - 2


# ------------------------------------------------------------------------------------------ pairs


CELL = 30 / 9


def test_pixels_are_paired_by_location(pair):
    """Rasters that cover different ground are cropped to their common area."""
    y, x = pair
    cut = fifesim.regress(y[3:40, :50], x[:, 7:])
    assert cut == fifesim.regress(y[3:40, 7:50], x[3:40, 7:50])


def test_pixels_can_be_paired_by_row_and_column(pair):
    y, x = pair
    moved = grids.place(x, fifesim.fife_site(CELL, window=((91, 136), (180, 234))))
    assert fifesim.regress(y, moved, pair="index") == fifesim.regress(y, x)
    assert fifesim.regress(y, moved).r2 < 0.5
    common = fifesim.regress(y[5:20, 11:30], x[5:20, 11:30])
    assert fifesim.regress(y[5:40, :30], x[:20, 11:]) == common
    cropped = fifesim.regress(y[5:25, :30], x[:20, 11:41], pair="index")
    assert fifesim.regress(y[5:40, :30], x[:20, 11:], pair="index") == cropped
    assert fifesim.regress(y, moved).n == 44 * 54


# ------------------------------------------------------------------------------------------ noise


def test_equivalent_noise_of_a_line_matches_the_closed_form(scattered):
    """
    Closed form, including the variation of the line within an increment; 900 pairs determine a deviation to 2.4 %.
    """
    lai, ndvi = scattered
    found = fifesim.scaling.relative_equivalent_noise(lai, ndvi, 0.02)
    expected = np.hypot(0.03, 0.3 * 0.02 / np.sqrt(12)) / (0.3 * found["increment"])
    np.testing.assert_allclose(found["ren"], expected, rtol=0.12)
    assert found.attrs["slope"] == pytest.approx(0.3, rel=0.01)
    assert int(found["count"].sum()) == lai.size


def test_equivalent_noise_is_identical_in_any_chunks(scattered):
    lai, ndvi = scattered
    whole = fifesim.scaling.relative_equivalent_noise(lai, ndvi)
    xr.testing.assert_identical(
        fifesim.scaling.relative_equivalent_noise(in_chunks(lai, {"y": 77, "x": 50}), in_chunks(ndvi, ODD_CHUNKS)),
        whole,
    )


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda y, x: fifesim.regress(y[:10], x[20:]), "do not overlap"),
        (
            lambda y, x: fifesim.scaling.relative_equivalent_noise(y, x, increment=0.0),
            "increment must be above 0, got 0",
        ),
        (lambda y, x: fifesim.scaling.relative_equivalent_noise(y, x, increment=1e-6), "take a larger one"),
        (lambda y, x: fifesim.scaling.relative_equivalent_noise(y, x, min_count=1), "at least 2, got 1"),
        (lambda y, x: fifesim.scaling.relative_equivalent_noise(y * np.nan, x, slope=0.4), "needs finite values"),
        *(
            (
                lambda y, x, fill=fill: fifesim.regress(y.where(y > y.min(), fill), x),
                f"a value of {fill:g} marks missing",
            )
            for fill in (-999.0, -9999.0, -99999.0, -32768.0, 65535.0)
        ),
    ],
)
def test_invalid_pairs_and_estimates_are_rejected(pair, call, message):
    with pytest.raises(ValueError, match=message):
        call(*pair)
