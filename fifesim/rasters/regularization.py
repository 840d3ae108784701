"""Means of a raster of cells over the footprints of the pixels of another grid."""

from functools import partial

from fifesim.base.footprints import Boxcar, axis_operator, regularize
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
    down, across : fifesim.base.footprints.Boxcar
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
        down,
        cell_origin=a.f,
        cell_size=a.e,
        n_cells=cells.shape.y,
        pixel_origin=b.f,
        pixel_size=b.e,
        n_pixels=pixels.shape.y,
        shift=south,
    )
    columns = axis_operator(
        across,
        cell_origin=a.c,
        cell_size=a.a,
        n_cells=cells.shape.x,
        pixel_origin=b.c,
        pixel_size=b.a,
        n_pixels=pixels.shape.x,
        shift=east,
    )
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
        Lazy where the array is.

    See Also
    --------
    fifesim.base.footprints.regularize
    """
    rows, columns = operators(spreads, grids.geobox(array), pixels, shifts)
    return chunks.resample(partial(regularize, min_valid=min_valid), rows, columns, array, pixels)
