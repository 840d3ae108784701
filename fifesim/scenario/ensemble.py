"""
Many realisations of scenarios in memory. Small scenes are computed as plain arrays, without dask graphs.

A scene of 20 x 20 pixels takes 5 ms of processor time. `fifesim.simulate` in memory takes 25 ms for the same result.
"""

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import dask
import numpy as np
import xarray as xr
from odc.geo.geobox import GeoBox

from fifesim.base.caches import cached
from fifesim.chain.driver import Driver, cell_block_means, varying_parts
from fifesim.chain.landscapes import aggregate
from fifesim.chain.setup import Setup, reflectance_of
from fifesim.grids import cf, directions
from fifesim.grids import grid as grids
from fifesim.grids.grid import as_carried
from fifesim.ground.landscape.lai_labels import scene_cells
from fifesim.scenario.ground import elevation, fpar_kinds, ground_scene, in_memory, light_of, truth_of
from fifesim.scenario.keys import KEYS
from fifesim.scenario.simulation import setup_of, simulate, with_margin
from fifesim.sensor.instrument_labels import attributes_of

# Coordinates of an image that describe its illumination and view.
LIGHT = ("sza", "saa", "vza", "vaa", "earth_sun_distance")

# Keys by section that plain arrays use. `simulate` computes a scenario whose other keys differ from their defaults.
# The listed keys of clouds have no effect on a clear sky, and `varying_parts` names the clouds of another sky.
_STAND = " ".join(KEYS) + " distribution arp leaf leaf_reflectance leaf_transmittance brown_leaf"
_STAND += " background background_spectra"
_KNOWN = {
    "grid": "crs west north width height cell",
    "ground": f"{_STAND} seed method lai_file fpar_inf",
    "landscape": "cover size deviations arps coarser covary",
    "classes": f"{_STAND} share code",
    "terrain": "dem seed fill vertical_units horizon_reach upwelling",
    "geometry": "time latitude longitude sza saa vza vaa",
    "atmosphere": "profile aerosol visibility aot altitude h2o o3 engine",
    "clouds": "thickness deviation length base top seed mask",
    "sensor": "instrument bands pixel interval offset response noise noise_model seed min_valid",
}
_SUPPORTED = {section: frozenset(keys.split()) for section, keys in _KNOWN.items()}

# Larger scenes are computed in chunks. [cell]
_LARGEST = 4_000_000


def realise(scenario, *, complete=False):
    """Image and truth of a scenario in memory, identical to the result of `fifesim.simulate`."""
    # Consecutive scenes share intermediate results if they have the same grid, atmosphere, canopy or instrument, and
    # tiles of the random field if they have the same seed and arp.
    grid, setup = scenario.geobox(), setup_of(scenario)
    if _is_small(grid) and not unsupported_parts(scenario, setup):
        scene = _scene(scenario, grid, setup, complete)
        return {"image": _labelled_image(scene), "truth": _labelled_truth(scenario, scene)}
    run = simulate(scenario, chunks=None if _is_small(grid) else "auto", complete=complete)
    return {name: run[name].to_dataset().compute(scheduler="synchronous") for name in ("image", "truth")}


def realise_arrays(scenario, *, complete=False):
    """Image and truth as arrays, for small scenes where labels would take longer than the simulation."""
    grid, setup = scenario.geobox(), setup_of(scenario)
    if not _is_small(grid) or unsupported_parts(scenario, setup):
        image, truth = realise(scenario, complete=complete).values()
        return _values(image) | {name: image[name].values for name in LIGHT}, _values(truth)
    scene = _scene(scenario, grid, setup, complete)
    truth = _truth(scenario, scene)
    light = {name: getattr(setup.geometry, name) for name in LIGHT}
    return _image(scene) | light, truth if isinstance(truth, dict) else _values(truth)


def uniform_reflectance(scenario, ground):
    """Planetary reflectance of pixels of uniform ground without noise, shape (band, y, x). [1]"""
    setup = setup_of(scenario)
    if parts := unsupported_parts(scenario, setup):
        raise ValueError(f"uniform ground does not support {', '.join(parts)}: use pixels='chain'")
    driver = _driver(scenario, setup)
    if scenario.landscape.is_one():
        return driver.toa(driver.reflectance(ground["lai"]))
    pixels = grids.aligned_grid(as_carried(scenario.geobox()), scenario.sensor.size)
    variables = {name: xr.Variable(("y", "x"), each, {"units": "1"}) for name, each in ground.items()}
    return driver.toa(reflectance_of(setup, _placed(variables, grids.coordinates(pixels))).values)


def unsupported_parts(scenario, setup):
    """Names of the parts of a setup, or of the keys of its scenario, that plain arrays do not support."""
    return varying_parts(setup) or [
        ".".join((*place, key))
        for place, section in scenario.sections().items()
        for key in type(section).model_fields.keys() - _SUPPORTED.get(place[0], ())
        if getattr(section, key) != type(section).model_fields[key].get_default(call_default_factory=True)
    ]


def _values(dataset):
    return {str(name): each.values for name, each in dataset.data_vars.items()}


def _is_small(grid):
    return grid.shape.x * grid.shape.y <= _LARGEST


class _Scene(NamedTuple):
    """Land and reflectance of a scenario in memory. The land is a dict of arrays for one stand, else a dataset."""

    driver: Driver
    setup: Setup
    grid: GeoBox
    """Cells of the scene, without a margin."""
    land: np.ndarray | xr.Dataset
    """Slices of the scene within the wider grid."""
    lit_grid: GeoBox
    """Cells of the reflectance, with the margin of a complete image."""
    reflectance: np.ndarray


def _scene(scenario, grid, setup, complete):
    """Scene of a scenario."""
    driver, own, inside, wide = _driver(scenario, setup), scenario.ground, {}, grid
    if complete:
        wide, setup, inside = with_margin(scenario, setup)
    wide = as_carried(wide)
    if not scenario.landscape.is_one() or own.lai_file:
        with dask.config.set(scheduler="synchronous"):
            dem, horizon = in_memory(*elevation(scenario, wide)[:2])
        land = ground_scene(scenario, wide, dem=dem)
        reflectance = reflectance_of(replace(setup, dem=dem, horizon=horizon), land).values
        return _Scene(driver, setup, grid, land.isel(inside), wide, reflectance)
    lai = scene_cells(wide, own.distribution, own.arp, own.seed, own.method)
    reflectance, light = driver.reflectance(lai), light_of(scenario, wide, setup.geometry)
    if light is not None:
        reflectance = driver.on_slopes(reflectance, light)
    return _Scene(driver, setup, grid, lai[tuple(inside.values())], wide, reflectance)


def _image(scene):
    """Digital numbers of a scene, and their NDVI."""
    driver = scene.driver
    dn = driver.image(driver.toa(scene.reflectance), scene.lit_grid, scene.setup)
    return {"dn": dn, "ndvi": driver.ndvi(driver.planetary(dn))} if driver.shows_ndvi else {"dn": dn}


def _labelled_image(scene):
    """Image of a scene with its coordinates."""
    image, driver = _image(scene), scene.driver
    gain, offset, bits = driver.scale
    along = {"band": [band.name for band in driver.bands], "wavelength": [band.wavelength for band in driver.bands]}
    along |= {"gain": gain, "offset": offset}
    along |= {"compression": driver.compression} if driver.compression.any() else {}
    along |= {"solar_irradiance": driver.irradiance}
    own = attributes_of(driver.instrument) | {"atmosphere": driver.air.text, "recorded_by": driver.instrument.name}
    fill = {"dn": {"_FillValue": image["dn"].dtype.type(0), "saturated": 2**bits - 1}}
    variables = {
        name: xr.Variable(("band", "y", "x")[-each.ndim :], each, cf.attributes(name) | own | fill.get(name, {}))
        for name, each in image.items()
    }
    pixels = driver.pixels(scene.lit_grid, scene.setup)[0]
    coords = grids.coordinates(pixels) | cf.band_coordinates(**along)
    return _placed(variables, coords, directions.coordinates_of(scene.setup.geometry))


def _truth(scenario, scene):
    """Block means for the truth: a dict of arrays for one stand, else a dataset."""
    size, own = scenario.sensor.size, scene.setup
    if not scenario.landscape.is_one():
        return aggregate(truth_of(scenario, own, scene.land), size, min_valid=own.min_valid)
    lai = scene.land if isinstance(scene.land, np.ndarray) else scene.land["lai"].values
    kinds, fpar_inf = fpar_kinds(scenario), scenario.ground.fpar_inf
    cells = {"lai": lai} | {name: scene.driver.fpar(lai, fpar_inf, leaves) for name, leaves in kinds.items()}
    return {name: cell_block_means(each, scene.grid, size, own.min_valid) for name, each in cells.items()}


def _labelled_truth(scenario, scene):
    """Truth of a scene with its coordinates."""
    truth = _truth(scenario, scene)
    if not isinstance(truth, dict):
        return truth
    variables = {name: xr.Variable(("y", "x"), means, cf.attributes(name)) for name, means in truth.items()}
    return _placed(variables, grids.coordinates(grids.aligned_grid(as_carried(scene.grid), scenario.sensor.size)))


def _placed(variables, coordinates, others=None):
    """Dataset on a grid, without comparing coordinates that were made for that grid."""
    for each in variables.values():
        each.encoding = {"grid_mapping": "spatial_ref"}
    return xr.Dataset(variables, coordinates | (others or {}))


def _driver(scenario, setup):
    """Driver of a setup, shared by scenarios that differ only in place and seeds."""
    others = {"grid": True, "ground": {"seed", "arp", "distribution", "method"}, "sensor": {"seed", "offset"}}
    if scenario.files:
        # The content of a file may change while its name stays the same.
        return Driver(setup)
    return _cached_driver(_Keyed((scenario.model_dump_json(exclude=others), setup.geometry), setup))


@dataclass(frozen=True)
class _Keyed:
    """A setup with a hashable key, for caching."""

    key: tuple
    setup: Setup = field(compare=False)


@cached(32, "kernels of setups")
def _cached_driver(keyed):
    return Driver(keyed.setup)
