"""Many realisations of scenarios in memory: small scenes as arrays, without labels and graphs for each."""

from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import dask
import numpy as np
import xarray as xr

from fifesim.chain.arrays import ArrayChain
from fifesim.chain.kernels import Kernels, labelled_only
from fifesim.chain.landscapes import aggregate
from fifesim.chain.setup import Setup, reflectance_of
from fifesim.ground.landscape.raster import scene_cells
from fifesim.ground.terrain.rasters.dem import beside_altitude
from fifesim.ground.terrain.rasters.lit_slopes import light_on_slopes
from fifesim.rasters import cf, directions
from fifesim.rasters import grid as grids
from fifesim.scenario.ground import fpar_kinds, ground_scene, truth_of
from fifesim.scenario.land import elevation, in_memory, light_on_hills
from fifesim.scenario.scenario import Scenario
from fifesim.scenario.simulation import setup_of, simulate, with_margin
from fifesim.sensor.description.rasters.carried import attributes_of

# Of a run, what a regression takes.
KEPT = ("image", "truth")

# Light of an image, by the names of its coordinates.
LIGHT = ("sza", "saa", "vza", "vaa", "earth_sun_distance")

# Larger scenes go by chunks. [cell]
_LARGEST = 4_000_000


def realise(scenario, keep=KEPT, *, complete=False):
    """
    Nodes of a scenario's run, in memory.

    Scenes of the same grid, air, canopy or instrument share what is made of it, and scenes of the same seed and arp the
    tiles of their field: let them follow each other.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
    keep : sequence of str, optional
        Among ``scene``, ``image``, ``truth``, ``terrain`` and ``level``; the others are not computed.
    complete : bool, optional
        As in `fifesim.simulate`.

    Returns
    -------
    nodes : dict of str to xarray.Dataset
        With the bits and the coordinates of `fifesim.simulate`. Image and truth come without the history of how they
        were made.

    Raises
    ------
    ValueError
        If the run has no such node, or the scenario asks for what cannot be.

    See Also
    --------
    fifesim.chain.arrays.ArrayChain
    """
    if not isinstance(scenario, Scenario):
        raise TypeError(f"realise takes a Scenario, got {type(scenario).__name__}: see fifesim.read_scenario")
    grid, setup = scenario.geobox(), setup_of(scenario)
    if _is_small(grid) and set(keep) <= set(KEPT) and not labelled_only(setup):
        return _of_arrays(scenario, grid, setup, keep, complete)
    run = simulate(scenario, chunks=None if _is_small(grid) else "auto", complete=complete)
    missing = [name for name in keep if name not in run.children]
    if missing:
        raise ValueError(f"keep names {', '.join(missing)}, and this run has {', '.join(run.children)}")
    return {name: run[name].to_dataset().compute(scheduler="synchronous") for name in keep}


def realise_arrays(scenario, *, complete=False):
    """
    Image and truth of a scenario's run as arrays; for many small scenes, labels would take longer than the simulation.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
    complete : bool, optional
        As in `fifesim.simulate`.

    Returns
    -------
    image : dict of str to array
        ``dn``, ``ndvi`` where there are the bands for one, and numbers, or arrays, of `LIGHT`.
    truth : dict of str to array
        The bits of `realise` in both.

    Raises
    ------
    ValueError
        If the scenario asks for what cannot be.
    """
    grid, setup = scenario.geobox(), setup_of(scenario)
    if not _is_small(grid) or labelled_only(setup):
        image, truth = realise(scenario, complete=complete).values()
        return _values(image) | {name: image[name].values for name in LIGHT}, _values(truth)
    chain, blocks, land, reflectance = _scene(scenario, grid, setup, True, complete)
    truth = _truth(scenario, blocks, land)
    light = {name: getattr(setup.geometry, name) for name in LIGHT}
    return _image(chain, reflectance) | light, truth if isinstance(truth, dict) else _values(truth)


def _values(dataset):
    return {str(name): each.values for name, each in dataset.data_vars.items()}


def _is_small(grid):
    return grid.shape.x * grid.shape.y <= _LARGEST


def _of_arrays(scenario, grid, setup, keep, complete):
    """Image and truth by the kernels alone, with the labels that they have."""
    chain, blocks, land, reflectance = _scene(scenario, grid, setup, "image" in keep, complete)
    made = {}
    if "image" in keep:
        made["image"] = _labelled_image(chain, _image(chain, reflectance))
    if "truth" in keep:
        made["truth"] = _labelled_truth(scenario, blocks, _truth(scenario, blocks, land))
    return made


def _scene(scenario, grid, setup, lit, complete):
    """
    Chains of the image and of the truth, the ground of the truth, and if lit the reflectance; of one stand as arrays.

    The chains differ where the image sees ground around the scene.
    """
    blocks, own, inside = ArrayChain(setup, grid, _kernels(scenario, setup)), scenario.ground, {}
    chain = blocks
    if complete:
        grid, setup, inside = with_margin(scenario, setup)
        chain = ArrayChain(setup, grid, blocks.kernels)
    is_one, dem, horizon = scenario.landscape.is_one() and not own.lai_file, None, None
    light = light_on_hills(scenario, grid, setup.geometry) if is_one and lit else None
    if light is None and scenario.terrain.dem != "flat" and (lit or not is_one):
        # Threads take longer to start than so few cells to make.
        with dask.config.set(scheduler="synchronous"):
            dem, horizon = in_memory(*elevation(scenario, grid)[:2])
    if not is_one:
        land = ground_scene(scenario, grid, dem=dem)
        lit = lit and reflectance_of(replace(setup, dem=dem, horizon=horizon), land).values
        return chain, blocks, land.isel(inside), lit
    land, reflectance = scene_cells(grid, own.distribution, own.arp, own.seed, own.method), None
    if lit:
        reflectance = chain.kernels.reflectance(land)
        if dem is not None:
            on_cells = beside_altitude(dem, chain.kernels.air.altitude), chain.grid, setup.geometry, horizon
            light = light_on_slopes(*on_cells)
        reflectance = reflectance if light is None else chain.kernels.on_slopes(reflectance, light)
    return chain, blocks, land[tuple(inside.values())], reflectance


def _image(chain, reflectance):
    """Image and its NDVI."""
    dn = chain.image(chain.kernels.toa(reflectance))
    if not chain.kernels.shows_ndvi:
        return {"dn": dn}
    return {"dn": dn, "ndvi": chain.kernels.ndvi(chain.kernels.planetary(dn))}


def _labelled_image(chain, image):
    """The same with its coordinates."""
    kernels, dn = chain.kernels, image["dn"]
    gain, offset, _ = kernels.scale
    along = {"band": [band.name for band in kernels.bands], "wavelength": [band.wavelength for band in kernels.bands]}
    along |= {"gain": gain, "offset": offset}
    along |= {"compression": kernels.compression} if kernels.compression.any() else {}
    along |= {"solar_irradiance": kernels.irradiance}
    own = attributes_of(kernels.instrument) | {"atmosphere": kernels.air.text}
    attrs = cf.attributes("dn") | own | {"_FillValue": dn.dtype.type(0)}
    variables = {"dn": xr.Variable(("band", "y", "x"), dn, attrs)}
    if "ndvi" in image:
        variables["ndvi"] = xr.Variable(("y", "x"), image["ndvi"], cf.attributes("ndvi") | own)
    coords = grids.coordinates(chain.pixels) | cf.band_coordinates(**along)
    return _placed(variables, coords, directions.coordinates_of(kernels.setup.geometry))


def _truth(scenario, chain, land):
    """Means over the blocks of the truth: of one stand as arrays, else as a dataset."""
    size = scenario.sensor.size
    if not scenario.landscape.is_one():
        return aggregate(truth_of(scenario, chain.setup, land), size, min_valid=chain.setup.min_valid)
    fpar_inf = scenario.ground.fpar_inf
    lai = land if isinstance(land, np.ndarray) else land["lai"].values
    kinds = fpar_kinds(scenario)
    cells = {"lai": lai} | {name: chain.kernels.fpar(lai, fpar_inf, leaves) for name, leaves in kinds.items()}
    return {name: chain.means(each, size) for name, each in cells.items()}


def _labelled_truth(scenario, chain, truth):
    if not isinstance(truth, dict):
        return truth
    variables = {name: xr.Variable(("y", "x"), means, cf.attributes(name)) for name, means in truth.items()}
    return _placed(variables, grids.coordinates(chain.blocks(scenario.sensor.size)))


def _placed(variables, coordinates, others=None):
    """Dataset on a grid; coordinates are not compared with each other, for they are made for it."""
    for each in variables.values():
        each.encoding = {"grid_mapping": "spatial_ref"}
    bare = {name: each.variable for name, each in coordinates.items()}
    return xr.Dataset(variables, bare | (others or {}))


def _kernels(scenario, setup):
    """What does not depend on place and seeds, made once for all scenes that say the same."""
    others = {"grid": True, "ground": {"seed", "arp", "distribution", "method"}, "sensor": {"seed", "offset"}}
    said = scenario.model_dump_json(exclude=others)
    if scenario.files:
        # A file may change under its name.
        return Kernels(setup)
    return _known(_Keyed((said, setup.geometry), setup))


class _Keyed(NamedTuple):
    """A setup by what it is told."""

    key: tuple
    setup: Setup

    def __hash__(self):
        return hash(self.key)

    def __eq__(self, other):
        return self.key == other.key


@lru_cache(maxsize=32)
def _known(keyed):
    return Kernels(keyed.setup)
