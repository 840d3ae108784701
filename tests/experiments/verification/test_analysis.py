"""Checks of the analysis notice what is wrong."""

import dataclasses

import pytest

from fifesim.experiments.verification import analysis


@pytest.mark.parametrize(
    ("name", "wrong", "said"),
    [
        ("row_sums", lambda sums: sums * [1, 1, 1, 1, -1, 1], "least-squares line and its errors"),
        ("fit", lambda line: dataclasses.replace(line, x_mean=-line.x_mean), "intervals of a line"),
        ("normalized_difference", lambda index: -index, "normalized difference"),
    ],
)
def test_what_is_wrong_is_named(exceeded, name, wrong, said):
    assert said in exceeded(analysis, name, wrong)


def test_all_is_well(exceeded):
    assert exceeded(analysis) == []
