"""The light on the synthetic hills of a small scene, in memory and without labels."""

from functools import partial

import numpy as np

from fifesim.ground.terrain import horizon as horizons
from fifesim.ground.terrain.flint_hills import elevation, elevation_around
from fifesim.ground.terrain.rasters.dem import look_at_altitude
from fifesim.ground.terrain.rasters.places import between_places, places_of, places_on
from fifesim.ground.terrain.rasters.sky import DIRECTIONS, sky_under, useful_reach
from fifesim.ground.terrain.slope import steepness
from fifesim.rasters import chunks as chunking
from fifesim.rasters import grid as grids
from fifesim.rasters.carried_grid import as_carried, centres_of
from fifesim.rasters.directions import from_grid_north
from fifesim.rasters.windows import gather

# Distance at which elevations of the hills are independent, as their labels say. [m]
_RESOLUTION = 30.0


def light_on_hills(grid, around, seed, reach, geometry, altitude):
    """
    What slopes of the hills make their light of: the last arguments of `slope_reflectance` but the air's.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox
        Of the cells.
    around : odc.geo.geobox.GeoBox
        Coarse grid of the land that makes the horizon, on multiples of its cells.
    seed : int
        Of the hills.
    reach : float
        Of horizons. [m]
    geometry : fifesim.base.geometry.Geometry
    altitude : float
        Of the atmosphere. [km]

    Returns
    -------
    elevation, sky, cell, geometry
        To the bit those of `fifesim.ground.terrain.rasters.lit_slopes.light_on_slopes`, of the hills of these grids and
        their horizon.

    Raises
    ------
    ValueError
        If the sun reaches no slope.
    """
    wide = grid.pad(1)
    northing, easting = centres_of(wide)
    data = look_at_altitude(elevation(seed, northing, easting), altitude)
    carried, turned = as_carried(grid), from_grid_north(geometry, as_carried(grid))
    zenith, places = _horizon(around, seed, reach, as_carried(wide))
    layers = sky_under(zenith, data, places, turned)
    of_block, reads = between_places(carried, (1, 1), data, layers, places, turned)
    return chunking.windows(partial(of_block, lambda *light: light), reads, tuple(carried.shape))


def steepest(grid, seed):
    """
    Slope of the steepest cell of the hills on a coarse grid.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox
        On multiples of its cells.
    seed : int

    Returns
    -------
    slope : float
        [degree]
    """
    land = np.pad(_land(grid, seed), 1, constant_values=np.nan)
    return float(steepness(land, *grids.cell_size(grid)).max())


def _land(grid, seed):
    return elevation_around(seed, grids.cell_size(grid), *grids.lattice_position(grid), tuple(grid.shape))


def _horizon(around, seed, reach, grid):
    """Horizon at those places of the land around that lie on a grid, and the places. [degree]"""
    whole = places_of(as_carried(around), _RESOLUTION)
    places, cut = places_on(grid, as_carried(whole.coarse))
    useful = useful_reach(reach, whole)
    margin = horizons.horizon_margin(*whole.cell, useful)
    window = tuple(slice(part.start - wide, part.stop + wide) for part, wide in zip(cut, margin, strict=True))
    land = gather(_land(around, seed)[np.ix_(*whole.cells)], window)
    return horizons.horizon_zenith(land, *whole.cell, horizons.azimuths(DIRECTIONS), useful), places
