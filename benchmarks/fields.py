"""
Time of a random field and variable soils, relative to the floor of `chain.py` in the same process.

    python benchmarks/fields.py --cells 3000
"""

import argparse

import dask
from chain import BANDS, CASE, floor
from timing import seconds

import fifesim


def cases(cells):
    """Calls without arguments on arrays in memory; each seed is another landscape, so that no tile is kept."""
    grid = fifesim.fife_site(30 / 9, window=((0, cells), (0, cells)))
    seeds = iter(range(100, 10_000))
    dem = fifesim.flint_hills(grid, seed=7)
    lai = fifesim.lai_scene(grid, "burned-grazed", arp=0.15, seed=7)
    field = fifesim.ground.Field(sd=0.04, arp=0.24)
    soil = fifesim.landscape(grid, lai=lai, soil=field, seed=7).soil
    moisture = 0.3 + soil

    def reflectance(**properties):
        canopy = fifesim.Canopy(**properties)
        return lambda: lai.fifesim.surface_reflectance("TM", bands=BANDS, canopy=canopy, **CASE)

    return {
        "leaf area alone": lambda: fifesim.lai_scene(grid, arp=0.15, seed=next(seeds)),
        "soil alone": lambda: fifesim.landscape(grid, lai=lai, soil=field, seed=next(seeds)),
        "wetness": lambda: fifesim.terrain.wetness(dem),
        "reflectance, even soil": reflectance(),
        "reflectance, soil by cell": reflectance(soil=soil),
        "reflectance, moisture by cell": reflectance(moisture=moisture),
        "reflectance, both": reflectance(soil=soil, moisture=moisture),
    }


def main():
    """Print a table of ratios."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument("--cells", type=int, default=3000, help="cells along each side, at most 4500")
    options = parser.parse_args()
    with dask.config.set(scheduler="synchronous"):
        base = seconds(lambda: floor(options.cells))
        print(f"{options.cells**2 / 1e6:.1f} million cells, floor {base:.2f} s of processor time\n")
        print("| | times the floor |\n|---|---|")
        for name, call in cases(options.cells).items():
            print(f"| {name} | {seconds(call) / base:.2f} |", flush=True)


if __name__ == "__main__":
    main()
