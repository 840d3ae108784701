"""
Make intervals.csv: how well retrieved intervals of LAI hold on unseen landscapes, and pixels per second.

    python docs/make_intervals.py          # a quarter of an hour of processor time
"""

import sys
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

import fifesim
from fifesim.retrieval import training

TABLE = Path(__file__).with_name("intervals.csv")
BANDS = {
    "OLI": ["OLI2", "OLI3", "OLI4", "OLI5", "OLI6", "OLI7"],
    "MSI": ["MSI2", "MSI3", "MSI4", "MSI8"],
}
SIDE = {"OLI": 30.0, "MSI": 10.0}
ALIKE, DENSE = (
    "as in the training",
    "LAI of cells uniform from 0 to 4",
)


def study(instrument, landscapes, split, seed, distribution="burned-grazed"):
    """Landscapes whose leaves, soils, texture and atmosphere vary, with noise, blur and registration error."""
    side = 12 * SIDE[instrument]
    draws = {
        "visibility": {"uniform": [10, 60]},
        "arp": {"uniform": [0.1, 0.24]},
        "ground.brown": {"uniform": [0, 0.4]},
        "ground.leaf.chlorophyll": {"uniform": [20, 60]},
        "ground.moisture": {"uniform": [0, 0.8]},
        "ground.soil": {"normal": [0, 0.03], "within": [-0.09, 0.09]},
    }
    for axis in ("down", "across"):
        draws[f"sensor.offset.{axis}"] = {"normal": [0, 0.2], "within": [-1, 1]}
    scenario = fifesim.Scenario(
        grid={"width": side, "height": side, "cell": SIDE[instrument] / 5},
        ground={"leaf": {"water": 0.015}, "seed": seed, "distribution": str(distribution)},
        terrain={"dem": "flat"},
        landscape={"deviations": {"soil": 0.02}},
        sensor={"instrument": instrument, "bands": BANDS[instrument], "noise": ["all"]},
    )
    return fifesim.Study(scenario, draws, landscapes=landscapes, split=split, seed=seed)


def learned(instrument, **options):
    """Chips of 100 landscapes for training."""
    split = {"train": 0.6, "validation": 0.3, "test": 0.1}
    return training.made(study(instrument, 100, split, 1, **options), 200)


def unseen(instrument, seed, **options):
    """Chips of 40 other landscapes."""
    return training.made(study(instrument, 40, {"test": 1.0}, seed, **options), 120)


def scored(retrieval, chips):
    """RMSE of LAI, width of the 95 % interval, coverage by level and its standard error, and the flagged share."""
    if retrieval.level == "surface":
        chips = training.with_surface_reflectance(chips, 1)
    light = (
        chips[f"{retrieval.level}_reflectance"]
        .transpose("chip", "y", "x", "band")
        .values.astype(float)
    )
    truth, landscape = (
        chips["lai"].values.ravel(),
        np.repeat(chips["landscape"].values, light[0, ..., 0].size),
    )
    angles = np.zeros((truth.size, 3))
    angles[:, 0] = float(chips["sza"][0])
    found = retrieval.estimate(light.reshape(truth.size, -1), angles)
    good = (found.flag == 0) & np.isfinite(found.median[:, 0])
    true = xr.DataArray(
        truth[good], dims="pixel", name="lai", coords={"landscape": ("pixel", landscape[good])}
    )
    ends = {
        f"lai_{name}": (("pixel", "level"), getattr(found, name)[good, 0])
        for name in ("low", "high")
    }
    estimate = xr.Dataset(
        {"lai": ("pixel", found.median[good, 0])} | ends, {"level": list(retrieval.levels)}
    )
    score = fifesim.score(estimate, true)
    values = {"rmse": float(score.rmse), "width_95": float(score.width[-1])}
    for level, coverage, error in zip(
        retrieval.levels, score.coverage.values, score.coverage_se.values, strict=True
    ):
        values |= {
            f"coverage_{100 * level:g}": 100 * coverage,
            f"error_{100 * level:g}": 100 * error,
        }
    return values | {"flagged": 100 * (1 - good.mean())}


def speed(retrieval, chips):
    """Pixels per second of processor time."""
    light = (
        chips["toa_reflectance"]
        .transpose("chip", "y", "x", "band")
        .values.reshape(-1, len(retrieval.bands))
    )
    light = np.resize(light, (20_000, light.shape[1])).astype(float)
    angles = np.tile([float(chips["sza"][0]), 0.0, 0.0], (len(light), 1))
    retrieval.estimate(light[:100], angles[:100])
    begun = time.process_time()
    retrieval.estimate(light, angles)
    return len(light) / (time.process_time() - begun)


def rows(instrument, chips, images, prior, cases):
    """Rows of the table for methods, levels and kinds of training pixels."""
    for method, level, pixels in cases:
        options = {"quantities": "lai", "level": level, "pixels": pixels}
        retrieval = fifesim.train(chips, method, **options)
        per_second = round(speed(retrieval, chips), -3)
        for name, own in images.items():
            about = {
                "instrument": instrument,
                "level": level,
                "pixels": pixels,
                "method": method,
                "prior": prior,
            }
            yield about | {"images": name} | scored(retrieval, own) | {"per_second": per_second}
            print(*list(about.values()), name, flush=True)


def main():
    warnings.simplefilter("ignore")
    chain = [
        (method, "toa", "chain")
        for method in ("quantiles", "optimal-estimation", "lookup", "line")
    ]
    compared = [("quantiles", "toa", "uniform")]
    with tempfile.TemporaryDirectory() as folder:
        wide = Path(folder) / "lai.csv"
        wide.write_text(
            "lai\n" + "\n".join(f"{value:.4f}" for value in np.linspace(0, 4, 401)) + "\n"
        )
        dense = {DENSE: unseen("OLI", 9000, distribution=wide)}
        chips, images = learned("OLI"), {ALIKE: unseen("OLI", 5000)}
        found = [*rows("OLI", chips, images, "landscapes", chain + compared)]
        found += rows("OLI", chips, images, "landscapes", [("quantiles", "surface", "chain")])
        found += rows("OLI", chips, dense, "landscapes", chain[:2])
        found += rows(
            "OLI",
            learned("OLI", distribution=wide),
            dense,
            "LAI of cells uniform from 0 to 4",
            chain[:2],
        )
    chips, images = learned("MSI"), {ALIKE: unseen("MSI", 5000)}
    found += rows("MSI", chips, images, "landscapes", [chain[0], *compared])
    pd.DataFrame(found).round(3).to_csv(TABLE, index=False)


if __name__ == "__main__":
    sys.exit(main())
