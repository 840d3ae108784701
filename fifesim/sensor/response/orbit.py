"""Passes of a sun-synchronous satellite in a circular orbit over a place."""

from typing import NamedTuple

import numpy as np

from fifesim.sensor.response.scan import EARTH_RADIUS

DAY = 86400.0  # [s]


class Orbit(NamedTuple):
    """Nominal circular orbit whose plane follows the mean sun."""

    per_day: float  # revolutions [1]
    crossing: float  # mean local solar time of the stated node [h]
    ascending: bool  # whether this node is the ascending one
    inclination: float  # [degree]
    altitude: float  # [m]


def ground_track(orbit, seconds):
    r"""
    Place below a satellite at times since a passage of its ascending node over the prime meridian.

    .. math::

        \sin \varphi = \sin i \sin u, \qquad
        \lambda = \mathrm{atan2}(\cos i \sin u, \cos u) - 360° \, t / 1\,\mathrm{d}

    Parameters
    ----------
    orbit : Orbit
    seconds : array
        :math:`t`, with the argument of latitude :math:`u = 360° \, n t`. [s]

    Returns
    -------
    latitude, longitude : array, shape of seconds
        On a sphere. [degree]

    Notes
    -----
    Seen from the plane of a sun-synchronous orbit, the Earth turns once in a mean solar day.

    References
    ----------
    [Capderou2014]_, chapter 5
    """
    argument, inclination = 2 * np.pi * orbit.per_day * np.asarray(seconds, float) / DAY, np.radians(orbit.inclination)
    latitude = np.arcsin(np.sin(inclination) * np.sin(argument))
    turned = np.arctan2(np.cos(inclination) * np.sin(argument), np.cos(argument))
    longitude = np.degrees(turned) - 360 * np.asarray(seconds, float) / DAY
    return np.degrees(latitude), (longitude + 180) % 360 - 180


def passes(orbit, first, last, latitude, longitude, max_angle):
    """
    Closest approaches of a satellite to a place, within the swath.

    Parameters
    ----------
    orbit : Orbit
    first, last : float
        Time span, since a midnight in UTC at which a revolution begins. [s]
    latitude, longitude : float
        Place. [degree]
    max_angle : float
        Largest scan angle. [degree]

    Returns
    -------
    seconds, vza, vaa : array, shape (passes,)
        Times since this midnight [s], and view zenith and azimuth toward the satellite, clockwise from north [degree].
    ascending : array of bool, shape (passes,)

    Notes
    -----
    At the midnight the satellite is at its ascending node, at the longitude of the node's mean solar time.

    References
    ----------
    [Capderou2014]_, chapter 5
    """
    node = (orbit.crossing + (0 if orbit.ascending else 12)) * 15  # solar time of the ascending node [degree]
    samples = np.arange(first - 20.0, last + 40.0, 20.0)
    near = _closeness(orbit, node, samples, latitude, longitude)
    peak = np.flatnonzero((near[1:-1] >= near[:-2]) & (near[1:-1] > near[2:])) + 1
    # The cosine of the distance is a parabola at its maximum.
    left, middle, right = near[peak - 1], near[peak], near[peak + 1]
    seconds = samples[peak] + 20 * 0.5 * (left - right) / (left - 2 * middle + right)
    below = _below(orbit, node, seconds)
    toward = np.radians(np.array([latitude, longitude]))
    angle = np.arccos(np.clip(_closeness(orbit, node, seconds, latitude, longitude), -1, 1))
    scan = np.arctan2(EARTH_RADIUS * np.sin(angle), EARTH_RADIUS * (1 - np.cos(angle)) + orbit.altitude)
    lat, lon = np.radians(below)
    east = np.sin(lon - toward[1]) * np.cos(lat)
    north = np.cos(toward[0]) * np.sin(lat) - np.sin(toward[0]) * np.cos(lat) * np.cos(lon - toward[1])
    visible = (scan <= np.radians(max_angle)) & (angle < np.pi / 2) & (seconds >= first) & (seconds <= last)
    rising = np.cos(2 * np.pi * orbit.per_day * seconds / DAY) > 0
    found = seconds, np.degrees(scan + angle), np.degrees(np.arctan2(east, north)) % 360, rising
    return tuple(each[visible] for each in found)


def _below(orbit, node, seconds):
    """Latitude and longitude below the satellite, whose plane has the node at a solar time [degree]."""
    latitude, longitude = ground_track(orbit, seconds)
    return latitude, longitude + node


def _closeness(orbit, node, seconds, latitude, longitude):
    """Cosine of the distance of a place from the point below the satellite. [1]"""
    lat, lon = np.radians(_below(orbit, node, seconds))
    place = np.radians([latitude, longitude])
    return np.sin(place[0]) * np.sin(lat) + np.cos(place[0]) * np.cos(lat) * np.cos(lon - place[1])
