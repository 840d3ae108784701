"""Which date of a cell is kept, and what that does to an index with errors."""

from math import asin, pi, sqrt

import numpy as np
import pytest

from fifesim.analysis.indices import date_of_maximum, values_of_date

# Expected largest of n standard normal numbers, in closed form.
LARGEST = {
    2: 1 / sqrt(pi),
    3: 3 / (2 * sqrt(pi)),
    4: 3 / sqrt(pi) * (0.5 + asin(1 / 3) / pi),
    5: 5 / (4 * sqrt(pi)) * (1 + 6 / pi * asin(1 / 3)),
}


@pytest.mark.parametrize("n", LARGEST)
def test_composite_of_noisy_ndvi_is_high_by_the_largest_of_normal_numbers(n):
    """Within four standard errors of the mean of 90 000 cells."""
    deviation, cells = 0.03, 90_000
    ndvi = 0.4 + deviation * np.random.default_rng(n).standard_normal((cells, n))
    bias = values_of_date(ndvi, date_of_maximum(ndvi), np.nan) - 0.4
    assert bias.mean() / deviation == pytest.approx(LARGEST[n], abs=4 / sqrt(cells))
    np.testing.assert_array_equal(bias, ndvi.max(axis=-1) - 0.4)


def test_missing_dates_are_passed_over_and_equal_ones_are_the_first():
    index = np.array([[np.nan, -0.2, -0.1], [0.3, 0.3, np.nan], [np.nan, -np.inf, np.nan], [np.nan] * 3])
    assert date_of_maximum(index).tolist() == [2, 0, 1, -1]
