"""Figures of a run: frequencies and regressions, a panel each, so that a page lays them out by its width."""

import numpy as np
from matplotlib.figure import Figure

from fifesim.analysis.rasters.pairs import matched
from fifesim.output.colours import BAND, LINE, finite
from fifesim.output.words import axis_label, capital
from fifesim.rasters import cf
from fifesim.sensor.raster import to_reflectance

_COLORS = ("#2166ac", "#b2182b", "#1a9850", "#762a83", "#e08214", "#35978f")

# Places of axes and colour bar: laying a figure out by its words takes longer than drawing it. [1]
_PANEL, _BESIDE = (0.15, 0.17, 0.82, 0.72), (0.88, 0.14, 0.025, 0.66)
_PLOT = (0.125, 0.14, 0.73, 0.77)


def fit_figure(image, truth, name, fit):
    """
    Pixels by NDVI and truth, and the regression.

    Parameters
    ----------
    image, truth : xarray.Dataset
        In memory.
    name : str
        Of a variable of the truth.
    fit : fifesim.analysis.regression.Regression

    Returns
    -------
    figure : matplotlib.figure.Figure
    """
    y, x = (each.values.ravel() for each in matched(truth[name], image["ndvi"], "index"))
    both = np.isfinite(x) & np.isfinite(y)
    figure = Figure(figsize=(5.2, 4.1))
    axis = figure.add_axes(_PLOT)
    _density(axis, figure.add_axes(_BESIDE), x[both], y[both])
    line = np.linspace(x[both].min(), x[both].max(), 50)
    interval = fit.prediction_interval(line)
    axis.fill_between(line, *interval, color=BAND, alpha=0.35, linewidth=0, label="95 % prediction interval")
    axis.plot(line, fit.predict(line), color=LINE, linewidth=2, label="least-squares line")
    sign = "+" if fit.slope >= 0 else "−"
    index = cf.QUANTITIES["ndvi"].label
    title = f"{fit.intercept:.3f} {sign} {abs(fit.slope):.3f} {index},  R² = {fit.r2:.3f},  n = {fit.n}"
    axis.set(xlabel=f"{index} at the top of the atmosphere", ylabel=f"True {axis_label(name)}")
    axis.set_title(title.replace("-", "−"), fontsize=10)
    # Above all that is drawn, whichever way the line goes; not below the least that the quantity can be.
    low, high = axis.get_ylim()
    lowest = cf.QUANTITIES[name].lowest
    low = low if lowest is None else max(low, lowest)
    axis.set_ylim(low, high + 0.16 * (high - low))
    axis.legend(frameon=False, loc="upper left", fontsize=8.5, ncols=2, columnspacing=1.2)
    return figure


def _density(axis, beside, x, y):
    """How many pixels lie where, as an image: a hexagon each would be drawn for itself."""
    bins = int(np.clip(np.sqrt(x.size) / 3, 25, 72))
    count, across, up = np.histogram2d(x, y, bins=bins)
    shown = np.log10(np.where(count > 0, count, np.nan)).T
    extent = [across[0], across[-1], up[0], up[-1]]
    most = max(float(np.nanmax(shown)), 0.5)
    # Even one pixel is to be seen: the lightest colour is a grey.
    style = {"cmap": "Greys", "vmin": -0.35 * most, "vmax": most, "aspect": "auto", "origin": "lower"}
    drawn = axis.imshow(shown, extent=extent, interpolation="nearest", **style)
    bar = axis.figure.colorbar(drawn, cax=beside, boundaries=np.linspace(0, most, 64))
    ticks = np.arange(0, np.floor(most) + 1)
    bar.set_ticks(ticks, labels=[f"{10**each:.0f}" for each in ticks])
    bar.ax.tick_params(labelsize=8)
    bar.ax.set_title("pixels", fontsize=8.5)
    axis.margins(0.02)
    axis.autoscale()


def histogram_figures(image, truth, detail):
    """
    Frequencies of leaf area index, FPAR and digital numbers.

    Parameters
    ----------
    image, truth : xarray.Dataset
        In memory.
    detail : xarray.DataArray
        LAI of cells.

    Returns
    -------
    figures : list of matplotlib.figure.Figure
    """
    figures = [Figure(figsize=(3.6, 2.6)) for _ in range(3)]
    leaves, fpar, counts = (figure.add_axes(_PANEL) for figure in figures)
    top = max((float(each.max()) for each in (detail, truth["lai"]) if each.notnull().any()), default=1.0)
    bins = np.linspace(0, max(top, 1e-6), 60)
    for values, label, color in (
        (detail, "cells in the middle", "#a6d96a"),
        (truth["lai"], "means over all pixels", "#1a9850"),
    ):
        leaves.hist(finite(values), bins=bins, density=True, alpha=0.7, label=label, color=color, histtype="stepfilled")
    leaves.set(xlabel=axis_label("lai"), ylabel="density", title=capital(cf.QUANTITIES["lai"].long_name))
    leaves.set_ylim(top=1.22 * leaves.get_ylim()[1])
    leaves.legend(frameon=False, fontsize=7.5, ncols=2, loc="upper center", columnspacing=1.0)
    fpar.hist(finite(truth["fpar"]), bins=60, density=True, histtype="stepfilled", color="#1a9850")
    fpar.set(xlabel=axis_label("fpar"), ylabel="density", title=f"True {cf.QUANTITIES['fpar'].label} of the pixels")
    for number, band in enumerate(image["dn"]["band"].values):
        values = image["dn"].sel(band=band).values
        dn, times = np.unique(values[values > 0], return_counts=True)
        color = _COLORS[number % len(_COLORS)]
        counts.step(dn, times / max(times.sum(), 1), where="mid", label=str(band), color=color, linewidth=1)
    counts.set(xlabel=axis_label("dn"), ylabel="share of pixels", title="Image")
    counts.legend(frameon=False, fontsize=8)
    for axis in (leaves, fpar, counts):
        axis.title.set_size(10)
        axis.tick_params(labelsize=8)
    return figures


def reflectance_change(dn, level, band):
    """
    Planetary reflectance of an image less that of level ground.

    Parameters
    ----------
    dn, level : xarray.DataArray, dims (band, y, x)
        Digital numbers with and without terrain.
    band : str

    Returns
    -------
    change : xarray.DataArray, dims (y, x)
        [1]
    """
    one = [band]
    return (to_reflectance(dn.sel(band=one)) - to_reflectance(level.sel(band=one))).isel(band=0)
