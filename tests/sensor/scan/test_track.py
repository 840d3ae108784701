"""Scan geometry against vectors in space, published pixel sizes and symmetry."""

import numpy as np
import pytest

from fifesim.sensor.response.scan import (
    EARTH_RADIUS,
    Track,
    growth,
    place_beside,
    place_of,
    swath_width,
    view_components,
    view_from_ground,
    view_from_scan,
)

TRACK = Track(39.0, -97.0, 193.0)


@pytest.mark.parametrize(
    ("scan_angle", "vza", "along", "across"),
    [(0.0, 0.0, 1.17, 1.17), (20.0, 22.8, 1.25, 1.36), (40.0, 46.6, 1.60, 2.33), (55.4, 68.6, 2.47, 6.74)],
)
def test_avhrr_pixels_grow_as_they_are_known_to(scan_angle, vza, along, across):
    """1.4 mrad from 833 km, to the last digit [km]."""
    assert float(view_from_scan(scan_angle, 833e3)[0]) == pytest.approx(vza, abs=0.05)
    assert [0.0014 * 833 * float(each) for each in growth(scan_angle, 833e3)] == pytest.approx(
        [along, across], abs=0.006
    )


def unit(latitude, longitude):
    phi, lam = np.radians(latitude), np.radians(longitude)
    return np.array([np.cos(phi) * np.cos(lam), np.cos(phi) * np.sin(lam), np.sin(phi)])


@pytest.mark.parametrize("place", [(39.2, -96.5), (38.0, -99.5), (41.0, -88.0), (30.0, -97.3)])
@pytest.mark.parametrize("altitude", [705e3, 833e3])
def test_directions_agree_with_vectors_in_space(place, altitude):
    """The satellite abeam is the place on its orbit nearest to the point: found by search along the track."""
    steps = np.linspace(-2.5e6, 2.5e6, 500_001)
    below = np.stack(unit(*place_of(TRACK, steps, 0.0)), axis=-1)
    point = unit(*place)
    satellite = (EARTH_RADIUS + altitude) * below[np.argmax(below @ point)]
    sight = satellite - EARTH_RADIUS * point
    distance = np.linalg.norm(sight)
    vza = np.degrees(np.arccos(sight @ point / distance))
    nadir = -satellite / np.linalg.norm(satellite)
    scan_angle = np.degrees(np.arccos(-sight @ nadir / distance))
    east = np.cross([0, 0, 1.0], point)
    east /= np.linalg.norm(east)
    components = [sight @ east / distance, sight @ np.cross(point, east) / distance]
    # The search stands within 5 m of the nearest place.
    np.testing.assert_allclose(view_components(TRACK, *place, altitude), components, rtol=0, atol=1e-5)
    _, aside = place_beside(TRACK, *place)
    found_vza, found_scan = view_from_ground(abs(aside), altitude)
    assert float(found_vza) == pytest.approx(vza, abs=1e-4)
    assert float(found_scan) == pytest.approx(scan_angle, abs=1e-4)
    along, across = growth(found_scan, altitude)
    assert float(along) == pytest.approx(distance / altitude, rel=1e-5)
    assert float(across) == pytest.approx(distance / altitude / np.cos(np.radians(vza)), rel=1e-5)


def test_growth_is_how_the_ground_turns_with_the_scan():
    """Across the track: the derivative of the way over the ground by the scan angle, over the altitude."""
    theta, step = np.array([0.0, 10.0, 30.0, 55.0]), 1e-3
    ground = np.radians(view_from_scan(theta + step, 833e3)[1] - view_from_scan(theta - step, 833e3)[1])
    expected = EARTH_RADIUS * ground / np.radians(2 * step) / 833e3
    np.testing.assert_allclose(growth(theta, 833e3)[1], expected, rtol=1e-6)


def test_left_and_right_of_a_meridian_are_mirrored():
    track = Track(0.0, 0.0, 0.0)
    east, north = view_components(track, np.array([10.0, 10.0]), np.array([-4.0, 4.0]), 705e3)
    assert east[0] == pytest.approx(-east[1], rel=1e-12) and east[0] > 0
    assert north[0] == pytest.approx(north[1], rel=1e-12)
    distance, aside = place_beside(track, 10.0, np.array([-4.0, 4.0]))
    assert aside[1] > 0 and aside[0] == pytest.approx(-aside[1]) and distance[0] == pytest.approx(distance[1])


def test_places_come_back():
    distance, aside = np.array([-3e5, 0.0, 4e5]), np.array([-8.0, 0.0, 5.0])
    back = place_beside(TRACK, *place_of(TRACK, distance, aside))
    np.testing.assert_allclose(back[0], distance, rtol=0, atol=1e-6)
    np.testing.assert_allclose(back[1], aside, rtol=0, atol=1e-12)


def test_what_lies_beyond_the_horizon_is_missing():
    assert np.isnan(view_from_scan(70.0, 833e3)[0])
    assert np.isnan(view_from_ground(30.0, 833e3)).all()


def test_a_polar_orbit_over_a_turning_earth_drifts_westward():
    """Equator: ground velocity is that in space, less 465 m/s eastward at the speed of the subsatellite point."""
    altitude, inclination = 705e3, 98.2
    speed = EARTH_RADIUS * np.sqrt(3.986004418e14 / (EARTH_RADIUS + altitude) ** 3)
    east = speed * np.cos(np.radians(inclination)) - 2 * np.pi * EARTH_RADIUS / 86164.1
    north = speed * np.sin(np.radians(inclination))
    track = Track.from_inclination(0.0, 10.0, inclination, altitude, ascending=True)
    assert track.heading == pytest.approx(np.degrees(np.arctan2(east, north)) % 360, abs=1e-3)
    down = Track.from_inclination(0.0, 10.0, inclination, altitude)
    assert (down.heading + track.heading) % 360 == pytest.approx(180.0)


def test_tracks_that_cannot_be_are_refused():
    with pytest.raises(ValueError, match="latitude"):
        Track(90.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="finite"):
        Track(0.0, np.nan, 0.0)
    with pytest.raises(ValueError, match="does not reach latitude 85"):
        Track.from_inclination(85.0, 0.0, 98.2, 705e3)


@pytest.mark.parametrize("angle", [0.5, 7.5, 30.0, 55.4])
def test_swath_is_an_arc_whose_chord_closes_the_triangle(angle):
    """Law of sines in the triangle of satellite, ground and earth's centre."""
    half = swath_width(833e3, angle) / 2 / EARTH_RADIUS
    vza = np.radians(angle) + half
    assert (EARTH_RADIUS + 833e3) * np.sin(np.radians(angle)) == pytest.approx(EARTH_RADIUS * np.sin(vza), rel=1e-12)
    assert half > 0


def test_scan_beyond_the_horizon_has_no_width():
    horizon = np.degrees(np.arcsin(EARTH_RADIUS / (EARTH_RADIUS + 705e3)))
    assert np.isnan(swath_width(705e3, horizon + 0.01)) and np.isfinite(swath_width(705e3, horizon - 0.01))
