"""Checks of scans: triangles in space, geodesics on the sphere, and the moments of turned footprints."""

from functools import partial

import numpy as np
import pyproj
import xarray as xr

from fifesim.base.footprints import Boxcar, axis_operator
from fifesim.base.geometry import fife_geometry
from fifesim.grids import grid as grids
from fifesim.sensor.response import scan
from fifesim.sensor.response.scan import Footprints, apply_operator, footprint_operator
from fifesim.sensor.response.spatial import AggregatedSpread, CosineSpread, GaussianSpread
from fifesim.sensor.scan_labels import scan_geometry, sense_swath
from verification.deviations import Deviation, largest

_deviation = partial(Deviation, "sensor")

_SPHERE = pyproj.Geod(a=scan.EARTH_RADIUS, b=scan.EARTH_RADIUS)
_ALTITUDE = 833e3
_TRACK = scan.Track(39.0, -97.0, 193.0)


def _triangle(aside, altitude=_ALTITUDE):
    """Slant range [m], scan angle and view zenith [degree] by the triangle of ground, sensor and earth centre."""
    orbit = scan.EARTH_RADIUS + altitude
    slant = np.sqrt(scan.EARTH_RADIUS**2 + orbit**2 - 2 * scan.EARTH_RADIUS * orbit * np.cos(np.radians(aside)))
    scan_angle = np.degrees(np.arccos((slant**2 + orbit**2 - scan.EARTH_RADIUS**2) / (2 * slant * orbit)))
    vza = 180 - np.degrees(np.arccos((slant**2 + scan.EARTH_RADIUS**2 - orbit**2) / (2 * slant * scan.EARTH_RADIUS)))
    return slant, scan_angle, vza


def _lines_of_sight():
    aside = np.array([0.5, 2.0, 6.0, 12.0])
    slant, scan_angle, vza = _triangle(aside)
    found = [*scan.view_from_ground(aside, _ALTITUDE), *scan.view_from_scan(scan_angle, _ALTITUDE)]
    worst = largest(found, [vza, scan_angle, vza, aside])
    yield _deviation("angles of a line of sight", worst, 1e-9, "degree", "sides of a triangle")
    along, across = scan.growth(scan_angle, _ALTITUDE)
    cosine = np.cos(np.radians(vza))
    worst = largest([along, across], [slant / _ALTITUDE, slant / _ALTITUDE / cosine], relative=True)
    yield _deviation("growth of a footprint", worst, 1e-9, "1", "sides of a triangle")
    widths = [scan.swath_width(_ALTITUDE, each) for each in scan_angle]
    worst = largest(widths, 2 * scan.EARTH_RADIUS * np.radians(aside), relative=True)
    yield _deviation("width of a swath", worst, 1e-9, "1", "sides of a triangle")


def _places():
    """Check places on both sides and along the track against geodesics on the sphere."""
    distance, aside = np.array([-3e5, 4e5, 1e5, -2e5]), np.array([3.0, -8.0, 0.4, 12.0])
    lon, lat, back = _SPHERE.fwd([_TRACK.longitude] * 4, [_TRACK.latitude] * 4, [_TRACK.heading] * 4, distance)
    abeam = np.array(back) + 180 + 90 * np.sign(aside)
    lon, lat, back = _SPHERE.fwd(lon, lat, abeam, scan.EARTH_RADIUS * np.radians(np.abs(aside)))
    latitude, longitude = scan.place_of(_TRACK, distance, aside)
    yield _deviation("places beside a track", largest([latitude, longitude], [lat, lon]), 1e-9, "degree", "geodesics")
    there, angle = scan.place_beside(_TRACK, lat, lon)
    worst = largest([there / 1e5, angle], [distance / 1e5, aside])
    yield _deviation("and their way back", worst, 1e-9, "100 km", "geodesics")
    sine, azimuth = np.sin(np.radians(_triangle(np.abs(aside))[2])), np.radians(back)
    worst = largest(scan.view_components(_TRACK, lat, lon, _ALTITUDE), [sine * np.sin(azimuth), sine * np.cos(azimuth)])
    yield _deviation("direction to the sensor", worst, 1e-9, "1", "geodesics and a triangle")


def _detector(track_angle, scan_angle, altitude):
    """Angles at the earth's centre along and across the track by a right spherical triangle. [degree]"""
    beta, theta = np.radians(track_angle), np.radians(scan_angle)
    away = np.arccos(np.cos(beta) * np.cos(theta))
    arc = np.arcsin((1 + altitude / scan.EARTH_RADIUS) * np.sin(away)) - away
    right, forward = np.cos(beta) * np.sin(theta), np.sin(beta)
    along = np.arctan(np.tan(arc) * forward / np.sin(away))
    return np.degrees(along), np.degrees(np.arcsin(np.sin(arc) * right / np.sin(away)))


def _sweeps():
    """Check places of detectors out of the plane of the scan, and sums of samples."""
    track_angle, scan_angle = np.array([0.4, -0.4, 2.0, -0.1]), np.array([56.0, -44.0, 10.0, 31.0])
    distance, aside = scan.ground_of_detector(track_angle, scan_angle, _ALTITUDE)
    found = np.degrees(distance / scan.EARTH_RADIUS), aside
    worst = largest(found, _detector(track_angle, scan_angle, _ALTITUDE))
    yield _deviation("places of detectors in a sweep", worst, 1e-9, "degree", "right spherical triangles")
    x, frequency = np.linspace(-600, 600, 241), np.array([0.0, 1e-3, 2.5e-3])
    spread, one = AggregatedSpread(Boxcar(128.0), 3, 128.0), Boxcar(384.0)
    worst = largest([*spread.cumulative(x), *spread.mtf(frequency)], [*one.cumulative(x), *one.mtf(frequency)])
    yield _deviation("sum of three samples", worst, 1e-12, "1", "one detector of three times the width")


def _grid():
    """Check directions on cells of 10 km on both sides of a track, which are splines."""
    cells, track = grids.grid_at("EPSG:26914", 680e3, 4.35e6, 40e3, 30e3, 10e3), scan.Track(39.0, -96.7, 193.0)
    view = scan_geometry("TM", cells, track)
    lon, lat = pyproj.Transformer.from_crs(26914, 4269, always_xy=True).transform(*np.meshgrid(view["x"], view["y"]))
    abeam = scan.place_of(track, scan.place_beside(track, lat, lon)[0], 0.0)
    azimuth, _, distance = _SPHERE.inv(lon, lat, abeam[1], abeam[0])
    vza = _triangle(np.degrees(distance / scan.EARTH_RADIUS), 705e3)[2]
    worst = largest([view["vza"], (view["vaa"] - azimuth + 180) % 360 - 180], [vza, 0 * vza])
    yield _deviation("view angles of a grid", worst, 1e-6, "degree", "geodesics and a triangle")


def _orbits():
    """Check headings by velocities in space minus the rotation of the ground, on ascending and descending orbits."""
    worst = 0.0
    for latitude, inclination, ascending in ((0.0, 98.2, True), (39.0, 98.2, False), (-50.0, 65.0, True)):
        normal = np.array([0.0, -np.sin(np.radians(inclination)), np.cos(np.radians(inclination))])
        ahead = np.degrees(np.arcsin(np.sin(np.radians(latitude)) / np.sin(np.radians(inclination))))
        turn = np.radians(ahead if ascending else 180 - ahead)
        point = np.cos(turn) * np.array([1.0, 0, 0]) + np.sin(turn) * np.cross(normal, [1.0, 0, 0])
        rate = np.sqrt(3.986004418e14 / (scan.EARTH_RADIUS + 705e3) ** 3)
        velocity = rate * np.cross(normal, point) - 7.292115e-5 * np.cross([0, 0, 1.0], point)
        east = np.cross([0, 0, 1.0], point) / np.hypot(point[0], point[1])
        heading = np.degrees(np.arctan2(velocity @ east, velocity @ np.cross(point, east))) % 360
        found = scan.Track.from_inclination(latitude, 10.0, inclination, 705e3, ascending=ascending).heading
        worst = np.maximum(worst, largest(found, heading))
    yield _deviation("heading over the turning earth", worst, 1e-9, "degree", "vectors in space")


def _footprint(frame, along, across, row=30.3, column=28.7):
    return Footprints(np.array([row]), np.array([column]), frame[None], along, across)


def _turned():
    """Check the moments of turned and grown Gaussians on cells of 3.33 m, which add a twelfth of their squared size."""
    place = np.arange(60) + 0.5
    down, right = np.meshgrid(place - 30.3, place - 28.7, indexing="ij")
    centre, shape = 0.0, 0.0
    for turn in np.radians([20.0, 77.0, -35.0]):
        frame = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) * 10 / 3 / [[1.25], [1.6]]
        footprint = _footprint(frame, GaussianSpread(12.0), GaussianSpread(18.0))
        rows, columns = footprint.window((60, 60))
        operator = footprint_operator(footprint, rows, columns).toarray()
        weights = np.zeros((60, 60))
        weights[rows, columns] = operator.reshape(weights[rows, columns].shape)
        back = np.linalg.inv(frame)
        expected = back @ np.diag(np.square([12.0, 18.0]) / (8 * np.log(2))) @ back.T + np.eye(2) / 12
        moments = np.array([[np.sum(weights * a * b) for b in (down, right)] for a in (down, right)])
        centre = np.maximum(centre, largest([np.sum(weights * down), np.sum(weights * right)], 0))
        shape = np.maximum(shape, largest(moments, expected) / expected.max())
    yield _deviation("centre of a turned footprint", centre, 1e-6, "cell", "symmetry")
    yield _deviation("second moments of a turned footprint", shape, 1e-5, "1", "those of the response, turned")


def _rectangle():
    """Check a turned detector of 30 by 40 m over cells of 10 m, by 64 by 64 points in each cell."""
    frame = 10 * np.array([[np.cos(0.5), np.sin(0.5)], [-np.sin(0.5), np.cos(0.5)]])
    footprint = _footprint(frame, Boxcar(30.0), Boxcar(40.0), 6.3, 5.7)
    found = footprint_operator(footprint, slice(0, 12), slice(0, 12)).toarray().reshape(12, 12)
    place = (np.arange(12 * 64) + 0.5) / 64
    down, right = place[:, None] - 6.3, place - 5.7
    along, across = (abs(a * down + b * right) < half for (a, b), half in zip(frame, (15, 20), strict=True))
    points = (along & across).reshape(12, 64, 12, 64).sum(axis=(1, 3))
    worst = np.abs(found - points / points.sum()).sum()
    yield _deviation("turned detector, all cells", worst, 0.003, "1", "points inside of a rectangle")


def _straight():
    """Check that a quarter turn exchanges rows and columns; response tables have steps of 1/4096."""
    along, across = CosineSpread(30.32), Boxcar(24.0)
    operators = [
        axis_operator(
            spread,
            cell_origin=0,
            cell_size=10 / 3,
            n_cells=60,
            pixel_origin=middle * 10 / 3 - 15,
            pixel_size=30,
            n_pixels=1,
        )
        for spread, middle in ((across, 30.3), (along, 28.7))
    ]
    rows, columns = (np.zeros(60) for _ in operators)
    for line, each in zip((rows, columns), operators, strict=True):
        line[each.start[0] : each.start[0] + each.count[0]] = each.weights[0, : each.count[0]]
    scenes = np.random.default_rng(2).uniform(1, 2, (2, 60, 60))
    scenes[1, 31, 27] = np.nan
    weights = np.outer(rows, columns) * np.isfinite(scenes)
    footprint = _footprint(10 / 3 * np.array([[0.0, 1.0], [-1.0, 0.0]]), along, across)
    operator = footprint_operator(footprint, slice(0, 60), slice(0, 60))
    found, whole = (apply_operator(operator, scenes.reshape(2, -1), valid)[:, 0] for valid in (0.5, 1.0))
    worst = largest(found, np.sum(weights * np.nan_to_num(scenes), axis=(1, 2)) / weights.sum(axis=(1, 2)))
    worst = worst if np.array_equal(whole, [found[0], np.nan], equal_nan=True) else np.inf
    yield _deviation("pixel of a scan along the grid", worst, 1e-5, "1", "sums by rows and columns")


def _plane():
    """Check a linear ramp of light over cells of 3.33 m, for samples at equal scan angles."""
    cells = grids.grid_at("EPSG:26914", 705600.0, 4334000.0, 600.0, 500.0, 10 / 3)
    place = grids.coordinates(cells)
    light = 40 + 0.02 * (place["x"] - 705900) - 0.03 * (place["y"] - 4333750)
    toa = grids.place(xr.DataArray(light.transpose("y", "x").data, dims=("y", "x")), cells).assign_coords(band="TM3")
    toa.attrs["units"] = "W m-2 sr-1 um-1"
    seen = {"nadir_offset": -36e3, "heading": 193.6, "quantise": False, "min_valid": 1.0, "geometry": fife_geometry()}
    image = sense_swath(toa, "TM", view_tolerance=180, **seen)
    expected = 40 + 0.02 * (image["x"] - 705900) - 0.03 * (image["y"] - 4333750)
    worst = np.abs(image - expected).max() / np.hypot(0.02, 0.03) / (10 / 3)
    yield _deviation("plane in a scan", float(worst), 0.01, "cell", "the plane at its pixels")
    # 16 detectors, half of them on either side of the plane of the scan.
    detector, theta = image["line"].values % 16 - 7.5, np.degrees((image["sample"].values + 0.5) * 43e-6)
    aside = _detector(np.degrees(detector * 43e-6)[:, None], theta, 705e3)[1]
    worst = largest(image["vza"].values, _triangle(np.abs(aside), 705e3)[2])
    yield _deviation("view of its samples", worst, 1e-9, "degree", "Friedl et al. (1995), Table 1")


CHECKS = (_lines_of_sight, _places, _sweeps, _grid, _orbits, _turned, _rectangle, _straight, _plane)
