"""View of Landsat scenes that were acquired off nadir."""

import numpy as np
import pytest

from fifesim.sensor.products.landsat import view_of_roll
from fifesim.sensor.response.scan import Track, place_beside, view_components, view_from_scan


@pytest.mark.parametrize(
    ("roll", "row", "azimuth"),
    [
        # On the way south, the right is in the west: the sensor stands east of the scene.
        (-10.0, 60, 90.0),
        (10.0, 60, 270.0),
        # On the way north, the other way round.
        (-10.0, 184, 270.0),
        (10.0, 184, 90.0),
        # At the turning points it flies west: its left is in the south.
        (10.0, 122, 0.0),
        (10.0, 246, 0.0),
        (-10.0, 122, 180.0),
    ],
)
def test_the_sensor_stands_on_the_side_that_it_looks_away_from(roll, row, azimuth):
    vza, vaa = view_of_roll(roll, row)
    assert abs((vaa - azimuth + 180) % 360 - 180) < 13
    assert vza == pytest.approx(np.degrees(np.arcsin(np.sin(np.radians(10.0)) * (6371 + 705) / 6371)), abs=1e-6)


def test_no_roll_is_nadir():
    assert view_of_roll(0.0, 36)[0] == pytest.approx(0.0, abs=1e-12)


def centre_of(path, row):
    """
    Nominal centre of a scene on the Worldwide Reference System 2, geocentric [degree].

    Path 1 crosses the equator southward at 64.60 W. 233 paths divide the equator, and are flown in 16 days.
    """
    turn = 360 * (row - 60) / 248
    i, u = np.radians(98.2), np.radians(turn)
    longitude = -64.60 - (path - 1) * 360 / 233 + np.degrees(np.arctan(np.cos(i) * np.tan(u))) - turn * 16 / 233
    return -np.degrees(np.arcsin(np.sin(i) * np.sin(u))), longitude


def test_a_real_scene_lies_where_its_roll_looks():
    """Middle of the corners of LC08_L2SP_017036_20130419_20200913_02_T2, whose ROLL_ANGLE is -11.696."""
    latitude, longitude = centre_of(17, 36)
    track = Track.from_inclination(latitude, longitude, 98.2, 705e3)
    # The middle of the corners, 34.61 N geodetic.
    _, across = place_beside(track, 34.43, -82.89)
    # The pass may lie 5 km from its path, which is 0.05 degrees. The other side of the track has the other sign.
    assert float(across) == pytest.approx(float(view_from_scan(11.696, 705e3)[1]), abs=0.05)
    vza, vaa = view_of_roll(-11.696, 36)
    assert vza == pytest.approx(13.0, abs=0.1)
    # Toward the nearest point of the track.
    east, north = view_components(track, 34.43, -82.89, 705e3)
    assert vaa == pytest.approx(float(np.degrees(np.arctan2(east, north))), abs=1.0)
