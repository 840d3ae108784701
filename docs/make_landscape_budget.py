"""
Make landscape_budget.csv: what each stage takes from LAI on NDVI over the default landscape, for three instruments.

    python docs/make_landscape_budget.py          # a quarter of an hour of processor time
    python docs/make_landscape_budget.py TM MSI   # some of them
"""

import sys
from pathlib import Path

import pandas as pd

from fifesim.experiments.scatter.shares import budget, budget_table, instrument_scenario
from fifesim.scenario.scenario import Scenario, default_scenario

TABLE = Path(__file__).with_name("landscape_budget.csv")

# Cells along a window, which hold several pastures and enough pixels, and how many windows.
WINDOWS = {"TM": (600, 12), "MSI": (600, 12), "MODIS": (900, 4)}


def scenario_of(name):
    """The default landscape as an instrument sees it, with all that is known of that."""
    sections = default_scenario().model_dump(exclude_unset=True)
    seen = instrument_scenario(name).model_dump(exclude_unset=True)
    return Scenario(**sections | {"sensor": seen["sensor"]})


def rows_of(name):
    """Rows of the table of one instrument."""
    cells, realisations = WINDOWS[name]
    found = budget_table(budget(scenario_of(name), realisations=realisations, cells=cells))
    return found.assign(instrument=name, cells=cells, realisations=realisations)


def main():
    kept = pd.read_csv(TABLE) if TABLE.exists() else pd.DataFrame()
    for name in sys.argv[1:] or WINDOWS:
        rows = rows_of(name)
        kept = pd.concat(
            [kept[kept["instrument"] != name], rows] if len(kept) else [rows], ignore_index=True
        )
        columns = ["instrument", "cells", "realisations", "variable", "stage"]
        columns += ["share", "share_error", "alone", "alone_error", "first", "first_error"]
        kept[columns].to_csv(TABLE, index=False, float_format="%.4g")


if __name__ == "__main__":
    main()
