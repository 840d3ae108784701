"""Checks of line spread functions see the kernels that production calls."""

import pytest
from broken import exceeded, notices

from fifesim.base.line_spread import Boxcar
from fifesim.experiments.verification import sensor
from fifesim.sensor.response.spatial import CosineSpread, GaussianSpread


@pytest.mark.parametrize("check", sensor.LINE_SPREAD_CHECKS)
def test_all_is_well(check):
    assert exceeded(check) == []


@pytest.mark.parametrize(
    ("owner", "kernel", "check"),
    [
        (Boxcar, "_cumulative", sensor._shapes),
        (CosineSpread, "_mtf", sensor._shapes),
        (GaussianSpread, "_cumulative", sensor._shapes),
    ],
)
def test_production_kernels_are_checked(monkeypatch, owner, kernel, check):
    assert notices(check, monkeypatch, owner, kernel)
