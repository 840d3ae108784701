"""
Geometry of a scan across the track, on a sphere.

The track is a great circle, and a ground point is seen when the instrument is abeam of it. Scan angles are positive to
the right of the flight. Geodetic latitudes are taken as those of the sphere, which costs 0.3 % of a distance.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from fifesim.base.arguments import check_fields

# Mean radius of the earth [m].
EARTH_RADIUS = 6.371e6

# Gravitational parameter of the earth [m3 s-2] and its rotation [rad s-1], WGS 84.
_GRAVITY = 3.986004418e14
_ROTATION = 7.292115e-5


@dataclass(frozen=True)
class Track:
    """
    Ground track of an instrument: a point and a direction.

    Parameters
    ----------
    latitude, longitude : float
        Of a point on the track. [degree]
    heading : float
        Direction of flight there over the ground, clockwise from north. [degree]

    Raises
    ------
    ValueError
        If the latitude is out of range, or a number is not finite.

    Examples
    --------
    >>> from fifesim import Track
    >>> Track(latitude=39.1, longitude=-96.6, heading=190.0).heading
    190.0
    """

    latitude: float
    longitude: float
    heading: float

    def __post_init__(self):
        check_fields(self)
        if not -90 < self.latitude < 90:
            raise ValueError(f"the latitude of a track must be in (-90, 90) degrees, got {self.latitude}")
        if not np.all(np.isfinite([self.longitude, self.heading])):
            raise ValueError(f"longitude and heading must be finite degrees, got {self.longitude} and {self.heading}")

    @classmethod
    def from_inclination(
        cls, latitude: float, longitude: float, inclination: float, altitude: float, *, ascending: bool = False
    ) -> Self:
        r"""
        The track of a circular orbit over the turning earth.

        .. math::

            \tan \alpha = \frac{\cos i - (\omega / n) \cos^2 \varphi}{\sqrt{\cos^2 \varphi - \cos^2 i}},
            \qquad n = \sqrt{\mu / (R + h)^3}

        for the ascending half; the descending one has :math:`\pi - \alpha`.

        Parameters
        ----------
        latitude, longitude : float
            Of a point on the track. [degree]
        inclination : float
            Of the orbit. [degree]
        altitude : float
            [m]
        ascending : bool, optional
            Whether it flies north.

        Returns
        -------
        track : Track

        Raises
        ------
        ValueError
            If the orbit does not reach the latitude.

        References
        ----------
        [Capderou2014]_, chapter 5

        Examples
        --------
        Landsat descends west of south:

        >>> round(Track.from_inclination(39.0, -96.5, 98.2, 705e3).heading, 1)
        193.6
        """
        cos_i, cos_phi = np.cos(np.radians(inclination)), np.cos(np.radians(latitude))
        if cos_phi <= abs(cos_i):
            raise ValueError(f"an orbit of inclination {inclination:g} degrees does not reach latitude {latitude:g}")
        mean_motion = np.sqrt(_GRAVITY / (EARTH_RADIUS + altitude) ** 3)
        east = cos_i - _ROTATION / mean_motion * cos_phi**2
        north = np.sqrt(cos_phi**2 - cos_i**2)
        heading = np.degrees(np.arctan2(east, north if ascending else -north))
        return cls(latitude, longitude, float(heading % 360))

    def axes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Unit vectors to the point, along the flight and to its right, each of shape (3,)."""
        point, east, north = frame(self.latitude, self.longitude)
        along = np.cos(np.radians(self.heading)) * north + np.sin(np.radians(self.heading)) * east
        return point, along, np.cross(along, point)


def view_from_scan(scan_angle, altitude):
    r"""
    What a line of sight at a scan angle meets.

    .. math:: \sin \theta_v = \frac{R + h}{R} \sin \theta, \qquad \gamma = \theta_v - \theta

    Parameters
    ----------
    scan_angle : array
        From nadir, at the instrument. [degree]
    altitude : float
        [m]

    Returns
    -------
    vza : array
        At the ground, with the sign of the scan angle; NaN where the line misses the earth. [degree]
    central_angle : array
        Between the point and the track, at the earth's centre, with the same sign. [degree]

    Examples
    --------
    >>> [round(float(value), 1) for value in view_from_scan(40.0, 833e3)]
    [46.6, 6.6]
    """
    sine = (EARTH_RADIUS + altitude) / EARTH_RADIUS * np.sin(np.radians(scan_angle))
    vza = np.degrees(np.arcsin(np.where(np.abs(sine) < 1, sine, np.nan)))
    return vza, vza - scan_angle


def view_from_ground(central_angle, altitude):
    r"""
    How a point beside the track is seen.

    .. math:: \tan \theta = \frac{R \sin \gamma}{R + h - R \cos \gamma}, \qquad \theta_v = \theta + \gamma

    Parameters
    ----------
    central_angle : array
        Between the point and the track, at the earth's centre, positive to the right. [degree]
    altitude : float
        [m]

    Returns
    -------
    vza, scan_angle : array
        With the sign of the central angle; NaN beyond the instrument's horizon. [degree]

    Examples
    --------
    >>> vza, scan_angle = view_from_ground(view_from_scan(40.0, 833e3)[1], 833e3)
    >>> round(float(scan_angle), 9)
    40.0
    """
    gamma = np.radians(central_angle)
    orbit = EARTH_RADIUS + altitude
    theta = np.arctan2(EARTH_RADIUS * np.sin(gamma), orbit - EARTH_RADIUS * np.cos(gamma))
    visible = np.cos(gamma) > EARTH_RADIUS / orbit
    scan_angle = np.where(visible, np.degrees(theta), np.nan)
    return scan_angle + central_angle, scan_angle


def growth(scan_angle, altitude):
    r"""
    How much wider a footprint is than at nadir.

    .. math:: \frac{\rho}{h}, \quad \frac{\rho}{h \cos \theta_v}, \qquad \rho = R \, \frac{\sin \gamma}{\sin \theta}

    Parameters
    ----------
    scan_angle : array
        From nadir, at the instrument. [degree]
    altitude : float
        [m]

    Returns
    -------
    along, across : array
        Along and across the track. [1]

    Examples
    --------
    >>> along, across = growth(0.0, 833e3)
    >>> float(along), float(across)
    (1.0, 1.0)
    """
    vza, _ = view_from_scan(scan_angle, altitude)
    mu_v = np.cos(np.radians(vza))
    orbit = EARTH_RADIUS + altitude
    # The difference of two legs, which stays defined at nadir.
    slant = orbit * np.cos(np.radians(scan_angle)) - EARTH_RADIUS * mu_v
    return slant / altitude, slant / altitude / mu_v


def swath_width(altitude, max_angle):
    r"""
    Width of the ground that a scan covers, along the sphere.

    .. math:: s = 2 R \gamma

    Parameters
    ----------
    altitude : float
        Altitude of the instrument. [m]
    max_angle : float
        Largest scan angle from nadir. [degree]

    Returns
    -------
    width : float
        NaN where the line of sight misses the earth. [m]

    Examples
    --------
    A narrow swath is that of a plane:

    >>> round(float(swath_width(705e3, 0.1) / (2 * 705e3 * np.tan(np.radians(0.1)))), 5)
    1.0
    """
    return float(2 * EARTH_RADIUS * np.radians(view_from_scan(max_angle, altitude)[1]))


def place_beside(track, latitude, longitude):
    """
    Where points lie in the frame of a track.

    Parameters
    ----------
    track : Track
    latitude, longitude : array
        [degree]

    Returns
    -------
    distance : array
        Along the track from its point, forward, over the ground below the instrument. [m]
    central_angle : array
        From the track, positive to the right. [degree]
    """
    point, along, right = track.axes()
    there = frame(latitude, longitude)[0]
    distance = EARTH_RADIUS * np.arctan2(there @ along, there @ point)
    return distance, np.degrees(np.arcsin(np.clip(there @ right, -1, 1)))


def place_of(track, distance, central_angle):
    """
    Points by their place in the frame of a track, the inverse of `place_beside`.

    Parameters
    ----------
    track : Track
    distance : array
        Along the track from its point, forward. [m]
    central_angle : array
        From the track, positive to the right. [degree]

    Returns
    -------
    latitude, longitude : array
        [degree]

    Examples
    --------
    >>> track = Track(39.0, -96.5, 190.0)
    >>> [round(float(value), 6) for value in place_beside(track, *place_of(track, 5e4, 3.0))]
    [50000.0, 3.0]
    """
    point, along, right = track.axes()
    turn, aside = np.asarray(distance)[..., None] / EARTH_RADIUS, np.radians(central_angle)[..., None]
    there = np.cos(aside) * (np.cos(turn) * point + np.sin(turn) * along) + np.sin(aside) * right
    x, y, z = np.moveaxis(there, -1, 0)
    return np.degrees(np.arcsin(np.clip(z, -1, 1))), np.degrees(np.arctan2(y, x))


def view_components(track, latitude, longitude, altitude):
    r"""
    Horizontal components of the unit vector from the ground to the sensor.

    They are smooth where the track is crossed, while the azimuth turns round.

    .. math:: e = \sin \theta_v \sin \varphi_v, \qquad n = \sin \theta_v \cos \varphi_v

    Parameters
    ----------
    track : Track
    latitude, longitude : array
        [degree]
    altitude : float
        Of the sensor. [m]

    Returns
    -------
    east, north : array
        NaN beyond the instrument's horizon. [1]

    Examples
    --------
    East of a track that runs south, the sensor stands in the west:

    >>> east, north = view_components(Track(39.0, -97.0, 180.0), 39.0, -96.0, 705e3)
    >>> bool(east < 0), bool(abs(north) < 0.01)
    (True, True)
    """
    _, _, right = track.axes()
    there, to_east, to_north = frame(latitude, longitude)
    sine = there @ right
    vza, _ = view_from_ground(np.degrees(np.arcsin(np.clip(sine, -1, 1))), altitude)
    # Of unit length on the ground: `right` without its part along the vertical.
    length = np.sin(np.radians(vza)) / np.sqrt(1 - sine**2)
    return -length * (to_east @ right), -length * (to_north @ right)


def frame(latitude, longitude):
    """
    Unit vectors at points of the sphere.

    Parameters
    ----------
    latitude, longitude : array, shape (...)
        [degree]

    Returns
    -------
    up, east, north : array, shape (..., 3)
    """
    phi, lam = np.radians(latitude), np.radians(longitude)
    phi, lam = np.broadcast_arrays(phi, lam)
    up = np.stack([np.cos(phi) * np.cos(lam), np.cos(phi) * np.sin(lam), np.sin(phi)], axis=-1)
    east = np.stack([-np.sin(lam), np.cos(lam), np.zeros_like(lam)], axis=-1)
    return up, east, np.cross(up, east)
