"""Checks of the canopy see the kernels that make images."""

import pytest
from broken import exceeded, notices

from fifesim.experiments.verification import canopy
from fifesim.ground.canopy import interpolation, sail_model


@pytest.mark.parametrize("check", canopy.CHECKS)
def test_all_is_well(check):
    assert exceeded(check) == []


@pytest.mark.parametrize(
    "owner, kernel, check",
    [
        (sail_model, "_chains", canopy._chains),
        (interpolation, "_interpolate", canopy._tables),
        (interpolation, "_interpolate_over", canopy._tables),
        (canopy, "directional_reflectance", canopy._tables),
        (canopy, "over_background", canopy._orders),
    ],
)
def test_production_kernels_are_checked(monkeypatch, owner, kernel, check):
    assert notices(check, monkeypatch, owner, kernel)
