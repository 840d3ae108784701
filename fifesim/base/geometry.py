"""Directions of sun and sensor."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np
import pandas as pd

from fifesim.base.arguments import Range, check_fields, check_number, is_a
from fifesim.base.caches import cached
from fifesim.base.messages import warn
from fifesim.base.times import SITE_ALTITUDE, SITE_LATITUDE, SITE_LONGITUDE, SITE_TIME, utc

ANGLES = ("sza", "saa", "vza", "vaa")

PLACE = {"latitude": Range("degree", -90, 90), "longitude": Range("degree", -180, 360)}
_AZIMUTH = Range("degree", -720, 720)
_SUN = Range("degree", 0, 90, note="the sun is below the horizon; check time, latitude and longitude", ends="[)")


@dataclass(frozen=True)
class Geometry:
    """
    Directions of sun and sensor seen from the ground.

    Azimuths point toward the sun and toward the sensor, clockwise from north. Where an angle differs from cell to cell,
    an `xarray.Dataset` of the same names takes the place of this class.

    Parameters
    ----------
    sza, saa : float
        Solar zenith and azimuth angles. [degree]
    vza, vaa : float, optional
        Sensor zenith and azimuth angles; nadir by default. [degree]
    earth_sun_distance : float, optional
        [astronomical unit]

    Raises
    ------
    ValueError
        If the sun or the sensor is not above the horizon.
    TypeError
        If an angle is no number.

    Warns
    -----
    UserWarning
        If the angles of the sun or of the sensor look like radians.

    Examples
    --------
    >>> from fifesim import Geometry
    >>> Geometry(sza=30, saa=120, vza=10, vaa=290).raa
    170.0
    """

    sza: Annotated[float, _SUN, "solar zenith angle"]
    saa: Annotated[float, _AZIMUTH, "solar azimuth angle, clockwise from north"]
    vza: Annotated[
        float, Range("degree", 0, 90, note="the sensor looks down", ends="[)"), "sensor zenith angle; 0 is nadir"
    ] = 0.0
    vaa: Annotated[float, _AZIMUTH, "azimuth toward the sensor, clockwise from north"] = 0.0
    earth_sun_distance: Annotated[
        float, Range("astronomical units", 0.9, 1.1, note="it is from 0.983 to 1.017", ends="()")
    ] = 1.0

    def __post_init__(self):
        for name in ANGLES:
            if not is_a(getattr(self, name), "Dataset") and np.ndim(getattr(self, name)):
                raise TypeError(
                    f"{name} of a Geometry is one number, got an array: angles by cell are an xarray.Dataset with sza, "
                    "saa, vza and vaa, such as fifesim.sensor.scan_geometry(...).assign(sza=30.0, saa=120.0)"
                )
        check_fields(self)
        warn_of_radians(self.sza, self.saa)
        warn_of_radians(self.vza, self.vaa, "vza", "vaa")

    @cached_property
    def raa(self) -> float:
        """Relative azimuth folded to [0, 180]; 0 has sun and sensor on the same side. [degree]"""
        return float(relative_azimuth(self.saa, self.vaa))

    @property
    def mu_s(self) -> float:
        """Cosine of the solar zenith angle [1]."""
        return np.cos(np.radians(self.sza))

    @property
    def mu_v(self) -> float:
        """Cosine of the sensor zenith angle [1]."""
        return np.cos(np.radians(self.vza))


def warn_of_radians(zenith, azimuth, *names):
    """Warn if the directions of the sun, or of the sensor by the names of its angles, look like radians."""
    if 0 < zenith <= np.pi / 2 and 0 < azimuth <= 2 * np.pi:
        one, two = names or ("sza", "saa")
        warn(
            f"{one}={zenith:g} and {two}={azimuth:g} are taken as degrees and look like radians: if they are, convert "
            f"them with numpy.degrees, which gives {one}={np.degrees(zenith):.1f} and {two}={np.degrees(azimuth):.1f}"
        )


def relative_azimuth(saa, vaa):
    """Relative azimuth of sun and sensor, folded to [0, 180]; 0 is backscatter. [degree]"""
    difference = np.abs(np.asarray(saa, float) - vaa) % 360
    return np.where(difference > 180, 360 - difference, difference)


def scattering_angle_cosine(sza, vza, raa):
    r"""
    Cosine of the angle through which a sunbeam is scattered to the sensor.

    .. math:: \cos\Theta = -\mu_s \mu_v - \sin\theta_s \sin\theta_v \cos\varphi

    Parameters
    ----------
    sza, vza, raa : array
        [degree]

    Returns
    -------
    cosine : array
        -1 is backscatter. [1]

    Examples
    --------
    >>> float(scattering_angle_cosine(0.0, 0.0, 0.0))
    -1.0
    """
    sza, vza, raa = np.radians(sza), np.radians(vza), np.radians(raa)
    return -np.cos(sza) * np.cos(vza) - np.sin(sza) * np.sin(vza) * np.cos(raa)


def check_place(latitude, longitude):
    """Raise ValueError for numbers that are no latitude and longitude."""
    for name, values in (("latitude", latitude), ("longitude", longitude)):
        for value in np.unique(np.asarray(values, float)):
            check_number(name, value, PLACE[name]._replace(note="latitude is first, then longitude; swap them?"))


def sun_geometry(time, latitude, longitude, altitude=0.0):
    """Geometry of the sun at a time (UTC by default) and place, with a nadir view, by the NREL algorithm in pvlib."""
    # The zenith is true, not refracted.
    check_place(latitude, longitude)
    return _sun(utc(time)[0], float(latitude), float(longitude), float(altitude))


# Many scenes share their sun, and to find it takes as long as all that is done to their cells.
@cached(256, "sun position")
def _sun(time, latitude, longitude, altitude):
    import pvlib

    sun = pvlib.solarposition.get_solarposition(utc(time), latitude, longitude, altitude=altitude).iloc[0]
    return Geometry(float(sun["zenith"]), float(sun["azimuth"]), earth_sun_distance=earth_sun_distance(time))


def sun_positions(times, latitude, longitude, altitude=0.0):
    """Times in UTC, solar zeniths, possibly above 90, and azimuths [degree], and distances [AU], shape (n,)."""
    import pvlib

    check_place(latitude, longitude)
    stamps = pd.DatetimeIndex([utc(time)[0] for time in times])
    numbers = [np.asarray(each, float) for each in (latitude, longitude, altitude)]
    if any(each.shape not in ((), (1,), stamps.shape) for each in numbers):
        shapes = " and ".join(str(each.shape) for each in numbers)
        raise ValueError(
            f"latitude, longitude and altitude must be numbers, or one for each of {len(stamps)} times, got {shapes}"
        )
    sza, saa = np.empty(len(stamps)), np.empty(len(stamps))
    places = np.stack([np.broadcast_to(each, stamps.shape) for each in numbers])
    kinds, which = np.unique(places, axis=1, return_inverse=True)
    for number, (north, east, height) in enumerate(kinds.T):
        here = np.ravel(which) == number
        sun = pvlib.solarposition.get_solarposition(stamps[here], north, east, altitude=height)
        sza[here], saa[here] = sun["zenith"], sun["azimuth"]
    distance = pvlib.solarposition.nrel_earthsun_distance(stamps).to_numpy()
    return stamps.tz_localize(None).to_numpy(), sza, saa, distance


def earth_sun_distance(time):
    """Earth-Sun distance at a time, by the NREL algorithm in pvlib. [AU]"""
    return _distance(time) if isinstance(time, str) else _distance(utc(time)[0])


# Many scenes ask for the distance at one time.
@cached(256, "distance of the sun")
def _distance(time):
    import pvlib

    return float(pvlib.solarposition.nrel_earthsun_distance(utc(time)).iloc[0])


@cached(128, "geometry of the FIFE site")
def fife_geometry() -> Geometry:
    """
    The sun over the FIFE site on the paper's day, 6 June 1987 (Data), at 16:35 UTC and a nadir view, which are assumed.

    Returns
    -------
    geometry : Geometry
        sza 28.5, saa 117.0, vza 0, vaa 0. [degree]

    Examples
    --------
    >>> from fifesim import fife_geometry
    >>> round(fife_geometry().sza, 1)
    28.5
    """
    return sun_geometry(SITE_TIME, SITE_LATITUDE, SITE_LONGITUDE, SITE_ALTITUDE)


def angle_between(zenith, azimuth, other_zenith, other_azimuth):
    r"""
    Angle between two directions.

    .. math:: \cos \gamma = \cos \theta \cos \theta' + \sin \theta \sin \theta' \cos(\varphi - \varphi')

    Parameters
    ----------
    zenith, azimuth, other_zenith, other_azimuth : array
        [degree]

    Returns
    -------
    angle : array, shape of the broadcast inputs
        [degree]

    Examples
    --------
    >>> [round(float(angle_between(20.0, 90.0, *other)), 9) for other in ((50.0, 90.0), (50.0, 270.0), (0.0, 17.0))]
    [30.0, 70.0, 20.0]
    """
    theta, other = np.radians(zenith), np.radians(other_zenith)
    # By half angles, which keep their digits where the two agree.
    turn = np.radians(np.subtract(azimuth, other_azimuth)) / 2
    square = np.sin((theta - other) / 2) ** 2 + np.sin(theta) * np.sin(other) * np.sin(turn) ** 2
    return np.degrees(2 * np.arcsin(np.sqrt(np.clip(square, 0, 1))))
