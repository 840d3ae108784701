"""Datasheet of a dataset: its contents, draws, split and variable ranges, with a contact sheet."""

import hashlib
import warnings
from pathlib import Path

import dask
import dask.array as da
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from fifesim.grids import cf
from fifesim.output import report
from fifesim.output.colours import NO_DATA, colours_of, dark_and_bright, percentile_limits, stretched
from fifesim.output.maps import false_colour_names
from fifesim.scenario.chips import is_of_a_landscape

# Chips per part of the split on the contact sheet.
_SHOWN = 4

# Maximum number of truth rows, in the order of the table of quantities.
_ROWS = 3


def contact_sheet(dataset, parts):
    """Contact sheet of the first chips of each part of a dataset; all chips of a row share their colours."""
    split = dataset["split"].values
    parts = {name: chips for name in parts if (chips := np.flatnonzero(split == name)[:_SHOWN]).size}
    chosen = dataset.isel(chip=np.concatenate(list(parts.values()))).load()
    names = [name for name in cf.QUANTITIES if name != "ndvi" and name in chosen and chosen[name].ndim == 3][:_ROWS]
    figure = Figure(figsize=(1.15 * chosen.sizes["chip"] + 1.4, 1.25 * (len(names) + 1) + 0.9), layout="constrained")
    axes = figure.subplots(len(names) + 1, chosen.sizes["chip"], squeeze=False)
    rows = [_image_row(axes[0], chosen)]
    rows += [(cf.QUANTITIES[name].label, _row(row, chosen[name])) for row, name in zip(axes[1:], names, strict=True)]
    for row, (label, drawn) in zip(axes, rows, strict=True):
        row[0].set_ylabel(label.replace(" of ", "\nof "), fontsize=8)
        if drawn is not None:
            figure.colorbar(drawn, ax=row, fraction=0.01, pad=0.005).ax.tick_params(labelsize=7)
    for axis in axes.flat:
        axis.set(xticks=[], yticks=[], facecolor=NO_DATA)
    shown = [(name, chip, not at) for name, chips in parts.items() for at, chip in enumerate(chips)]
    for axis, (name, chip, is_first) in zip(axes[0], shown, strict=True):
        axis.set_title(f"{name if is_first else ''}\nchip {chip}", fontsize=8, fontweight="bold" if is_first else None)
    return figure


def _row(axes, array):
    """Draw one quantity of all chips."""
    colours, middle = colours_of(array.name)
    low, high = percentile_limits(array, middle=middle)
    style = {"cmap": colours, "vmin": low, "vmax": max(high, low + 1e-6), "interpolation": "nearest"}
    drawn = [axis.imshow(each, **style) for axis, each in zip(axes, array.values, strict=True)]
    return drawn[0]


def _image_row(axes, chosen):
    """Draw the images in false colours, else NDVI, else one band; return the label and the colour bar."""
    names = false_colour_names(chosen["toa_reflectance"])
    if not names and "ndvi" in chosen:
        return f"{cf.QUANTITIES['ndvi'].label} of the image", _row(axes, chosen["ndvi"])
    last = str(chosen["band"].values[-1])
    layers = chosen["toa_reflectance"].sel(band=names or [last] * 3).transpose("band", ...).values
    spans = map(dark_and_bright, layers)
    shares = [stretched(layer, low, max(high, low + 1e-6)) for layer, (low, high) in zip(layers, spans, strict=True)]
    pictures = np.stack([*np.nan_to_num(shares), np.isfinite(layers).all(axis=0)], axis=-1)
    for axis, picture in zip(axes, pictures, strict=True):
        axis.imshow(picture, interpolation="nearest")
    return "image: " + ",\n".join(names or [last]), None


_TEMPLATE = Path(__file__).with_name("datasheet.html.j2")
_DPI = 110

_SEQUENCES = {"sobol": "a scrambled Sobol sequence", "random": "independent random numbers"}


def write_datasheet(folder, chips, shards, page, picture):
    """Write the datasheet and the contact sheet of a dataset."""
    with xr.open_zarr(folder, chunks=None) as dataset:
        sheet = report.png(contact_sheet(dataset, list(chips.study.split)), _DPI)
        ranges = ranges_of(dataset, shards.length)
        text = datasheet_page(dataset, chips, ranges, sheet)
    (folder / picture).write_bytes(sheet)
    (folder / page).write_text(text, encoding="utf-8")


def ranges_of(dataset, length):
    """Range, mean and missing share of the variables of chips by name, read in pieces of some chips."""
    split, found = dataset["split"].values, {}
    for name, variable in dataset.chunk(chip=length).data_vars.items():
        values = variable.data
        row = {"least": da.nanmin(values), "greatest": da.nanmax(values), "mean": da.nanmean(values, dtype=float)}
        means = {part: da.nanmean(values[split == part], dtype=float) for part in dict.fromkeys(split.tolist())}
        found[str(name)] = row | {"without": da.isnan(values).mean(), "means": means}
    with warnings.catch_warnings():
        # A variable without data has no range.
        warnings.simplefilter("ignore", RuntimeWarning)
        return dask.compute(found)[0]


def datasheet_page(dataset, chips, ranges, sheet):
    """One self-contained HTML page about a dataset."""
    study, scenario = chips.study.to_toml(), chips.study.scenario
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
        "sequence": _SEQUENCES[chips.study.sequence],
        "seed": chips.study.seed,
        "digest": hashlib.sha256(study.encode()).hexdigest()[:12],
    }
    parts = [_part(chips, name) for name in chips.study.split]
    shown, empty = ([part["name"] for part in parts if bool(part["chips"]) is has] for has in (True, False))
    variables = [_variable(dataset[name], found) for name, found in ranges.items()]
    drawn = [_drawn(chips, key) for key in chips.columns]
    values = {"about": about, "parts": parts, "names": shown, "empty": empty, "variables": variables, "drawn": drawn}
    return report.page_html(_TEMPLATE, title=dataset.attrs["title"], study=study, sheet=sheet, **values)


def _part(chips, name):
    own = chips.split == name
    numbers = np.unique(chips.landscape[own]).tolist()
    return {"name": name, "landscapes": len(numbers), "chips": int(own.sum()), "numbers": ", ".join(map(str, numbers))}


def _drawn(chips, key):
    """Table row of a drawn quantity."""
    column, attributes = chips.columns[key], key.attributes
    row = {"name": key.name, "meaning": attributes["long_name"], "unit": attributes.get("units", "")}
    distribution = chips.study.drawn.get(key)
    row["distribution"] = distribution.in_words if distribution else "in sequence"
    row["of"] = "landscape" if is_of_a_landscape(key) else "chip"
    numbers = all(isinstance(value, int | float) and not isinstance(value, bool) for value in column)
    found = (min(column), sum(column) / len(column), max(column)) if numbers else ("", "", "")
    return row | dict(zip(("least", "mean", "greatest"), map(_short, found), strict=True))


def _variable(array, found):
    """Table row of a variable."""
    row = {"name": array.name, "meaning": array.attrs["long_name"], "unit": array.attrs["units"]}
    row |= {"dims": ", ".join(map(str, array.dims)), "type": str(array.encoding.get("dtype", array.dtype))}
    row |= {name: _short(found[name]) for name in ("least", "mean", "greatest")}
    means = {name: _short(value) for name, value in found["means"].items()}
    return row | {"without": report.fixed(100 * found["without"], 1), "means": means}


def _short(value):
    """Number with four digits."""
    if isinstance(value, str):
        return value
    if isinstance(value, int):
        return str(value)
    return f"{value:.4g}".replace("-", "−") if np.isfinite(value) else "–"
