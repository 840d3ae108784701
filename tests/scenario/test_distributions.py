"""Distributions beside those of scipy, and what is none."""

import numpy as np
import pytest
from scipy import stats

from fifesim.scenario.distributions import distribution_of

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
def test_draws_have_the_distribution_that_they_are_said_to_have(table, oracle):
    """The distribution function at a draw is its share; of whole numbers it steps over it."""
    values = np.array(distribution_of(table).quantile(SHARES))
    below = oracle.cdf(values)
    if "integers" in table:
        assert (below > SHARES).all() and (oracle.cdf(values - 1) <= SHARES + 1e-12).all()
    else:
        np.testing.assert_allclose(below, SHARES, atol=1e-9)


def test_choices_have_their_weights():
    drawn = distribution_of({"choice": ["a", "b", "c"], "weights": [1, 0, 3]}).quantile(SHARES)
    assert [drawn.count(each) for each in "abc"] == [250, 0, 750]
    even = distribution_of({"choice": [True, False]}).quantile(SHARES)
    assert even.count(True) == 500


def test_ends_are_never_passed():
    almost = np.array([0.0, np.nextafter(1, 0)])
    for table in ({"uniform": [0.1, 0.3]}, {"log-uniform": [0.1, 0.3]}, {"normal": [0, 1], "within": [0.1, 0.3]}):
        low, high = distribution_of(table).quantile(almost)
        assert 0.1 <= low < high <= 0.3
    assert distribution_of({"integers": [3, 7]}).quantile(almost) == [3, 7]


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (5, "a distribution is a table"),
        ({"unifrom": [1, 2]}, "got unifrom: did you mean 'uniform'"),
        ({"uniform": [1, 2], "choice": [1]}, "needs one of"),
        ({}, "got nothing"),
        ({"uniform": [2, 1]}, "must be below the second, got 2 and 1"),
        ({"uniform": [1]}, r"uniform = \[1\] must be \[low, high\]"),
        ({"uniform": [1, "two"]}, r"must be \[low, high\]"),
        ({"uniform": [0, True]}, r"must be \[low, high\]"),
        ({"uniform": [0, float("inf")]}, r"must be \[low, high\]"),
        ({"log-uniform": [0, 1]}, "both numbers must be above 0, got 0"),
        ({"normal": [0, 1]}, r"add within = \[low, high\]"),
        ({"normal": [0, 0], "within": [0, 1]}, "the standard deviation, must be above 0"),
        ({"integers": [1, 2.5]}, "both integers, got 1 and 2.5"),
        ({"choice": []}, "must be a list of values"),
        ({"choice": "abc"}, "must be a list of values"),
        ({"choice": ["a", "b"], "weights": [1]}, "2 numbers, one per choice"),
        ({"choice": ["a", "b"], "weights": [0, 0]}, "2 numbers, one per choice"),
        ({"uniform": [1, 2], "within": [0, 3]}, "is not a parameter of uniform"),
    ],
)
def test_what_is_no_distribution_is_refused(table, message):
    with pytest.raises(ValueError, match=message):
        distribution_of(table)


def test_a_table_is_read_back():
    for table in ({"normal": [0.2, 0.1], "within": [0.0, 1.0]}, {"choice": ["a", "b"], "weights": [1.0, 2.0]}):
        assert distribution_of(table).table == table


def test_words_name_the_numbers():
    assert distribution_of({"log-uniform": [5, 45]}).in_words == "log-uniform, 5 to 45"
    assert distribution_of({"choice": ["a", "b"], "weights": [1, 2]}).in_words == "one of a, b, weights 1, 2"
