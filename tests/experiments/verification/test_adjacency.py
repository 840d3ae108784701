"""Checks of adjacency notice a kernel that is wrong, and each where it is."""

import numpy as np
import pytest
from broken import exceeded

from fifesim.atmosphere import adjacency as blocks
from fifesim.atmosphere import adjacency as environment
from fifesim.atmosphere import adjacency as environment_grid
from fifesim.experiments.verification import scattering


@pytest.mark.parametrize("check", scattering.ADJACENCY_CHECKS)
def test_all_is_well(check):
    assert exceeded(check) == []


@pytest.mark.parametrize(
    "owner, name, what",
    [
        (environment, "point_spread", "point spread of the environment"),
        (blocks, "on_cells", "environment of cells"),
        (blocks, "whole_blocks", "environment of cells"),
        (environment_grid, "block_environment", "environment of cells"),
        (environment_grid, "environment_of_target", "scene with adjacency, there and back"),
    ],
)
def test_a_percent_is_noticed(monkeypatch, owner, name, what):
    right = getattr(owner, name)
    monkeypatch.setattr(owner, name, lambda *given, **options: 1.01 * np.asarray(right(*given, **options)))
    checks = scattering._point_spread, scattering._direct_sums, scattering._discs, scattering._there_and_back
    assert what in exceeded(*checks)


def test_surroundings_elsewhere_are_noticed(monkeypatch):
    """By one block."""
    right = environment_grid.block_environment

    def shifted(sums, surroundings, spread):
        return right(sums, np.roll(surroundings, 1, axis=1) if np.ndim(surroundings) else surroundings, spread)

    monkeypatch.setattr(environment_grid, "block_environment", shifted)
    assert exceeded(scattering._part_of_a_scene) == ["environment of a part of a scene"]


def test_a_turned_sum_over_blocks_is_noticed(monkeypatch):
    right = blocks._add_moments

    def turned(values, down, across, sums):
        right(-values, down, across, sums)

    monkeypatch.setattr(blocks, "_add_moments", turned)
    assert exceeded(scattering._direct_sums) == ["environment of cells"]
