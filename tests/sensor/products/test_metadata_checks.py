"""Checks of product metadata against each other and against the sun."""

import numpy as np
import pytest

from fifesim.base.geometry import earth_sun_distance, sun_positions
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.products import metadata as checks
from fifesim.sensor.response.calibration import ProductBand

TIME = np.datetime64("2020-06-06T17:00:00", "ns")


@pytest.mark.parametrize(
    ("gain", "offset", "good"),
    [
        (2e-5, -0.1, True),
        (2.0009e-5, -0.1, True),
        (2.0011e-5, -0.1, False),
        (2e-5, -0.0993, False),
        (0.0, -0.1, False),
        (float("inf"), -0.1, False),
    ],
)
def test_scales_agree_within_the_rounding_of_metadata(gain, offset, good):
    arguments = "KEY = 1", gain, offset, (1, 65535), (-0.09998, 1.2107)
    if good:
        checks.check_product_scale(*arguments)
    else:
        with pytest.raises(ValueError, match=r"KEY = 1 give values from .* states -0.09998 to 1.2107: .*fetch"):
            checks.check_product_scale(*arguments)


@pytest.mark.parametrize("offset", [-0.26, 0.11])
def test_reflectance_begins_near_0(offset):
    with pytest.raises(ValueError, match=r"must begin in \[-0.25, 0.1\]"):
        checks.check_product_scale("K", 1e-4, offset, (1, 65534), brightest=1.0)


@pytest.mark.parametrize(("largest", "good"), [(9999, False), (10000, True), (100_000, True), (100_001, False)])
def test_reflectance_ends_above_its_limit_and_below_10(largest, good):
    if good:
        checks.check_product_scale("K", 1e-4, 0.0, (1, largest), brightest=1.0)
    else:
        with pytest.raises(ValueError, match=r"end in \[1, 10\]"):
            checks.check_product_scale("K", 1e-4, 0.0, (1, largest), brightest=1.0)


def test_radiance_agrees_with_its_range():
    checks.check_radiance("K", 1.044, -2.21398, (1, 255), (-1.17, 264.0))
    with pytest.raises(ValueError, match=r"W m-2 sr-1 um-1, and the same file states -1.17 to 264"):
        checks.check_radiance("K", 1.050, -2.21398, (1, 255), (-1.17, 264.0))
    with pytest.raises(ValueError, match=r"the same file states 264 to -1.17"):
        checks.check_radiance("K", 1.044, -2.21398, (1, 255), (264.0, -1.17))


@pytest.mark.parametrize(("turn", "good"), [(0.0, True), (1.9, True), (-1.9, True), (2.1, False)])
def test_the_sun_is_that_of_the_almanac_within_2_degrees(turn, good):
    _, sza, saa, _ = sun_positions([str(TIME)], 39.0, -96.5)
    if good:
        checks.check_sun("K", sza[0] + turn, saa[0], TIME, (39.0, -96.5))
    else:
        with pytest.raises(ValueError, match=r"K: at 2020-06-06T17:00 UTC and 39.00 N, -96.50 E, the sun had"):
            checks.check_sun("K", sza[0] + turn, saa[0], TIME, (39.0, -96.5))
    with pytest.raises(ValueError, match="the sun had"):
        checks.check_sun("K", float("nan"), saa[0], TIME, (39.0, -96.5))


def test_the_distance_is_that_of_the_date():
    distance = earth_sun_distance(str(TIME))
    checks.check_distance("K", distance + 9e-4, TIME)
    with pytest.raises(ValueError, match=r"does not belong to the date 2020-06-06, which has 1.0148"):
        checks.check_distance("K", distance + 1.1e-3, TIME)


@pytest.mark.parametrize(
    ("factor", "good"), [(0.79, False), (0.81, True), (1.24, True), (1.26, False), (1000.0, False)]
)
def test_solar_irradiance_is_near_that_of_the_instrument(factor, good):
    tm = instrument("TM")
    own = next(band.solar_irradiance for band in tm.bands if band.name == "TM3")
    band = ProductBand("TM3", "B3.TIF", 1e-3, 0.0, 255, own * factor)
    others = ProductBand("TM4", "B4.TIF", 1e-3, 0.0, 255, None), ProductBand("TM9", "B9.TIF", 1e-3, 0.0, 255, 1.0)
    if good:
        checks.check_irradiance("LT05", (band, *others), tm)
    else:
        with pytest.raises(ValueError, match=r"LT05: the scale of TM3 .* must be in \[1229, 1920\]"):
            checks.check_irradiance("LT05", (band, *others), tm)
