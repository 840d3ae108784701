"""Regression of labelled rasters."""

import numpy as np
import pytest
from lazy import CHUNKS, ODD_CHUNKS, in_chunks
from scipy import stats

import fifesim

CELL = 30 / 9


def test_regression_agrees_with_scipy(pair):
    fitted, theirs = fifesim.regress(*pair), stats.linregress(pair[1].values.ravel(), pair[0].values.ravel())
    assert fitted.slope == pytest.approx(theirs.slope, rel=1e-10)
    assert fitted.intercept == pytest.approx(theirs.intercept, rel=1e-10)
    assert fitted.r2 == pytest.approx(theirs.rvalue**2, rel=1e-10)


def test_regression_has_the_same_bits_in_any_chunks(pair):
    y, x = pair
    y[3:5, 2] = np.nan
    whole = fifesim.regress(y, x)
    for one, other in [(CHUNKS, CHUNKS), (ODD_CHUNKS, CHUNKS), (ODD_CHUNKS, {}), ({}, {"y": 1, "x": 54})]:
        assert fifesim.regress(in_chunks(y, one), in_chunks(x, other)) == whole


def test_regression_works_where_the_first_row_is_empty(pair):
    y, x = pair
    y[0], x[0] = np.nan, np.nan
    assert fifesim.regress(y, x).n == 44 * 54
