"""The datasheet of a dataset: what it is, what was drawn, how it is split, and the range of every variable."""

import hashlib
from pathlib import Path

import numpy as np
import xarray as xr

from fifesim.output import pages
from fifesim.output.chips.pictures import contact_sheet
from fifesim.scenario.chips import is_of_a_landscape

_TEMPLATE = Path(__file__).with_name("datasheet.html.j2")
_DPI = 110

_SEQUENCES = {
    "sobol": ("a scrambled Sobol sequence", "With more chips the first stay as they are."),
    "latin-hypercube": ("a Latin hypercube", "Another number of chips makes all of them others."),
    "random": ("independent random numbers", "With more chips the first stay as they are."),
}


def write(folder, chips, shards, page, picture):
    """
    Write the datasheet and the contact sheet of a dataset.

    Parameters
    ----------
    folder : pathlib.Path
        Of its store, which is whole.
    chips : fifesim.scenario.chips.Chips
    shards : fifesim.output.chips.store.Shards
    page, picture : str
        Names of the files.
    """
    with xr.open_zarr(folder, chunks=None) as dataset:
        sheet = pages.png(contact_sheet(dataset, list(chips.study.split)), _DPI)
        ranges = ranges_of(dataset, shards)
        text = datasheet_page(dataset, chips, ranges, sheet)
    (folder / picture).write_bytes(sheet)
    (folder / page).write_text(text, encoding="utf-8")


def ranges_of(dataset, shards):
    """
    Range and means of the variables of chips, a shard at a time.

    Parameters
    ----------
    dataset : xarray.Dataset
        Lazy.
    shards : fifesim.output.chips.store.Shards

    Returns
    -------
    ranges : dict of str to dict
        By variable ``least``, ``greatest``, ``without``, the share that has no data, ``mean``, and ``means`` by part of
        the split. NaN where there are none.
    """
    split, parts = dataset["split"].values, list(dict.fromkeys(dataset["split"].values.tolist()))
    sums = {str(name): {"least": np.inf, "greatest": -np.inf, "cells": 0} for name in dataset.data_vars}
    totals = {(name, part): np.zeros(2) for name in sums for part in parts}
    for shard in range(len(shards)):
        chosen = slice(*shards.range_of(shard))
        for name, found in sums.items():
            values = dataset[name].isel(chip=chosen).values
            finite = np.isfinite(values)
            found["cells"] += values.size
            if finite.any():
                found["least"] = min(found["least"], float(values[finite].min()))
                found["greatest"] = max(found["greatest"], float(values[finite].max()))
            for part in parts:
                own = split[chosen] == part
                totals[name, part] += finite[own].sum(), values[own].sum(dtype=float, where=finite[own])
    for name, found in sums.items():
        count, total = sum(totals[name, part] for part in parts)
        found["means"] = {part: _ratio(*totals[name, part][::-1]) for part in parts}
        found |= {"mean": _ratio(total, count), "without": 1 - count / found["cells"]}
    return sums


def _ratio(total, count):
    return float(total / count) if count else np.nan


def datasheet_page(dataset, chips, ranges, sheet):
    """
    One self-contained HTML page on a dataset.

    Parameters
    ----------
    dataset : xarray.Dataset
    chips : fifesim.scenario.chips.Chips
    ranges : mapping
        From `ranges_of`.
    sheet : bytes
        The contact sheet, a PNG.

    Returns
    -------
    html : str
    """
    study, scenario = chips.study.to_toml(), chips.study.scenario
    by, prefix = _SEQUENCES[chips.study.sequence]
    about = {
        "chips": len(chips),
        "landscapes": chips.study.landscapes,
        "rows": dataset.sizes["y"],
        "columns": dataset.sizes["x"],
        "pixel": f"{scenario.sensor.size:g}",
        "instrument": scenario.sensor.instrument,
        "bands": dataset["band"].values.tolist(),
        "terrain": "level ground" if scenario.terrain.dem == "flat" else "synthetic hills",
        "engine": scenario.atmosphere.engine,
        "sequence": by,
        "seed": chips.study.seed,
        "prefix": prefix,
        "digest": hashlib.sha256(study.encode()).hexdigest()[:12],
    }
    parts = [_part(chips, name) for name in chips.study.split]
    shown, empty = ([part["name"] for part in parts if bool(part["chips"]) is has] for has in (True, False))
    variables = [_variable(dataset[name], found) for name, found in ranges.items()]
    drawn = [_drawn(chips, key) for key in chips.columns]
    values = {"about": about, "parts": parts, "names": shown, "empty": empty, "variables": variables, "drawn": drawn}
    return pages.html(_TEMPLATE, title=dataset.attrs["title"], study=study, sheet=sheet, **values)


def _part(chips, name):
    own = chips.split == name
    numbers = np.unique(chips.landscape[own]).tolist()
    return {"name": name, "landscapes": len(numbers), "chips": int(own.sum()), "numbers": ", ".join(map(str, numbers))}


def _drawn(chips, key):
    """A row on what is drawn."""
    column, attributes = chips.columns[key], key.attributes
    row = {"name": key.name, "meaning": attributes["long_name"], "unit": attributes.get("units", "")}
    distribution = chips.study.drawn.get(key)
    row["distribution"] = distribution.in_words if distribution else "one after the other"
    row["of"] = "landscape" if is_of_a_landscape(key) else "chip"
    numbers = all(isinstance(value, int | float) and not isinstance(value, bool) for value in column)
    found = (min(column), sum(column) / len(column), max(column)) if numbers else ("", "", "")
    return row | dict(zip(("least", "mean", "greatest"), map(_short, found), strict=True))


def _variable(array, found):
    """A row on a variable."""
    row = {"name": array.name, "meaning": array.attrs["long_name"], "unit": array.attrs["units"]}
    row |= {"dims": ", ".join(map(str, array.dims)), "type": str(array.encoding.get("dtype", array.dtype))}
    row |= {name: _short(found[name]) for name in ("least", "mean", "greatest")}
    means = {name: _short(value) for name, value in found["means"].items()}
    return row | {"without": pages.fixed(100 * found["without"], 1), "means": means}


def _short(value):
    """Four digits of a number."""
    if isinstance(value, str):
        return value
    if isinstance(value, int):
        return str(value)
    return f"{value:.4g}".replace("-", "−") if np.isfinite(value) else "–"
