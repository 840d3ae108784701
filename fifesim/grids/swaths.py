"""Images of a scan on labelled rasters: by line and sample instead of rows and columns, and their mapping to a grid."""

from __future__ import annotations

from functools import partial
from typing import Literal, NamedTuple

import dask.array as da
import numpy as np
import xarray as xr
from odc.geo.geobox import GeoBox

from fifesim.base import scan_pixels
from fifesim.grids import chunks, projection
from fifesim.grids import grid as grids
from fifesim.grids.dates import by_date

DIMS = ("line", "sample")

# Rows and columns of a map that are made at once. [cell]
_BLOCK = 512

# Coordinates of pixel positions, which a map does not need.
_PLACES = ("x", "y", "latitude", "longitude", "spatial_ref", "sweep", "deleted", *DIMS)


def placed_as(array, image, coordinates=None):
    """Result for the cells of an image, on its grid or on the lines and samples of its scan."""
    if not set(DIMS) <= set(image.dims):
        return grids.place(array, grids.geobox(image), coordinates)
    # Angles of the image that lie on these coordinates come with them.
    array = array.assign_coords({name: image.coords[name] for name in _PLACES if name in image.coords})
    array = grids.with_coordinates(array, coordinates) if coordinates else array
    array.encoding = {"grid_mapping": "spatial_ref"} if "spatial_ref" in array.coords else {}
    return array


@by_date
def grid_swath(
    image: xr.DataArray, grid: GeoBox, method: Literal["nearest", "mean"] = "nearest", *, min_valid: float = 0.5
) -> xr.DataArray:
    """
    Map an image of a scan to a grid.

    Parameters
    ----------
    image : xarray.DataArray, dims ([band], line, sample)
        From `fifesim.sense_swath`, or with coordinates ``latitude`` and ``longitude`` [degree] of each pixel. Lines
        that differ in a coordinate ``sweep`` do not share edges, and pixels that a coordinate ``deleted`` marks are
        left out.
    grid : odc.geo.geobox.GeoBox
        Grid in any projected CRS in metres, for example from `fifesim.grid_at`.
    method : {"nearest", "mean"}, optional
        Nearest pixel that covers the cell centre, or area-weighted mean of the pixels on the cell. Digital numbers need
        "nearest".
    min_valid : float, optional
        Minimum fraction of a cell covered by valid pixels for a mean. [1]

    Returns
    -------
    image : xarray.DataArray, dims ([band], y, x)
        Lazy if the image is. NaN (0 for digital numbers) without pixels. Angles of sun and view are taken from the
        nearest pixel.

    Raises
    ------
    ValueError
        If the image is not a scan, has no pixel positions, has only one line or sample, or does not overlap the grid.

    See Also
    --------
    fifesim.sense_swath

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(25, window=((0, 120), (0, 120)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> toa = lai.fifesim.surface_reflectance("MODIS", bands=["MODIS1"]).fifesim.to_toa()
    >>> swath = toa.fifesim.sense_swath("MODIS")
    >>> swath.fifesim.grid_swath(fifesim.fife_site(250, window=((0, 12), (0, 12)))).dims
    ('band', 'y', 'x')
    """
    grids.check_grid(grid)
    _check(image, method, min_valid)
    image = image.transpose(..., *DIMS)
    x, y = _places(image, grid)
    row, column = (y - grid.affine.f) / grid.affine.e, (x - grid.affine.c) / grid.affine.a
    edges = scan_pixels.corners(row, column, image["sweep"].values if "sweep" in image.coords else None)
    reach = scan_pixels.reach(row, column, edges, grids.cell_size(grid))
    if "deleted" in image.coords:  # pixels without a place, which are nearest to no cell
        deleted = np.asarray(image["deleted"].transpose(*DIMS), bool)
        row, column = np.where(deleted, np.nan, row), np.where(deleted, np.nan, column)
    scan = _Scan(row, column, *edges, reach)  # type: ignore[call-arg]
    _check_overlap(scan, grid)
    nearest = method == "nearest"
    data = _nearest(scan, image.data, grid) if nearest else _means(scan, image.data, grid, min_valid)
    along = {name: value for name, value in image.coords.items() if not {*DIMS} & set(value.dims)}
    out = xr.DataArray(data, dims=(*image.dims[:-2], "y", "x"), coords=along, attrs=dict(image.attrs), name=image.name)
    lazy = isinstance(image.data, da.Array)
    for name, value in image.coords.items():
        if name in _PLACES or set(value.dims) != {*DIMS} or value.dtype.kind not in "fiu":
            continue
        values = value.transpose(*DIMS).astype(float).data
        values = _nearest(scan, da.from_array(values, chunks=-1) if lazy else values, grid)
        out = out.assign_coords({name: (("y", "x"), values, value.attrs)})
    out = grids.place(out, grid)
    out.attrs["history"] = "\n".join(filter(None, [image.attrs.get("history", ""), f"grid_swath: {method}"]))
    return out


def _check(image, method, min_valid):
    if not 0 <= min_valid <= 1:
        raise ValueError(f"min_valid must be in [0, 1], got {min_valid}: it is a share of a cell")
    if not set(DIMS) <= set(image.dims) or set(image.dims) - {"band", *DIMS}:
        raise ValueError(
            f"grid_swath takes the image of a scan, dimensions ([band], line, sample), got {image.dims}: "
            "one that has a grid is taken to another by .rio.reproject_match"
        )
    if method == "mean" and image.dtype.kind != "f":
        raise ValueError(
            "digital numbers have no mean, for 0 is no data: take method='nearest', or convert them first with "
            ".fifesim.to_radiance()"
        )


class _Scan(NamedTuple):
    """Pixels of a scan on the cells of a map: centres and corners by line and edge [cell], and reach [m]."""

    row: np.ndarray
    column: np.ndarray
    rows: np.ndarray
    columns: np.ndarray
    reach: np.ndarray


def _places(image, grid):
    """Eastings and northings of the pixels in the CRS of a grid, shape (line, sample)."""
    if {"x", "y", "spatial_ref"} <= set(image.coords):
        names, crs = ("x", "y"), image["spatial_ref"].attrs["crs_wkt"]
    elif {"latitude", "longitude"} <= set(image.coords):
        names, crs = ("longitude", "latitude"), "EPSG:4326"
    else:
        raise ValueError(
            "the pixel positions are unknown: assign coordinates latitude and longitude over (line, sample)"
        )
    across, up = (np.asarray(image[name].transpose(*DIMS), float) for name in names)
    target = grid.crs.to_wkt()
    pipeline = projection.operation(crs, target, projection.degrees(grid))
    return projection.carry(pipeline, crs, target, across, up)


def _check_overlap(scan, grid):
    inside = (scan.row >= 0) & (scan.row <= grid.shape.y) & (scan.column >= 0) & (scan.column <= grid.shape.x)
    down, across = grids.cell_size(grid)
    near = (np.abs(scan.row - grid.shape.y / 2) - grid.shape.y / 2) * down <= scan.reach
    near &= (np.abs(scan.column - grid.shape.x / 2) - grid.shape.x / 2) * across <= scan.reach
    if not (inside | near).any():
        a = grid.affine
        spans = [
            f"{start + step * np.nanmin(each):.0f} to {start + step * np.nanmax(each):.0f}"
            for start, step, each in ((a.c, a.a, scan.column), (a.f, a.e, scan.row))
        ]
        raise ValueError(
            f"no pixel of the scan lies on the grid, which spans {grids.extent(grid)}: the scan spans {spans[0]} E and "
            f"{spans[1]} N there; make the grid around it with fifesim.grid_at"
        )


class _Touching(NamedTuple):
    """Pixels on blocks of a map, as reads for `chunks.windows`."""

    array: object
    scan: _Scan
    cell: tuple

    def window(self, rows, columns):
        """Lines and samples that reach some cells, at least one of each."""
        scan, (down, across) = self.scan, self.cell
        near = scan.row + scan.reach / down >= rows.start
        near &= scan.row - scan.reach / down <= rows.stop
        near &= scan.column + scan.reach / across >= columns.start
        near &= scan.column - scan.reach / across <= columns.stop
        lines, samples = (np.flatnonzero(near.any(axis=axis)) for axis in (1, 0))
        if not lines.size:
            return slice(0, 1), slice(0, 1)
        return slice(int(lines[0]), int(lines[-1]) + 1), slice(int(samples[0]), int(samples[-1]) + 1)


def _nearest(scan, values, grid):
    """Values of the nearest pixels, in their type."""
    touching = _Touching(values, scan, grids.cell_size(grid))
    kernel = partial(_nearest_block, touching._replace(array=None), np.nan if values.dtype.kind == "f" else 0)
    return chunks.in_blocks(kernel, [touching], (*values.shape[:-2], *grid.shape), _BLOCK, values.dtype)


def _nearest_block(touching, missing, rows, columns, pixels):
    scan, window = touching.scan, touching.window(rows, columns)
    spots = (np.ascontiguousarray(each[window]).ravel() for each in (scan.row, scan.column, scan.reach))
    limits = (rows.start, rows.stop), (columns.start, columns.stop)
    number = scan_pixels.nearest_pixels(*spots, tuple(map(float, touching.cell)), *limits)
    flat = np.reshape(pixels, (*pixels.shape[:-2], -1))
    return np.where(number >= 0, flat[..., np.maximum(number, 0)], np.asarray(missing, pixels.dtype))


def _means(scan, values, grid, min_valid):
    touching = _Touching(values, scan, grids.cell_size(grid))
    kernel = partial(_means_block, touching._replace(array=None), min_valid)
    return chunks.in_blocks(kernel, [touching], (*values.shape[:-2], *grid.shape), _BLOCK)


def _means_block(touching, min_valid, rows, columns, pixels):
    lines, samples = touching.window(rows, columns)
    around = lines, slice(None), slice(samples.start, samples.stop + 1)
    layers = np.asarray(pixels, float).reshape(-1, *pixels.shape[-2:])
    limits = (rows.start, rows.stop), (columns.start, columns.stop)
    edges = (np.ascontiguousarray(each[around]) for each in (touching.scan.rows, touching.scan.columns))
    means, covered = scan_pixels.covered_means(np.ascontiguousarray(layers), *edges, *limits)
    means = np.where(covered >= min_valid - 1e-9, means, np.nan)
    return means.reshape(*pixels.shape[:-2], *means.shape[-2:])
