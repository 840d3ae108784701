"""Time of leaves that differ between cells, relative to the same scene with equal leaves, in one run."""

import numpy as np
import xarray as xr
from timing import seconds

import fifesim

BANDS = ["TM3", "TM4"]
CELLS = 500
SIX = ["OLI2", "OLI3", "OLI4", "OLI5", "OLI6", "OLI7"]
SPECTRA = 60_000


def drawn(count):
    """Canopies of which everything is drawn."""
    random = np.random.default_rng(2)
    ranges = {
        "lai": (0, 6),
        "brown": (0, 0.9),
        "dissociation": (0, 1),
        "crown_cover": (0.5, 1),
        "hotspot": (0.01, 0.3),
        "soil": (-0.05, 0.05),
        "moisture": (0, 1),
        "sza": (10, 60),
        "vza": (0, 50),
        "raa": (0, 180),
        "diffuse_fraction": (0, 0.5),
        "leaf_structure": (1.2, 2.5),
        "leaf_chlorophyll": (10, 80),
        "leaf_water": (0.005, 0.03),
        "leaf_dry_matter": (0.002, 0.02),
    }
    return {name: random.uniform(*each, count) for name, each in ranges.items()}


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
    canopies = drawn(SPECTRA)
    print(f"equal leaves: {lai.size / floor / 1e6:.0f} million cells a second of processor time, {len(BANDS)} bands\n")
    print("| | times equal leaves | us a cell |\n|---|---|---|")
    for name, options in cases.items():
        spent = spent_on(options, exact=name.endswith("exact"))
        print(f"| {name} | {spent / floor:.3g} | {spent / lai.size * 1e6:.2g} |")
    one = seconds(lambda: fifesim.ground.canopy_spectra(canopies, "OLI", bands=SIX), 2)
    jacobian = seconds(lambda: fifesim.ground.canopy_spectra(canopies, "OLI", bands=SIX, derivatives=list(canopies)), 2)
    work = f"{SPECTRA} uniform canopies in {len(SIX)} bands, {len(canopies)} quantities drawn"
    print(f"\n{work}: {one:.2g} s of processor time; with all derivatives {jacobian / one:.2g} times that")


if __name__ == "__main__":
    main()
