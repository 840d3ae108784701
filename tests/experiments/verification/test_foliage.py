"""Checks of two kinds of leaf and of crowns see the kernels that make images."""

import pytest
from broken import exceeded, notices

from fifesim.experiments.verification import foliage
from fifesim.ground.canopy import foliage_interpolation, layers


@pytest.mark.parametrize("check", [each for each in foliage.CHECKS if each is not foliage._tables])
def test_all_is_well(check):
    assert exceeded(check) == []


@pytest.mark.parametrize(
    "owner, kernel, check",
    [
        (foliage_interpolation, "_foliage", foliage._tables),
        (foliage_interpolation, "_crowned", foliage._tables),
        (layers, "bidirectional_gap", foliage._other_layers),
        (foliage, "crowns_over_background", foliage._crowns),
        (foliage, "light_budget", foliage._energy),
    ],
)
def test_production_kernels_are_checked(monkeypatch, owner, kernel, check):
    assert notices(check, monkeypatch, owner, kernel)
