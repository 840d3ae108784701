"""Compute instruments.csv: what each instrument loses over the same ground. It takes half an hour of a processor."""

from itertools import product
from pathlib import Path

import pandas as pd

from fifesim.experiments.scatter.shares import (
    TOTAL,
    VARIATION,
    budget,
    budget_table,
    instrument_scenario,
    window_cells,
)
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.description.spatial_response import knows_blur

NAMES = (
    "MSI", "MSI-B", "MSI-C", "HRV", "TM", "L4TM", "ETM+", "OLI", "OLI2", "EnMAP", "PRISMA", "EMIT", "MSS", "MSS4",
    "MODIS", "MODIS-Aqua", "OLCI", "VIIRS", "AVHRR",
)  # fmt: skip

# Column of the table that states whether the instrument's file has what a stage needs.
KNOWN = {"point spread": "blur", "registration": "place", "noise": "noise"}


def compare_instruments(names, *, arps=(0.05, 0.15, 0.24), realisations=20):
    """Scatter budget of each instrument over the same ground, as a table."""
    found = []
    for name, arp in product(names, arps):
        scenario, description = instrument_scenario(name, arp=arp), instrument(name)
        bands, pixel = description.select(scenario.sensor.bands), scenario.sensor.size
        rows = budget_table(
            budget(scenario, realisations=realisations, cells=window_cells(scenario), each=iter)
        )
        known = {
            "blur": all(knows_blur(description, band) for band in bands),
            "noise": bool(scenario.sensor.noise),
            "place": description.geolocation is not None,
        }
        rows = _without_unknown(rows, known)
        found.append(rows.assign(instrument=description.name, arp=arp, pixel=pixel, **known))
    return pd.concat(found, ignore_index=True)


def _without_unknown(rows, known):
    """Rows of a budget, with NaN where a stage is unknown or a row includes all stages."""
    unknown = [stage for stage, name in KNOWN.items() if not known[name]]
    hidden = rows["stage"].isin([*unknown, TOTAL, VARIATION] if unknown else [])
    numbers = rows.columns.difference(["stage", "variable"])
    return rows.assign(**rows[numbers].mask(hidden))


def main():
    table = compare_instruments(NAMES)
    kept = [
        "instrument",
        "pixel",
        "blur",
        "noise",
        "place",
        "arp",
        "variable",
        "stage",
        "share",
        "share_error",
    ]
    table[kept].to_csv(
        Path(__file__).with_name("instruments.csv"), index=False, float_format="%.4g"
    )


if __name__ == "__main__":
    main()
