"""Means of a raster of cells over the footprints of the pixels of another grid."""

import numpy as np
import xarray as xr
from dask.base import tokenize

from fifesim.base.footprints import axis_operator, regularize
from fifesim.base.line_spread import Boxcar
from fifesim.rasters import chunks
from fifesim.rasters import grid as grids
from fifesim.rasters.windows import array_from_windows, slices


def areas(pixels):
    """
    Line spread functions of pixels that see their own area, and all of it alike.

    Parameters
    ----------
    pixels : odc.geo.geobox.GeoBox

    Returns
    -------
    down, across : fifesim.base.line_spread.Boxcar
    """
    down, across = grids.cell_size(pixels)
    return Boxcar(down), Boxcar(across)


def operators(spreads, cells, pixels, shifts=(0.0, 0.0)):
    """
    Operators from a grid of cells to one of pixels.

    Parameters
    ----------
    spreads : (line spread function, line spread function)
        Down and across, as `fifesim.base.footprints` takes them.
    cells, pixels : odc.geo.geobox.GeoBox
        North up, in one CRS.
    shifts : (float or array, float or array), optional
        Distance southward and eastward from where pixels should lie to where they do, a number or one for each row and
        each column. [m]

    Returns
    -------
    rows, columns : fifesim.base.footprints.AxisOperator
    """
    down, across = spreads
    south, east = shifts
    a, b = cells.affine, pixels.affine
    rows = axis_operator(
        down, cell_origin=a.f, cell_size=a.e, n_cells=cells.shape.y, pixel_origin=b.f, pixel_size=b.e,
        n_pixels=pixels.shape.y, shift=south,
    )  # fmt: skip
    columns = axis_operator(
        across, cell_origin=a.c, cell_size=a.a, n_cells=cells.shape.x, pixel_origin=b.c, pixel_size=b.a,
        n_pixels=pixels.shape.x, shift=east,
    )  # fmt: skip
    return rows, columns


def regularized(array, spreads, pixels, *, shifts=(0.0, 0.0), min_valid):
    """
    Means over the footprints of pixels.

    Parameters
    ----------
    array : xarray.DataArray, dims (..., y, x)
        By cells.
    spreads, pixels, shifts
        As in `operators`.
    min_valid : float
        Share of its footprint that a pixel needs on valid cells; below it is NaN. [1]

    Returns
    -------
    means : xarray.DataArray, dims (..., y, x)
        Lazy where the array is, when each chunk reads the window of cells that it needs.

    See Also
    --------
    fifesim.base.footprints.regularize
    """
    rows, columns = operators(spreads, grids.geobox(array), pixels, shifts)
    return resample(rows, columns, array, pixels, min_valid=min_valid)


def resample(rows, columns, array, grid, *, min_valid=0.98):
    """
    Carry a raster onto another grid by one operator for each axis.

    Parameters
    ----------
    rows, columns : fifesim.base.footprints.AxisOperator
    array : xarray.DataArray, dims (..., y, x)
    grid : odc.geo.geobox.GeoBox
        The output's.
    min_valid : float, optional
        As in `regularized`. [1]

    Returns
    -------
    array : xarray.DataArray, dims (..., y, x)
        Float, lazy where the input is.
    """
    array = array.transpose(..., "y", "x")
    data = array.data
    if array.chunks is None:
        these, those = rows[:], columns[:]
        out = regularize(data[..., these.window, those.window], these, those, min_valid=min_valid)
    else:
        out = _resample_lazily(rows, columns, data, min_valid)
    # xarray would take over dask's name.
    out = xr.DataArray(out, dims=array.dims, coords=chunks.other_coordinates(array), attrs=array.attrs)
    return grids.place(out.rename(array.name), grid)


def _resample_lazily(rows, columns, data, min_valid):
    """One task for each block of pixels, on the merged window of cells."""
    # What regularize makes of it.
    dtype = np.dtype(np.float32 if data.dtype == np.float32 else np.float64)
    # A pixel is made with the chunk of its last cell: what it needs of earlier chunks is cut off when these are made.
    lasts = [axis.start + np.maximum(axis.count, 1) - 1 for axis in (rows, columns)]
    sizes = tuple(chunks.runs(last, each) for last, each in zip(lasts, data.chunks[-2:], strict=True))
    down = {part.start: rows[part] for part in slices(sizes[0])}
    across = {part.start: columns[part] for part in slices(sizes[1])}

    def ask(row_range, column_range):
        these, those = down[row_range.start], across[column_range.start]
        return (these, those), [(these.window, those.window)]

    def block(these, those, window):
        return regularize(window, these, those, min_valid=min_valid)

    token = tokenize(rows, columns, min_valid, data.name)
    return array_from_windows(block, [data], sizes, ask, token=token, leading=data.shape[:-2], dtype=dtype)
