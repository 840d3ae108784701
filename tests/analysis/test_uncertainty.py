"""Relative equivalent noise, and errors of a map, from sums."""

import numpy as np

from fifesim.analysis import regression


def test_few_pairs_have_no_noise():
    sums = regression.increment_sums(np.array([[0.5, 1.5, 1.6]]), np.array([[0.1, 0.2, 0.4]]), 0, 1.0, 3, 0.0)
    count, mean, deviation = regression.increment_moments(sums)
    assert count.tolist() == [1, 2, 0]
    assert np.isnan(deviation).tolist() == [True, False, True]
    assert np.isnan(mean).tolist() == [False, False, True]


def test_noise_is_scatter_over_slope_and_value():
    """By hand: NDVI of 0.4 and 0.6 scatter by 0.1 sqrt(2), where it rises by 0.5 per unit around 0.2."""
    sums = regression.increment_sums(np.array([[0.1, 0.3]]), np.array([[0.4, 0.6]]), 0, 1.0, 1, 0.5)
    _, mean, deviation = regression.increment_moments(sums)
    ren = regression.equivalent_noise(deviation, 0.5, mean)
    np.testing.assert_allclose(ren, 0.1 * np.sqrt(2) / 0.5 / 0.2, rtol=1e-12)


def test_increments_begin_where_they_are_counted_from():
    """Values on an edge belong to the increment above it; what lies outside of all is left out, as is NaN."""
    values = np.array([[-0.6, -0.5, -0.1, 0.0, 0.4, 0.5], [np.nan, 0.1, 0.2, 9.0, -9.0, 0.3]])
    ndvi = np.where(values == 0.3, np.inf, 0.7)
    sums = regression.increment_sums(values, ndvi, -1, 0.5, 2, 0.2)
    np.testing.assert_allclose(sums[:, [0, 4]], [[2, 2], [0, 2]])
    np.testing.assert_allclose(sums[:, [1, 5]], [[-0.6, 0.4], [0, 0.3]], atol=1e-15)
    np.testing.assert_allclose(sums[:, [2, 6]], 0.5 * sums[:, [0, 4]])
    np.testing.assert_allclose(sums[:, [3, 7]], 0.25 * sums[:, [0, 4]])


def test_errors_are_of_estimate_less_truth_and_limits_belong_to_the_interval():
    truth = np.array([[1.0, 2.0, 3.0], [4.0, np.nan, 5.0]])
    estimate = np.array([[1.5, 1.0, np.nan], [4.0, 1.0, 8.0]])
    low, high = truth - [[0.0, 1.0, 1.0], [-1.0, 1.0, 2.0]], truth + [[1.0, 0.0, 1.0], [2.0, 1.0, 1.0]]
    sums = regression.error_sums(truth, estimate, low, high)
    np.testing.assert_array_equal(sums, [[2, -0.5, 1.25, 2], [2, 3, 9, 1]])
