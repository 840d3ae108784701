"""Fractions are in 0 to 1."""

import numpy as np
import pytest

from fifesim.ground.canopy.leaf_area import check_fraction, check_share, within


def test_fractions_are_told_from_others():
    assert within(np.array([0.0, 1.0, np.nan]), 0, 1) and within(0.5, 0, 1) and within(np.empty(0), 0, 1)
    for wrong in (-1e-9, 1 + 1e-9, np.inf, -np.inf):
        for cells in (np.array([0.5, wrong]), np.array([[0.5, wrong]] * 4).T, np.array([[0.5, wrong]] * 4)[::2, ::-1]):
            assert not within(cells, 0, 1)
    assert check_share("brown", 0.3) == 0.3


@pytest.mark.parametrize("check", [check_fraction, check_share])
def test_others_are_refused_by_name_and_value(check):
    with pytest.raises(ValueError, match=r"brown must be in \[0, 1\], got 40: give a fraction, not percent"):
        check("brown", np.array([0.4, 40.0]))


def test_no_data_pass_where_there_are_cells():
    check_share("brown", np.array([0.4, np.nan]))
    with pytest.raises(ValueError, match="got nan"):
        check_fraction("brown", np.array([0.4, np.nan]))
