"""Checks of elevation see the kernels that make it."""

import pytest
from broken import exceeded, notices

from fifesim.experiments.verification import terrain
from fifesim.ground.terrain import flint_hills, spline


@pytest.mark.parametrize("check", terrain.ELEVATION_CHECKS)
def test_all_is_well(check):
    assert exceeded(check) == []


@pytest.mark.parametrize(
    "owner, kernel, check",
    [
        (spline, "spline_grid", terrain._upsampling),
        (spline, "spline_points", terrain._upsampling),
        (spline, "extend", terrain._unknown_cells),
        (spline, "_least_bending", terrain._unknown_cells),
        (flint_hills, "least_ways", terrain._ways),
        (flint_hills, "erode", terrain._erosion),
        (flint_hills, "hypsometry", terrain._hills),
    ],
)
def test_production_kernels_are_checked(monkeypatch, owner, kernel, check):
    assert notices(check, monkeypatch, owner, kernel)
