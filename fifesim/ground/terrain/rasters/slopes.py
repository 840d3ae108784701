"""Slope and aspect of labelled elevation."""

from __future__ import annotations

import xarray as xr

from fifesim.ground.terrain.rasters.dem import REFERENCE, elevation_grid
from fifesim.ground.terrain.slope import slope_aspect, steepness
from fifesim.rasters import cf
from fifesim.rasters import chunks as chunking
from fifesim.rasters import grid as grids


def slope(dem: xr.DataArray) -> xr.DataArray:
    """
    Slope of the ground.

    Parameters
    ----------
    dem : xarray.DataArray, dims (y, x)
        [m]

    Returns
    -------
    slope : xarray.DataArray, dims (y, x)
        At every cell; one-sided at the edges and beside missing cells. [degree]

    Raises
    ------
    ValueError
        If the elevation is not in metres on a north-up grid in a projected CRS.

    See Also
    --------
    fifesim.ground.terrain.slope.slope_aspect

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> dem = fifesim.flint_hills(grid, seed=7)
    >>> bool((dem.fifesim.slope() < 30).all())
    True
    """
    return _slope_or_aspect(dem, "slope", steepness)


def aspect(dem: xr.DataArray) -> xr.DataArray:
    """
    Azimuth down the slope, clockwise from north.

    Parameters
    ----------
    dem : xarray.DataArray, dims (y, x)
        [m]

    Returns
    -------
    aspect : xarray.DataArray, dims (y, x)
        0 on level ground. [degree]

    Raises
    ------
    ValueError
        As in `slope`.

    See Also
    --------
    fifesim.ground.terrain.slope.slope_aspect

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> dem = fifesim.flint_hills(grid, seed=7)
    >>> aspect = dem.fifesim.aspect()
    >>> bool(((aspect >= 0) & (aspect < 360)).all())
    True
    """
    return _slope_or_aspect(dem, "aspect", lambda *ground: slope_aspect(*ground)[1])


def _slope_or_aspect(dem, name, of_ground):
    grid = elevation_grid(dem)

    def kernel(block):
        return of_ground(block, *grids.cell_size(grid))

    out = grids.place(chunking.neighbourhood(kernel, dem, 1), grid)
    return cf.label(out, name, source=dem, history=f"{name}: central differences", references=REFERENCE)
