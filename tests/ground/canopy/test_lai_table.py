"""Tables over leaf area index, against the functions that they hold."""

import numpy as np
import pytest

from fifesim.ground.canopy.interpolation import LARGEST_TABLE_LAI, interpolate, interpolate_over, tabulate
from fifesim.ground.canopy.sail_model import over_background


def test_tables_meet_their_tolerance_or_say_so():
    table = tabulate(lambda lai: np.stack([np.exp(-5 * lai), lai**2 / (1 + lai**2)]), rate=5.0)
    lai = np.random.default_rng(2).uniform(0, LARGEST_TABLE_LAI, 10_000)
    np.testing.assert_allclose(interpolate(table, lai), [np.exp(-5 * lai), lai**2 / (1 + lai**2)], atol=2.5e-7)
    with pytest.raises(ValueError, match="exact=True"):
        tabulate(lambda lai: np.floor(lai)[None], rate=1.0)


def test_outside_a_table_there_is_nothing():
    table = tabulate(lambda lai: np.exp(-lai)[None], rate=1.0)
    assert np.all(np.isnan(interpolate(table, [np.nan, -1e-9, LARGEST_TABLE_LAI * 1.001, np.inf])))


def test_terms_of_a_layer_are_joined_over_each_background():
    """Functions that a cubic spline holds well, of two bands; NaN in the layer or below it is NaN."""

    def terms(lai):
        return np.stack([np.exp(-k * lai) / k for k in (1.0, 2.0, 1.5, 3.0, 1.2, 2.5, 1.1, 4.0)])

    table = tabulate(terms, rate=4.0, tolerance=1e-7)
    rng = np.random.default_rng(5)
    lai, background = rng.uniform(0, 8, (30, 40)), rng.uniform(0, 1, (2, 30, 40))
    expected = over_background(*terms(lai).reshape(2, 4, 30, 40).swapaxes(0, 1), background)
    np.testing.assert_allclose(interpolate_over(table, lai, background), expected, rtol=0, atol=2e-7)
    lai[2, 3], background[1, 4, 5] = np.nan, np.nan
    holes = np.isnan(interpolate_over(table, lai, background))
    assert holes[:, 2, 3].all() and holes[:, 4, 5].tolist() == [False, True] and holes.sum() == 3
