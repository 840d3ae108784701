"""
What people wait for, in this version and in an older one from the history of the repository, in one run.

Each row is a ratio within one process, or a time on the clock, which other work on the machine changes.

    python benchmarks/waits.py
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path

import dask
import numpy as np
import xarray as xr
from chain import CASE, chain_on, floor, grid_of
from dask.distributed import Client, LocalCluster
from labels import cases as small_cases
from start import COMMAND, processor_time
from timing import both_times, in_turn, seconds

import fifesim
from fifesim.atmosphere import engines
from fifesim.atmosphere.skylight import atmospheric_sky
from fifesim.models.radiation import two_stream

OLDER = "ae5f6de4"
BANDS = ["TM3", "TM4"]
CELLS = 3000


def commands():
    """Processes from their start to their end: time on the clock with and without kernels, and ratios."""
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"NUMBA_CACHE_DIR": str(Path(folder) / "kernels")}
        for _ in range(2):
            start = time.perf_counter()
            call = [sys.executable, "-c", COMMAND, "simulate", "-o", str(Path(folder) / "out"), "--overwrite"]
            subprocess.run(call, env=environment, capture_output=True, check=True)
            yield time.perf_counter() - start
        (Path(folder) / "typo.toml").write_text("[grid]\nwidht = 300.0\n", encoding="utf-8")
        calls = ("import fifesim",), (COMMAND, "scenario"), (COMMAND, "simulate", "typo.toml")
        rounds = [[processor_time(*each, folder=folder) for each in calls] for _ in range(6)]
    base, *spent = np.median(rounds[1:], axis=0)
    yield from spent / base


def atmosphere():
    """Clouds, view angles by cell and adjacency, each in turn with a clear sky and one geometry."""
    grid = fifesim.fife_site(30 / 9, window=((0, CELLS), (0, CELLS)))
    lai = fifesim.lai_scene(grid, arp=0.15, seed=7)
    rho = lai.fifesim.surface_reflectance("TM", bands=BANDS)
    zenith = lai.copy(data=np.broadcast_to(np.linspace(0, 50, CELLS), lai.shape)).drop_attrs(deep=False)
    swath = xr.Dataset({"sza": 30.0, "saa": 120.0, "vza": zenith, "vaa": 200.0})
    sky = rho.fifesim.cast_clouds(fifesim.cloud_field(grid, 0.4, seed=3, margin=3000))
    anywhere = rho.drop_vars(["sza", "saa", "vza", "vaa"])
    spent = in_turn(
        {
            "clear": rho.fifesim.to_toa,
            "clouds": lambda: rho.fifesim.to_toa(clouds=sky),
            "swath": lambda: anywhere.fifesim.to_toa(geometry=swath),
            "adjacency": lambda: rho.fifesim.to_toa(adjacency=True),
        }
    )
    yield from (spent[name] / spent["clear"] for name in ("clouds", "swath", "adjacency"))


def canopy():
    """Upright plants on slopes and leaves that differ."""
    grid = fifesim.fife_site(30 / 9, window=((0, 1000), (0, 1000)))
    lai, dem = fifesim.lai_scene(grid, arp=0.15, seed=7), fifesim.flint_hills(grid, seed=7)
    horizon = fifesim.horizon(dem)
    spent = in_turn(
        {
            slopes: lambda slopes=slopes: lai.fifesim.surface_reflectance(
                "TM", bands=BANDS, dem=dem, horizon=horizon, slopes=slopes
            )
            for slopes in ("kt", "upright")
        }
    )
    yield spent["upright"] / spent["kt"]
    chlorophyll = lai.copy(data=np.random.default_rng(1).uniform(20, 60, lai.shape)).drop_attrs(deep=False)
    by_cell = fifesim.Canopy(leaf_optics=fifesim.Leaf(chlorophyll=chlorophyll))
    spent = in_turn(
        {
            "equal": lambda: fifesim.surface_reflectance(lai, bands=BANDS),
            "by cell": lambda: fifesim.surface_reflectance(lai, bands=BANDS, canopy=by_cell),
        }
    )
    yield spent["by cell"] / spent["equal"]


def skies():
    """Milliseconds for both skies and for the terms of a band, at a new zenith angle of the sun."""
    band = fifesim.instrument("TM").select("TM3")[0].response
    angles = iter(np.linspace(20, 50, 100).tolist())
    air = fifesim.Atmosphere()
    yield 1e3 * both_times(lambda: [atmospheric_sky(air, band.center, next(angles)) for _ in range(2)], 5)[1]
    yield 1e3 * both_times(lambda: engines.band_terms(air, (band,), next(angles), 5.0, 80.0), 5)[1]


def small():
    """Public functions on small rasters, relative to their kernels."""
    for _, ours, plain in small_cases():
        spent = in_turn({"ours": ours, "plain": plain}, rounds=30)
        yield spent["ours"] / spent["plain"]


def workers():
    """Two worker processes relative to two threads: first call with the start of the workers, and later calls."""
    lai = fifesim.lai_scene(grid_of(1800), arp=0.15, seed=7, chunks="auto")

    def small_scene():
        lai.fifesim.surface_reflectance("TM", bands=BANDS, **CASE).fifesim.to_toa().fifesim.sense("TM").compute()

    def clock(call):
        start = time.perf_counter()
        call()
        return time.perf_counter() - start

    calls = small_scene, lambda: chain_on(4500).compute()
    with dask.config.set(scheduler="threads", num_workers=2):
        threads = [[clock(call) for _ in range(4)] for call in calls]
    start = time.perf_counter()
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster):
        small_scene()
        yield (time.perf_counter() - start) / threads[0][0]
        for call, known in zip(calls, threads, strict=True):
            yield min(clock(call) for _ in range(4)) / min(known)


def level():
    """The level chain in memory, from field to digital numbers, relative to the floor."""
    grid, seeds = grid_of(4500), iter(range(100, 200))

    def chain():
        lai = fifesim.lai_scene(grid, arp=0.15, seed=next(seeds))
        lai.fifesim.surface_reflectance("TM", bands=BANDS, **CASE).fifesim.to_toa().fifesim.sense("TM")

    spent = in_turn({"floor": lambda: floor(4500), "chain": chain})
    yield spent["chain"] / spent["floor"]


def light():
    """Million values per second of the two-stream equations."""
    lai = np.random.default_rng(1).uniform(0, 6, (2, 1_000_000))
    optics = np.array([[0.1], [0.45]]), np.array([[0.05], [0.4]])
    yield lai.size / 1e6 / seconds(lambda: two_stream(*optics, 0.1, 35.0, lai, np.array([[0.1], [0.2]])))


ROWS = {
    commands: {
        "`fifesim simulate` on a new machine, where kernels are compiled [s]": 12,
        "the same, once they are compiled [s]": None,
        "`fifesim scenario`, times `import fifesim`": 2,
        "a misspelt key, times `import fifesim`": 2,
    },
    atmosphere: {
        "to_toa with 40 % clouds, times clear": 1.6,
        "to_toa with view angles by cell, times clear": 8,
        "to_toa with adjacency, times clear": 5,
    },
    canopy: {"slopes = upright, times kt": 2, "chlorophyll by cell, times equal leaves": 8},
    skies: {"skies of a band for directional coupling [ms]": 20, "terms of a band [ms]": None},
    small: {
        "surface_reflectance, 333 x 333 cells, times its kernel": 3,
        "to_toa, 333 x 333 cells, times its kernel": 4,
        "sense, 333 x 333 cells, times its kernel": 4,
        "ndvi, 50 x 50 pixels, times xarray.apply_ufunc": 2,
    },
    workers: {
        "two workers, first call with their start, times threads": None,
        "two workers, later calls, 3.2 million cells, times threads": 2,
        "two workers, 20 million cells of new landscapes, times threads": None,
    },
    level: {"level chain in memory, times the floor": 1},
    light: {"two_stream [million values/s]": 10},
}


def measured(group, folder):
    """Figures of a group by the version in a folder, in a new process."""
    call = [sys.executable, __file__, "--group", group.__name__]
    done = subprocess.run(
        call, env=os.environ | {"PYTHONPATH": str(folder)}, stdout=subprocess.PIPE, text=True, check=False
    )
    return json.loads(done.stdout) if done.returncode == 0 else ["failed"] * len(ROWS[group])


def main():
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument("--group", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.group:
        warnings.simplefilter("ignore")
        print(json.dumps([float(f"{each:.3g}") for each in globals()[given.group]()]))
        return
    root = Path(__file__).parents[1]
    print(f"| | {OLDER} | this version | goal |\n|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        files = subprocess.run(["git", "archive", OLDER], cwd=root, stdout=subprocess.PIPE, check=True)
        subprocess.run(["tar", "x", "-C", folder], input=files.stdout, check=True)
        for group, rows in ROWS.items():
            before, now = (measured(group, each) for each in (folder, root))
            for (name, goal), *found in zip(rows.items(), before, now, strict=True):
                print(f"| {name} | {found[0]} | {found[1]} | {goal or ''} |", flush=True)


if __name__ == "__main__":
    main()
