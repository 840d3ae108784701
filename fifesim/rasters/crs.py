"""Rasters that lost their CRS on the way, beside one that has it."""

import numpy as np

from fifesim.rasters import grid as grids


def with_crs_of(array, main):
    """
    A raster that lost its CRS, as results of ``xr.where`` do, with that of another on whose cells it lies.

    Parameters
    ----------
    array, main : xarray.DataArray
        With dimensions (..., y, x).

    Returns
    -------
    array : xarray.DataArray
        What was given where it has a CRS, or ``x`` and ``y`` that are not those of ``main``.
    """
    if {"y", "x"} - set(array.dims) or array.odc.crs is not None or main.odc.crs is None:
        return array
    grid = grids.geobox(main)
    for axis, size in zip(("y", "x"), grids.cell_size(grid), strict=True):
        known, own = (raster.coords.get(axis) for raster in (main, array))
        if known is None or own is None or known.shape != own.shape:
            return array
        if not np.allclose(own.values.astype(float), known.values, rtol=0, atol=1e-3 * size):
            return array
    return grids.place(array, grid)
