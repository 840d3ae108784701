"""Regression against scipy, statsmodels and the normal equations, and sums by increment."""

import numpy as np
import pytest
import statsmodels.api

from fifesim.analysis import regression
from fifesim.analysis.regression import Regression, fit, row_sums

RNG = np.random.default_rng(8)
X = RNG.uniform(0.3, 0.8, (20, 30))
Y = -1.2 + 3.4 * X + RNG.normal(0, 0.2, X.shape)


def line(y, x, y_origin=0.0, x_origin=0.0):
    return fit(row_sums(y, x, y_origin, x_origin), y_origin, x_origin)


@pytest.mark.parametrize("shift", [0.0, 300.0])
def test_line_errors_and_intervals_agree_with_statsmodels(shift):
    """Agreement to 1e-10, also where values are a thousand times their spread."""
    ours = line(Y + shift, X - shift, shift, -shift)
    theirs = statsmodels.api.OLS((Y + shift).ravel(), statsmodels.api.add_constant((X - shift).ravel())).fit()
    np.testing.assert_allclose([ours.intercept, ours.slope], theirs.params, rtol=1e-10)
    np.testing.assert_allclose([ours.intercept_error, ours.slope_error], theirs.bse, rtol=1e-10)
    assert ours.r2 == pytest.approx(theirs.rsquared, rel=1e-10) and ours.n == X.size
    at = np.array([0.0, 0.5, 1.3]) - shift
    for level in (0.5, 0.68, 0.95):
        frame = theirs.get_prediction(statsmodels.api.add_constant(at)).summary_frame(1 - level)
        for name, interval in (("mean_ci", ours.confidence_interval), ("obs_ci", ours.prediction_interval)):
            low, high = interval(at, level)
            np.testing.assert_allclose(low, frame[f"{name}_lower"], rtol=1e-10)
            np.testing.assert_allclose(high, frame[f"{name}_upper"], rtol=1e-10)


def test_missing_and_infinite_values_are_left_out():
    """One infinite value of an index, such as 1 / 0, must not turn the whole line into NaN."""
    y, x = Y.copy(), X.copy()
    y[3, :], x[:, 4], x[0, 0], y[5, 6], y[7, 8] = np.nan, np.nan, np.inf, -np.inf, np.inf
    keep = np.isfinite(y) & np.isfinite(x)
    ours, theirs = line(y, x), line(y[keep][None], x[keep][None])
    assert ours.n == theirs.n == keep.sum() and ours.slope == pytest.approx(theirs.slope, rel=1e-12)


def test_constant_and_exact_lines():
    flat, exact = line(np.full_like(X, 2.0), X), line(1 + 2 * X, X)
    assert (flat.slope, flat.intercept, flat.r2) == (0.0, 2.0, 0.0)
    assert exact.r2 == pytest.approx(1, abs=1e-12) and exact.residual_deviation < 1e-6
    for level in (0.0, 1.0, 95):
        with pytest.raises(ValueError, match=r"level must be in \(0, 1\)"):
            exact.confidence_interval(0.5, level)


def test_line_accepts_numbers_lists_and_arrays():
    ours = line(Y, X)
    expected = ours.intercept + ours.slope * np.array([0.3, 0.4])
    for x in ([0.3, 0.4], (0.3, 0.4), np.array([0.3, 0.4])):
        np.testing.assert_array_equal(ours.predict(x), expected)
        assert not ours.extrapolates(x).any()
    assert ours.predict(0.3) == expected[0]
    far = X.mean() + 3 * X.std(ddof=1) * np.array([-1.01, -0.99, 0.99, 1.01])
    np.testing.assert_array_equal(ours.extrapolates([*far, np.nan]), [True, False, False, True, False])


def test_repr_of_a_regression_has_two_lines():
    first, second = repr(Regression(-2.0, 1.25, 0.9, 10, 0.1, 0.5, 4.0)).splitlines()
    assert first == "Regression: y = 1.25 - 2 x, R2 0.9000, n 10"
    assert second == "  standard errors: slope 0.05, intercept 0.0403; y about the line 0.1"


# ------------------------------------------------------------------------------------------ increments


def test_increments_start_at_their_origin():
    """Values on an edge belong to the increment above it; values outside all increments and NaN are ignored."""
    values = np.array([[-0.6, -0.5, -0.1, 0.0, 0.4, 0.5], [np.nan, 0.1, 0.2, 9.0, -9.0, 0.3]])
    ndvi = np.where(values == 0.3, np.inf, 0.7)
    sums = regression.increment_sums(values, ndvi, -1, 0.5, 2, 0.2)
    np.testing.assert_allclose(sums[:, [0, 4]], [[2, 2], [0, 2]])
    np.testing.assert_allclose(sums[:, [1, 5]], [[-0.6, 0.4], [0, 0.3]], atol=1e-15)
    np.testing.assert_allclose(sums[:, [2, 6]], 0.5 * sums[:, [0, 4]])
    np.testing.assert_allclose(sums[:, [3, 7]], 0.25 * sums[:, [0, 4]])
