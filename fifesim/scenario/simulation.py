"""Figure 1 end to end: a scenario as scene, image and truth."""

import numpy as np
import xarray as xr

from fifesim.analysis.rasters import regression as analysis
from fifesim.chain import steps as chain
from fifesim.ground.canopy import raster as ground
from fifesim.ground.landscape.raster import lai_scene, open_lai
from fifesim.ground.terrain.rasters import light as terrain_raster
from fifesim.ground.terrain.rasters import sky as sky_raster
from fifesim.ground.terrain.rasters import slopes
from fifesim.ground.terrain.rasters.elevation import fine_dem, source_dem
from fifesim.ground.terrain.rasters.hills import flint_hills
from fifesim.rasters import grid as grids
from fifesim.scenario.scenario import Scenario
from fifesim.sensor import raster as sensor
from fifesim.sensor.description.instruments import instrument as find_instrument

# The synthetic hills around a scene are made at this resolution, as its own horizons are. [m]
_HILLS_AROUND = 30.0

# A horizon has 32 numbers a cell: 16 MB in chunks of this size. [cell]
_AROUND_CHUNK = 252


def simulate(scenario, chunks="auto"):
    """
    Scene, image and truth of a scenario.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
    chunks : mapping or int, optional
        Of the scene; by default whole tiles of the random field.

    Returns
    -------
    run : xarray.DataTree
        Lazy. ``scene`` holds ``lai`` and ``surface_reflectance`` by cells, and ``dem`` where the ground is not flat;
        ``image`` the digital numbers ``dn`` and their ``ndvi``; ``truth`` the means of ``lai`` and ``fpar`` over the
        ground of the pixels of the gridded product, whatever the interval. With terrain, ``terrain`` holds ``dem``,
        ``slope`` and ``kt`` over the same ground; its attributes say how far the elevation is known beyond the scene.
        ``level`` holds the digital numbers on level ground.

    Raises
    ------
    ValueError
        If the scenario asks for what cannot be.
    """
    if not isinstance(scenario, Scenario):
        raise TypeError(f"simulate takes a Scenario, got {type(scenario).__name__}: see fifesim.read_scenario")
    grid, geometry = scenario.geobox(), scenario.sun_and_view()
    instrument = find_instrument(scenario.sensor.instrument)
    pixels = grids.aligned(grid, scenario.sensor.pixel or instrument.gsd)
    interval, min_valid = scenario.sensor.interval, scenario.sensor.min_valid
    taken = {"offset": scenario.sensor.offset, "noise": scenario.sensor.noise, "seed": scenario.sensor.seed}
    taken |= {"onto": pixels} if interval == "product" else {"interval": interval}

    def sensed(reflectance):
        toa = chain.to_toa(reflectance, adjacency=scenario.atmosphere.adjacency)
        return sensor.sense(toa, instrument, min_valid=min_valid, **taken)

    def means(array):
        return analysis.aggregate(array, grids.cell_size(pixels)[0], min_valid=min_valid)

    lai = leaf_area(scenario, grid, chunks)
    land = scenario.ground
    fpar = ground.fpar(lai, geometry=geometry, leaf_angles=land.leaf_angles, fpar_inf=land.fpar_inf)
    level = surface_reflectance(scenario, lai, instrument)
    nodes = {"scene": {"lai": lai}, "truth": {"lai": means(lai), "fpar": means(fpar)}}
    dem, horizon, reach = elevation(scenario, grid, chunks)
    if dem is None:
        reflectance = level
    else:
        reflectance = surface_reflectance(scenario, lai, instrument, dem=dem, horizon=horizon)
        kt = chain.kt(level, dem, horizon=horizon)
        dem, slope = (_cut(raster, grid) for raster in (dem, slopes.slope(dem)))
        nodes["scene"]["dem"] = dem
        nodes["terrain"] = {"dem": means(dem), "slope": means(slope), "kt": means(kt)}
        nodes["level"] = {"dn": sensed(level)}
    nodes["scene"]["surface_reflectance"] = reflectance
    image = sensed(reflectance)
    nodes["image"] = {"dn": image} | ({"ndvi": chain.ndvi(image)} if _has_ndvi(image) else {})
    tree = xr.DataTree.from_dict({name: xr.Dataset(arrays) for name, arrays in nodes.items()})
    if reach:
        tree["terrain"].attrs = {f"reach_{side}": distance for side, distance in reach.items()}
    return tree


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
        around, reach = source_dem(terrain.dem, grid, terrain.horizon_reach, **options)
        middle, around = around[_middle(around.shape)], around.chunk(_AROUND_CHUNK)
    horizon = sky_raster.horizon(around, reach=terrain.horizon_reach, beside=dem)
    _check_sun(middle, around, horizon, scenario.sun_and_view())
    return dem, horizon, reach


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


def leaf_area(scenario, grid, chunks=None):
    """
    Leaf area of a scenario.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
    grid : odc.geo.geobox.GeoBox
        Of ground cells.
    chunks : mapping or int, optional
        Makes it lazy.

    Returns
    -------
    lai : xarray.DataArray, dims (y, x)
        [m2 m-2]
    """
    land = scenario.ground
    if land.lai_file:
        return open_lai(land.lai_file, grid, chunks=chunks)
    return lai_scene(grid, land.distribution, arp=land.arp, seed=land.seed, method=land.method, chunks=chunks)


def surface_reflectance(scenario, lai, instrument, dem=None, horizon=None):
    """
    Reflectance of the ground of a scenario in the bands of its sensor.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
    lai : xarray.DataArray, dims (y, x)
        [m2 m-2]
    instrument : fifesim.sensor.description.instruments.Instrument
    dem, horizon : xarray.DataArray, optional
        From `elevation`; level ground without.

    Returns
    -------
    reflectance : xarray.DataArray, dims (band, y, x)
        [1]
    """
    land = scenario.ground
    return chain.surface_reflectance(
        lai,
        instrument,
        bands=scenario.sensor.bands,
        atmosphere=scenario.model_atmosphere(),
        geometry=scenario.sun_and_view(),
        leaf_optics=land.leaf_optics(),
        background=land.below_canopy(),
        leaf_angles=land.leaf_angles,
        hotspot=land.hotspot,
        upwelling=scenario.terrain.upwelling,
        dem=dem,
        horizon=horizon,
    )


def _cut(raster, grid):
    """A raster cut to a grid of its cells."""
    rows, columns = grids.lattice_offset(grids.geobox(raster), grid)
    return raster.isel(y=slice(rows, rows + grid.shape.y), x=slice(columns, columns + grid.shape.x))


def _padded(grid, margin):
    """Coarse grid on multiples of its cells from the origin of the CRS that reaches a margin past a fine one."""
    down, across = (max(round(_HILLS_AROUND / size), 1) * size for size in grids.cell_size(grid))
    box = grid.boundingbox
    west, east = (np.floor((box.left - margin) / across), np.ceil((box.right + margin) / across))
    south, north = (np.floor((box.bottom - margin) / down), np.ceil((box.top + margin) / down))
    size = (east - west) * across, (north - south) * down
    return grids.grid_at(grid.crs.to_wkt(), west * across, north * down, *size, (down, across))


def _has_ndvi(image):
    wavelength = image["wavelength"].values
    return bool(
        np.any((wavelength >= 0.6) & (wavelength <= 0.7)) and np.any((wavelength >= 0.75) & (wavelength <= 1.0))
    )
