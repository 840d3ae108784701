"""Regression against scipy and the textbook's intervals."""

import numpy as np
import pytest
import statsmodels.api
from scipy import stats

from fifesim.analysis.regression import Regression, fit, row_sums

RNG = np.random.default_rng(8)
X = RNG.uniform(0.3, 0.8, (20, 30))
Y = -1.2 + 3.4 * X + RNG.normal(0, 0.2, X.shape)


def line(y, x, y_origin=0.0, x_origin=0.0):
    return fit(row_sums(y, x, y_origin, x_origin), y_origin, x_origin)


def test_line_agrees_with_scipy():
    ours, theirs = line(Y, X), stats.linregress(X.ravel(), Y.ravel())
    assert ours.slope == pytest.approx(theirs.slope, rel=1e-12)
    assert ours.intercept == pytest.approx(theirs.intercept, rel=1e-12)
    assert ours.r2 == pytest.approx(theirs.rvalue**2, rel=1e-12)
    error = ours.residual_deviation / np.sqrt(ours.x_sum_of_squares)
    assert error == pytest.approx(theirs.stderr, rel=1e-10)
    assert ours.n == X.size


@pytest.mark.parametrize("shift", [0.0, 300.0])
def test_line_errors_and_intervals_agree_with_statsmodels(shift):
    """To 1e-10, also where the values are a thousand times their spread."""
    ours = line(Y + shift, X - shift, shift, -shift)
    theirs = statsmodels.api.OLS((Y + shift).ravel(), statsmodels.api.add_constant((X - shift).ravel())).fit()
    assert ours.slope == pytest.approx(theirs.params[1], rel=1e-10)
    assert ours.intercept == pytest.approx(theirs.params[0], rel=1e-10)
    assert ours.r2 == pytest.approx(theirs.rsquared, rel=1e-10)
    np.testing.assert_allclose([ours.intercept_error, ours.slope_error], theirs.bse, rtol=1e-10)
    at = np.array([0.0, 0.5, 1.3]) - shift
    for level in (0.68, 0.95):
        frame = theirs.get_prediction(statsmodels.api.add_constant(at)).summary_frame(1 - level)
        for name, interval in (("mean_ci", ours.confidence_interval), ("obs_ci", ours.prediction_interval)):
            low, high = interval(at, level)
            np.testing.assert_allclose(low, frame[f"{name}_lower"], rtol=1e-10)
            np.testing.assert_allclose(high, frame[f"{name}_upper"], rtol=1e-10)


def normal_equations(x, y, at, own_scatter, level):
    """Interval at a point by matrices, without the sums that the package uses."""
    design = np.column_stack([np.ones(x.size), x.ravel()])
    inverse = np.linalg.inv(design.T @ design)
    coefficients = inverse @ design.T @ y.ravel()
    residual = y.ravel() - design @ coefficients
    variance = residual @ residual / (x.size - 2)
    point = np.array([1.0, at])
    half = stats.t.ppf(0.5 + level / 2, x.size - 2) * np.sqrt(variance * (own_scatter + point @ inverse @ point))
    return point @ coefficients - half, point @ coefficients + half


@pytest.mark.parametrize("at", [0.0, 0.55, 1.3])
@pytest.mark.parametrize("level", [0.5, 0.95])
def test_intervals_agree_with_the_normal_equations(at, level):
    ours = line(Y, X)
    expected = normal_equations(X, Y, at, 1.0, level)
    np.testing.assert_allclose(ours.prediction_interval(at, level), expected, rtol=1e-10)
    np.testing.assert_allclose(ours.confidence_interval(at, level), normal_equations(X, Y, at, 0.0, level), rtol=1e-10)


def test_prediction_interval_holds_its_share_of_new_values():
    """10 000 new values; binomial error of 0.0022 (four: .009), and that of the line itself, of 600 values."""
    new_x = RNG.uniform(0.3, 0.8, 10_000)
    new_y = -1.2 + 3.4 * new_x + RNG.normal(0, 0.2, new_x.size)
    low, high = line(Y, X).prediction_interval(new_x)
    assert np.mean((new_y > low) & (new_y < high)) == pytest.approx(0.95, abs=0.02)


def test_confidence_interval_is_narrowest_at_the_mean():
    ours = line(Y, X)
    low, high = ours.confidence_interval(np.array([0.4, ours.x_mean, 0.7]))
    assert np.argmin(high - low) == 1


def test_pairs_with_nan_are_left_out():
    y, x = Y.copy(), X.copy()
    y[3, :], x[:, 4] = np.nan, np.nan
    keep = np.isfinite(y) & np.isfinite(x)
    theirs = stats.linregress(x[keep], y[keep])
    ours = line(y, x)
    assert ours.n == keep.sum()
    assert ours.slope == pytest.approx(theirs.slope, rel=1e-12)


def test_origins_keep_digits_of_values_far_from_zero():
    plain, far = line(Y, X), line(Y + 1e7, X - 1e7, 1e7, -1e7)
    assert far.slope == pytest.approx(plain.slope, rel=1e-6)
    assert far.r2 == pytest.approx(plain.r2, rel=1e-6)
    assert far.predict(X[0, 0] - 1e7) == pytest.approx(plain.predict(X[0, 0]) + 1e7, rel=1e-12)


def test_constant_y_is_a_flat_line_that_explains_nothing():
    flat = line(np.full_like(X, 2.0), X)
    assert (flat.slope, flat.intercept, flat.r2) == (0.0, 2.0, 0.0)


def test_exact_line_explains_everything():
    exact = line(1 + 2 * X, X)
    assert exact.r2 == pytest.approx(1, abs=1e-12)
    assert exact.residual_deviation < 1e-6


def test_too_few_pairs_or_no_spread_are_refused():
    with pytest.raises(ValueError, match="at least 3 pairs of values, got 2"):
        line(Y[:1, :2], X[:1, :2])
    with pytest.raises(ValueError, match=r"all 600 values of x are 0\.5"):
        line(Y, np.full_like(X, 0.5))


def test_infinite_values_are_left_out():
    """1 / 0 is no value of an index: it may not turn a whole line into NaN."""
    x, y = X.copy(), Y.copy()
    x[0, 0], y[3, 4], y[5, 6] = np.inf, np.inf, -np.inf
    kept = np.isfinite(x) & np.isfinite(y)
    theirs = stats.linregress(x[kept], y[kept])
    assert line(y, x).n == kept.sum() == X.size - 3
    assert line(y, x).slope == pytest.approx(theirs.slope, rel=1e-12)


@pytest.mark.parametrize("level", [0.0, 1.0, 95])
def test_impossible_levels_are_refused(level):
    with pytest.raises(ValueError, match="level must be between 0 and 1"):
        line(Y, X).confidence_interval(0.5, level)


def test_line_takes_numbers_of_any_kind():
    ours = line(Y, X)
    expected = ours.intercept + ours.slope * np.array([0.3, 0.4])
    for x in ([0.3, 0.4], (0.3, 0.4), np.array([0.3, 0.4])):
        np.testing.assert_array_equal(ours.predict(x), expected)
        assert not ours.extrapolates(x).any()
    assert ours.predict(0.3) == expected[0]
    far = X.mean() + 3 * X.std(ddof=1) * np.array([-1.01, -0.99, 0.99, 1.01])
    np.testing.assert_array_equal(ours.extrapolates([*far, np.nan]), [True, False, False, True, False])


def test_regression_is_told_in_two_lines():
    line = Regression(-2.0, 1.25, 0.9, 10, 0.1, 0.5, 4.0)
    first, second = repr(line).splitlines()
    assert first == "Regression: y = 1.25 - 2 x, R2 0.9000, n 10"
    assert second == "  standard errors: slope 0.05, intercept 0.0403; y about the line 0.1"
