"""Shares of an effect: the textbook's games, and the definition written out."""

from itertools import permutations

import numpy as np
import pytest

from fifesim.analysis.scaling import by_itself, shapley, taken_away


def test_glove_game():
    """One left glove and two right ones, where a pair is worth 1: shares 2/3, 1/6 and 1/6."""
    pair = np.zeros((2, 2, 2))
    pair[1, 1, :] = pair[1, :, 1] = 1.0
    np.testing.assert_allclose(shapley(pair, 3), [2 / 3, 1 / 6, 1 / 6], rtol=1e-14)


def test_airport_game():
    """Runways that cost 1, 2 and 6, of which the longest asked for is built: 1/3, 1/3 + 1/2, 1/3 + 1/2 + 4."""
    lengths = np.array([1.0, 2.0, 6.0])
    cost = np.array([np.max(lengths * which) for which in np.ndindex(2, 2, 2)])
    np.testing.assert_allclose(shapley(cost.reshape(2, 2, 2), 3), [1 / 3, 5 / 6, 29 / 6], rtol=1e-14)


def test_share_is_the_mean_over_all_orders():
    causes = 5
    values = np.random.default_rng(3).normal(size=(2,) * causes + (2, 4))
    orders, expected = list(permutations(range(causes))), np.zeros((causes, 2, 4))
    for order in orders:
        at_work = [0] * causes
        for cause in order:
            before = values[tuple(at_work)]
            at_work[cause] = 1
            expected[cause] += (values[tuple(at_work)] - before) / len(orders)
    np.testing.assert_allclose(shapley(values, causes), expected, rtol=1e-12, atol=1e-14)


def test_shares_of_effects_that_add_are_the_effects():
    effects = np.array([0.5, -0.25, 2.0, 0.125])
    values = np.tensordot(np.indices((2,) * 4), effects, axes=(0, 0)) + 7.0
    for attribute in (shapley, taken_away, by_itself):
        np.testing.assert_allclose(attribute(values, 4), effects, rtol=1e-13)


def test_cause_that_changes_nothing_has_exactly_nothing():
    values = np.repeat(np.random.default_rng(5).normal(size=(2, 1, 2)), 2, axis=1)
    for attribute in (shapley, taken_away, by_itself):
        assert attribute(values, 3)[1] == 0.0


def test_missing_axis_is_named():
    with pytest.raises(ValueError, match="3 axes of 2 first"):
        shapley(np.zeros((2, 2)), 3)
