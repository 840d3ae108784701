"""
Time of correlated fields and variable soils, relative to the floor of `chain.py` in the same process.

    python benchmarks/fields.py --cells 3000
"""

import argparse

import dask
from chain import BANDS, CASE, floor
from timing import seconds

import fifesim
from fifesim.ground.landscape.field_labels import of_elevation

ARPS = {"lai": 0.15, "soil": 0.24}


def cases(cells):
    """Calls without arguments on arrays in memory; each seed is another landscape, so that no tile is kept."""
    grid = fifesim.fife_site(30 / 9, window=((0, cells), (0, cells)))
    seeds = iter(range(100, 10_000))
    dem = fifesim.flint_hills(grid, seed=7)
    ground = of_elevation(dem, ["elevation", "wetness", "illumination"])
    lai = fifesim.lai_scene(grid, "burned-grazed", arp=0.15, seed=7)
    score = fifesim.ground.correlated_fields(grid, {"soil": 0.24}, seed=7)["soil"]
    soil, moisture = 0.04 * score, 0.3 + 0.04 * score

    def fields(arps, correlations=None, covariates=None):
        return lambda: fifesim.ground.correlated_fields(
            grid, arps, correlations, seed=next(seeds), covariates=covariates
        )

    def reflectance(**properties):
        canopy = fifesim.Canopy(**properties)
        return lambda: lai.fifesim.surface_reflectance("TM", bands=BANDS, canopy=canopy, **CASE)

    alike = dict.fromkeys(ARPS, 0.15)
    follows = {"elevation": 0.3, "wetness": 0.5, "illumination": -0.2}
    return {
        "leaf area alone": fields({"lai": 0.15}),
        "and soil, independent": fields(ARPS),
        "and soil, of one arp, correlated": fields(alike, {("lai", "soil"): -0.4}),
        "and soil, of two arps, correlated": fields(ARPS, {("lai", "soil"): -0.4}),
        "leaf area that follows elevation": fields({"lai": 0.15}, {("lai", "elevation"): 0.3}, ground),
        "leaf area that follows three": fields({"lai": 0.15}, {"lai": follows}, ground),
        "three, and soil of two arps": fields(ARPS, {"lai": follows | {"soil": -0.4}}, ground),
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
