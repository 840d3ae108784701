"""
Many realisations of scenarios in memory, by the steps of `fifesim.simulate`, or as plain arrays for one stand.

A chip of 300 m takes 5 ms of processor time as plain arrays, and 12 ms by the labelled steps, with the same bits.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import dask
import numpy as np
import xarray as xr
from odc.geo.geobox import GeoBox

from fifesim.base.caches import cached
from fifesim.chain.driver import Driver, cell_block_means, varying_parts
from fifesim.chain.setup import Setup, reflectance_of, toa_of
from fifesim.grids import cf, directions
from fifesim.grids import grid as grids
from fifesim.grids.grid import as_carried
from fifesim.ground.landscape.lai_labels import scene_cells
from fifesim.scenario.ground import fpar_kinds, light_of
from fifesim.scenario.keys import KEYS
from fifesim.scenario.simulation import run_nodes, setup_of, with_margin
from fifesim.sensor.instrument_labels import attributes_of

# Coordinates of an image that describe its illumination and view.
LIGHT = ("sza", "saa", "vza", "vaa", "earth_sun_distance")

# Keys by section that plain arrays use, for one stand. The steps of `simulate` compute a scenario whose other keys
# differ from their defaults. The listed keys of clouds have no effect on a clear sky, and `varying_parts` names the
# clouds of another sky.
_STAND = " ".join(KEYS) + " distribution arp leaf leaf_reflectance leaf_transmittance brown_leaf"
_STAND += " background background_spectra"
_KNOWN = {
    "grid": "crs west north width height cell",
    "ground": f"{_STAND} seed method fpar_inf",
    "landscape": "learned",
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
    if scene := _scene(scenario, complete):
        return {"image": _labelled_image(scene), "truth": _labelled_truth(scenario, scene)}
    return {name: xr.Dataset(rasters) for name, rasters in _rasters(scenario, complete).items()}


def realise_arrays(scenario, *, complete=False):
    """Image and truth as arrays, for small scenes where labels would take longer than the simulation."""
    if scene := _scene(scenario, complete):
        light = {name: getattr(scene.setup.geometry, name) for name in LIGHT}
        return _image(scene) | light, _truth(scenario, scene)
    nodes = _rasters(scenario, complete)
    image, truth = ({name: each.values for name, each in nodes[node].items()} for node in ("image", "truth"))
    coordinates = nodes["image"]["dn"].coords.variables
    return image | {name: coordinates[name].values for name in LIGHT}, truth


def _rasters(scenario, complete):
    """Rasters of image and truth in memory by node and name, from the steps of `fifesim.simulate`."""
    with dask.config.set(scheduler="synchronous"):
        if _is_small(scenario.geobox()):
            nodes, _ = run_nodes(scenario, None, complete, whole=False)
        else:
            nodes, _ = run_nodes(scenario, "auto", complete)
        rasters = {node: nodes[node] for node in ("image", "truth")}
        return {node: dict(zip(own, dask.compute(*own.values()), strict=True)) for node, own in rasters.items()}


def uniform_reflectance(scenario, ground):
    """Planetary reflectance of pixels of uniform ground without noise, shape (band, y, x). [1]"""
    setup = setup_of(scenario)
    if parts := varying_parts(setup):
        raise ValueError(f"uniform ground does not support {', '.join(parts)}: use pixels='chain'")
    if scenario.is_one():
        driver = _driver(scenario, setup)
        return driver.toa(driver.reflectance(ground["lai"]))
    pixels = grids.aligned_grid(as_carried(scenario.geobox()), scenario.sensor.size)
    cells = {name: xr.DataArray(each, dims=("y", "x"), attrs={"units": "1"}) for name, each in ground.items()}
    land = xr.Dataset({name: grids.place(each, pixels) for name, each in cells.items()})
    return toa_of(setup, reflectance_of(setup, land), land).values


def unsupported_parts(scenario, setup):
    """Names of the parts of a setup, or of the keys of its scenario, that plain arrays do not support."""
    if scenario.learned:
        return ["landscape.learned"]
    return varying_parts(setup) or [
        ".".join((*place, key))
        for place, section in scenario.sections().items()
        for key in type(section).model_fields.keys() - _SUPPORTED.get(place[0], ())
        if getattr(section, key) != type(section).model_fields[key].get_default(call_default_factory=True)
    ]


def _is_small(grid):
    return grid.shape.x * grid.shape.y <= _LARGEST


class _Scene(NamedTuple):
    """Leaf area and reflectance of one stand in memory."""

    driver: Driver
    setup: Setup
    grid: GeoBox
    """Cells of the scene, without a margin."""
    lai: np.ndarray
    """Leaf area of these cells."""
    lit_grid: GeoBox
    """Cells of the reflectance, with the margin of a complete image."""
    reflectance: np.ndarray


def _scene(scenario, complete):
    """Scene of a scenario; None if it is large, or needs labels."""
    grid, setup, own = scenario.geobox(), setup_of(scenario), scenario.ground
    if not _is_small(grid) or unsupported_parts(scenario, setup):
        return None
    driver, inside, wide = _driver(scenario, setup), {}, grid
    if complete:
        wide, setup, inside = with_margin(scenario, setup)
    wide = as_carried(wide)
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
    """Block means for the truth by name."""
    size, min_valid, fpar_inf = scenario.sensor.size, scene.setup.min_valid, scenario.ground.fpar_inf
    kinds = fpar_kinds(scenario).items()
    cells = {"lai": scene.lai} | {name: scene.driver.fpar(scene.lai, fpar_inf, leaves) for name, leaves in kinds}
    return {name: cell_block_means(each, scene.grid, size, min_valid) for name, each in cells.items()}


def _labelled_truth(scenario, scene):
    """Truth of a scene with its coordinates."""
    truth = _truth(scenario, scene).items()
    variables = {name: xr.Variable(("y", "x"), means, cf.attributes(name)) for name, means in truth}
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
