"""Slope and aspect of labelled elevation."""

from __future__ import annotations

import numpy as np
import xarray as xr

from fifesim.ground.terrain.rasters.dem import REFERENCE, elevation_grid
from fifesim.ground.terrain.slope import slope_aspect, steepness
from fifesim.rasters import cf, projection
from fifesim.rasters import chunks as chunking
from fifesim.rasters import grid as grids

# The meridian convergence is computed at nodes this far apart, and is linear between. [m]
_NODES = 1000.0


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
    grid = elevation_grid(dem)

    def kernel(block):
        return steepness(block, *grids.cell_size(grid))

    return _labelled(chunking.neighbourhood(kernel, dem, 1), dem, grid, "slope")


def aspect(dem: xr.DataArray) -> xr.DataArray:
    """
    Azimuth down the slope, clockwise from true north.

    Grid north differs from true north by the meridian convergence, which is added at each cell. A projection that does
    not preserve angles adds its own distortion, 0.2 degrees for EPSG:3035 at 30 degrees east.

    Parameters
    ----------
    dem : xarray.DataArray, dims (y, x)
        [m]

    Returns
    -------
    aspect : xarray.DataArray, dims (y, x)
        Named ``ground_slope_direction`` as in CF; 0 on level ground. The convergence is interpolated between nodes 1 km
        apart, within 0.001 degrees farther than 100 km from a pole. [degree]

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
    grid = elevation_grid(dem)
    crs, cell, first = grid.crs.to_wkt(), grids.cell_size(grid), grids.lattice_position(grid)

    def kernel(rows, columns, block):
        steep, from_grid_north = slope_aspect(block, *cell)
        turn = _convergence(crs, cell, first[0] + rows.start, first[1] + columns.start, steep.shape)
        return np.where(steep == 0, 0.0, (from_grid_north + turn) % 360)

    return _labelled(chunking.neighbourhood(kernel, dem, 1, located=True), dem, grid, "aspect")


def _labelled(raster, dem, grid, name):
    """Raster with its grid and the labels of a quantity made from elevation."""
    history = f"{name}: central differences"
    return cf.label(grids.place(raster, grid), name, source=dem, history=history, references=REFERENCE)


def _convergence(crs, cell, row, column, shape):
    """Meridian convergence of cells [degree], a function of their place on the lattice of the CRS alone."""
    nodes, shares = [], []
    for size, start, count in zip(cell, (row, column), shape, strict=True):
        step = max(round(_NODES / size), 1)
        at, inside = np.divmod(start + np.arange(count), step)
        nodes.append((at - at[0], (at[0] + np.arange(at[-1] - at[0] + 2)) * step * size))
        shares.append(inside / step)
    (down, south), (across, east) = nodes
    found = np.radians(projection.convergence_at(crs, *np.broadcast_arrays(east, -south[:, None])))
    share_down, share_across = shares[0][:, None], shares[1]

    def between(values):
        upper, lower = (np.take(values, each, axis=0) for each in (down, down + 1))
        left = (1 - share_down) * upper[:, across] + share_down * lower[:, across]
        right = (1 - share_down) * upper[:, across + 1] + share_down * lower[:, across + 1]
        return (1 - share_across) * left + share_across * right

    # Sine and cosine pass over the jump from 180 to -180 degrees.
    return np.degrees(np.arctan2(between(np.sin(found)), between(np.cos(found))))
