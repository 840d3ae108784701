"""The image of a scan over a labelled scene: lines and samples, each with a footprint of its own."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
import xarray as xr

from fifesim.base.annotations import Noise, Time, WholeNumber
from fifesim.rasters import cf, chunks, directions, projection
from fifesim.rasters import grid as grids
from fifesim.rasters.dates import by_date
from fifesim.rasters.directions import Directions
from fifesim.sensor.description.annotations import InstrumentLike
from fifesim.sensor.raster import MIN_VALID, as_radiance, by_bands, labelled
from fifesim.sensor.response.noise import NoiseModels
from fifesim.sensor.response.rasters.digital_numbers import recorded
from fifesim.sensor.response.rasters.noise import noisy
from fifesim.sensor.response.rasters.pixels import by_line_spread, common_size
from fifesim.sensor.scan import track as scan
from fifesim.sensor.scan.rasters.light import at_pixels, seen_alike
from fifesim.sensor.scan.rasters.view import find_track, scan_nodes, transformer
from fifesim.sensor.scan.swath import Footprints, apply_operator, footprint_operator
from fifesim.sensor.scan.track import Track

# Pixels along each side of a block: the operator of a whole image would fill the memory.
_BLOCK = 128

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
    noise: Noise = (),
    seed: WholeNumber = 0,
    noise_models: NoiseModels | None = None,
    quantise: bool = True,
    min_valid: float = MIN_VALID,
    geometry: Directions | None = None,
    time: Time | None = None,
    view_tolerance: float = 1.0,
) -> xr.DataArray:
    """
    Image of a scan as the instrument takes it: by line and sample, at its own interval, and never resampled.

    Each pixel has the footprint of its scan angle, turned as the track lies on the grid.

    Parameters
    ----------
    toa : xarray.DataArray, dims (band, y, x)
        As in `fifesim.sensor.raster.sense`. [1 or W m-2 sr-1 um-1]
    instrument : str or fifesim.sensor.description.instruments.Instrument, optional
        By default that whose bands the array carries.
    track, nadir_offset, heading : optional
        As in `fifesim.sensor.scan.rasters.view.scan_geometry`.
    noise, seed, noise_models, quantise, min_valid, geometry, time : optional
        As in `fifesim.sensor.raster.sense`.
    view_tolerance : float, optional
        How far the view that the light was computed for may be from that of the scan; 180 takes light that does not
        depend on it. [degree]

    Returns
    -------
    image : xarray.DataArray, dims (band, line, sample)
        Digital numbers or radiance. Lines follow the flight, samples go from its left to its right. ``latitude``,
        ``longitude``, ``x``, ``y``, ``vza`` and ``vaa`` are coordinates of each pixel. [1 or W m-2 sr-1 um-1]

    Raises
    ------
    ValueError
        As in `fifesim.sensor.raster.sense`, if no pixel of the scan lies in the scene, and, where angles are lazy when
        it computes, if the light was computed for another view.

    Notes
    -----
    Each line is a sweep of its own. Lines follow each other by the interval at nadir, so that those of an instrument
    that sweeps several at once do not overlap more at the ends.

    See Also
    --------
    fifesim.sensor.scan.swath.footprint_operator, fifesim.sensor.scan.track

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
    said = f"fifesim.Track({track.latitude:.4f}, {track.longitude:.4f}, {track.heading:.2f})"
    means = seen_alike(means, geometry, view, view_tolerance, f"{description.name!r}, grid, {said}")
    radiance = noisy(as_radiance(means, bands, geometry), description, bands, noise, seed, pixels.first, noise_models)
    image = recorded(radiance, description, bands, quantise).assign_coords(coordinates)
    history = f"sense_swath: {description.name}, track {track.heading:.2f} degrees"
    image = directions.with_geometry(image, geometry, ("sza", "saa", "earth_sun_distance"))
    image = labelled(image, toa, description, history)
    image.encoding = {"grid_mapping": "spatial_ref"}
    return image


@dataclass(frozen=True, eq=False)
class _Pixels:
    """Lines and samples of a scan: number of the first, place, and step of a cell in each pixel's frame at nadir."""

    first: tuple
    latitude: np.ndarray  # shape (line, sample)
    longitude: np.ndarray
    row: np.ndarray
    column: np.ndarray
    frame: np.ndarray  # shape (line, sample, 2, 2)
    track: scan.Track


def _pixels(scene, description, bands, track):
    """Pixels whose centres lie in the smallest box of lines and samples around a scene."""
    spacing, across = common_size(description, bands, description.ground_intervals)
    angle = np.degrees(across / description.altitude)
    distance, _, scan_angle, seen = scan_nodes(description, scene, track)
    if not seen.any():
        raise ValueError(
            f"{description.name} does not see the scene, whose scan angles are beyond {description.max_angle:g} degrees"
        )
    lines, samples = _inside(distance[seen] / spacing), _inside(scan_angle[seen] / angle)
    if not (lines.size and samples.size):
        raise ValueError(
            f"no pixel of {description.name}, {spacing:g} m along the track, lies in the scene: simulate a larger one"
        )
    along, theta = np.meshgrid((lines + 0.5) * spacing, (samples + 0.5) * angle, indexing="ij")
    _, aside = scan.view_from_scan(theta, description.altitude)
    latitude, longitude = scan.place_of(track, along, aside)
    row, column = _cells(scene, latitude, longitude)
    parallel = np.cos(np.radians(aside))
    forward = _cells(scene, *scan.place_of(track, along + _STEP / parallel, aside))
    sideward = _cells(scene, *scan.place_of(track, along, aside + np.degrees(_STEP / scan.EARTH_RADIUS)))
    # A metre along and across the track (last axis) in rows and columns. The inverse takes cells to metres.
    here = np.stack([row, column], axis=-1)
    steps = np.stack([np.stack(forward, axis=-1) - here, np.stack(sideward, axis=-1) - here], axis=-1)
    frame = np.linalg.inv(steps / _STEP) / np.stack(scan.growth(theta, description.altitude), axis=-1)[..., None]
    return _Pixels((int(lines[0]), int(samples[0])), latitude, longitude, row, column, frame, track)


def _inside(places):
    """Numbers of the lines or samples whose centres lie between the first and the last of some places."""
    return np.arange(int(np.ceil(places.min() - 0.5)), int(np.floor(places.max() - 0.5)) + 1)


def _cells(scene, latitude, longitude):
    """Row and column of places, counted from the corner of a grid [cell]."""
    x, y = transformer(scene.crs.to_wkt()).transform(longitude, latitude, direction="INVERSE")
    return (y - scene.affine.f) / scene.affine.e, (x - scene.affine.c) / scene.affine.a


class _Seen(NamedTuple):
    """What pixels see of an array, as `fifesim.rasters.chunks.windows` reads it."""

    array: object
    footprints: Footprints

    def window(self, lines, samples):
        """Rows and columns of the cells that a block of pixels touches."""
        return self.footprints[lines, samples].window(self.array.shape[-2:])


def _means(toa, description, bands, pixels, min_valid):
    """Means over the footprints, by band; lazy where the scene is."""
    if not 0 <= min_valid <= 1:
        raise ValueError(f"min_valid must be in [0, 1], got {min_valid}: it is a share of the footprint")

    def means(part, spreads, names):
        footprints = Footprints(pixels.row, pixels.column, pixels.frame, *spreads)
        kernel = partial(_block_means, footprints, part.shape[-2:], min_valid)
        shape = part.sizes["band"], *pixels.row.shape
        data = chunks.in_blocks(kernel, [_Seen(part.data, footprints)], shape, _BLOCK)
        coords = chunks.other_coordinates(part)
        return xr.DataArray(data, dims=("band", "line", "sample"), coords=coords, attrs=toa.attrs)

    return by_line_spread(means, toa, description, bands)


def _block_means(footprints, shape, min_valid, lines, samples, cells):
    """Means over the footprints of a block of pixels, from the cells that they touch."""
    seen = footprints[lines, samples]
    operator = footprint_operator(seen, *seen.window(shape))
    means = apply_operator(operator, cells.reshape(len(cells), -1), min_valid)
    return means.reshape(len(cells), lines.stop - lines.start, samples.stop - samples.start)


def _coordinates(scene, pixels, description):
    """Where the pixels lie and whence they are seen, after CF."""
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
    for axis, first, size in zip(("line", "sample"), pixels.first, pixels.row.shape, strict=True):
        out[axis] = (axis, first + np.arange(size), {"long_name": f"{axis} of the scan, from the track's point"})
    return out | {"spatial_ref": grids.coordinates(scene)["spatial_ref"]}
