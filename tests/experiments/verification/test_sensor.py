"""Checks of the sensor notice what is wrong."""

import pytest

from fifesim.experiments.verification import sensor


@pytest.mark.parametrize(
    ("name", "wrong", "said"),
    [
        ("regularize", lambda image: 1.001 * image, "image of one bright cell"),
        ("regularized", lambda image: image[::-1], "image of a scene with holes, on another grid"),
        ("nearest", lambda number: 0, "red and near infrared of four instruments"),
        ("solar_irradiance_steps", lambda sun: 1.001 * sun, "and of its steps"),
        ("add_noise", lambda image: 80 + 1.05 * (image - 80), "noise at a radiance between two"),
        ("fixed_pattern", lambda pattern: (pattern[0], -pattern[1]), "detectors of rows"),
    ],
)
def test_what_is_wrong_is_named(exceeded, name, wrong, said):
    assert said in exceeded(sensor, name, wrong)


def test_all_is_well(exceeded):
    assert exceeded(sensor) == []
