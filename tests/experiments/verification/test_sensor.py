"""Checks of the sensor see the kernels that production calls."""

import pytest
from broken import exceeded, notices

from fifesim.experiments.verification import sensor
from fifesim.sensor.response import calibration


@pytest.mark.parametrize("check", sensor.CHECKS)
def test_all_is_well(check):
    assert exceeded(check) == []


@pytest.mark.parametrize(
    ("owner", "kernel", "check"),
    [
        (sensor, "regularize", sensor._impulse),
        (sensor, "regularize", sensor._wave),
        (calibration, "gain_offset", sensor._counts),
        (calibration, "radiance_to_dn", sensor._counts),
        (sensor, "line_noise", sensor._detectors),
    ],
)
def test_production_kernels_are_checked(monkeypatch, owner, kernel, check):
    assert notices(check, monkeypatch, owner, kernel)
