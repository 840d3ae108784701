"""Compute instruments.csv: what each instrument loses over the same ground. It takes half an hour of a processor."""

from concurrent.futures import ProcessPoolExecutor
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
from fifesim.sensor.description.provenance import UNKNOWN, band_provenance

NAMES = (
    "AVHRR", "MSI", "MSI-B", "MSI-C", "HRV", "TM", "L4TM", "ETM+", "OLI", "OLI2", "EnMAP", "PRISMA", "EMIT", "MSS",
    "MSS4", "MODIS", "MODIS-Aqua", "OLCI", "VIIRS",
)  # fmt: skip

# Column of the table that states whether the instrument's file has what a stage needs.
KNOWN = {"point spread": "blur", "registration": "place", "noise": "noise"}

# Best known blur, and both ends of its uncertainty.
RESPONSES = ("system", "sharpest", "softest")


def compare_instruments(names, *, arps=(0.05, 0.15, 0.24), realisations=8):
    """Scatter budget of each instrument over the same ground, with each end of its blur, as a table."""
    found = []
    for name, arp, response in product(names, arps, RESPONSES):
        description = instrument(name)
        bands = description.red_and_near_infrared()
        blurs = [band_provenance(description, "blur", band) for band in bands]
        if response != "system" and any(row.uncertainty is None for row in blurs):
            continue
        scenario = instrument_scenario(
            name, arp=arp, response=None if response == "system" else response
        )
        bands, pixel = description.select(scenario.sensor.bands), scenario.sensor.size
        rows = budget_table(
            budget(
                scenario,
                realisations=realisations,
                cells=window_cells(scenario),
                each=iter,
            )
        )
        known = {
            name: all(
                band_provenance(description, quantity, band).origin != UNKNOWN for band in bands
            )
            for name, quantity in (
                ("blur", "blur"),
                ("noise", "noise"),
                ("place", "geolocation"),
            )
        }
        origins = {
            f"{quantity} origin": " and ".join(
                dict.fromkeys(
                    band_provenance(description, quantity, band).origin for band in bands
                )
            )
            for quantity in ("blur", "noise", "geolocation")
        }
        rows = _without_unknown(rows, known)
        row = {"instrument": description.name, "arp": arp, "pixel": pixel, "response": response}
        found.append(rows.assign(**row, **known, **origins))
    return pd.concat(found, ignore_index=True)


def _without_unknown(rows, known):
    """Rows of a budget, with NaN where a stage is unknown or a row includes all stages."""
    unknown = [stage for stage, name in KNOWN.items() if not known[name]]
    hidden = rows["stage"].isin([*unknown, TOTAL, VARIATION] if unknown else [])
    numbers = rows.columns.difference(["stage", "variable"])
    return rows.assign(**rows[numbers].mask(hidden))


def main():
    with ProcessPoolExecutor(2) as pool:
        table = pd.concat(pool.map(compare_instruments, [[name] for name in NAMES]))
    kept = [
        "instrument",
        "pixel",
        "blur",
        "noise",
        "place",
        "blur origin",
        "noise origin",
        "geolocation origin",
        "response",
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
