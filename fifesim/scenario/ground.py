"""Ground of a scenario: leaf area or a landscape, its canopies, elevation and horizon."""

import os
from collections.abc import Mapping
from pathlib import Path

import dask
import numpy as np

from fifesim.base.caches import cached
from fifesim.chain.absorbed_light import fpar
from fifesim.chain.landscapes import warn_of_tallgrass
from fifesim.grids import grid as grids
from fifesim.grids.sites import on_fife_site
from fifesim.ground.canopy.optics import band_background, band_leaf_optics
from fifesim.ground.landscape.classes import CoverClass, Field, class_table
from fifesim.ground.landscape.cover import PATTERNS, Patches
from fifesim.ground.landscape.distribution import lai_distribution
from fifesim.ground.landscape.labels import landscape
from fifesim.ground.landscape.lai_labels import lai_scene, lai_window
from fifesim.ground.landscape.learned_labels import Landscape
from fifesim.ground.terrain import labels as terrain_labels
from fifesim.ground.terrain import sky_labels
from fifesim.ground.terrain.elevation_labels import fine_dem, flint_hills, known_dem, source_dem
from fifesim.ground.terrain.sky_labels import horizon_places
from fifesim.ground.terrain.source_labels import beside_altitude, elevation_grid

# Resolution of the synthetic hills around a scene, equal to the resolution of its horizons. [m]
_HILLS_AROUND = 30.0

# A horizon has 32 numbers per cell, so a chunk of this size takes 16 MB. [cell]
_AROUND_CHUNK = 252


def elevation(scenario, grid, chunks=None):
    """Elevation of a scenario, the horizon of the surrounding land, and their attributes; None on flat ground."""
    terrain = scenario.terrain
    if terrain.dem == "flat":
        return None, None, {}
    if terrain.dem == "flint-hills":
        # One extra cell on each side, so that slopes at the border are exact.
        dem = flint_hills(grid.pad(1), terrain.seed, chunks=chunks)
        wider = _padded(grid, terrain.horizon_reach)
        around = flint_hills(wider, terrain.seed, chunks=_AROUND_CHUNK)
        middle = flint_hills(wider[_middle(wider.shape)], terrain.seed)
        reach = dict.fromkeys(("north", "east", "south", "west"), terrain.horizon_reach)
    else:
        fill, units = terrain.fill, terrain.vertical_units
        dem = fine_dem(terrain.dem, grid, chunks=chunks, fill=fill, vertical_units=units)
        around, reach = source_dem(
            terrain.dem, grid, terrain.horizon_reach, chunks="auto", fill=fill, vertical_units=units
        )
        # Reads a few blocks of the file now, to fail early if the sun is below the horizon.
        middle = around[_middle(around.shape)].compute(scheduler="synchronous")
    horizon = sky_labels.horizon(around, reach=terrain.horizon_reach, beside=dem)
    _check_sun(middle, around, horizon, scenario.sun_and_view())
    return dem, horizon, reach


def scenario_light_on_hills(scenario, grid, geometry):
    """Last arguments of `slope_reflectance` for synthetic hills, in memory, identical to `elevation`; or None."""
    # None if the sun is so low that all surrounding land must be checked.
    terrain = scenario.terrain
    if terrain.dem != "flint-hills":
        return None
    around = _padded(grid, terrain.horizon_reach)
    if not terrain_labels.steepest(around[_middle(around.shape)], terrain.seed) < 90 - geometry.sza:
        return None
    return terrain_labels.light_on_hills(
        grid, around, terrain.seed, terrain.horizon_reach, geometry, scenario.atmosphere.altitude
    )


def light_of(scenario, grid, geometry):
    """Last arguments of `slope_reflectance` for the slopes of a scenario, in memory; None on level ground."""
    if scenario.terrain.dem == "flat":
        return None
    light = scenario_light_on_hills(scenario, grid, geometry)
    if light is not None:
        return light
    dem, horizon = in_memory(*elevation(scenario, grid)[:2])
    return terrain_labels.light_on_slopes(beside_altitude(dem, scenario.atmosphere.altitude), grid, geometry, horizon)


def in_memory(dem, horizon):
    """Elevation and horizon in memory; the horizon covers only the grid of the elevation."""
    # For so few cells, starting threads takes longer than the computation.
    with dask.config.set(scheduler="synchronous"):
        if horizon is None:
            return dem if dem is None else dem.compute(), None
        _, (rows, columns) = horizon_places(elevation_grid(dem), horizon)
        # A scene of a thousand pixels needs only 1 % of the terrain within the horizon reach.
        return dem.compute(), horizon.isel(y=rows, x=columns).compute()


def cut(raster, grid):
    """Crop a raster to a grid of the same cells."""
    rows, columns = grids.lattice_offset(grids.geobox(raster), grid)
    return raster.isel(y=slice(rows, rows + grid.shape.y), x=slice(columns, columns + grid.shape.x))


def _middle(shape):
    return tuple(slice(max(size // 2 - 8, 0), size // 2 + 8) for size in shape)


def _check_sun(middle, around, horizon, geometry):
    """Raise ValueError if the sun is below the horizon everywhere, which chunks of a lazy elevation cannot detect."""
    # If all slopes are less steep than the solar elevation, all face the sun, and terrain that shades others is lit.
    if float(terrain_labels.slope(middle).max()) < 90 - geometry.sza:
        return
    light = terrain_labels.illumination(around, geometry, horizon)
    for block in light.data.blocks.ravel():
        if np.any(block.compute() > 0):
            return
    # The sun shines nowhere. The same computation in memory raises the error.
    terrain_labels.illumination(around.compute(), geometry, horizon.compute())


def _padded(grid, margin):
    """Coarse grid around a fine grid and a margin, aligned with the origin of the CRS."""
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


def ground_scene(scenario, grid, chunks=None):
    """Ground of a scenario: a Dataset with ``lai`` [m2 m-2], ``cover`` and varying properties."""
    land = scenario.ground
    if scenario.learned:
        scene = _learned(scenario, grid, chunks)
    elif not scenario.is_one():
        scene = _landscape(scenario, grid, chunks)
    elif land.lai_file:
        scene = lai_window(land.lai_file, grid, chunks=chunks).to_dataset(name="lai")
    else:
        lai = lai_scene(grid, land.distribution, arp=land.arp, seed=land.seed, method=land.method, chunks=chunks)
        scene = lai.to_dataset(name="lai")
    scene["lai"].attrs |= scenario._made_on
    return scene


def _learned(scenario, grid, chunks):
    """Learned landscape of a scenario, with the elevation within reach of the grid."""
    terrain, seed, drawn = scenario.terrain, scenario.ground.seed, drawn_properties(scenario)
    land = learned_landscape(scenario.learned)
    wide, others = land.around(grid), {name: each for name, each in drawn.items() if name not in land.properties}
    given = {name: {"mean": each.mean, "sd": each.sd} for name, each in drawn.items()}
    properties = {name: each.model_copy(update=given[name]) for name, each in land.properties.items() if name in given}
    if terrain.dem == "flat":
        dem = None
    elif terrain.dem == "flint-hills":
        dem = flint_hills(wide, terrain.seed, chunks=chunks)
    else:
        fill, units = terrain.fill, terrain.vertical_units
        dem = known_dem(terrain.dem, wide, chunks, fill, units)
    scene = land.model_copy(update={"properties": properties}).simulate(grid, dem, seed=seed, chunks=chunks)
    if others:
        found = landscape(grid, lai=scene["lai"], seed=seed, chunks=chunks, **others)
        scene = scene.assign({name: found[name] for name in others})
    return scene


def _landscape(scenario, grid, chunks):
    land, own = scenario.ground, scenario.landscape
    if own.cover == "none":
        cover, classes = None, CoverClass("ground", lai=land.distribution)
    else:
        cover, classes = own.cover, scenario.class_table()
    if own.cover in PATTERNS:
        cover = Patches(own.cover, own.size, _shares(scenario))
    return landscape(
        grid,
        cover=cover,
        classes=classes,
        lai=land.lai_file,
        arp=land.arp,
        seed=land.seed,
        chunks=chunks,
        **drawn_properties(scenario),
    )


def warn_of_canopy(scenario):
    """Warn if the default tallgrass optics of FIFE are used for an LAI map or another site."""
    own = scenario.ground.lai_file
    if own or not (scenario._made_on or on_fife_site(scenario.geobox())):
        name, classes = Path(own).name if own else "the scene", _classes(scenario)
        # Drawn properties are represented by their means.
        cells = {name: each.mean for name, each in drawn_properties(scenario).items()}
        warn_of_tallgrass(name, class_table(classes) if classes else (), canopy_of(scenario), cells)


def drawn_properties(scenario):
    """Ground properties of a scenario that vary as fields, by name."""
    land, own = scenario.ground, scenario.landscape
    described = learned_landscape(scenario.learned).properties if scenario.learned else {}
    # A property of a learned landscape is uniform if [ground] has its value and no deviation is given.
    taken = {name: each for name, each in described.items() if name not in land.model_fields_set}
    return {
        name: Field(mean=taken[name].mean if name in taken else getattr(land, name), sd=deviation, arp=land.arp)
        for name, deviation in ({name: each.sd for name, each in taken.items()} | own.deviations).items()
        if deviation
    }


def learned_landscape(name):
    """Learned landscape by name or file, read once."""
    return _read_once(name, os.stat(name).st_mtime_ns if os.path.exists(name) else None)


@cached(8, "learned landscapes")
def _read_once(name, changed):
    return Landscape.read(name)


def check_leaf_area(scenario):
    """Check that the canopy of each stand allows the largest LAI of its distribution."""
    land, classes = scenario.ground, _classes(scenario)
    if land.lai_file:
        return
    drawn = dict.fromkeys(drawn_properties(scenario))
    stands = [(f"classes.{each.name}", each.lai, each.canopy.over(land.canopy())) for each in classes]
    for place, distribution, canopy in stands or [("ground", land.distribution, land.canopy())]:
        try:
            canopy.replace(**drawn).check_lai(lai_distribution(distribution).support()[1])
        except ValueError as error:
            raise ValueError(f"{place}.{error}") from None


def canopy_of(scenario):
    """Canopy from the keys of [ground], without properties that are drawn or defined by every class."""
    found = scenario.ground.canopy()
    left_out = {name for name in found.given if _all_have(scenario, name)} | set(drawn_properties(scenario))
    return found.replace(**dict.fromkeys(left_out))


def spectral_canopy(scenario, canopy):
    """Canopy of a complete scenario whose optics by band are replaced by spectra if they are the defaults."""
    own = scenario.sensor
    bands = [band.response for band in own.description.select(own.bands)]
    defaults = {"leaf_optics": band_leaf_optics(bands), "background": band_background(bands)}
    for name, default in defaults.items():
        given = getattr(canopy, name)
        if isinstance(given, Mapping) and set(given) == {band.name for band in bands}:
            values = np.array([given[band.name] for band in bands]).T
            if np.allclose(values, default, rtol=1e-6):
                canopy = canopy.replace(**{name: None})
    return canopy


def truth_of(scenario, setup, land):
    """True ground properties of a scenario by cell, for comparison with an image."""
    absorbed = {name: absorbed_light(scenario, setup, land, kind) for name, kind in fpar_kinds(scenario).items()}
    varying = {name: each for name, each in land.data_vars.items() if name not in ("lai", "cover") and each.ndim == 2}
    return {"lai": land["lai"], **absorbed, **varying}


def fpar_kinds(scenario):
    """Leaves whose FPAR is part of the truth, by the name of the variable."""
    has_dead_leaves = any(numbers_of_stands(scenario, "brown")) or "brown" in drawn_properties(scenario)
    return {"fpar": "all"} | ({"green_fpar": "green"} if has_dead_leaves else {})


def absorbed_light(scenario, setup, land, leaves="all"):
    """Fraction of light absorbed by leaves of a scenario, dims (y, x). [1]"""
    fpar_inf = scenario.ground.fpar_inf
    return fpar(land, canopy=setup.canopy, geometry=setup.geometry, leaves=leaves, fpar_inf=fpar_inf)


def numbers_of_stands(scenario, name):
    """Values of a property in the stands of a scenario that do not draw it."""
    ground = [] if _all_have(scenario, name) else [getattr(scenario.ground, name)]
    return [*ground, *(getattr(each.canopy, name) for each in _classes(scenario) if name in each.canopy.given)]


def _all_have(scenario, name):
    """Whether every class of cover defines a property."""
    classes = _classes(scenario)
    return bool(classes) and all(name in each.canopy.given for each in classes)


def _classes(scenario):
    return list(scenario.class_table().values()) if scenario.landscape.cover != "none" else []


def _shares(scenario):
    """Area fractions of the drawn classes; None if they are equal."""
    shares = {name: stand.share for name, stand in scenario.classes.items()}
    return shares if any(shares.values()) else None
