"""What leaves that differ from cell to cell cost, as ratios to the same scene of equal leaves, in one run."""

import numpy as np
import xarray as xr
from timing import seconds

import fifesim

BANDS = ["TM3", "TM4"]
CELLS = 500


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
        "equal leaves, exact": {},
    }

    def spent_on(options, times=2, exact=False):
        canopy = fifesim.Canopy(**options)
        return seconds(lambda: fifesim.surface_reflectance(lai, bands=BANDS, canopy=canopy, exact=exact), times)

    floor = spent_on({}, times=9)
    print(f"equal leaves: {lai.size / floor / 1e6:.0f} million cells a second of processor time, {len(BANDS)} bands\n")
    print("| | times equal leaves | us a cell |\n|---|---|---|")
    for name, options in cases.items():
        spent = spent_on(options, exact=name.endswith("exact"))
        print(f"| {name} | {spent / floor:.3g} | {spent / lai.size * 1e6:.2g} |")


if __name__ == "__main__":
    main()
