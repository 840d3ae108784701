"""Processor time of scenes with cover classes, relative to the same scene without classes, in one run."""

from itertools import count

from scipy import stats
from timing import seconds

import fifesim

BANDS = ["TM3", "TM4"]
CELLS = 2016

# Each call has another landscape, because the last tiles of a field are cached.
SEEDS = count(100)


def table(classes):
    """Classes that differ in all that a table over leaf area holds."""
    return [
        fifesim.CoverClass(
            f"class{number}",
            lai=stats.gamma(8 + number, scale=0.15),
            canopy=fifesim.Canopy(
                leaf_optics={"TM3": (0.06 + 0.001 * number, 0.04), "TM4": (0.45, 0.42 - 0.002 * number)},
                background=0.1 + 0.005 * number,
                leaf_angles=f"campbell({50 + number})",
            ),
        )
        for number in range(classes)
    ]


def main():
    """Print a table of ratios."""
    grid = fifesim.fife_site(30 / 9, window=((0, CELLS), (0, CELLS)))
    patches = fifesim.ground.Patches("voronoi", 300)
    found = {}
    for number in (1, 3, 20):
        classes = table(number)
        land = fifesim.landscape(grid, cover=patches, classes=classes, seed=1)
        found[number] = [
            seconds(lambda kinds=classes: fifesim.landscape(grid, cover=patches, classes=kinds, seed=next(SEEDS))),
            seconds(lambda scene=land: scene.fifesim.surface_reflectance("TM", bands=BANDS)),
        ]
    lone = [
        seconds(lambda: fifesim.lai_scene(grid, table(1)[0].lai, seed=next(SEEDS))),
        seconds(lambda: land.lai.fifesim.surface_reflectance("TM", bands=BANDS)),
    ]
    print(
        f"{CELLS**2 / 1e6:.1f} million cells, {len(BANDS)} bands, {sum(lone):.2f} s of processor time without classes\n"
    )
    print("| | landscape | reflectance | both |\n|---|---|---|---|")
    for name, spent in [("no classes", lone), *((f"{number} classes", each) for number, each in found.items())]:
        ratios = [*(mine / floor for mine, floor in zip(spent, lone, strict=True)), sum(spent) / sum(lone)]
        print(f"| {name} | " + " | ".join(f"{ratio:.2f}" for ratio in ratios) + " |")


if __name__ == "__main__":
    main()
