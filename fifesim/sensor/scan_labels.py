"""Scans over labelled scenes: view angles, directions of light, and the image by line and sample."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import dask.array as da
import numpy as np
import pyproj
import xarray as xr
from odc.geo.geobox import GeoBox
from scipy.interpolate import RectBivariateSpline

from fifesim.base.arguments import Chunks, NoiseKinds, Time, WholeNumber
from fifesim.base.caches import cached
from fifesim.base.geometry import angle_between
from fifesim.grids import cf, chunks, directions, projection, windows
from fifesim.grids import grid as grids
from fifesim.grids.dates import by_date
from fifesim.grids.directions import Directions
from fifesim.sensor.description.instrument_file import InstrumentLike
from fifesim.sensor.description.instruments import instrument as find_instrument
from fifesim.sensor.labels import MIN_VALID, as_radiance, by_bands, labelled, noisy, recorded
from fifesim.sensor.pixel_labels import by_line_spread, common_size
from fifesim.sensor.response import scan
from fifesim.sensor.response.noise import NoiseModels
from fifesim.sensor.response.scan import Footprints, Track, apply_operator, footprint_operator

# Nodes along each axis between which the direction to the sensor is a cubic spline.
_NODES = 65

# A quarter of the circumference of the Earth. [m]
_FARTHEST = 1e7

_TILE = 512


def scan_geometry(
    instrument: InstrumentLike,
    grid: GeoBox,
    track: Track | None = None,
    *,
    nadir_offset: float = 0.0,
    heading: float = 180.0,
    chunks: Chunks | None = None,
) -> xr.Dataset:
    """
    View zenith and azimuth of an instrument over a grid.

    Parameters
    ----------
    instrument : str or fifesim.sensor.description.instruments.Instrument
    grid : odc.geo.geobox.GeoBox
        Grid of cells or pixels.
    track : fifesim.sensor.response.scan.Track, optional
        Ground track; by default derived from `nadir_offset` and `heading`.
    nadir_offset : float, optional
        Distance of the grid centre from the track, to the right of the flight direction. [m]
    heading : float, optional
        Flight direction for ``nadir_offset``, clockwise from north; by default southward, with west on the right.
        [degree]
    chunks : mapping or int or "auto", optional
        Chunks of a lazy result; in memory by default.

    Returns
    -------
    view : xarray.Dataset of ``vza`` and ``vaa``, dims (y, x)
        Azimuth toward the sensor, clockwise from true north; NaN outside the swath. Altitude and track are attributes.
        [degree]

    Raises
    ------
    ValueError
        If the grid is invalid, the track is given in two ways, or the grid is outside the swath.

    See Also
    --------
    fifesim.sense_swath, fifesim.sensor.overpasses

    Examples
    --------
    >>> import fifesim
    >>> view = fifesim.sensor.scan_geometry("MODIS", fifesim.fife_site(500), nadir_offset=300_000)
    >>> view.vza.mean().round(0).item()
    26.0
    """
    description = find_instrument(instrument)
    grids.check_grid(grid)
    track = find_track(grid, track, nadir_offset, heading)
    _, aside, _, seen = scan_nodes(description, grid, track)
    if not seen.any():
        near = np.min(np.abs(aside)) * np.pi / 180 * scan.EARTH_RADIUS / 1000
        raise ValueError(
            f"{description.name} does not see the grid: it begins {near:.0f} km from the track, where the scan angle "
            f"is beyond {description.max_angle:g} degrees; give a nearer track or a smaller nadir_offset"
        )
    attrs = {"instrument": description.name, "altitude": description.altitude}
    attrs |= {f"track_{name}": value for name, value in vars(track).items()}
    out = {}
    for name in ("vza", "vaa"):
        kernel = partial(_view, name, grid, track, description.altitude, description.max_angle)
        array = windows.tiles(kernel, grid, chunks, tile=_TILE)
        out[name] = cf.label(array, name, history=f"scan_geometry: {description.name}", instrument=description.name)
    return xr.Dataset(out, attrs=attrs)


def find_track(grid, track=None, nadir_offset=0.0, heading=180.0):
    """Ground track, as given or at an offset from the middle of a grid."""
    if track is not None:
        if nadir_offset:
            raise ValueError("track and nadir_offset both determine the track: give one of them")
        return track
    if not abs(nadir_offset) <= _FARTHEST:
        raise ValueError(f"nadir_offset must be at most {_FARTHEST:g} m on either side, got {nadir_offset:g}")
    latitude, longitude = latitude_longitude(grid, grid.shape.y / 2, grid.shape.x / 2)
    here = scan.Track(float(latitude), float(longitude), heading)
    aside = np.degrees(nadir_offset / scan.EARTH_RADIUS)
    # Great circle at this distance. Its nearest point is abeam to the left, and it is parallel to `here` there.
    latitude, longitude = scan.place_of(here, 0.0, -aside)
    _, along, _ = here.axes()
    _, east, north = scan.frame(float(latitude), float(longitude))
    heading = np.degrees(np.arctan2(along @ east, along @ north)) % 360
    return scan.Track(float(latitude), float(longitude), float(heading))


def latitude_longitude(grid, rows, columns):
    """Latitude and longitude of places in a grid. [degree]"""
    x, y = projection.transform_points(grid.affine, columns, rows)
    longitude, latitude = geodetic_transformer(grid.crs.to_wkt()).transform(x, y)
    return latitude, longitude


@cached(8, "transformers to longitude and latitude")
def geodetic_transformer(crs):
    """Transformer from a CRS to its geographic coordinates."""
    projected = pyproj.CRS.from_wkt(crs)
    return pyproj.Transformer.from_crs(projected, projected.geodetic_crs, always_xy=True)


def scan_nodes(instrument, grid, track):
    """Position relative to the track, scan angle and visibility of nodes over a grid."""
    distance, aside = scan.place_beside(track, *_nodes(grid)[2:])
    _, scan_angle = scan.view_from_ground(aside, instrument.altitude)
    return distance, aside, scan_angle, np.abs(scan_angle) <= instrument.max_angle


def _nodes(grid):
    """Rows and columns of nodes along the axes of a grid, and the latitudes and longitudes of all."""
    rows, columns = np.linspace(0, grid.shape.y, _NODES), np.linspace(0, grid.shape.x, _NODES)
    latitude, longitude = latitude_longitude(grid, *np.meshgrid(rows, columns, indexing="ij"))
    return rows, columns, latitude, longitude


@cached(4, "view directions of a track")
def _splines(grid, track, altitude):
    """Components of the direction to the sensor over a grid, as splines of row and column."""
    rows, columns, latitude, longitude = _nodes(grid)
    east, north = scan.view_components(track, latitude, longitude, altitude)
    # Beyond the horizon, where splines need finite values: a direction outside every scan.
    to_east = RectBivariateSpline(rows, columns, np.nan_to_num(east, nan=2.0))
    return to_east, RectBivariateSpline(rows, columns, np.nan_to_num(north, nan=2.0))


def _view(name, grid, track, altitude, limit, row, column, shape):
    """View zenith or azimuth of a block of cells. [degree]"""
    rows, columns = row + np.arange(shape[0]) + 0.5, column + np.arange(shape[1]) + 0.5
    to_east, to_north = _splines(grid, track, altitude)
    east, north = to_east(rows, columns), to_north(rows, columns)
    sine = np.hypot(east, north)
    seen = sine < min(1.0, np.sin(np.radians(min(limit, 90.0))) * (1 + altitude / scan.EARTH_RADIUS) + 1e-12)
    if name == "vza":
        return np.where(seen, np.degrees(np.arcsin(np.minimum(sine, 1.0))), np.nan)
    return np.where(seen, np.degrees(np.arctan2(east, north)) % 360, np.nan)


# Rows and columns of pixels per block.
_BLOCK = 512


def at_pixels(geometry, row, column):
    """Directions of sun and sensor at pixels, from the cells that contain their centres."""
    names = directions.varying(geometry)
    if not names:
        return geometry
    rasters = {name: geometry[name].transpose("y", "x") for name in names}
    return geometry.drop_dims(["y", "x"]).assign({name: _sampled(each, row, column) for name, each in rasters.items()})


class _Centres(NamedTuple):
    """Cells that contain the centres of pixels, as reads for `chunks.windows`."""

    array: object
    rows: np.ndarray
    columns: np.ndarray

    def window(self, lines, samples):
        """Rows and columns of the cells of a block of pixels."""
        numbers = self.rows[lines, samples], self.columns[lines, samples]
        return tuple(slice(int(cells.min()), int(cells.max()) + 1) for cells in numbers)


def _sampled(raster, row, column):
    """Raster sampled at pixels."""
    places = zip((row, column), raster.shape, strict=True)
    cells = [np.clip(np.floor(place), 0, size - 1).astype(int) for place, size in places]
    data = chunks.in_blocks(partial(_block, *cells), [_Centres(raster.data, *cells)], row.shape, _BLOCK)
    return xr.DataArray(data, dims=("line", "sample"), attrs=raster.attrs)


def _block(rows, columns, lines, samples, cells):
    rows, columns = rows[lines, samples], columns[lines, samples]
    return cells[rows - rows.min(), columns - columns.min()]


def seen_alike(means, geometry, view, tolerance, arguments):
    """Check that light was computed for the view of a scan within a tolerance, lazily where angles are lazy."""
    if not 0 <= tolerance <= 180:
        raise ValueError(f"view_tolerance must be in [0, 180] degrees, got {tolerance}")
    scan = [xr.Variable(("line", "sample"), angle) for angle in view]
    light = [xr.as_variable(getattr(geometry, name)) for name in ("vza", "vaa")]
    check = partial(_checked, tolerance=tolerance, arguments=arguments)
    if any(isinstance(angle.data, da.Array) for angle in light):
        return chunks.pointwise(check, means, *light, *scan)
    check(0.0, *(angle.values for angle in (*light, *scan)))
    return means


def _checked(means, vza, vaa, scan_vza, scan_vaa, tolerance, arguments):
    apart = np.where(np.isnan(means), np.nan, angle_between(vza, vaa, scan_vza, scan_vaa))
    if np.any(apart > tolerance):
        raise ValueError(
            f"toa was computed for another view, vza {_span(vza)}, than the scan, vza {_span(scan_vza)}: "
            f"up to {np.nanmax(apart):.1f} degrees apart. Compute it with "
            f"geometry=fifesim.sensor.scan_geometry({arguments}).assign(sza=..., saa=...), or "
            "give view_tolerance=180 if it does not depend on the view"
        )
    return means


def _span(values):
    low, high = np.nanmin(values), np.nanmax(values)
    return f"{low:.1f}" if high - low < 0.05 else f"{low:.1f} to {high:.1f}"


# Pixels along each side of a block, to limit the memory of the operator.
_SWATH_BLOCK = 128

# Displacement on the ground by which the frame of a pixel is found. [m]
_STEP = 100.0


@by_date
def sense_swath(
    toa: xr.DataArray,
    instrument: InstrumentLike | None = None,
    track: Track | None = None,
    *,
    nadir_offset: float = 0.0,
    heading: float = 180.0,
    noise: NoiseKinds = (),
    seed: WholeNumber = 0,
    noise_models: NoiseModels | None = None,
    quantise: bool = True,
    min_valid: float = MIN_VALID,
    geometry: Directions | None = None,
    time: Time | None = None,
    view_tolerance: float = 1.0,
) -> xr.DataArray:
    """
    Simulate a scan by line and sample, at the sampling interval of the instrument and without resampling.

    The footprint of each pixel depends on its scan angle and is rotated with the track. Lines of one sweep of a
    whiskbroom scanner spread toward the ends of the scan and overlap the next sweep (bow-tie). Samples are summed and
    lines deleted as on board.

    Parameters
    ----------
    toa : xarray.DataArray, dims (band, y, x)
        As in `fifesim.sensor.labels.sense`. [1 or W m-2 sr-1 um-1]
    instrument : str or fifesim.sensor.description.instruments.Instrument, optional
        Instrument; by default from the array.
    track, nadir_offset, heading : optional
        As in `fifesim.sensor.scan_labels.scan_geometry`.
    noise, seed, noise_models, quantise, min_valid, geometry, time : optional
        As in `fifesim.sensor.labels.sense`.
    view_tolerance : float, optional
        Maximum difference between the view directions of `toa` and of the scan; use 180 if `toa` does not depend on the
        view. [degree]

    Returns
    -------
    image : xarray.DataArray, dims (band, line, sample)
        Digital numbers or radiance. Lines are in flight direction, samples from left to right. ``latitude``,
        ``longitude``, ``x``, ``y``, ``vza`` and ``vaa`` are coordinates of each pixel. ``sweep`` is the number of the
        sweep of each line if several lines are swept together. ``deleted`` marks the pixels that the instrument
        deletes on board, which are NaN or digital number 0. [1 or W m-2 sr-1 um-1]

    Raises
    ------
    ValueError
        As in `fifesim.sensor.labels.sense`, or if no pixel is in the scene, or `toa` was computed for another view (for
        lazy angles, when computed).

    Notes
    -----
    Sweeps are spaced by the height of a sweep at nadir. The platform does not move during a sweep, each pixel is seen
    at right angles to the track, and noise does not depend on the number of summed samples.

    See Also
    --------
    fifesim.sense, fifesim.sensor.grid_swath, fifesim.sensor.scan_geometry

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(25, window=((0, 120), (0, 120)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> toa = lai.fifesim.surface_reflectance("MODIS", bands=["MODIS1"]).fifesim.to_toa()
    >>> toa.fifesim.sense_swath("MODIS").dims
    ('band', 'line', 'sample')
    """
    toa, description, bands = by_bands(toa, instrument)
    geometry = directions.given_geometry(geometry, toa, time)
    scene = grids.geobox(toa)
    track = find_track(scene, track, nadir_offset, heading)
    pixels = _pixels(scene, description, bands, track)
    coordinates = _coordinates(scene, pixels, description)
    geometry = at_pixels(geometry, pixels.row, pixels.column)
    means = _means(toa.transpose("band", "y", "x"), description, bands, pixels, min_valid)
    view = coordinates["vza"][1], coordinates["vaa"][1]
    words = f"fifesim.sensor.Track({track.latitude:.4f}, {track.longitude:.4f}, {track.heading:.2f})"
    means = seen_alike(means, geometry, view, view_tolerance, f"{description.name!r}, grid, {words}")
    radiance = noisy(as_radiance(means, bands, geometry), description, bands, noise, seed, pixels.first, noise_models)
    image, along_band = recorded(radiance, description, bands, quantise)
    image = grids.with_coordinates(image, along_band).assign_coords(coordinates)
    history = f"sense_swath: {description.name}, track {track.heading:.2f} degrees"
    image = directions.with_geometry(image, geometry, ("sza", "saa", "earth_sun_distance"))
    image = labelled(image, toa, description, history, 2**description.bits - 1)
    image.encoding = {"grid_mapping": "spatial_ref"}
    return image


@dataclass(frozen=True, eq=False)
class _Pixels:
    """Lines and samples of a scan, their places, and the steps of a cell in the frame of each pixel."""

    pattern: scan.ScanPattern
    lines: np.ndarray  # numbers, shape (line,)
    samples: np.ndarray  # shape (sample,)
    latitude: np.ndarray  # shape (line, sample)
    longitude: np.ndarray
    row: np.ndarray
    column: np.ndarray
    frame: np.ndarray  # shape (line, sample, 2, 2)
    track: scan.Track

    @property
    def first(self):
        """Numbers of the first line and sample."""
        return int(self.lines[0]), int(self.samples[0])

    @property
    def deleted(self):
        """Whether a pixel is deleted on board, shape (line, sample)."""
        return self.pattern.is_deleted(self.lines[:, None], self.samples)

    def zones(self):
        """Samples in each zone from left to right, as slices, and the elementary samples that are summed there."""
        zone = self.pattern.zone_of(self.samples)
        edges = [0, *(np.flatnonzero(np.diff(zone)) + 1).tolist(), zone.size]
        for start, stop in pairwise(edges):
            count = self.pattern.zones[zone[start]].aggregation if self.pattern.zones else None
            yield slice(start, stop), count


def _pixels(scene, description, bands, track):
    """Pixels with centres in the smallest box of lines and samples around a scene."""
    spacing, _ = common_size(description, bands, description.ground_intervals)
    pattern = description.scan_pattern(bands[0])
    distance, _, scan_angle, seen = scan_nodes(description, scene, track)
    if not seen.any():
        raise ValueError(
            f"{description.name} does not see the scene, whose scan angles are beyond {description.max_angle:g} degrees"
        )
    samples = _inside(pattern.position(scan_angle[seen]))
    theta = pattern.scan_angle(samples + 0.5)
    lines, along, aside = _lines(pattern, spacing, theta, distance[seen], description.altitude)
    if not (lines.size and samples.size):
        raise ValueError(
            f"no pixel of {description.name}, {spacing:g} m along the track, lies in the scene: simulate a larger one"
        )
    latitude, longitude = scan.place_of(track, along, aside)
    row, column = _cells(scene, latitude, longitude)
    parallel = np.cos(np.radians(aside))
    forward = _cells(scene, *scan.place_of(track, along + _STEP / parallel, aside))
    sideward = _cells(scene, *scan.place_of(track, along, aside + np.degrees(_STEP / scan.EARTH_RADIUS)))
    # A metre along and across the track (last axis) in rows and columns. The inverse takes cells to metres.
    here = np.stack([row, column], axis=-1)
    steps = np.stack([np.stack(forward, axis=-1) - here, np.stack(sideward, axis=-1) - here], axis=-1)
    frame = np.linalg.inv(steps / _STEP) / np.stack(scan.growth(theta, description.altitude), axis=-1)[..., None]
    return _Pixels(pattern, lines, samples, latitude, longitude, row, column, frame, track)


def _lines(pattern, spacing, theta, distance, altitude):
    """Numbers of the lines between two distances along the track, their distances [m] and central angles [degree]."""
    if not theta.size:
        return np.empty(0, int), np.empty((0, 0)), np.empty((0, 0))
    ahead, aside = scan.ground_of_detector(pattern.track_angle()[:, None], theta, altitude)
    advance, reach = pattern.lines * spacing, np.abs(ahead).max()
    low, high = distance.min(), distance.max()
    sweeps = np.arange(int(np.floor((low - reach) / advance)) - 1, int(np.ceil((high + reach) / advance)) + 1)
    along = (((sweeps + 0.5) * advance)[:, None, None] + ahead).reshape(-1, theta.size)
    within = np.flatnonzero(((along >= low) & (along <= high)).any(axis=1))
    kept = slice(within[0], within[-1] + 1) if within.size else slice(0)
    numbers = sweeps[0] * pattern.lines + np.arange(len(along))
    return numbers[kept], along[kept], np.tile(aside, (sweeps.size, 1))[kept]


def _inside(places):
    """Numbers of the samples with centres between the outermost of some places."""
    return np.arange(int(np.ceil(places.min() - 0.5)), int(np.floor(places.max() - 0.5)) + 1)


def _cells(scene, latitude, longitude):
    """Row and column of places, from the corner of a grid. [cell]"""
    x, y = geodetic_transformer(scene.crs.to_wkt()).transform(longitude, latitude, direction="INVERSE")
    return (y - scene.affine.f) / scene.affine.e, (x - scene.affine.c) / scene.affine.a


class _Seen(NamedTuple):
    """Cells in the footprints of pixels, as reads for `chunks.windows`."""

    array: object
    footprints: Footprints

    def window(self, lines, samples):
        """Rows and columns of the cells that a block of pixels touches."""
        return self.footprints[lines, samples].window(self.array.shape[-2:])


def _means(toa, description, bands, pixels, min_valid):
    """Means over the footprints by band, lazy where the scene is."""
    if not 0 <= min_valid <= 1:
        raise ValueError(f"min_valid must be in [0, 1], got {min_valid}: it is a share of the footprint")

    def means(zone, part, spreads, names):
        places = (each[:, zone] for each in (pixels.row, pixels.column, pixels.frame))
        footprints = Footprints(*places, *spreads)
        kernel = partial(_block_means, footprints, part.shape[-2:], min_valid)
        shape = part.sizes["band"], *footprints.row.shape
        data = chunks.in_blocks(kernel, [_Seen(part.data, footprints)], shape, _SWATH_BLOCK)
        coords = chunks.other_coordinates(part)
        return xr.DataArray(data, dims=("band", "line", "sample"), coords=coords, attrs=toa.attrs)

    parts = []
    for zone, count in pixels.zones():
        spreads = partial(description.line_spreads, aggregation=count)
        parts.append(by_line_spread(partial(means, zone), toa, spreads, bands))
    whole, deleted = parts[0], pixels.deleted
    if len(parts) > 1:
        alike = {"combine_attrs": "override", "coords": "minimal", "compat": "override", "join": "exact"}
        whole = xr.concat(parts, dim="sample", **alike)
    return whole.where(~xr.Variable(("line", "sample"), deleted)) if deleted.any() else whole


def _block_means(footprints, shape, min_valid, lines, samples, cells):
    """Means over the footprints of a block of pixels, from the cells that they touch."""
    seen = footprints[lines, samples]
    operator = footprint_operator(seen, *seen.window(shape))
    means = apply_operator(operator, cells.reshape(len(cells), -1), min_valid)
    return means.reshape(len(cells), lines.stop - lines.start, samples.stop - samples.start)


def _coordinates(scene, pixels, description):
    """Positions of the pixels and their view directions, after CF."""
    x, y = projection.transform_points(scene.affine, pixels.column, pixels.row)
    east, north = scan.view_components(pixels.track, pixels.latitude, pixels.longitude, description.altitude)
    values = {
        "latitude": (pixels.latitude, {"standard_name": "latitude", "units": "degrees_north"}),
        "longitude": (pixels.longitude, {"standard_name": "longitude", "units": "degrees_east"}),
        "y": (y, {"standard_name": "projection_y_coordinate", "units": "m"}),
        "x": (x, {"standard_name": "projection_x_coordinate", "units": "m"}),
        "vza": (np.degrees(np.arcsin(np.hypot(east, north))), cf.attributes("vza")),
        "vaa": (np.degrees(np.arctan2(east, north)) % 360, cf.attributes("vaa")),
    }
    out = {name: (("line", "sample"), value, attrs) for name, (value, attrs) in values.items()}
    for axis, numbers in (("line", pixels.lines), ("sample", pixels.samples)):
        out[axis] = (axis, numbers, {"long_name": f"{axis} of the scan, from the track's point"})
    if pixels.pattern.lines > 1:
        out["sweep"] = ("line", pixels.lines // pixels.pattern.lines, {"long_name": "sweep across the track"})
    if any(zone.deleted for zone in pixels.pattern.zones):
        out["deleted"] = (("line", "sample"), pixels.deleted, {"long_name": "deleted on board"})
    return out | {"spatial_ref": grids.coordinates(scene)["spatial_ref"]}
