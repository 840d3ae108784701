"""
Speed and memory of the flat two-band chain, beside a floor in the same process.

The floor draws as many normals as there are cells and filters them by one Fourier transform. Absolute times differ from
machine to machine and hour to hour: read the ratios.

    python benchmarks/chain.py --cells 4500 --threads 1
"""

import argparse
import resource
import subprocess
import sys
import time
from pathlib import Path

import dask
import numpy as np
from scipy import fft

import fifesim

BANDS = ["TM3", "TM4"]
CASE = {"geometry": fifesim.fife_geometry(), "atmosphere": fifesim.Atmosphere()}  # wherever a large scene reaches


def floor(cells, threads):
    noise = np.random.Generator(np.random.Philox(7)).standard_normal((cells, cells))
    spectrum = fft.rfft2(noise, workers=threads, overwrite_x=True)
    spectrum *= 0.5
    return fft.irfft2(spectrum, s=(cells, cells), workers=threads, overwrite_x=True)


def chain(cells, chunks="auto"):
    grid = fifesim.fife_site(30 / 9, window=((0, cells), (0, cells)))
    lai = fifesim.lai_scene(grid, "burned-grazed", arp=0.15, seed=7, chunks=chunks)
    return lai.fifesim.surface_reflectance("TM", bands=BANDS, **CASE).fifesim.to_toa().fifesim.sense("TM")


def stages(cells):
    """Each stage alone on one array in memory, as calls without arguments."""
    grid = fifesim.fife_site(30 / 9, window=((0, cells), (0, cells)))
    lai = fifesim.lai_scene(grid, "burned-grazed", arp=0.15, seed=7)
    rho = lai.fifesim.surface_reflectance("TM", bands=BANDS, **CASE)
    toa = rho.fifesim.to_toa()
    return {
        "field and LAI": lambda: fifesim.lai_scene(grid, "burned-grazed", arp=0.15, seed=7),
        "reflectance (SAIL)": lambda: lai.fifesim.surface_reflectance("TM", bands=BANDS, **CASE),
        "atmosphere (5S)": lambda: rho.fifesim.to_toa(),
        "sensor": lambda: toa.fifesim.sense("TM"),
        "30 m truth": lambda: lai.fifesim.aggregate(30),
    }


def seconds(call, repeat=3):
    """Best of some calls; the first warms up what is compiled."""
    times = []
    for _ in range(repeat):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times)


def peak_memory(arguments):
    """Peak resident memory of a process that only runs the chain [GB]."""
    command = [
        sys.executable,
        __file__,
        "--only-chain",
        "--cells",
        str(arguments.cells),
        "--threads",
        str(arguments.threads),
    ]
    return float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def own_peak():
    """Peak resident memory of this process [GB]."""
    status = Path("/proc/self/status")
    if status.exists():
        # ru_maxrss of a child starts at its parent's: Linux counts this one afresh for each program.
        line = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM"))
        return int(line.split()[1]) / 1e6
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument("--cells", type=int, default=4500, help="cells along each side, at most 4500")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--only-chain", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    dask.config.set(scheduler="threads", num_workers=arguments.threads)
    if arguments.only_chain:
        chain(arguments.cells).compute()
        print(own_peak())
        return
    million = arguments.cells**2 / 1e6
    chain(min(arguments.cells, 600)).compute()
    base = seconds(lambda: floor(arguments.cells, arguments.threads))
    rows = [("floor", base), ("chain, lazy, field to DN", seconds(lambda: chain(arguments.cells).compute()))]
    rows += [(f"  {name}, in memory", seconds(call)) for name, call in stages(arguments.cells).items()]
    print(f"{million:.1f} million cells, {len(BANDS)} bands, {arguments.threads} thread(s)")
    print(f"| {'':<32} | seconds | million cells/s | times the floor |\n|---|---|---|---|")
    for name, time_taken in rows:
        print(f"| {name:<32} | {time_taken:7.2f} | {million / time_taken:15.1f} | {time_taken / base:15.2f} |")
    print(f"peak memory of the chain alone: {peak_memory(arguments):.2f} GB")


if __name__ == "__main__":
    main()
