"""Fractions are in 0 to 1."""

import numpy as np
import pytest

from fifesim.ground.canopy.ranges import check_fraction, check_share, within_one


def test_fractions_are_told_from_others():
    assert within_one(np.array([0.0, 1.0, np.nan]))
    for wrong in (-1e-9, 1 + 1e-9, np.inf, -np.inf):
        assert not within_one(np.array([0.5, wrong]))
    assert check_share("brown", 0.3) == 0.3


@pytest.mark.parametrize("check", [check_fraction, check_share])
def test_others_are_refused_by_name_and_value(check):
    with pytest.raises(ValueError, match=r"brown must be in \[0, 1\], got 40: give a fraction, not percent"):
        check("brown", np.array([0.4, 40.0]))


def test_no_data_pass_where_there_are_cells():
    check_share("brown", np.array([0.4, np.nan]))
    with pytest.raises(ValueError, match="got nan"):
        check_fraction("brown", np.array([0.4, np.nan]))
