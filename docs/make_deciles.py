"""
Make deciles.csv: bias and coverage of retrieved LAI and FPAR by decile of the estimate and of the truth.

    python docs/make_deciles.py          # a quarter of an hour of processor time
"""

import sys
import warnings
from pathlib import Path

import pandas as pd

import fifesim
from fifesim.retrieval import training

TABLE = Path(__file__).with_name("deciles.csv")
BANDS = {
    "TM": ["TM2", "TM3", "TM4", "TM5"],
    "OLI": ["OLI3", "OLI4", "OLI5", "OLI6"],
    "MSI": ["MSI2", "MSI3", "MSI4", "MSI8"],
}
SIDE = {"TM": 30.0, "OLI": 30.0, "MSI": 10.0}
SEEDS = {"TM": 8801, "OLI": 8802, "MSI": 8803}


def study(instrument, landscapes=240):
    """Landscapes of one chip of 20 x 20 pixels each, of which 96 are for the test."""
    side, draws = (
        20 * SIDE[instrument],
        {
            "visibility": {"uniform": [10, 60]},
            "arp": {"uniform": [0.1, 0.24]},
            "ground.brown": {"uniform": [0, 0.4]},
            "ground.leaf.chlorophyll": {"uniform": [20, 60]},
            "ground.soil": {"normal": [0, 0.03], "within": [-0.09, 0.09]},
        },
    )
    for axis in ("down", "across"):
        draws[f"sensor.offset.{axis}"] = {"normal": [0, 0.2], "within": [-1, 1]}
    scenario = fifesim.Scenario(
        grid={"width": side, "height": side, "cell": SIDE[instrument] / 5},
        ground={"seed": SEEDS[instrument]},
        terrain={"dem": "flat"},
        landscape={"deviations": {"soil": 0.02}},
        sensor={"instrument": instrument, "bands": BANDS[instrument], "noise": ["all"]},
    )
    split = {"train": 0.4, "validation": 0.2, "test": 0.4}
    return fifesim.Study(
        scenario, draws, landscapes=landscapes, split=split, seed=SEEDS[instrument]
    )


def rows(instrument, chips):
    """Scores of optimal estimation and of the network by quantity and decile."""
    for method in ("optimal-estimation", "quantiles"):
        score = fifesim.train(chips, method).score
        for level in (0.5, 0.95):
            for name in ("coverage_by_estimate", "coverage_by_truth"):
                score[f"{name}_{100 * level:g}"] = score[name].sel(level=level, drop=True)
        names = ["rmse", "slope", *(name for name in score if "_by_" in name)]
        names = [name for name in names if "level" not in score[name].dims]
        table = score[names].to_dataframe().reset_index()
        yield table.assign(instrument=instrument, method=method)
        print(instrument, method, flush=True)


def main():
    warnings.simplefilter("ignore")
    found = [
        table
        for instrument in BANDS
        for table in rows(instrument, training.made(study(instrument), 240))
    ]
    pd.concat(found).set_index(["instrument", "method", "quantity", "decile"]).round(4).to_csv(
        TABLE
    )


if __name__ == "__main__":
    sys.exit(main())
