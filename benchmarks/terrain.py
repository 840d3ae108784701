"""
Time of terrain, relative to a floor: draw one normal per cell and filter them by one Fourier transform.

The ground is a sum of waves, and of the synthetic hills, made anew each time. Processor time, the best of some rounds
in which each call has its turn; absolute times differ from machine to machine and hour to hour: read the ratios.

    python benchmarks/terrain.py --cells 4000 --threads 1
"""

import argparse
from itertools import count

import dask
import numpy as np
import xarray as xr
from chain import BANDS, CASE, floor, grid_of
from timing import in_turn, own_peak
from work import _run

import fifesim
from fifesim.base.geometry import fife_geometry
from fifesim.grids import grid as grids
from fifesim.ground.terrain import sky_labels as sky_raster
from fifesim.ground.terrain.source_labels import source_resolution


def waves(grid):
    """Elevation of 60 m relief over wavelengths of 200 to 2000 m."""
    x, y = (grids.coordinates(grid)[name].values for name in ("x", "y"))
    rng = np.random.default_rng(3)
    z = np.full(grid.shape, 400.0)
    for length in np.geomspace(200, 2000, 8):
        angle, phase = rng.uniform(0, 2 * np.pi, 2)
        kx, ky = 2 * np.pi / length * np.array([np.cos(angle), np.sin(angle)])
        across, down = kx * x + phase, ky * y
        # sin(a + b), from one-dimensional factors.
        z += length / 150 * (np.cos(down)[:, None] * np.sin(across) + np.sin(down)[:, None] * np.cos(across))
    attrs = {"units": "m", "source_resolution": 30.0}
    return grids.place(xr.DataArray(z, dims=("y", "x"), name="dem", attrs=attrs), grid)


def chain(lai, dem=None):
    rho = lai.fifesim.surface_reflectance("TM", bands=BANDS, dem=dem, **CASE)
    return rho.fifesim.to_toa().fifesim.sense("TM")


def calls(grid, dem):
    """Measured calls by name, each with another landscape."""
    seeds = count(100)
    lazy, lai = dem.chunk(1008), fifesim.lai_scene(grid, arp=0.15, seed=7, chunks="auto").persist()
    geometry, known = fife_geometry(), fifesim.horizon(dem)
    sky = (dem.values, grid, source_resolution(dem))

    def scene():
        return fifesim.lai_scene(grid, arp=0.15, seed=next(seeds), chunks="auto")

    def reflectance(dem):
        return _run(lai.fifesim.surface_reflectance("TM", bands=BANDS, dem=dem, **CASE).data)

    return {
        "chain, level": lambda: chain(scene()).compute(),
        "chain, elevation in memory": lambda: chain(scene(), dem).compute(),
        "chain, elevation in chunks": lambda: chain(scene(), lazy).compute(),
        "chain, synthetic hills": lambda: chain(
            scene(), fifesim.flint_hills(grid.pad(1), next(seeds), chunks="auto")
        ).compute(),
        "synthetic hills": lambda: _run(fifesim.flint_hills(grid, next(seeds), chunks="auto").data),
        "reflectance, level": lambda: reflectance(None),
        "reflectance, elevation in chunks": lambda: reflectance(lazy),
        "horizon, 32 directions, 30 m": lambda: fifesim.horizon(dem),
        "sky at 30 m, horizon known": lambda: sky_raster.sky_above(*sky, known, geometry),
        "sky at 30 m with horizon": lambda: sky_raster.sky_above(*sky, None, geometry),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument("--cells", type=int, default=4000, help="cells along each side")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--lazy-only", choices=("flat", "terrain"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    dask.config.set(scheduler="threads", num_workers=arguments.threads)
    grid = grid_of(arguments.cells)
    dem = waves(grid)
    if arguments.lazy_only:
        scene = fifesim.lai_scene(grid, arp=0.15, seed=7, chunks="auto")
        chain(scene, dem.chunk(1008) if arguments.lazy_only == "terrain" else None).compute()
        print(f"peak memory: {own_peak():.2f} GB")
        return
    named = {"floor": lambda: floor(arguments.cells, arguments.threads)} | calls(grid, dem)
    best = in_turn(named, arguments.repeat)
    million = arguments.cells**2 / 1e6
    print(f"{million:.1f} million cells, {len(BANDS)} bands, {arguments.threads} thread(s)\n")
    print("| | million cells/s | times the floor |\n|---|---|---|")
    for name, taken in best.items():
        print(f"| {name} | {million / taken:.1f} | {taken / best['floor']:.2f} |")


if __name__ == "__main__":
    main()
