"""
Speed of the terrain factors, and of the two-band chain with and without terrain.

The ground is a sum of waves, known beyond the site; absolute times differ from machine to machine: read the ratios.

    python benchmarks/terrain.py --cells 4500 --threads 1
"""

import argparse

import dask
import numpy as np
import xarray as xr
from chain import BANDS, own_peak, seconds

import fifesim
from fifesim.base.geometry import fife_geometry
from fifesim.ground.terrain.rasters import sky as sky_raster
from fifesim.ground.terrain.rasters.dem import source_resolution
from fifesim.rasters import grid as grids


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
    return grids.place(xr.DataArray(z, dims=("y", "x"), name="dem", attrs={"units": "m"}), grid)


def chain(lai, dem=None):
    rho = lai.fifesim.surface_reflectance("TM", bands=BANDS, dem=dem)
    return rho.fifesim.to_toa().fifesim.sense("TM")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument("--cells", type=int, default=4500, help="cells along each side, at most 4500")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--lazy-only", choices=("flat", "terrain"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    dask.config.set(scheduler="threads", num_workers=arguments.threads)
    grid = fifesim.fife_site(30 / 9, window=((0, arguments.cells), (0, arguments.cells)))
    dem = waves(grid)
    chunked = dem.chunk(1000)

    def scene():
        return fifesim.lai_scene(grid, arp=0.15, seed=7, chunks={"y": 1000, "x": 1000})

    if arguments.lazy_only:
        chain(scene(), chunked if arguments.lazy_only == "terrain" else None).compute()
        print(f"peak memory: {own_peak():.2f} GB")
        return
    lai = fifesim.lai_scene(grid, arp=0.15, seed=7)
    level = lai.fifesim.surface_reflectance("TM", bands=BANDS)
    geometry, known = fife_geometry(), fifesim.horizon(dem)
    sky = (dem.values, grid, source_resolution(dem))
    rows = {
        "chain, level, lazy": lambda: chain(scene()).compute(),
        "chain, terrain, lazy": lambda: chain(scene(), chunked).compute(),
        "  horizon, 32 directions, 30 m": lambda: fifesim.horizon(dem),
        "  sky at 30 m, horizon known": lambda: sky_raster.sky_above(*sky, known, geometry),
        "  sky at 30 m with horizon": lambda: sky_raster.sky_above(*sky, None, geometry),
        "  terrain_reflectance, all": lambda: lai.fifesim.surface_reflectance("TM", bands=BANDS, dem=dem),
        "  the same, level": lambda: lai.fifesim.surface_reflectance("TM", bands=BANDS),
        "slope": lambda: fifesim.slope(dem),
        "sky view": lambda: fifesim.sky_view(dem),
        "illumination": lambda: fifesim.illumination(dem),
        "Kt": lambda: fifesim.kt(level, dem),
    }
    million = arguments.cells**2 / 1e6
    print(f"{million:.1f} million cells, {len(BANDS)} bands, {arguments.threads} thread(s)")
    print(f"| {'':<32} | seconds | million cells/s |\n|---|---|---|")
    for name, call in rows.items():
        taken = seconds(call, repeat=2)
        print(f"| {name:<32} | {taken:7.2f} | {million / taken:15.1f} |", flush=True)


if __name__ == "__main__":
    main()
