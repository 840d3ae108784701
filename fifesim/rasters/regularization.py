"""Means of a raster of cells over the footprints of the pixels of another grid."""

from typing import NamedTuple

import numpy as np
import xarray as xr

from fifesim.base.footprints import AxisOperator, axis_operator, regularize
from fifesim.base.line_spread import Boxcar
from fifesim.rasters import chunks
from fifesim.rasters import grid as grids


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


class _Covered(NamedTuple):
    """What the pixels of two operators read of an array, as `fifesim.rasters.chunks.windows` asks it."""

    array: object
    rows: AxisOperator
    columns: AxisOperator

    def window(self, rows, columns):
        return self.rows[rows].window, self.columns[columns].window


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
    sizes, seams = None, ((), ())
    if array.chunks is not None:
        # A pixel is made with the chunk of its last cell: what it needs of earlier ones is cut off when these are made.
        lasts = [axis.start + np.maximum(axis.count, 1) - 1 for axis in (rows, columns)]
        sizes = tuple(chunks.runs(last, each) for last, each in zip(lasts, array.chunks[-2:], strict=True))
        # From the first pixel on that begins in a chunk, all up to the next chunk lie in it.
        edges = [np.cumsum((0, *each[:-1])) for each in array.chunks[-2:]]
        seams = tuple(
            np.unique(np.searchsorted(axis.start, each)).tolist()
            for axis, each in zip((rows, columns), edges, strict=True)
        )

    def means(these, those, cells):
        return regularize(cells, rows[these], columns[those], min_valid=min_valid)

    shape = (*array.shape[:-2], len(rows), len(columns))
    # What regularize makes of it.
    dtype = np.dtype(np.float32 if array.dtype == np.float32 else np.float64)
    out = chunks.windows(means, [_Covered(array.data, rows, columns)], shape, sizes, dtype, seams)
    # xarray would take over dask's name.
    out = xr.DataArray(out, dims=array.dims, coords=chunks.other_coordinates(array), attrs=array.attrs)
    return grids.place(out.rename(array.name), grid)
