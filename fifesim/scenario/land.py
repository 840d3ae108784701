"""Elevation of a scenario, and the horizon that the land around makes."""

import numpy as np

from fifesim.ground.terrain.rasters import hills_light, slopes
from fifesim.ground.terrain.rasters import light as terrain_raster
from fifesim.ground.terrain.rasters import sky as sky_raster
from fifesim.ground.terrain.rasters.dem import elevation_grid
from fifesim.ground.terrain.rasters.elevation import fine_dem, source_dem
from fifesim.ground.terrain.rasters.hills import flint_hills
from fifesim.ground.terrain.rasters.places import horizon_places
from fifesim.rasters import grid as grids

# The synthetic hills around a scene are made at this resolution, as its own horizons are. [m]
_HILLS_AROUND = 30.0

# A horizon has 32 numbers a cell: 16 MB in chunks of this size. [cell]
_AROUND_CHUNK = 252


def elevation(scenario, grid, chunks=None):
    """
    Elevation of a scenario, and the horizon that the land around makes.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
    grid : odc.geo.geobox.GeoBox
        Of ground cells.
    chunks : mapping or int, optional
        Makes the elevation lazy.

    Returns
    -------
    dem : xarray.DataArray, dims (y, x), or None
        On the grid or a cell more on each side; None where the ground is flat. [m]
    horizon : xarray.DataArray, dims (direction, y, x), or None
        Lazy. [degree]
    reach : dict of str to float
        How far the elevation is known beyond each side of the grid, up to the reach of horizons. [m]

    Raises
    ------
    ValueError
        If the elevation cannot be had, or the sun reaches no slope.
    """
    terrain = scenario.terrain
    if terrain.dem == "flat":
        return None, None, {}
    if terrain.dem == "flint-hills":
        # One cell more on each side: slopes at the border are those of the wider land.
        dem = flint_hills(grid.pad(1), terrain.seed, chunks=chunks)
        wider = _padded(grid, terrain.horizon_reach)
        around = flint_hills(wider, terrain.seed, chunks=_AROUND_CHUNK)
        middle = flint_hills(wider[_middle(wider.shape)], terrain.seed)
        reach = dict.fromkeys(("north", "east", "south", "west"), terrain.horizon_reach)
    else:
        options = {"fill": terrain.fill, "vertical_units": terrain.vertical_units}
        dem = fine_dem(terrain.dem, grid, chunks=chunks, **options)
        around, reach = source_dem(terrain.dem, grid, terrain.horizon_reach, chunks="auto", **options)
        # A few blocks of the file, at once: whether the sun shines is asked before anything is made.
        middle = around[_middle(around.shape)].compute(scheduler="synchronous")
    horizon = sky_raster.horizon(around, reach=terrain.horizon_reach, beside=dem)
    _check_sun(middle, around, horizon, scenario.sun_and_view())
    return dem, horizon, reach


def light_on_hills(scenario, grid, geometry):
    """
    What slopes of the synthetic hills make their light of, in memory: the bits of `elevation` and of what follows it.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
    grid : odc.geo.geobox.GeoBox
        Of ground cells.
    geometry : fifesim.base.geometry.Geometry

    Returns
    -------
    light : tuple or None
        The last arguments of `fifesim.ground.terrain.lit_slopes.slope_reflectance` but the air's. None where the sun is
        so low that all of the land around has to be asked whether it shines, or the ground is none of these hills.

    Raises
    ------
    ValueError
        If the sun reaches no slope.
    """
    terrain = scenario.terrain
    if terrain.dem != "flint-hills":
        return None
    around = _padded(grid, terrain.horizon_reach)
    if not hills_light.steepest(around[_middle(around.shape)], terrain.seed) < 90 - geometry.sza:
        return None
    told = terrain.seed, terrain.horizon_reach, geometry, scenario.atmosphere.altitude
    return hills_light.light_on_hills(grid, around, *told)


def in_memory(dem, horizon):
    """
    Elevation and horizon in memory, of the horizon what lies above the elevation.

    Parameters
    ----------
    dem, horizon : xarray.DataArray or None
        From `elevation`.

    Returns
    -------
    dem, horizon : xarray.DataArray or None
    """
    if horizon is None:
        return dem if dem is None else dem.compute(), None
    _, (rows, columns) = horizon_places(elevation_grid(dem), horizon)
    # A scene of a thousand pixels needs a hundredth of what lies within reach.
    return dem.compute(), horizon.isel(y=rows, x=columns).compute()


def cut(raster, grid):
    """
    A raster cut to a grid of its cells.

    Parameters
    ----------
    raster : xarray.DataArray, dims (..., y, x)
    grid : odc.geo.geobox.GeoBox
        Within that of the raster.

    Returns
    -------
    raster : xarray.DataArray, dims (..., y, x)
    """
    rows, columns = grids.lattice_offset(grids.geobox(raster), grid)
    return raster.isel(y=slice(rows, rows + grid.shape.y), x=slice(columns, columns + grid.shape.x))


def _middle(shape):
    return tuple(slice(max(size // 2 - 8, 0), size // 2 + 8) for size in shape)


def _check_sun(middle, around, horizon, geometry):
    """Somewhere the sun must shine: on lazy elevation no chunk knows whether it reaches another."""
    # Where no slope is as steep as the sun is high, all face it, and what hides it from them is lit itself.
    if float(slopes.slope(middle).max()) < 90 - geometry.sza:
        return
    light = terrain_raster.illumination(around, geometry, horizon)
    for block in light.data.blocks.ravel():
        if np.any(block.compute() > 0):
            return
    # Nowhere: the same on elevation in memory says so.
    terrain_raster.illumination(around.compute(), geometry, horizon.compute())


def _padded(grid, margin):
    """Coarse grid on multiples of its cells from the origin of the CRS that reaches a margin past a fine one."""
    height, width = grids.cell_size(grid)
    down, across = max(round(_HILLS_AROUND / height), 1) * height, max(round(_HILLS_AROUND / width), 1) * width
    box = grid.boundingbox
    west, east = np.floor((box.left - margin) / across), np.ceil((box.right + margin) / across)
    south, north = np.floor((box.bottom - margin) / down), np.ceil((box.top + margin) / down)
    return grids.grid_at(
        grid.crs.to_wkt(),
        west * across,
        north * down,
        width=(east - west) * across,
        height=(north - south) * down,
        cell=(down, across),
    )
