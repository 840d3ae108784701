"""A contact sheet: a few chips of each part of a dataset, their image above their truth."""

import numpy as np
from matplotlib.figure import Figure

from fifesim.base.bands import GREEN, NEAR_INFRARED, RED, nearest
from fifesim.output.figures import NAMES

_NO_DATA = (0.85, 0.85, 0.85)

# Of each part of the split.
_SHOWN = 4

# Truth in this order, as far as there is any, with its colours.
_TRUTH = {
    "lai": "YlGn",
    "fpar": "viridis",
    "green_fpar": "viridis",
    "brown": "copper_r",
    "soil": "cividis",
    "moisture": "Blues",
}
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
    names = [name for name in _TRUTH if name in chosen][:_ROWS]
    figure = Figure(figsize=(1.15 * chosen.sizes["chip"] + 1.4, 1.25 * (len(names) + 1) + 0.9), layout="constrained")
    axes = figure.subplots(len(names) + 1, chosen.sizes["chip"], squeeze=False)
    colours, said = _composite(chosen)
    for axis, picture in zip(axes[0], colours, strict=True):
        axis.imshow(picture, interpolation="nearest")
    axes[0, 0].set_ylabel(said, fontsize=8)
    for row, name in zip(axes[1:], names, strict=True):
        drawn = _row(row, chosen[name].values, _TRUTH[name])
        row[0].set_ylabel(NAMES.get(name, name).replace(" of ", "\nof "), fontsize=8)
        figure.colorbar(drawn, ax=row, fraction=0.01, pad=0.005).ax.tick_params(labelsize=7)
    for axis in axes.flat:
        axis.set(xticks=[], yticks=[], facecolor=_NO_DATA)
    shown = [(name, chip, not at) for name, chips in parts.items() for at, chip in enumerate(chips)]
    for axis, (name, chip, is_first) in zip(axes[0], shown, strict=True):
        axis.set_title(f"{name if is_first else ''}\nchip {chip}", fontsize=8, fontweight="bold" if is_first else None)
    return figure


def _row(axes, values, colours):
    """One truth of all chips."""
    finite = values[np.isfinite(values)]
    low, high = np.percentile(finite, (0.5, 99.5)) if finite.size else (0.0, 1.0)
    high = max(high, low + 1e-6)
    style = {"cmap": colours, "vmin": low, "vmax": high, "interpolation": "nearest"}
    drawn = [axis.imshow(each, **style) for axis, each in zip(axes, values, strict=True)]
    return drawn[0]


def _composite(chosen):
    """
    False colours, and which bands they are.

    All three span the same range about their own middle: stretched each by itself, bands that vary against each other
    leave nothing but pure colours.
    """
    wavelengths = chosen["wavelength"].values
    numbers = [nearest(wavelengths, window) for window in (NEAR_INFRARED, RED, GREEN)]
    numbers = [number for number in numbers if number is not None] or [0]
    numbers = [*numbers, *numbers[-1:] * 2][:3]
    layers = chosen["toa_reflectance"].values[:, numbers]
    spans = []
    for each in range(3):
        values = layers[:, each][np.isfinite(layers[:, each])]
        spans.append(np.percentile(values, (1, 50, 99)) if values.size else np.array([0.0, 0.5, 1.0]))
    half = max(*(max(high - middle, middle - low) for low, middle, high in spans), 1e-3)
    middles = np.array([middle for _, middle, _ in spans])[:, None, None]
    stretched = np.clip((layers - middles + half) / (2 * half), 0, 1)
    valid = np.isfinite(layers).all(axis=1, keepdims=True)
    pictures = np.concatenate([np.nan_to_num(stretched), valid], axis=1).transpose(0, 2, 3, 1)
    return pictures, "image: " + ",\n".join(dict.fromkeys(str(chosen["band"].values[number]) for number in numbers))
