"""A contact sheet: a few chips of each part of a dataset, their image above their truth, in the report's colours."""

import numpy as np
from matplotlib.figure import Figure

from fifesim.output.colours import NO_DATA, colours_of, dark_and_bright, percentile_limits
from fifesim.output.composites import false_colour_names
from fifesim.rasters import cf

# Of each part of the split.
_SHOWN = 4

# Rows of truth at most, in the order of the table of quantities.
_ROWS = 3


def contact_sheet(dataset, parts):
    """
    Pictures of the first chips of each part of a dataset.

    Parameters
    ----------
    dataset : xarray.Dataset
        Of chips, lazy or in memory.
    parts : sequence of str
        Parts of the split in their order; those without chips are left out.

    Returns
    -------
    figure : matplotlib.figure.Figure
        All chips of a row share their colours.
    """
    split = dataset["split"].values
    parts = {name: chips for name in parts if (chips := np.flatnonzero(split == name)[:_SHOWN]).size}
    chosen = dataset.isel(chip=np.concatenate(list(parts.values()))).load()
    names = [name for name in cf.QUANTITIES if name != "ndvi" and name in chosen and chosen[name].ndim == 3][:_ROWS]
    figure = Figure(figsize=(1.15 * chosen.sizes["chip"] + 1.4, 1.25 * (len(names) + 1) + 0.9), layout="constrained")
    axes = figure.subplots(len(names) + 1, chosen.sizes["chip"], squeeze=False)
    said, drawn = _image_row(axes[0], chosen)
    rows = [(said, drawn)]
    rows += [(cf.QUANTITIES[name].label, _row(row, chosen[name])) for row, name in zip(axes[1:], names, strict=True)]
    for row, (said, drawn) in zip(axes, rows, strict=True):
        row[0].set_ylabel(said.replace(" of ", "\nof "), fontsize=8)
        if drawn is not None:
            figure.colorbar(drawn, ax=row, fraction=0.01, pad=0.005).ax.tick_params(labelsize=7)
    for axis in axes.flat:
        axis.set(xticks=[], yticks=[], facecolor=NO_DATA)
    shown = [(name, chip, not at) for name, chips in parts.items() for at, chip in enumerate(chips)]
    for axis, (name, chip, is_first) in zip(axes[0], shown, strict=True):
        axis.set_title(f"{name if is_first else ''}\nchip {chip}", fontsize=8, fontweight="bold" if is_first else None)
    return figure


def _row(axes, array):
    """One quantity of all chips."""
    colours, middle = colours_of(array.name)
    low, high = percentile_limits(array, middle=middle)
    style = {"cmap": colours, "vmin": low, "vmax": max(high, low + 1e-6), "interpolation": "nearest"}
    drawn = [axis.imshow(each, **style) for axis, each in zip(axes, array.values, strict=True)]
    return drawn[0]


def _image_row(axes, chosen):
    """Images in false colours; without the bands for these their NDVI; without that one band. What it is, and a bar."""
    names = false_colour_names(chosen["toa_reflectance"])
    if not names and "ndvi" in chosen:
        return f"{cf.QUANTITIES['ndvi'].label} of the image", _row(axes, chosen["ndvi"])
    said, names = ",\n".join(names or chosen["band"].values[-1:]), names or [chosen["band"].values[-1]] * 3
    layers = chosen["toa_reflectance"].sel(band=names).values
    limits = [dark_and_bright(each) for each in layers.swapaxes(0, 1)]
    dark, bright = np.array(limits).T[:, :, None, None]
    stretched = np.clip((layers - dark) / np.maximum(bright - dark, 1e-6), 0, 1)
    valid = np.isfinite(layers).all(axis=1, keepdims=True)
    pictures = np.concatenate([np.nan_to_num(stretched), valid], axis=1).transpose(0, 2, 3, 1)
    for axis, picture in zip(axes, pictures, strict=True):
        axis.imshow(picture, interpolation="nearest")
    return f"image: {said}", None
