"""Checks of the canopy see the kernels that make images."""

import pytest
from broken import exceeded, notices

from fifesim.experiments.verification import canopy
from fifesim.ground.canopy import divided_differences, lai_table


@pytest.mark.parametrize("check", canopy.CHECKS)
def test_all_is_well(check):
    assert exceeded(check) == []


@pytest.mark.parametrize(
    "owner, kernel, check",
    [
        (divided_differences, "_chains", canopy._chains),
        (lai_table, "_interpolate", canopy._tables),
        (lai_table, "_interpolate_over", canopy._tables),
        (canopy, "directional_reflectance", canopy._tables),
        (canopy, "over_background", canopy._orders),
    ],
)
def test_production_kernels_are_checked(monkeypatch, owner, kernel, check):
    assert notices(check, monkeypatch, owner, kernel)
