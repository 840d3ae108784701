"""Checks of elevation see the kernels that make it."""

import pytest
from broken import exceeded, notices

from fifesim.experiments.verification import elevation
from fifesim.ground.terrain import flint_hills, gaps, spline, streams


@pytest.mark.parametrize("check", elevation.CHECKS)
def test_all_is_well(check):
    assert exceeded(check) == []


@pytest.mark.parametrize(
    "owner, kernel, check",
    [
        (spline, "spline_grid", elevation._upsampling),
        (spline, "spline_points", elevation._upsampling),
        (gaps, "extend", elevation._unknown_cells),
        (gaps, "_least_bending", elevation._unknown_cells),
        (streams, "least_ways", elevation._ways),
        (streams, "erode", elevation._erosion),
        (flint_hills, "hypsometry", elevation._hills),
    ],
)
def test_production_kernels_are_checked(monkeypatch, owner, kernel, check):
    assert notices(check, monkeypatch, owner, kernel)
