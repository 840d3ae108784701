"""Directions of the sun and sensor, dates and times."""

import dataclasses
from datetime import datetime, timedelta, timezone

import numpy as np
import pandas as pd
import pytest

import fifesim
from fifesim.base.geometry import Geometry, angle_between, relative_azimuth, scattering_angle_cosine, sun_geometry
from fifesim.base.times import utc


def almanac_sun(time, latitude, longitude):
    """Solar zenith and azimuth by the low-precision formulas of the Astronomical Almanac, accurate to 0.01 degrees."""
    days = (pd.Timestamp(time).tz_convert("UTC") - pd.Timestamp("2000-01-01T12:00Z")) / pd.Timedelta(days=1)
    anomaly = np.radians(357.528 + 0.9856003 * days)
    ecliptic = np.radians(280.460 + 0.9856474 * days + 1.915 * np.sin(anomaly) + 0.020 * np.sin(2 * anomaly))
    obliquity = np.radians(23.439 - 4e-7 * days)
    right_ascension = np.arctan2(np.cos(obliquity) * np.sin(ecliptic), np.cos(ecliptic))
    declination = np.arcsin(np.sin(obliquity) * np.sin(ecliptic))
    sidereal = np.radians(280.46061837 + 360.98564736629 * days + longitude)
    hour, phi = sidereal - right_ascension, np.radians(latitude)
    up = np.sin(phi) * np.sin(declination) + np.cos(phi) * np.cos(declination) * np.cos(hour)
    east = -np.cos(declination) * np.sin(hour)
    north = np.cos(phi) * np.sin(declination) - np.sin(phi) * np.cos(declination) * np.cos(hour)
    return np.degrees(np.arccos(up)), np.degrees(np.arctan2(east, north)) % 360


@pytest.mark.parametrize(
    "time, latitude, longitude",
    [
        ("1987-06-06T16:35:00Z", 39.06, -96.54),
        ("1987-06-06T21:00:00Z", 39.06, -96.54),
        ("1989-12-21T12:00:00Z", -33.0, 18.0),
    ],
)
def test_sun_agrees_with_the_almanac(time, latitude, longitude):
    sun = sun_geometry(time, latitude, longitude)
    zenith, azimuth = almanac_sun(time, latitude, longitude)
    assert sun.sza == pytest.approx(zenith, abs=0.02)
    assert sun.saa == pytest.approx(azimuth, abs=0.03)


def test_sun_of_the_paper_case():
    """In the morning the sun is in the southeast; in June the Earth is near aphelion."""
    case = fifesim.fife_geometry()
    assert (round(case.sza, 1), round(case.saa, 1), case.vza, case.vaa) == (28.5, 117.0, 0.0, 0.0)
    assert case.earth_sun_distance == pytest.approx(1.0148, abs=5e-4)


def test_relative_azimuth_is_symmetric_and_folded():
    azimuths = np.linspace(-360, 720, 37)
    raa = relative_azimuth(azimuths[:, None], azimuths)
    np.testing.assert_allclose(raa, raa.T, rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.cos(np.radians(raa)), np.cos(np.radians(azimuths[:, None] - azimuths)), atol=1e-12)
    assert raa.min() >= 0 and raa.max() <= 180
    assert Geometry(30, 117, 20, 117).raa == 0
    assert Geometry(30, 117, 20, 297).raa == 180


def unit_vector(zenith, azimuth):
    zenith, azimuth = np.radians(zenith), np.radians(azimuth)
    return np.array([np.sin(zenith) * np.sin(azimuth), np.sin(zenith) * np.cos(azimuth), np.cos(zenith)])


def test_angle_between_directions_matches_the_unit_vectors():
    zenith, azimuth = np.random.default_rng(6).uniform(0, [[[90.0]], [[360.0]]], (2, 2, 50))
    expected = np.degrees(np.arccos(np.prod(unit_vector(zenith, azimuth), axis=1).sum(axis=0)))
    found = angle_between(zenith[0], azimuth[0], zenith[1], azimuth[1])
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
    assert angle_between(33.0, 10.0, 33.0, 370.0) < 1e-12


@pytest.mark.parametrize(
    "sza, saa, vza, vaa", [(30, 117, 20, 117), (60, 10, 45, 200), (0, 0, 70, 33), (50, 350, 50, 90)]
)
def test_scattering_angle_matches_the_unit_vectors(sza, saa, vza, vaa):
    """Light travels away from the sun and toward the sensor."""
    expected = -unit_vector(sza, saa) @ unit_vector(vza, vaa)
    assert scattering_angle_cosine(sza, vza, relative_azimuth(saa, vaa)) == pytest.approx(expected, abs=1e-12)


def test_geometry_is_frozen_and_hashable():
    with pytest.raises(dataclasses.FrozenInstanceError):
        fifesim.fife_geometry().sza = 10.0
    assert hash(Geometry(30.0, 0.0)) == hash(Geometry(30.0, 0.0))
    assert Geometry(60.0, 0.0, 0.0).mu_s == pytest.approx(0.5, abs=1e-15)
    for wrong in ({"sza": np.nan}, {"earth_sun_distance": 149.6e6}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            Geometry(**{"sza": 30.0, "saa": 0.0} | wrong)


SUMMER = pd.Timestamp("1987-06-06T16:35Z")


@pytest.mark.parametrize(
    "time",
    [
        *("1987-06-06T16:35:00", "1987-06-06 16:35", "1987-06-06T16:35:00.0Z", "19870606T1635", " 1987-06-06T16:35Z "),
        *("1987-06-06T11:35:00-05:00", "1987-06-06 11:35-05:00", datetime(1987, 6, 6, 16, 35)),
        datetime(1987, 6, 6, 11, 35, tzinfo=timezone(timedelta(hours=-5))),
    ],
)
def test_time_without_zone_is_utc_and_other_times_are_converted(time):
    assert utc(time).tolist() == [SUMMER]


def test_invalid_times_are_rejected():
    refused = {
        r"such as 1987-06-06T16:35:00Z, got.*the year first": [
            "3.6.2022 10:00", "03/06/2022 10:00", "13.6.2022 10:00", "10:00", "June 3, 2022 9:00", "1987-06",
        ],
        "add the time of day, such as 1987.*T17:10Z": ["1987-06-06", "19870606"],
        "years 1957 to 2100.*satellites": [
            "1956-12-31T23:59", "2100-01-01T00:00", "9999-12-31T23:59", "0001-01-01T12:00",
        ],
        "must be a date and time such as": [
            1987, 0.5, None, "NaT", "1987-06-06T24:00", "1987-06-06T16:35 US/Central", "now", "today", "12:00", "",
            "-1987-06-06T12:00", "1987-W23-6T12:00", "1987-02-30T12:00", " ", "June 6 1987 16:35", "-1987-06-06",
        ],
    }  # fmt: skip
    for message, times in refused.items():
        for time in times:
            with pytest.raises(ValueError, match=message):
                utc(time)
    for time in ("1957-01-01T00:00", "2099-12-31T23:59"):
        assert utc(time)[0] == pd.Timestamp(time, tz="UTC")
