"""Time of dead leaves, crowns and soil by cell, relative to the whole flat chain, in one run."""

from functools import partial
from itertools import count

import dask
import numpy as np
from timing import in_turn, seconds

import fifesim

BANDS = ["TM3", "TM4"]
CELLS, LAZY_CELLS = 2000, 4500

FIELDS = {
    "soil": fifesim.ground.Field(sd=0.03, arp=0.05),
    "brown": fifesim.ground.Field(mean=0.15, sd=0.06, arp=0.05),
    "crown_cover": fifesim.ground.Field(mean=0.8, sd=0.1, arp=0.05),
    "moisture": fifesim.ground.Field(mean=0.25, sd=0.08, arp=0.05),
}


def grid_of(cells):
    """Grid of cells x cells on the site."""
    return fifesim.fife_site(30 / 9, window=((0, cells), (0, cells)))


def image_of(scene):
    """Digital numbers of leaf area or of a landscape, in memory."""
    return scene.fifesim.surface_reflectance("TM", bands=BANDS).fifesim.to_toa().fifesim.sense("TM").compute()


def chains(grid, seeds, names, lazy=False):
    """The flat chain and chains of landscapes with three classes and variable properties, with a new scene per call."""
    chunks = {"chunks": "auto"} if lazy else {}

    def landscape(given):
        fields = {name: FIELDS[name] for name in given}
        return image_of(
            fifesim.landscape(grid, classes=fifesim.ground.fife_classes(), seed=next(seeds), **fields, **chunks)
        )

    found = {"flat": lambda: image_of(fifesim.lai_scene(grid, seed=next(seeds), **chunks))}
    for given in names:
        found[", ".join(["three classes", *given])] = partial(landscape, given)
    return found


def whole_chains(title, calls, cells):
    """Print a table of them, in turn."""
    found = in_turn(calls)
    print(f"\n| {title} | flat chains | ns a cell |\n|---|---|---|")
    for said, spent in found.items():
        print(f"| {said} | {spent / found['flat']:.2f} | {spent / cells * 1e9:.0f} |", flush=True)


def learned(grid, seeds):
    """Print the time of the landscape "konza" relative to one of four random fields."""
    dem, konza = fifesim.flint_hills(grid, seed=7), fifesim.ground.Landscape.read("konza")
    bare = konza.model_copy(update={"properties": {}})
    fields = {name: fifesim.ground.Field(each.mean, each.sd, 0.05) for name, each in konza.properties.items()}
    four = "leaf area and three properties as random fields"
    calls = {
        four: lambda: fifesim.landscape(grid, arp=0.15, seed=next(seeds), **fields),
        "konza": lambda: konza.simulate(grid, dem, seed=next(seeds)),
        "konza, leaf area alone": lambda: bare.simulate(grid, dem, seed=next(seeds)),
        "konza, level ground": lambda: konza.simulate(grid, seed=next(seeds)),
    }
    found = in_turn(calls)
    print("\n| landscape alone, on hills | landscapes of four fields | ns a cell |\n|---|---|---|")
    for said, spent in found.items():
        print(f"| {said} | {spent / found[four]:.2f} | {spent / np.prod(grid.shape) * 1e9:.0f} |", flush=True)


def main():
    """Print a table of processor time a cell, and of ratios to the flat chain."""
    grid, seeds = grid_of(CELLS), count(50)
    lai = fifesim.lai_scene(grid, seed=1)
    rng = np.random.default_rng(1)

    def raster(values):
        return lai.copy(data=values).drop_attrs(deep=False)

    soil, brown = raster(rng.uniform(0.1, 0.3, lai.shape)), raster(rng.beta(2, 4, lai.shape))
    crowns = raster(0.5 + 0.5 * rng.beta(4, 2, lai.shape))
    cases = {
        "equal leaves": {},
        "soil by cell": {"background": soil},
        "dead leaves": {"brown": 0.3, "dissociation": 0.5},
        "dead leaves by cell": {"brown": brown, "dissociation": 0.5},
        "dead leaves and soil by cell": {"brown": brown, "dissociation": 0.5, "background": soil},
        "crowns by cell": {"crown_cover": crowns},
        "crowns and soil by cell": {"crown_cover": crowns, "background": soil},
        "dead leaves, crowns and soil by cell": {
            "brown": brown,
            "dissociation": 0.5,
            "crown_cover": crowns,
            "background": soil,
        },
    }
    in_memory = chains(grid, seeds, [list(FIELDS)[:n] for n in range(5)])
    # The largest first: a process that has not had its memory yet pays for that in the first case.
    list(in_memory.values())[-2]()
    whole = in_turn({"flat": in_memory["flat"]})["flat"]
    print(f"flat chain, field to digital numbers: {whole / lai.size * 1e9:.0f} ns a cell, {len(BANDS)} bands\n")
    print("| canopy alone | ns a cell | flat chains |\n|---|---|---|")
    for name, options in cases.items():
        canopy = fifesim.Canopy(**options)
        spent = seconds(partial(fifesim.surface_reflectance, lai, "TM", bands=BANDS, canopy=canopy))
        print(f"| {name} | {spent / lai.size * 1e9:.0f} | {spent / whole:.2f} |", flush=True)
    whole_chains("whole chain, level ground", in_memory, lai.size)
    learned(grid, seeds)
    grid = grid_of(LAZY_CELLS)
    with dask.config.set(scheduler="synchronous"):
        whole_chains("20 million cells, in chunks", chains(grid, seeds, [list(FIELDS)], lazy=True), LAZY_CELLS**2)


if __name__ == "__main__":
    main()
