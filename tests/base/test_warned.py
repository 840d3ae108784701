"""Warnings point at the user's line, however deep they come from."""

import warnings

from fifesim.base.messages import warn


def test_a_warning_points_outside_of_the_package():
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        warn("careful")
    assert [(str(each.message), each.filename) for each in said] == [("careful", __file__)]
