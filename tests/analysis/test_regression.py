"""Regression compared with statsmodels, pairs of labelled pixels, and relative equivalent noise by increments."""

import numpy as np
import pytest
import statsmodels.api
import xarray as xr
from lazy import CHUNKS, ODD_CHUNKS, in_chunks

import fifesim
from fifesim.analysis import regression
from fifesim.analysis.regression import fit, row_sums
from fifesim.grids import grid as grids

CELL = 30 / 9
RNG = np.random.default_rng(8)
X = RNG.uniform(0.3, 0.8, (20, 30))
Y = -1.2 + 3.4 * X + RNG.normal(0, 0.2, X.shape)


def line(y, x, y_origin=0.0, x_origin=0.0):
    return fit(row_sums(y, x, y_origin, x_origin), y_origin, x_origin)


@pytest.mark.parametrize("shift", [0.0, 300.0])
def test_line_errors_and_intervals_agree_with_statsmodels(shift):
    """Agreement to 1e-10, also where values are a thousand times their spread. Infinite and NaN pairs are left out."""
    y, x = Y + shift, X - shift
    y[3, 2:5], x[0, 0], y[5, 6], y[7, 8] = np.nan, np.inf, -np.inf, np.inf
    ours, valid = line(y, x, shift, -shift), np.isfinite(y + x)
    theirs = statsmodels.api.OLS(y[valid], statsmodels.api.add_constant(x[valid])).fit()
    np.testing.assert_allclose([ours.intercept, ours.slope], theirs.params, rtol=1e-10)
    np.testing.assert_allclose([ours.intercept_error, ours.slope_error], theirs.bse, rtol=1e-10)
    assert ours.r2 == pytest.approx(theirs.rsquared, rel=1e-10) and ours.n == valid.sum()
    at = np.array([0.0, 0.5, 1.3]) - shift
    for level in (0.5, 0.95):
        frame = theirs.get_prediction(statsmodels.api.add_constant(at)).summary_frame(1 - level)
        for name, interval in (("mean_ci", ours.confidence_interval), ("obs_ci", ours.prediction_interval)):
            low, high = interval(at, level)
            np.testing.assert_allclose(low, frame[f"{name}_lower"], rtol=1e-10)
            np.testing.assert_allclose(high, frame[f"{name}_upper"], rtol=1e-10)


def test_constant_and_exact_lines():
    """A line accepts numbers and lists, and extrapolates beyond three standard deviations."""
    flat, exact, ours = line(np.full_like(X, 2.0), X), line(1 + 2 * X, X), line(Y, X)
    assert (flat.slope, flat.intercept, flat.r2) == (0.0, 2.0, 0.0)
    assert exact.r2 == pytest.approx(1, abs=1e-12) and exact.residual_deviation < 1e-6
    expected = ours.intercept + ours.slope * np.array([0.3, 0.4])
    np.testing.assert_array_equal(ours.predict([0.3, 0.4]), expected)
    assert ours.predict(0.3) == expected[0]
    far = X.mean() + 3 * X.std(ddof=1) * np.array([-1.01, -0.99, 0.99, 1.01])
    np.testing.assert_array_equal(ours.extrapolates([*far, np.nan]), [True, False, False, True, False])


def test_increments_start_at_their_origin():
    """Values on an edge belong to the increment above it; values outside all increments and NaN are ignored."""
    values = np.array([[-0.6, -0.5, -0.1, 0.0, 0.4, 0.5], [np.nan, 0.1, 0.2, 9.0, -9.0, 0.3]])
    ndvi = np.where(values == 0.3, np.inf, 0.7)
    sums = regression.increment_sums(values, ndvi, -1, 0.5, 2, 0.2)
    np.testing.assert_allclose(sums[:, [0, 4]], [[2, 2], [0, 2]])
    np.testing.assert_allclose(sums[:, [1, 5]], [[-0.6, 0.4], [0, 0.3]], atol=1e-15)
    np.testing.assert_allclose(sums[:, [2, 6]], 0.5 * sums[:, [0, 4]])
    np.testing.assert_allclose(sums[:, [3, 7]], 0.25 * sums[:, [0, 4]])


# ------------------------------------------------------------------------------------------ labelled rasters


@pytest.fixture
def pair(lai):
    """LAI as a linear function of itself, with a little noise."""
    noise = np.random.default_rng(5).normal(0, 0.1, lai.shape)
    return (2 * lai + 1 + noise).rename("lai"), lai.rename("ndvi")


def test_pixels_are_paired_by_location_in_any_chunks(pair):
    """Rasters that cover different ground are cropped to their common area."""
    y, x = pair
    cut = fifesim.regress(y[3:40, :50], x[:, 7:])
    assert cut == fifesim.regress(y[3:40, 7:50], x[3:40, 7:50])
    y[3:5, 2] = np.nan
    whole = fifesim.regress(y, x)
    for one, other in [(CHUNKS, CHUNKS), (ODD_CHUNKS, {}), ({}, {"y": 1, "x": 54})]:
        assert fifesim.regress(in_chunks(y, one), in_chunks(x, other)) == whole
    y[0] = x[0] = np.nan
    assert fifesim.regress(y, x).n == 44 * 54 - 2


def test_pixels_can_be_paired_by_row_and_column(pair):
    y, x = pair
    moved = grids.place(x, fifesim.fife_site(CELL, window=((91, 136), (180, 234))))
    assert fifesim.regress(y, moved, pair="index") == fifesim.regress(y, x)
    assert fifesim.regress(y, moved).r2 < 0.5 and fifesim.regress(y, moved).n == 44 * 54
    cropped = fifesim.regress(y[5:25, :30], x[:20, 11:41], pair="index")
    assert fifesim.regress(y[5:40, :30], x[:20, 11:], pair="index") == cropped


def test_equivalent_noise_of_a_line_matches_the_closed_form():
    """
    Closed form, including the variation of the line within an increment; 900 pairs determine a deviation to 2.4 %.
    """
    rng, grid = np.random.default_rng(8), fifesim.fife_site(CELL, window=((0, 300), (0, 300)))
    lai = grids.place(xr.DataArray(rng.uniform(0.2, 2.2, grid.shape), dims=("y", "x"), name="lai"), grid)
    ndvi = (0.1 + 0.3 * lai + rng.normal(0, 0.03, lai.shape)).rename("ndvi")
    found = fifesim.scaling.relative_equivalent_noise(lai, ndvi, 0.02)
    expected = np.hypot(0.03, 0.3 * 0.02 / np.sqrt(12)) / (0.3 * found["increment"])
    np.testing.assert_allclose(found["ren"], expected, rtol=0.12)
    assert found.attrs["slope"] == pytest.approx(0.3, rel=0.01)
    assert int(found["count"].sum()) == lai.size
    lazy = in_chunks(lai, {"y": 77, "x": 50}), in_chunks(ndvi, ODD_CHUNKS)
    xr.testing.assert_identical(fifesim.scaling.relative_equivalent_noise(*lazy, 0.02), found)
