"""Sweeps of MODIS and VIIRS: published sizes of pixels, lines that overlap, and lines that are deleted on board."""

import numpy as np
import pytest

from fifesim.base.line_spread import Boxcar
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.response.scan import (
    EARTH_RADIUS,
    ScanPattern,
    Track,
    ground_of_detector,
    place_of,
    view_from_scan,
)
from fifesim.sensor.response.spatial import AggregatedSpread, GaussianSpread


def pattern_of(name, band):
    item = instrument(name)
    (found,) = item.select([band])
    return item.scan_pattern(found), item.altitude


def pixel_size(name, band, scan_angle):
    """Along and across the track, between the edges of the sample and between two lines in the middle. [m]"""
    pattern, altitude = pattern_of(name, band)
    sample = np.floor(pattern.position(scan_angle))
    edges = pattern.scan_angle(np.array([sample, sample + 1]))
    across = np.diff(np.radians(view_from_scan(edges, altitude)[1])) * EARTH_RADIUS
    lines = pattern.track_angle()[pattern.lines // 2 - 1 :][:2]
    ahead, aside = ground_of_detector(lines, edges.mean(), altitude)
    return float(np.diff(ahead)[0] * np.cos(np.radians(aside[0]))), float(across[0])


def modis_by_ichoku_and_kaufman(scan_angle, size=1000.0):
    """Size of a pixel along and across the track, IEEE TGRS 43 (2005), doi:10.1109/TGRS.2005.857328. [m]"""
    radius, orbit, step = 6378.137e3, 6378.137e3 + 705e3, size / 705e3
    theta, ratio = np.radians(scan_angle), 6378.137 / (6378.137 + 705)
    root = np.sqrt(ratio**2 - np.sin(theta) ** 2)
    return step * orbit * (np.cos(theta) - root), step * radius * (np.cos(theta) / root - 1)


@pytest.mark.parametrize(("band", "size"), [("MODIS1", 250.0), ("MODIS3", 500.0)])
@pytest.mark.parametrize("scan_angle", [0.01, 30.0, -30.0, 54.9])
def test_pixels_of_modis_are_as_published(band, size, scan_angle):
    np.testing.assert_allclose(
        pixel_size("MODIS", band, scan_angle), modis_by_ichoku_and_kaufman(scan_angle, size), rtol=0.01
    )


def test_a_pixel_of_modis_at_the_edge_is_two_by_nearly_five_kilometres():
    """NASA: 2.01 x 4.83 km; ten lines of 1 km are 20 km high there."""
    along, across = pixel_size("MODIS", "MODIS1", 54.99)
    assert (4 * along, 4 * across) == pytest.approx((2010, 4830), rel=0.01)
    pattern, altitude = pattern_of("MODIS", "MODIS1")
    edges = ground_of_detector(np.degrees(20 * pattern.track_interval) * np.array([-1, 1]), 55.0, altitude)
    assert float(np.diff(edges[0])[0] * np.cos(np.radians(edges[1][0]))) == pytest.approx(20.06e3, rel=0.01)


@pytest.mark.parametrize(
    ("band", "scan_angle", "published"),
    [
        ("I1", 0.01, (371, 388)),
        ("I1", 56.06, (800, 789)),
        ("M5", 0.01, (742, 776)),
        ("M5", -56.06, (1600, 1580)),
    ],
)
def test_pixels_of_viirs_are_as_published(band, scan_angle, published):
    """Horizontal sampling intervals in Table 2.2-1 of the VIIRS geolocation ATBD (2014)."""
    np.testing.assert_allclose(pixel_size("VIIRS", band, scan_angle), published, rtol=0.02)


@pytest.mark.parametrize(
    ("scan_angle", "area"),
    [(0.01, 0.1384), (30.0, 0.2341), (31.5, 0.2483), (31.8, 0.1676), (44.6, 0.3443), (44.9, 0.1759), (55.0, 0.5230)],
)
def test_areas_of_viirs_follow_its_zones(scan_angle, area):
    """
    Areas of I pixels by W. Schroeder (NOAA), in km2, within 3 % of a side.

    A fit of degree 5 in NASA's fire emission code is evaluated at the samples that have these angles by design, with
    0.1552 mrad between two elementary samples.
    """
    along, across = pixel_size("VIIRS", "I1", scan_angle)
    assert np.sqrt(along * across * 1e-6) == pytest.approx(np.sqrt(area), rel=0.03)


def test_a_sweep_of_viirs_grows_as_published():
    """ATBD: from 11.87 km at nadir to 25.60 km at 56.063 degrees."""
    pattern, altitude = pattern_of("VIIRS", "M5")
    half = np.degrees(8 * pattern.track_interval)
    for scan_angle, height in ((0.0, 11.87e3), (56.063, 25.60e3)):
        ahead, aside = ground_of_detector(half, scan_angle, altitude)
        assert 2 * float(ahead * np.cos(np.radians(aside))) == pytest.approx(height, rel=0.01)


def test_places_of_detectors_agree_with_rays_in_space():
    """The point where a ray from the orbit meets the sphere, by bisection, in the frame of a turned track."""
    track, altitude, distance = Track(39.0, -97.0, 193.0), 824e3, 4e5
    point, along, right = track.axes()
    turn = distance / EARTH_RADIUS
    up, forward = np.cos(turn) * point + np.sin(turn) * along, np.cos(turn) * along - np.sin(turn) * point
    for beta, theta in ((0.4, 0.0), (0.4, 30.0), (-0.4, 56.0), (3.0, -50.0)):
        b, t = np.radians([beta, theta])
        ray = np.cos(b) * (np.sin(t) * right - np.cos(t) * up) + np.sin(b) * forward
        start = (EARTH_RADIUS + altitude) * up
        low, high = 0.0, -start @ ray
        for _ in range(60):
            middle = (low + high) / 2
            outside = np.linalg.norm(start + middle * ray) > EARTH_RADIUS
            low, high = (middle, high) if outside else (low, middle)
        x, y, z = (start + low * ray) / EARTH_RADIUS
        ahead, aside = ground_of_detector(beta, theta, altitude)
        found = place_of(track, distance + ahead, aside)
        expected = np.degrees(np.arcsin(z)), np.degrees(np.arctan2(y, x))
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)


def test_a_line_of_sight_beside_the_earth_has_no_place():
    assert np.isnan(ground_of_detector(0.1, 70.0, 833e3)).all()


@pytest.mark.parametrize("band", ["I1", "M5"])
def test_samples_and_angles_of_zones_are_inverse(band):
    """Zones of the SDR User's Guide 1.2: 31.72, 44.86 and 56.28 degrees; samples of OCSSW's viirs_pxcvt.c."""
    pattern, _ = pattern_of("VIIRS", band)
    half = {"I1": (1184, 1920, 3200), "M5": (592, 960, 1600)}[band]
    np.testing.assert_allclose(pattern.scan_angle(np.array(half)), (31.72, 44.86, 56.28), rtol=0, atol=0.015)
    position = np.array([-half[2], -half[0] - 7.5, -0.5, 0.0, 0.5, half[0] + 7.5, half[1] + 3.5])
    np.testing.assert_allclose(pattern.position(pattern.scan_angle(position)), position, rtol=1e-14, atol=0)
    assert float(pattern.position(60.0)) == half[2]
    found = pattern.zone_of(
        np.array([-half[1] - 1, -half[1], -half[0] - 1, -half[0], 0, half[0] - 1, half[0], half[1]])
    )
    assert found.tolist() == [2, 1, 1, 0, 0, 0, 1, 2]


@pytest.mark.parametrize(
    ("band", "lines", "samples", "zones"),
    [
        ("I1", 32, 6400, [((0, 1, 30, 31), 2016, 4384), ((2, 3, 28, 29), 1280, 5120)]),
        ("M5", 16, 3200, [((0, 15), 1008, 2192), ((1, 14), 640, 2560)]),
    ],
)
def test_lines_deleted_on_board_are_those_of_granules(band, lines, samples, zones):
    """Rows of a scan and the columns that are left in them, as granules have them (CoastWatch, VIIRSBowtieFilter)."""
    expected = np.zeros((lines, samples), bool)
    for rows, first, last in zones:
        expected[list(rows), :first] = expected[list(rows), last:] = True
    pattern, _ = pattern_of("VIIRS", band)
    line, sample = np.arange(-3 * lines, -2 * lines)[:, None], np.arange(samples) - samples // 2
    np.testing.assert_array_equal(pattern.is_deleted(line, sample), expected)


@pytest.mark.parametrize("band", ["I1", "M5"])
def test_deleted_lines_leave_no_gap_between_sweeps(band):
    """
    The last line left of a sweep reaches the first line left of the next, at every sample.

    User's Guide: sweeps overlap by more than 1 and 2 M pixels at either end where 1 and 2 lines are deleted.
    """
    item = instrument("VIIRS")
    pattern, altitude = pattern_of("VIIRS", band)
    sample = np.arange(0, sum(zone.samples for zone in pattern.zones), 5)
    ahead, _ = ground_of_detector(pattern.track_angle()[:, None], pattern.scan_angle(sample + 0.5), altitude)
    spacing = np.diff(ahead, axis=0)[pattern.lines // 2]
    advance = pattern.lines * item.ground_intervals(item.select([band])[0]).along
    overlap = (ahead[-1] - ahead[0] + spacing - advance) / spacing / 2
    deleted = pattern.is_deleted(np.arange(pattern.lines)[:, None], sample).sum(axis=0) / 2
    assert set(deleted) == {0, pattern.lines // 16, pattern.lines // 8}
    assert np.all(overlap >= deleted - 1e-6)
    assert np.all(overlap[deleted == deleted.max()] > 1.2 * deleted.max())


def test_a_pushbroom_and_a_single_detector_sweep_one_line():
    for name in ("OLI", "MSI", "AVHRR"):
        item = instrument(name)
        pattern = item.scan_pattern(item.bands[0])
        assert pattern.lines == 1 and pattern.track_angle() == [0.0] and not pattern.zones
    assert not ScanPattern(1e-3, 1e-3).is_deleted(np.arange(3)[:, None], np.arange(2)).any()


def test_sums_of_samples_add_their_variances():
    """The variance of a sum is the variance of one sample plus the variance of the places, (n^2 - 1) d^2 / 12."""
    x = np.linspace(-1500, 1500, 60_001)
    for count in (1, 2, 3):
        spread = AggregatedSpread(GaussianSpread(150.0), count, 128.0)
        density = np.gradient(spread.cumulative(x), x)
        variance = np.trapezoid(density * x**2, x)
        assert variance == pytest.approx(GaussianSpread(150.0).sigma ** 2 + (count**2 - 1) * 128.0**2 / 12, rel=1e-5)
        transfer = np.trapezoid(density * np.cos(2 * np.pi * 0.002 * x), x)
        assert float(spread.mtf(0.002)) == pytest.approx(transfer, abs=1e-5)
        ends = spread.cumulative(spread.half_width * np.array([-1, 1]))
        assert ends.tolist() == pytest.approx([0.0, 1.0], abs=1e-15)
    with pytest.raises(ValueError, match="count must be at least 1, got 0"):
        AggregatedSpread(Boxcar(10.0), 0, 10.0)


def test_a_band_of_viirs_sees_what_three_detectors_see_at_nadir():
    item = instrument("VIIRS", "detector")
    widths = [item.line_spreads(item.bands[0], count).across.half_width * 2 for count in (None, 3, 2, 1)]
    assert widths == pytest.approx([385.19, 385.19, 256.79, 128.4], rel=1e-4)
    assert item.line_spreads(item.bands[0], 1).along.half_width * 2 == pytest.approx(370.96, rel=1e-4)


@pytest.mark.parametrize(("name", "sample"), [("I1", 0.35), ("M5", 0.25)])
def test_blur_of_viirs_is_that_of_one_sample_before_aggregation(name, sample):
    """Half a cycle per sum of n samples: the sample passes m^(1 / n^2), the sum 1 / (n sin(pi / 2 n))."""
    item = instrument("VIIRS")
    (band,) = item.select(name)
    step = item.ground_intervals(band).across / 3
    for count in (1, 2, 3):
        expected = sample ** (1 / count**2) / (count * np.sin(np.pi / (2 * count)))
        found = float(item.line_spreads(band, count).across.mtf(0.5 / (count * step)))
        assert found == pytest.approx(expected, rel=1e-6)
    spread = item.line_spreads(band)
    assert float(spread.along.mtf(0.5 / item.ground_intervals(band).along)) == pytest.approx(0.42, rel=1e-9)
