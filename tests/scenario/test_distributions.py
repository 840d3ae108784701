"""Distributions compared with scipy, and invalid distributions."""

import numpy as np
import pytest
from mistakes import check_message, mistakes
from scipy import stats

from fifesim.scenario.distributions import distribution_of, points

SHARES = np.linspace(0, 1, 1001)[:-1]


@pytest.mark.parametrize(
    ("table", "oracle"),
    [
        ({"uniform": [5, 45]}, stats.uniform(5, 40)),
        ({"log-uniform": [5, 45]}, stats.loguniform(5, 45)),
        ({"normal": [0.2, 0.1], "within": [0, 0.5]}, stats.truncnorm(-2, 3, 0.2, 0.1)),
        ({"integers": [3, 7]}, stats.randint(3, 8)),
    ],
    ids=lambda each: next(iter(each)) if isinstance(each, dict) else "",
)
def test_draws_follow_their_distribution(table, oracle):
    """The CDF at a draw equals its probability; for integers it steps across the probability."""
    values = np.array(distribution_of(table).quantile(SHARES))
    below = oracle.cdf(values)
    if "integers" in table:
        assert (below > SHARES).all() and (oracle.cdf(values - 1) <= SHARES + 1e-12).all()
    else:
        np.testing.assert_allclose(below, SHARES, atol=1e-9)


def test_choices_occur_with_their_weights():
    drawn = distribution_of({"choice": ["a", "b", "c"], "weights": [1, 0, 3]}).quantile(SHARES)
    assert [drawn.count(each) for each in "abc"] == [250, 0, 750]
    even = distribution_of({"choice": [True, False]}).quantile(SHARES)
    assert even.count(True) == 500


def test_draws_stay_within_the_limits():
    almost = np.array([0.0, np.nextafter(1, 0)])
    for table in ({"uniform": [0.1, 0.3]}, {"log-uniform": [0.1, 0.3]}, {"normal": [0, 1], "within": [0.1, 0.3]}):
        low, high = distribution_of(table).quantile(almost)
        assert 0.1 <= low < high <= 0.3
    assert distribution_of({"integers": [3, 7]}).quantile(almost) == [3, 7]


def test_table_states_the_parameters():
    for table in (
        {"log-uniform": [5, 45]},
        {"normal": [0.2, 0.1], "within": [0.0, 1.0]},
        {"choice": ["a", "b"], "weights": [1.0, 2.0]},
    ):
        assert distribution_of(table).table == table


@pytest.mark.parametrize("sequence", ["sobol", "random"])
def test_points_depend_on_seed_and_stream_alone(sequence):
    found = points(sequence, 7, 3, 16, 2)
    assert found.shape == (16, 2) and (found >= 0).all() and (found < 1).all()
    np.testing.assert_array_equal(found, points(sequence, 7, 3, 16, 2))
    assert (found != points(sequence, 8, 3, 16, 2)).any() and (found != points(sequence, 7, 4, 16, 2)).any()
    np.testing.assert_array_equal(found, points(sequence, 7, 3, 500, 2)[:16])


def test_every_stratum_of_a_dimension_has_one_point():
    """The first 2**k points of a Sobol sequence form a net."""
    slices = np.sort(np.floor(points("sobol", 7, 3, 64, 4) * 64), axis=0)
    np.testing.assert_array_equal(slices, np.arange(64)[:, None] * np.ones(4))


@pytest.mark.parametrize(("stage", "table", "said"), mistakes("distribution"), ids=str)
def test_invalid_distributions_are_rejected(stage, table, said):
    with pytest.raises(ValueError) as caught:
        distribution_of(table)
    check_message(str(caught.value), said)
