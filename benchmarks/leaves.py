"""What leaves that differ from cell to cell cost, as ratios to the same scene of equal leaves, in one run."""

import time

import numpy as np
import xarray as xr

import fifesim

BANDS = ["TM3", "TM4"]
CELLS = 500


def seconds(options, lai, times=2):
    """Processor time of the reflectance of a scene, once its tables are made."""
    spent = []
    for _ in range(times):
        start = time.process_time()
        fifesim.surface_reflectance(lai, bands=BANDS, **options)
        spent.append(time.process_time() - start)
    return min(spent)


def main():
    """Print a table of ratios."""
    lai = fifesim.lai_scene(fifesim.fife_site(30, window=((0, CELLS), (0, CELLS))), seed=1)
    chlorophyll = lai.copy(data=np.random.default_rng(1).uniform(20, 60, lai.shape)).drop_attrs(deep=False)
    covers = xr.where(chlorophyll > 40, 1.0, 0.0)
    optics = chlorophyll / 600
    cases = {
        "background by cell": {"background": optics},
        "two covers, two contents": {"leaf_optics": fifesim.Leaf(chlorophyll=30 + 20 * covers, brown=covers)},
        "chlorophyll by cell": {"leaf_optics": fifesim.Leaf(chlorophyll=chlorophyll)},
        "leaf optics by cell": {"leaf_optics": {"TM3": (optics, optics), "TM4": (0.45, 0.42)}},
        "equal leaves, exact": {"exact": True},
    }
    floor = seconds({}, lai, times=9)
    print(f"equal leaves: {lai.size / floor / 1e6:.0f} million cells a second of processor time, {len(BANDS)} bands\n")
    print("| | times equal leaves | us a cell |\n|---|---|---|")
    for name, options in cases.items():
        spent = seconds(options, lai)
        print(f"| {name} | {spent / floor:.3g} | {spent / lai.size * 1e6:.2g} |")


if __name__ == "__main__":
    main()
