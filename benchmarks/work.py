"""
Measured calls without arguments, by name, for a number of cells along each side.

Each gives, as a pair, the call and how many cells it makes.
"""

import tempfile
from pathlib import Path

import dask
import numpy as np
from chain import BANDS, CASE, CELL, SEEDS, chain_on, floor, grid_of

import fifesim
from fifesim.output.run_folder import simulate_to_folder
from fifesim.scenario.scenario import parse_scenario
from fifesim.scenario.simulation import simulate

WHEN = {"geometry": {"time": "1987-06-06T16:35:00Z"}, "atmosphere": {"altitude": 0.4}}  # wherever it reaches


def scenario_of(side, dem="flat", paper=True):
    """Scenario of the paper's stand, or of the default landscape."""
    size = side // 9 * 9 * CELL
    keys = {"grid": {"width": size, "height": size}, "terrain": {"dem": dem}} | WHEN
    return parse_scenario({"base": "paper"} | keys if paper else keys).complete()


def lai_of(side):
    """Leaf area index in memory, in chunks as the chain has them."""
    return fifesim.lai_scene(grid_of(side), "burned-grazed", arp=0.15, seed=7, chunks="auto").persist()


def field(side):
    grid = grid_of(side)
    return lambda: _run(fifesim.lai_scene(grid, "burned-grazed", arp=0.15, seed=next(SEEDS), chunks="auto").data)


def downscaling(side):
    grid = grid_of(side // 3 * 3)
    pixels = fifesim.lai_scene(grid, "burned-grazed", arp=0.15, seed=7, chunks="auto").fifesim.aggregate(10).persist()
    return lambda: _run(pixels.fifesim.downscale(grid, arp=0.15, cv=0.4, seed=next(SEEDS), chunks="auto").data)


def canopy(side):
    lai = lai_of(side)
    return lambda: _run(lai.fifesim.surface_reflectance("TM", bands=BANDS, **CASE).data)


def atmosphere(side):
    rho = lai_of(side).fifesim.surface_reflectance("TM", bands=BANDS, **CASE).persist()
    return lambda: _run(rho.fifesim.to_toa().data)


def sensor(side):
    toa = lai_of(side).fifesim.surface_reflectance("TM", bands=BANDS, **CASE).fifesim.to_toa().persist()
    return lambda: toa.fifesim.sense("TM").compute()


def truth(side):
    lai = lai_of(side)
    return lambda: lai.fifesim.aggregate(30).compute()


def flat_chain(side):
    return lambda: chain_on(side).compute()


def terrain_chain(side):
    scenario = scenario_of(side, "flint-hills")
    return lambda: simulate(scenario)["image"]["dn"].compute()


def landscape_chain(side):
    scenario = scenario_of(side, "flint-hills", paper=False)
    return lambda: simulate(scenario)["image"]["dn"].compute()


def run_flat(side):
    return _to_folder(scenario_of(side))


def run_terrain(side):
    return _to_folder(scenario_of(side, "flint-hills"))


def floor_of(side):
    return lambda: floor(side)


def _to_folder(scenario):
    def call():
        with tempfile.TemporaryDirectory() as folder:
            simulate_to_folder(scenario, Path(folder) / "out", threads=dask.config.get("num_workers"))

    return call


def _run(array):
    """Compute all blocks and keep none."""
    dask.compute(array.map_blocks(lambda block: np.zeros((1,) * block.ndim), chunks=(1,) * array.ndim, dtype=float))


STAGES = {
    "field and LAI": field,
    "map of 10 m downscaled": downscaling,
    "canopy, 2 bands": canopy,
    "atmosphere, 2 bands": atmosphere,
    "sensor, 2 bands": sensor,
    "30 m truth": truth,
}
CHAINS = {
    "flat chain, field to DN": flat_chain,
    "terrain chain, field to DN": terrain_chain,
    "default landscape on hills, field to DN": landscape_chain,
    "fifesim simulate --paper, flat": run_flat,
    "fifesim simulate --paper, terrain": run_terrain,
}
FLOOR = {"floor: normals and FFT": floor_of}
