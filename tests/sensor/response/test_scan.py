"""Scan geometry, sweeps and rotated footprints compared with published sizes, ray tracing and dense sums."""

import numpy as np
import pytest

from fifesim.base.footprints import Boxcar, axis_operator
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.response.scan import (
    EARTH_RADIUS,
    Footprints,
    ScanPattern,
    Track,
    apply_operator,
    footprint_operator,
    ground_of_detector,
    growth,
    place_beside,
    place_of,
    swath_width,
    view_components,
    view_from_ground,
    view_from_scan,
)
from fifesim.sensor.response.spatial import AggregatedSpread, CosineSpread, GaussianSpread

# ------------------------------------------------------------------------------------------ track


TRACK = Track(39.0, -97.0, 193.0)


@pytest.mark.parametrize(
    ("scan_angle", "vza", "along", "across"),
    [(0.0, 0.0, 1.17, 1.17), (20.0, 22.8, 1.25, 1.36), (40.0, 46.6, 1.60, 2.33), (55.4, 68.6, 2.47, 6.74)],
)
def test_avhrr_pixel_growth_agrees_with_published_values(scan_angle, vza, along, across):
    """1.4 mrad from 833 km, to the last digit. [km]"""
    assert float(view_from_scan(scan_angle, 833e3)[0]) == pytest.approx(vza, abs=0.05)
    found = [0.0014 * 833 * float(each) for each in growth(scan_angle, 833e3)]
    assert found == pytest.approx([along, across], abs=0.006)


def unit(latitude, longitude):
    phi, lam = np.radians(latitude), np.radians(longitude)
    return np.array([np.cos(phi) * np.cos(lam), np.cos(phi) * np.sin(lam), np.sin(phi)])


@pytest.mark.parametrize("place", [(39.2, -96.5), (38.0, -99.5), (41.0, -88.0), (30.0, -97.3)])
@pytest.mark.parametrize("altitude", [705e3, 833e3])
def test_view_directions_agree_with_vector_geometry(place, altitude):
    """The satellite is abeam at the point of its orbit nearest to the place, found by a search along the track."""
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
    # The search is accurate to 5 m.
    np.testing.assert_allclose(view_components(TRACK, *place, altitude), components, rtol=0, atol=1e-5)
    _, aside = place_beside(TRACK, *place)
    found_vza, found_scan = view_from_ground(abs(aside), altitude)
    assert float(found_vza) == pytest.approx(vza, abs=1e-4)
    assert float(found_scan) == pytest.approx(scan_angle, abs=1e-4)
    along, across = growth(found_scan, altitude)
    assert float(along) == pytest.approx(distance / altitude, rel=1e-5)
    assert float(across) == pytest.approx(distance / altitude / np.cos(np.radians(vza)), rel=1e-5)


def test_view_beyond_the_horizon_is_missing():
    assert np.isnan(view_from_scan(70.0, 833e3)[0])
    assert np.isnan(view_from_ground(30.0, 833e3)).all()
    horizon = np.degrees(np.arcsin(EARTH_RADIUS / (EARTH_RADIUS + 705e3)))
    assert np.isnan(swath_width(705e3, horizon + 0.01)) and np.isfinite(swath_width(705e3, horizon - 0.01))


def test_ground_track_heading_includes_earth_rotation():
    """At the equator, ground velocity is the velocity of the subsatellite point minus 465 m/s eastward."""
    altitude, inclination = 705e3, 98.2
    speed = EARTH_RADIUS * np.sqrt(3.986004418e14 / (EARTH_RADIUS + altitude) ** 3)
    east = speed * np.cos(np.radians(inclination)) - 2 * np.pi * EARTH_RADIUS / 86164.1
    north = speed * np.sin(np.radians(inclination))
    track = Track.from_inclination(0.0, 10.0, inclination, altitude, ascending=True)
    assert track.heading == pytest.approx(np.degrees(np.arctan2(east, north)) % 360, abs=1e-3)
    down = Track.from_inclination(0.0, 10.0, inclination, altitude)
    assert (down.heading + track.heading) % 360 == pytest.approx(180.0)


def test_invalid_tracks_raise():
    for call, said in (
        (lambda: Track(90.0, 0.0, 0.0), "latitude"),
        (lambda: Track(0.0, np.nan, 0.0), r"longitude must be in \[-180, 360\] degrees, got nan"),
        (lambda: Track(0.0, 0.0, np.nan), "heading must be finite"),
        (lambda: Track.from_inclination(-96.0, 39.0, 98.2, 705e3), "latitude must be in .*got -96.*swap"),
        (lambda: Track.from_inclination(85.0, 0.0, 98.2, 705e3), "does not reach latitude 85"),
    ):
        with pytest.raises(ValueError, match=said):
            call()


# ------------------------------------------------------------------------------------------ sweeps


def pattern_of(name, band):
    item = instrument(name)
    (found,) = item.select([band])
    return item.scan_pattern(found), item.altitude


def pixel_size(name, band, scan_angle):
    """Pixel size along track (between the two middle lines) and across track (between sample edges). [m]"""
    pattern, altitude = pattern_of(name, band)
    sample = np.floor(pattern.position(scan_angle))
    edges = pattern.scan_angle(np.array([sample, sample + 1]))
    across = np.diff(np.radians(view_from_scan(edges, altitude)[1])) * EARTH_RADIUS
    lines = pattern.track_angle()[pattern.lines // 2 - 1 :][:2]
    ahead, aside = ground_of_detector(lines, edges.mean(), altitude)
    return float(np.diff(ahead)[0] * np.cos(np.radians(aside[0]))), float(across[0])


def modis_by_ichoku_and_kaufman(scan_angle, size=1000.0):
    """Pixel size along and across track, IEEE TGRS 43 (2005), doi:10.1109/TGRS.2005.857328. [m]"""
    radius, orbit, step = 6378.137e3, 6378.137e3 + 705e3, size / 705e3
    theta, ratio = np.radians(scan_angle), 6378.137 / (6378.137 + 705)
    root = np.sqrt(ratio**2 - np.sin(theta) ** 2)
    return step * orbit * (np.cos(theta) - root), step * radius * (np.cos(theta) / root - 1)


MODIS = [
    ("MODIS", band, scan_angle, modis_by_ichoku_and_kaufman(scan_angle, size), 0.01)
    for band, size in (("MODIS1", 250.0), ("MODIS3", 500.0))
    for scan_angle in (0.01, 30.0, -30.0, 54.9)
]
# Horizontal sampling intervals of Table 2.2-1, VIIRS geolocation ATBD (2014).
VIIRS = [
    ("VIIRS", "I1", 0.01, (371, 388), 0.02),
    ("VIIRS", "I1", 56.06, (800, 789), 0.02),
    ("VIIRS", "M5", 0.01, (742, 776), 0.02),
    ("VIIRS", "M5", -56.06, (1600, 1580), 0.02),
]


@pytest.mark.parametrize(("name", "band", "scan_angle", "published", "rtol"), MODIS + VIIRS)
def test_pixel_sizes_agree_with_published_values(name, band, scan_angle, published, rtol):
    np.testing.assert_allclose(pixel_size(name, band, scan_angle), published, rtol=rtol)


def test_detector_positions_agree_with_ray_tracing():
    """Intersection of a ray from the orbit with the sphere, by bisection in the frame of the track."""
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


@pytest.mark.parametrize("band", ["I1", "M5"])
def test_sample_positions_and_scan_angles_are_inverse(band):
    """Zones from the SDR User's Guide 1.2: 31.72, 44.86 and 56.28 degrees; samples from viirs_pxcvt.c of OCSSW."""
    pattern, _ = pattern_of("VIIRS", band)
    half = {"I1": (1184, 1920, 3200), "M5": (592, 960, 1600)}[band]
    np.testing.assert_allclose(pattern.scan_angle(np.array(half)), (31.72, 44.86, 56.28), rtol=0, atol=0.015)
    position = np.array([-half[2], -half[0] - 7.5, -0.5, 0.0, 0.5, half[0] + 7.5, half[1] + 3.5])
    np.testing.assert_allclose(pattern.position(pattern.scan_angle(position)), position, rtol=1e-14, atol=0)
    assert float(pattern.position(60.0)) == half[2]
    ends = np.array([-half[1] - 1, -half[1], -half[0] - 1, -half[0], 0, half[0] - 1, half[0], half[1]])
    assert pattern.zone_of(ends).tolist() == [2, 1, 1, 0, 0, 0, 1, 2]


@pytest.mark.parametrize(
    ("band", "lines", "samples", "zones"),
    [
        ("I1", 32, 6400, [((0, 1, 30, 31), 2016, 4384), ((2, 3, 28, 29), 1280, 5120)]),
        ("M5", 16, 3200, [((0, 15), 1008, 2192), ((1, 14), 640, 2560)]),
    ],
)
def test_deleted_pixels_agree_with_granules(band, lines, samples, zones):
    """Rows of a scan and their remaining columns in granules (CoastWatch, VIIRSBowtieFilter)."""
    expected = np.zeros((lines, samples), bool)
    for rows, first, last in zones:
        expected[list(rows), :first] = expected[list(rows), last:] = True
    pattern, _ = pattern_of("VIIRS", band)
    line, sample = np.arange(-3 * lines, -2 * lines)[:, None], np.arange(samples) - samples // 2
    np.testing.assert_array_equal(pattern.is_deleted(line, sample), expected)


def test_pushbroom_and_single_detector_sweep_one_line():
    for name in ("OLI", "MSI", "AVHRR"):
        item = instrument(name)
        pattern = item.scan_pattern(item.bands[0])
        assert pattern.lines == 1 and pattern.track_angle() == [0.0] and not pattern.zones
    assert not ScanPattern(1e-3, 1e-3).is_deleted(np.arange(3)[:, None], np.arange(2)).any()


def test_variance_of_aggregated_samples():
    """The variance is the variance of one sample plus the variance of the positions, (n^2 - 1) d^2 / 12."""
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


@pytest.mark.parametrize(("name", "sample"), [("I1", 0.35), ("M5", 0.25)])
def test_viirs_mtf_is_sample_mtf_times_aggregation(name, sample):
    """At 0.5 cycles per n samples, a sample passes m^(1 / n^2) and the sum of samples 1 / (n sin(pi / 2 n))."""
    item = instrument("VIIRS")
    (band,) = item.select(name)
    step = item.ground_intervals(band).across / 3
    for count in (1, 2, 3):
        expected = sample ** (1 / count**2) / (count * np.sin(np.pi / (2 * count)))
        found = float(item.line_spreads(band, count).across.mtf(0.5 / (count * step)))
        assert found == pytest.approx(expected, rel=1e-6)
    spread = item.line_spreads(band)
    assert spread == item.line_spreads(band, 3) != item.line_spreads(band, 2), "three samples at nadir"
    assert float(spread.along.mtf(0.5 / item.ground_intervals(band).along)) == pytest.approx(0.42, rel=1e-9)


# ------------------------------------------------------------------------------------------ rotated footprints


N = 60
CELL = 10 / 3


def turned(angle, cell=CELL, growth=(1.0, 1.0)):
    """Steps of a row and a column in a rotated frame, divided by the growth."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    return cell * np.array([[c, s], [-s, c]]) / np.array(growth)[:, None]


def weights(angle, along, across, row=30.3, column=28.7, growth=(1.0, 1.0), cell=CELL):
    pixel = Footprints(np.array([row]), np.array([column]), turned(angle, cell, growth)[None], along, across)
    operator = footprint_operator(pixel, slice(0, N), slice(0, N))
    return operator.toarray().reshape(N, N)


@pytest.mark.parametrize("quarter", [0, 90, 180])
def test_footprint_aligned_with_the_grid_is_separable(quarter):
    """1e-6: steps of the tables, 1/4096 of the support."""
    along, across = CosineSpread(30.32), GaussianSpread(24.0)
    order = (along, across) if quarter % 180 == 0 else (across, along)
    rows, columns = (
        axis_operator(
            spread, cell_origin=0.0, cell_size=CELL, n_cells=N, pixel_origin=center * CELL - 15, pixel_size=30.0,
            n_pixels=1,
        )
        for spread, center in zip(order, (30.3, 28.7), strict=True)
    )  # fmt: skip
    lines = np.zeros((2, N))
    for line, axis in zip(lines, (rows, columns), strict=True):
        line[axis.start[0] : axis.start[0] + axis.count[0]] = axis.weights[0, : axis.count[0]]
    expected = np.outer(*lines)
    found = weights(quarter, along, across)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6)


@pytest.mark.parametrize("angle", [13.6, 45.0, -72.0])
@pytest.mark.parametrize(
    ("along", "across", "growth"),
    [(Boxcar(30.0), CosineSpread(30.32), (1.0, 1.0)), (CosineSpread(30.32), GaussianSpread(20.0), (1.25, 1.36))],
)
def test_rotated_footprint_agrees_with_dense_sums(angle, along, across, growth):
    """24 x 24 points per cell, with densities from differences of the cumulative response."""
    fine = 24
    places = (np.arange(N * fine) + 0.5) / fine
    down, right = np.meshgrid(places - 30.3, places - 28.7, indexing="ij")
    frame = turned(angle, growth=growth)
    step = 0.01
    dense = np.ones_like(down)
    for spread, (by_row, by_column) in zip((along, across), frame, strict=True):
        x = by_row * down + by_column * right
        dense *= spread.cumulative(x + step / 2) - spread.cumulative(x - step / 2)
    expected = dense.reshape(N, fine, N, fine).sum(axis=(1, 3)) / dense.sum()
    found = weights(angle, along, across, growth=growth)
    # Sub-cells at a jump of the response are aligned with the grid instead of rotated.
    np.testing.assert_allclose(found, expected, rtol=0, atol=0.04 * expected.max())
    assert np.abs(found - expected).sum() < 0.015


def test_means_are_over_valid_cells():
    frames = np.stack([turned(14.0)] * 2)
    pixels = Footprints(np.array([30.3, 2.0]), np.full(2, 28.7), frames, CosineSpread(30.32), Boxcar(30.0))
    operator = footprint_operator(pixels, slice(0, N), slice(0, N))
    share = operator.sum(axis=1)
    assert share[0] == pytest.approx(1.0, rel=1e-12) and 0.5 < share[1] < 0.98
    constant = np.full((2, N * N), 0.3)
    constant[1, 30 * N + 28] = np.nan
    means = apply_operator(operator, constant, 0.9)
    assert means[:, 0] == pytest.approx(0.3, rel=1e-14)
    assert np.isnan(means[:, 1]).all()
    assert np.isfinite(apply_operator(operator, constant, 0.5)).all()
    scene = np.random.default_rng(1).random((1, N * N))
    weight = operator.toarray()[0]
    assert apply_operator(operator, scene, 0.9)[0, 0] == pytest.approx(weight @ scene[0], rel=1e-12)


def test_window_contains_the_footprint():
    pixels = Footprints(np.array([30.3]), np.array([28.7]), turned(33.0)[None], CosineSpread(30.32), Boxcar(30.0))
    rows, columns = pixels.window((N, N))
    whole = footprint_operator(pixels, slice(0, N), slice(0, N)).toarray().reshape(N, N)
    part = footprint_operator(pixels, rows, columns).toarray().reshape(rows.stop - rows.start, -1)
    np.testing.assert_array_equal(part, whole[rows, columns])
    assert part.sum() == pytest.approx(1.0, rel=1e-12)
