"""Checks of scans see the kernels that production calls."""

import pytest
from broken import exceeded, notices

from fifesim.experiments.verification import scan
from fifesim.sensor.response import scan as track


@pytest.mark.parametrize("check", scan.CHECKS)
def test_all_is_well(check):
    assert exceeded(check) == []


@pytest.mark.parametrize(
    ("owner", "kernel", "check"),
    [
        (track, "view_from_ground", scan._lines_of_sight),
        (track, "growth", scan._lines_of_sight),
        (track, "place_of", scan._places),
        (track, "ground_of_detector", scan._sweeps),
        (scan, "apply_operator", scan._straight),
    ],
)
def test_production_kernels_are_checked(monkeypatch, owner, kernel, check):
    assert notices(check, monkeypatch, owner, kernel)
