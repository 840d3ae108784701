"""Checks of product metadata against each other and against the sun."""

import numpy as np
import pytest

from fifesim.base.geometry import earth_sun_distance, sun_positions
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.products import metadata as checks
from fifesim.sensor.response.calibration import ProductBand

TIME = np.datetime64("2020-06-06T17:00:00", "ns")
PLACE = (39.0, -96.5)
(SZA,), (SAA,) = sun_positions([str(TIME)], *PLACE)[1:3]
DISTANCE = earth_sun_distance(str(TIME))
RANGE = "KEY = 1 give values from .* states -0.09998 to 1.2107: .*fetch"
TM = instrument("TM")
(RED,) = TM.select("TM3")


def scale(gain, offset):
    checks.check_product_scale("KEY = 1", gain, offset, (1, 65535), (-0.09998, 1.2107))


def unbounded(offset, largest):
    checks.check_product_scale("K", 1e-4, offset, (1, largest), brightest=1.0)


def radiance(gain, limits):
    checks.check_radiance("K", gain, -2.21398, (1, 255), limits)


def sun(turn):
    checks.check_sun("K", SZA + turn, SAA, TIME, PLACE)


def distance(more):
    checks.check_distance("K", DISTANCE + more, TIME)


def irradiance(factor):
    """A band without irradiance and one that the instrument lacks are not compared."""
    others = ProductBand("TM4", "B4.TIF", 1e-3, 0.0, 255, None), ProductBand("TM9", "B9.TIF", 1e-3, 0.0, 255, 1.0)
    band = ProductBand("TM3", "B3.TIF", 1e-3, 0.0, 255, RED.solar_irradiance * factor)
    checks.check_irradiance("LT05", (band, *others), TM)


CHECKS = [
    # The rounding of metadata is below half of 0.1 %.
    (
        scale,
        [(2e-5, -0.1), (2.0009e-5, -0.1)],
        [(2.0011e-5, -0.1), (2e-5, -0.0993), (0.0, -0.1), (np.inf, -0.1)],
        RANGE,
    ),
    (unbounded, [(-0.25, 65534), (0.0999, 65534)], [(-0.26, 65534), (0.11, 65534)], r"must begin in \[-0.25, 0.1\]"),
    (unbounded, [(0.0, 10000), (0.0, 100_000)], [(0.0, 9999), (0.0, 100_001)], r"end in \[1, 10\]"),
    (radiance, [(1.044, (-1.17, 264.0))], [(1.050, (-1.17, 264.0))], "and the same file states -1.17 to 264"),
    (radiance, [], [(1.044, (264.0, -1.17))], "W m-2 sr-1 um-1, and the same file states 264 to -1.17"),
    (sun, [(0.0,), (1.9,), (-1.9,)], [(2.1,), (np.nan,)], "K: at 2020-06-06T17:00 UTC and 39.00 N, -96.50 E, the sun"),
    (
        irradiance,
        [(0.81,), (1.24,)],
        [(0.79,), (1.26,), (1e3,)],
        r"LT05: the scale of TM3 .* must be in \[1229, 1920\]",
    ),
    (distance, [(9e-4,), (-9e-4,)], [(1.1e-3,), (-1.1e-3,)], "not belong to the date 2020-06-06, which has 1.0148"),
]


@pytest.mark.parametrize(("check", "good", "wrong", "said"), CHECKS)
def test_numbers_agree_within_limits(check, good, wrong, said):
    for numbers in good:
        check(*numbers)
    for numbers in wrong:
        with pytest.raises(ValueError, match=said):
            check(*numbers)
