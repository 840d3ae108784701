"""
Time of the flat two-band chain, from field to digital numbers, with one and two threads, relative to a floor.

The floor draws as many normals as there are cells and filters them by one Fourier transform. Absolute times differ from
machine to machine and hour to hour: read the ratios.

    python benchmarks/chain.py --sides 4500 8000
"""

import argparse
from itertools import count

import dask
import numpy as np
from scipy import fft
from timing import both_times

import fifesim

CELL = 30 / 9
BANDS = ["TM3", "TM4"]
CASE = {"geometry": fifesim.fife_geometry(), "atmosphere": fifesim.Atmosphere()}  # wherever a large scene reaches
WEST, NORTH = 704970.0, 4334220.0

# Each call has another landscape, because the last tiles of a landscape are cached.
SEEDS = count(100)


def floor(cells, threads=1):
    """Normals of cells x cells, filtered."""
    noise = np.random.Generator(np.random.Philox(7)).standard_normal((cells, cells))
    spectrum = fft.rfft2(noise, workers=threads, overwrite_x=True)
    spectrum *= 0.5
    return fft.irfft2(spectrum, s=(cells, cells), workers=threads, overwrite_x=True)


def grid_of(side):
    """Grid of side x side cells, on the site of FIFE and beyond it."""
    return fifesim.grid_at("EPSG:26914", WEST, NORTH, side * CELL + 1e-3, side * CELL + 1e-3, CELL)


def chain_on(side):
    """Lazy image of a new landscape."""
    lai = fifesim.lai_scene(grid_of(side), "burned-grazed", arp=0.15, seed=next(SEEDS), chunks="auto")
    return lai.fifesim.surface_reflectance("TM", bands=BANDS, **CASE).fifesim.to_toa().fifesim.sense("TM")


def main():
    """Print a table of ratios."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument("--sides", type=int, nargs="+", default=[4500, 8000], help="cells along each side")
    parser.add_argument("--repeat", type=int, default=3)
    given = parser.parse_args()
    print("| million cells | floor [s] | one thread [s] | floors | two threads are faster by |\n|---|---|---|---|---|")
    for side in given.sides:
        base = both_times(lambda side=side: floor(side), given.repeat)
        found = []
        for threads in (1, 2):
            with dask.config.set(scheduler="threads", num_workers=threads):
                found.append(both_times(lambda side=side: chain_on(side).compute(), given.repeat))
        (one, clock), (_, clock_of_two) = found
        row = f"{side**2 / 1e6:.0f} | {base[0]:.2f} | {one:.2f} | {one / base[0]:.2f} | {clock / clock_of_two:.2f}"
        print(f"| {row} |", flush=True)


if __name__ == "__main__":
    main()
