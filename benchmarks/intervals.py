"""Coverage and width of retrieved LAI intervals on unseen landscapes, and pixels per second of each method."""

import argparse
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np
import xarray as xr

import fifesim
from fifesim.retrieval import training

BANDS = {"OLI": ["OLI2", "OLI3", "OLI4", "OLI5", "OLI6", "OLI7"], "MSI": ["MSI2", "MSI3", "MSI4", "MSI8"]}
SIDE = {"OLI": 30.0, "MSI": 10.0}


def study(instrument, pixels, landscapes, split, seed, covary, is_chain=True, distribution="burned-grazed"):
    """Landscapes whose leaves, soils, texture and atmosphere vary; noise, blur and registration if `is_chain`."""
    side = pixels * SIDE[instrument]
    sensor = {"instrument": instrument, "bands": BANDS[instrument], "noise": ["all"]}
    draws = {
        "visibility": {"uniform": [10, 60]},
        "arp": {"uniform": [0.1, 0.24]},
        "ground.brown": {"uniform": [0, 0.4]},
        "ground.leaf.chlorophyll": {"uniform": [20, 60]},
        "ground.moisture": {"uniform": [0, 0.8]},
        "ground.soil": {"normal": [0, 0.03], "within": [-0.09, 0.09]},
    }
    landscape = {}
    if covary is not None:
        landscape = {"deviations": {"soil": 0.02}}
        draws["landscape.covary.soil"] = {"uniform": covary}
    if is_chain:
        for axis in ("down", "across"):
            draws[f"sensor.offset.{axis}"] = {"normal": [0, 0.2], "within": [-1, 1]}
    scenario = fifesim.Scenario(
        grid={"width": side, "height": side, "cell": SIDE[instrument] / 5},
        ground={"leaf": {"water": 0.015}, "seed": seed, "distribution": str(distribution)},
        terrain={"dem": "flat"}, sensor=sensor, landscape=landscape,
    )  # fmt: skip
    return fifesim.Study(scenario, draws, landscapes=landscapes, split=split, seed=seed)


def scored(retrieval, chips):
    """Coverage by level, mean width of the 95 % interval and RMSE of LAI, and the share of flagged pixels."""
    names = list(retrieval.bands)
    light = chips["toa_reflectance"].sel(band=names).transpose("chip", "y", "x", "band").values
    truth = chips["lai"].values.ravel()
    angles = np.zeros((truth.size, 3))
    angles[:, 0] = np.repeat(chips["sza"].values, light[0, ..., 0].size)
    found = retrieval.estimate(light.reshape(-1, len(names)).astype(float), angles)
    landscape = np.repeat(chips["landscape"].values, light[0, ..., 0].size)
    good = (found.flag == 0) & np.isfinite(found.median[:, 0])
    true = xr.DataArray(truth[good], dims="pixel", name="lai", coords={"landscape": ("pixel", landscape[good])})
    level = xr.DataArray(list(retrieval.levels), dims="level")
    estimate = xr.Dataset(
        {"lai": ("pixel", found.median[good, 0]), "lai_low": (("pixel", "level"), found.low[good, 0]),
         "lai_high": (("pixel", "level"), found.high[good, 0])}, {"level": level},
    )  # fmt: skip
    score = fifesim.score(estimate, true)
    coverage = " / ".join(f"{100 * each:.0f}" for each in score.coverage.values)
    return f"{float(score.rmse):.3f} | {float(score.width[-1]):.2f} | {coverage} | {100 * (1 - good.mean()):.0f} %"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--instrument", default="OLI", choices=BANDS)
    parser.add_argument("--chips", type=int, default=600)
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    split = {"train": 0.6, "validation": 0.3, "test": 0.1}
    plan = {"instrument": given.instrument, "pixels": 12, "covary": (-0.7, 0.0), "split": split}
    learned = training._made(study(landscapes=100, seed=1, **plan), given.chips)
    unseen = {}
    for name, covary in (("drawn from -0.7 to 0", (-0.7, 0.0)), ("-0.6", (-0.6001, -0.6))):
        new = study(**(plan | {"covary": covary, "landscapes": 40, "seed": 5000, "split": {"test": 1.0}}))
        unseen[name] = training._made(new, 240)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "lai.csv"
        path.write_text("lai\n" + "\n".join(f"{value:.4f}" for value in np.linspace(0, 4, 401)) + "\n")
        wide = plan | {"landscapes": 40, "seed": 9000, "split": {"test": 1.0}, "distribution": path}
        unseen["drawn, LAI uniform from 0 to 4"] = training._made(study(**wide), 240)
    print(
        "| method | soil covariance | RMSE | width of 95 % | coverage of 50 / 80 / 95 % | flagged | pixels per second |"
    )
    print("|---|---|---|---|---|---|---|")
    for method in ("quantiles", "lookup", "line"):
        retrieval = fifesim.train(learned, method, quantities=("lai",))
        light = learned["toa_reflectance"].values.transpose(0, 2, 3, 1).reshape(-1, len(retrieval.bands))
        light = np.resize(light, (2000 if method == "lookup" else 200_000, light.shape[1])).astype(float)
        angles = np.tile([float(learned["sza"][0]), 0.0, 0.0], (len(light), 1))
        retrieval.estimate(light[:100], angles[:100])
        begun = time.process_time()
        retrieval.estimate(light, angles)
        speed = len(light) / (time.process_time() - begun)
        for name, chips in unseen.items():
            print(f"| {method} | {name} | {scored(retrieval, chips)} | {speed:,.0f} |", flush=True)


if __name__ == "__main__":
    main()
