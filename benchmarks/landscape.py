"""What dead leaves, crowns and soil by cell cost the canopy, beside the whole flat chain, in one run."""

import numpy as np
from timing import in_turn, seconds

import fifesim

BANDS = ["TM3", "TM4"]
CELLS = 2000


def chain(seed):
    """Field to digital numbers, of a new landscape each time."""
    grid = fifesim.fife_site(30 / 9, window=((0, CELLS), (0, CELLS)))
    lai = fifesim.lai_scene(grid, seed=next(seed))
    return lai.fifesim.surface_reflectance("TM", bands=BANDS).fifesim.to_toa().fifesim.sense("TM")


FIELDS = {
    "soil": fifesim.Field(sd=0.03, arp=0.05, coarser=4),
    "brown": fifesim.Field(mean=0.15, sd=0.06, arp=0.05, coarser=4),
    "crown_cover": fifesim.Field(mean=0.8, sd=0.1, arp=0.05, coarser=4),
    "moisture": fifesim.Field(mean=0.25, sd=0.08, arp=0.05, coarser=4),
}


def landscape_chain(seed, names, **options):
    """The same of a landscape of three classes with some properties that vary."""
    grid = fifesim.fife_site(30 / 9, window=((0, CELLS), (0, CELLS)))
    land = fifesim.landscape(grid, seed=next(seed), **{name: FIELDS[name] for name in names}, **options)
    return land.fifesim.surface_reflectance("TM", bands=BANDS).fifesim.to_toa().fifesim.sense("TM")


def main():
    """Print a table of processor time a cell, and of ratios to the flat chain."""
    lai = fifesim.lai_scene(fifesim.fife_site(30 / 9, window=((0, CELLS), (0, CELLS))), seed=1)
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
    # The largest first: a process that has not had its memory yet pays for that in the first case.
    landscape_chain(iter([1]), FIELDS)
    seeds = iter(range(50, 5000))
    whole = in_turn({"flat": lambda: chain(seeds)})["flat"]
    print(f"flat chain, field to digital numbers: {whole / lai.size * 1e9:.0f} ns a cell, {len(BANDS)} bands\n")
    print("| canopy alone | ns a cell | flat chains |\n|---|---|---|")
    for name, options in cases.items():
        spent = seconds(lambda given=options: fifesim.surface_reflectance(lai, "TM", bands=BANDS, **given))
        print(f"| {name} | {spent / lai.size * 1e9:.0f} | {spent / whole:.2f} |", flush=True)
    dem = fifesim.flint_hills(fifesim.fife_site(30 / 9, window=((0, CELLS), (0, CELLS))), seed=7)
    go = {"covary": {"wetness": 0.4, "elevation": -0.2, "soil": -0.3}, "dem": dem}
    chains = {"flat": lambda: chain(seeds)}
    for names, options in (((), {}), *((list(FIELDS)[: n + 1], {}) for n in range(4)), (list(FIELDS), go)):
        said = ", ".join(["three classes", *names]) + (", leaf area that goes with three" if options else "")
        chains[said] = lambda given=names, more=options: landscape_chain(seeds, given, **more)
    found = in_turn(chains)
    print("\n| whole chain, level ground | flat chains | ns a cell |\n|---|---|---|")
    for said, spent in found.items():
        print(f"| {said} | {spent / found['flat']:.2f} | {spent / lai.size * 1e9:.0f} |", flush=True)


if __name__ == "__main__":
    main()
