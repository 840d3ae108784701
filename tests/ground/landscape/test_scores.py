"""Standard normal scores of values."""

import numpy as np
import pytest
from scipy import stats

from fifesim.ground.landscape.covariance import normal_scores, score_table


@pytest.fixture(scope="module")
def places():
    """Heights and wetness, neither of them normal."""
    drawn = np.random.default_rng(4).standard_normal((2, 20_000))
    return {"elevation": 400 + 30 * drawn[0] ** 3, "wetness": np.exp(drawn[1] - drawn[0] / 2)}


def test_scores_are_normal_whatever_the_values(places):
    for values in (places["elevation"], places["wetness"]):
        scores = normal_scores(values, score_table(values))
        assert stats.kstest(scores, "norm").statistic < 1e-3
        assert stats.spearmanr(scores, values).statistic == pytest.approx(1, abs=1e-9)


def test_values_that_are_shared_have_one_score():
    table = score_table(np.array([0.0, 0.0, 0.0, 1.0, 2.0]))
    assert table.values.tolist() == [0, 1, 2]
    scores = normal_scores(np.array([0.0, 0.0, 0.0, 1.0, 2.0]), table)
    assert scores.mean() == pytest.approx(0, abs=1e-12) and scores.std() == pytest.approx(1, abs=1e-12)


def test_scores_are_those_of_a_line_between_the_nodes(places):
    """As numpy interpolates them, on the table's own nodes, between them and beyond."""
    table = score_table(places["elevation"])
    values = np.concatenate([table.values, np.linspace(-5000, 6000, 3001), [np.inf, -np.inf]])
    expected = np.interp(values, table.values, table.scores)
    np.testing.assert_allclose(normal_scores(values, table), expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("sample", [[-1e6, 0, 1, 2, 3], [-3, -2, -1, 0, 1e6], [-1e6, 0, 1, 2, 1e6]])
def test_nodes_that_lie_close_at_an_end_are_told_apart(sample):
    """All but one in the same of the even steps that the search starts from."""
    table, values = score_table(np.array(sample, float)), np.linspace(-4, 4, 81)
    expected = np.interp(values, table.values, table.scores)
    np.testing.assert_allclose(normal_scores(values, table), expected, rtol=0, atol=1e-9)


def test_missing_values_have_no_score_and_shapes_stay(places):
    table = score_table(places["wetness"])
    found = normal_scores(np.array([[np.nan, 1.0], [2.0, 3.0]]), table)
    assert np.isnan(found).tolist() == [[True, False], [False, False]]
