"""Checks of adjacency notice a kernel that is wrong, and each where it is."""

import numpy as np
import pytest
from broken import exceeded

from fifesim.atmosphere.adjacency import blocks, environment, environment_grid
from fifesim.experiments.verification import adjacency


@pytest.mark.parametrize("check", adjacency.CHECKS)
def test_all_is_well(check):
    assert exceeded(check) == []


@pytest.mark.parametrize(
    "owner, name, what",
    [
        (environment, "point_spread", "point spread of the environment"),
        (blocks, "on_cells", "environment of cells"),
        (blocks, "whole_blocks", "environment of cells"),
        (environment_grid, "environment", "environment of cells"),
        (environment_grid, "environment_of_target", "scene with adjacency, there and back"),
    ],
)
def test_a_percent_is_noticed(monkeypatch, owner, name, what):
    right = getattr(owner, name)
    monkeypatch.setattr(owner, name, lambda *given, **options: 1.01 * np.asarray(right(*given, **options)))
    checks = adjacency._point_spread, adjacency._direct_sums, adjacency._discs, adjacency._there_and_back
    assert what in exceeded(*checks)


def test_surroundings_elsewhere_are_noticed(monkeypatch):
    """By one block."""
    right = environment_grid.environment

    def shifted(sums, surroundings, spread):
        return right(sums, np.roll(surroundings, 1, axis=1) if np.ndim(surroundings) else surroundings, spread)

    monkeypatch.setattr(environment_grid, "environment", shifted)
    assert exceeded(adjacency._part_of_a_scene) == ["environment of a part of a scene"]


def test_a_turned_sum_over_blocks_is_noticed(monkeypatch):
    right = blocks._add_moments

    def turned(values, down, across, sums):
        right(-values, down, across, sums)

    monkeypatch.setattr(blocks, "_add_moments", turned)
    assert exceeded(adjacency._direct_sums) == ["environment of cells"]
