"""Checks of the terrain see the kernels that light real slopes."""

import pytest
from broken import exceeded, notices

from fifesim.experiments.verification import terrain
from fifesim.ground.terrain import horizon, lit_slopes, slope


@pytest.mark.parametrize("check", terrain.CHECKS[: -len(terrain.ELEVATION_CHECKS)])
def test_all_is_well(check):
    assert exceeded(check) == []


@pytest.mark.parametrize(
    "owner, kernel, check",
    [
        (slope, "_gradient", terrain._slopes),
        (horizon, "_sky_vector", terrain._any_sky),
        (horizon, "horizon_tangent", terrain._horizons),
        (lit_slopes, "_slope_light", terrain._light),
        (lit_slopes, "_slope_factors", terrain._light),
    ],
)
def test_production_kernels_are_checked(monkeypatch, owner, kernel, check):
    assert notices(check, monkeypatch, owner, kernel)
