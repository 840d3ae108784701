"""Figures 3 to 9 of Friedl et al. (1995), from scenes of one seed."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from fifesim.analysis import density, regression, scaling
from fifesim.analysis.rasters import indices
from fifesim.analysis.rasters.means import aggregate
from fifesim.chain import steps as chain
from fifesim.chain.images import ndvi, planetary_reflectance
from fifesim.chain.setup import image_of, reflectance_of
from fifesim.experiments.friedl1995 import case as friedl1995
from fifesim.experiments.friedl1995 import table as friedl1995_table
from fifesim.experiments.friedl1995.case import ARPS, BANDS, PIXEL, VARIABLES
from fifesim.ground.landscape.distribution import treatments

# Okabe and Ito's colours, which the colour-blind tell apart; dashes and markers tell them apart in grey.
_COLORS = ("#0072B2", "#D55E00", "#009E73")
_DASHES = ("-", "--", ":")
_BLACK, _GREY = "#222222", "#767676"
_DOT = {"s": 9, "linewidths": 0, "alpha": 0.75}

_LABELS = {"lai": "LAI [m² m⁻²]", "fpar": "FPAR [1]", "ndvi": "NDVI [1]"}
_FIGURE_WIDTH = 7.2
BURNED_GRAZED = "burned-grazed"


def pixels(case, treatment, seed):
    """
    What figures 4 to 9 show, of the three scenes of a treatment.

    Parameters
    ----------
    case : fifesim.experiments.friedl1995.case.Case
    treatment : str
    seed : int

    Returns
    -------
    scenes : list of dict
        For each arp: ``cells``, LAI by cells; ``of_cells``, a dict of LAI, FPAR and TOA NDVI of all cells;
        ``pixels``, a dict of values over pixels, among them means of the products of reflectances; ``sample``, the
        same of a sample of 200.
    """
    return [_scene(case, treatment, arp, seed) for arp in ARPS]


def figure3(case):
    """
    Densities of LAI of the three treatments.

    Parameters
    ----------
    case : fifesim.experiments.friedl1995.case.Case

    Returns
    -------
    figure : matplotlib.figure.Figure
    """
    figure = Figure(figsize=(4.6, 3.2), layout="constrained")
    axis = figure.subplots()
    for treatment, color, dash in zip(treatments(), _COLORS, _DASHES, strict=True):
        distribution = case.densities[treatment]
        low, high = distribution.support()
        at = np.linspace(low, high, 400)
        # Down to zero where the density is cut off.
        axis.plot(
            [low, *at, high], [0, *distribution.pdf(at), 0], dash, color=color, label=treatment.replace("-", ", ")
        )
    axis.set(xlabel=_LABELS["lai"], ylabel="density [m² m⁻²]⁻¹", xlim=(0, None), ylim=(0, None))
    _finish(axis)
    axis.legend(frameon=False, fontsize=8)
    return figure


def figure4(scenes):
    """
    LAI of the cells at three values of arp.

    Parameters
    ----------
    scenes : list of dict
        From `pixels`.

    Returns
    -------
    figure : matplotlib.figure.Figure
    """
    figure = Figure(figsize=(_FIGURE_WIDTH, 2.75), layout="constrained")
    axes = figure.subplots(1, len(ARPS), sharey=True)
    high = max(float(scene["cells"].max()) for scene in scenes)
    for axis, scene, arp in zip(axes, scenes, ARPS, strict=True):
        cells = scene["cells"]
        shown = cells[: min(120, cells.shape[0]), : min(120, cells.shape[1])]
        extent = np.array([0, shown.shape[1], shown.shape[0], 0]) * friedl1995.CELL
        drawn = axis.imshow(shown, cmap="viridis", vmin=0, vmax=high, extent=extent, interpolation="nearest")
        axis.set(xlabel="east [m]", title=f"arp {arp:g}")
        axis.title.set_fontsize(9)
        axis.xaxis.set_major_locator(MaxNLocator(4))
        axis.yaxis.set_major_locator(MaxNLocator(4))
        axis.tick_params(labelsize=8)
    axes[0].set_ylabel("south [m]")
    figure.colorbar(drawn, ax=axes, label=_LABELS["lai"], shrink=0.9)
    return figure


def figure5(scenes):
    """
    LAI and FPAR against NDVI at the ground and at the top of the atmosphere.

    Parameters
    ----------
    scenes : list of dict

    Returns
    -------
    figure : matplotlib.figure.Figure
    """
    figure = Figure(figsize=(_FIGURE_WIDTH, 8.2), layout="constrained")
    axes = figure.subplots(len(ARPS), len(VARIABLES))
    for row, scene, arp in zip(axes, scenes, ARPS, strict=True):
        values = scene["sample"]
        for axis, variable in zip(row, VARIABLES, strict=True):
            truth, toa, boa = values[variable], values["ndvi"], values["boa_ndvi"]
            axis.scatter(boa, truth, color=_COLORS[0], marker="^", label="ground (BOA)", **_DOT)
            axis.scatter(toa, truth, color=_COLORS[1], marker="o", label="sensor (TOA)", **_DOT)
            fit = regression.fit(regression.row_sums(truth[None], toa[None], truth.mean(), toa.mean()), truth.mean(),
                                 toa.mean())  # fmt: skip
            at = np.linspace(toa.min(), toa.max(), 60)
            axis.plot(at, fit.predict(at), "--", color=_BLACK, linewidth=1.3, label="line through TOA")
            for limit, name in zip(fit.confidence_interval(at), ("95 % confidence", None), strict=True):
                axis.plot(at, limit, color=_BLACK, linewidth=0.9, label=name)
            low, high = fit.prediction_interval(at)
            axis.fill_between(at, low, high, color=_GREY, alpha=0.2, linewidth=0, label="95 % prediction")
            axis.set(xlabel=_LABELS["ndvi"], ylabel=_LABELS[variable])
            axis.set_title(f"arp {arp:g}: R² = {fit.r2:.2f} (TOA), {np.corrcoef(boa, truth)[0, 1] ** 2:.3f} (BOA)")
            _finish(axis)
    _legend_below(figure, axes[0, 0])
    return figure


def figure6(scenes):
    """
    Densities of LAI, FPAR and NDVI of the cells and of the pixels.

    Parameters
    ----------
    scenes : list of dict

    Returns
    -------
    figure : matplotlib.figure.Figure
    """
    figure = Figure(figsize=(_FIGURE_WIDTH, 2.9), layout="constrained")
    for axis, variable in zip(figure.subplots(1, 3), (*VARIABLES, "ndvi"), strict=True):
        cells = scenes[-1]["of_cells"][variable]
        at = np.linspace(cells.min(), cells.max(), 500)
        counts, edges = np.histogram(cells, bins=400)
        bandwidth = density.silverman_bandwidth(cells.std(), np.subtract(*np.percentile(cells, (75, 25))), cells.size)
        axis.plot(at, density.gaussian_density((edges[1:] + edges[:-1]) / 2, at, bandwidth, counts), color=_BLACK,
                  linewidth=1, label="cells")  # fmt: skip
        for scene, arp, color, dash in zip(scenes, ARPS, _COLORS, _DASHES, strict=True):
            found = density.sample_density(scene["sample"][variable], at)
            axis.plot(at, found, dash, color=color, label=f"pixels, arp {arp:g}")
        unit = "[m² m⁻²]⁻¹" if variable == "lai" else "[1]"
        axis.set(xlabel=_LABELS[variable], ylabel=f"density {unit}", ylim=(0, None))
        _finish(axis)
    _legend_below(figure, figure.axes[0])
    return figure


def figure7(scenes):
    """
    Relative equivalent noise by increments of LAI and FPAR.

    Parameters
    ----------
    scenes : list of dict

    Returns
    -------
    figure : matplotlib.figure.Figure
    """
    figure = Figure(figsize=(_FIGURE_WIDTH, 3.0), layout="constrained")
    for axis, variable in zip(figure.subplots(1, 2), VARIABLES, strict=True):
        for scene, arp, color, dash, marker in zip(scenes, ARPS, _COLORS, _DASHES, "osD", strict=True):
            values, increment = scene["sample"], friedl1995_table.INCREMENTS[variable]
            at, noise = friedl1995_table.mean_noise(values[variable], values["ndvi"], increment)
            axis.plot(at, noise, dash, color=color, marker=marker, markersize=4, linewidth=1.2,
                      label=f"arp {arp:g}, mean {noise.mean():.2f}")  # fmt: skip
        axis.set(xlabel=_LABELS[variable], ylabel=f"REN of {variable.upper()} [1]", ylim=(0, None))
        _finish(axis)
        axis.legend(frameon=False, fontsize=8)
    return figure


def figure8(scenes):
    """
    NDVI of the mean reflectance against the mean NDVI of the cells, and their difference.

    Parameters
    ----------
    scenes : list of dict

    Returns
    -------
    figure : matplotlib.figure.Figure
    """
    figure = Figure(figsize=(_FIGURE_WIDTH, 4.6), layout="constrained")
    axes = figure.subplots(2, len(ARPS), height_ratios=(1.25, 1))
    for column, scene, arp in zip(axes.T, scenes, ARPS, strict=True):
        values = scene["sample"]
        mean, of_mean, red, nir = (values[name] for name in ("boa_ndvi", "ndvi_of_mean", "boa_red", "boa_nir"))
        column[0].scatter(mean, of_mean, color=_COLORS[0], **_DOT)
        ends = np.array([mean.min(), mean.max()])
        column[0].plot(ends, ends, color=_BLACK, linewidth=0.9)
        column[0].set_title(f"arp {arp:g}")
        column[0].set_aspect("equal", "datalim")
        mixed = values["red_nir"] - red * nir
        covariance = np.array([[values["red_red"] - red**2, mixed], [mixed, values["nir_nir"] - nir**2]])
        predicted = -scaling.second_order_bias(scaling.ndvi_hessian(red, nir), covariance)
        column[1].axhline(0, color=_BLACK, linewidth=0.9)
        column[1].scatter(mean, of_mean - mean, color=_COLORS[0], label="simulated", **_DOT)
        column[1].scatter(mean, predicted, facecolors="none", edgecolors=_COLORS[1], s=10, linewidths=0.5,
                          label="second order")  # fmt: skip
        column[1].set_xlabel("mean NDVI of the cells [1]")
        for axis in column:
            _finish(axis)
    axes[0, 0].set_ylabel("NDVI of mean reflectance [1]")
    axes[1, 0].set_ylabel("difference [1]")
    _legend_below(figure, axes[1, 0])
    return figure


def figure9(scenes):
    """
    Reflectance at the top of the atmosphere against the mean of that of the ground.

    Parameters
    ----------
    scenes : list of dict

    Returns
    -------
    figure : matplotlib.figure.Figure
    """
    figure = Figure(figsize=(_FIGURE_WIDTH, 5.0), layout="constrained")
    for row, band, name in zip(figure.subplots(len(BANDS), len(ARPS)), BANDS, ("red", "nir"), strict=True):
        for axis, scene, arp in zip(row, scenes, ARPS, strict=True):
            # What the atmosphere alone makes of the mean reflectance of the ground is clear.
            boa, toa, clear = (scene["sample"][f"{kind}_{name}"] for kind in ("boa", "toa", "clear"))
            axis.scatter(boa, toa, color=_COLORS[1], label="simulated image", **_DOT)
            at = np.array([boa.min(), boa.max()])
            order = np.argsort(boa)
            axis.plot(boa[order], clear[order], color=_BLACK, linewidth=1.1, label="atmosphere alone")
            axis.plot(at, at, ":", color=_GREY, linewidth=1, label="1 : 1")
            axis.set(xlabel=f"{band} reflectance, ground [1]")
            axis.set_title(f"arp {arp:g}: R² = {np.corrcoef(boa, toa)[0, 1] ** 2:.2f}")
            _finish(axis)
        row[0].set_ylabel(f"{band} reflectance, TOA [1]")
    _legend_below(figure, figure.axes[0])
    return figure


def _scene(case, treatment, arp, seed):
    lai, fpar = friedl1995.landscape(case, treatment, arp, seed)
    ground = reflectance_of(case.read, lai)
    toa = chain.to_toa(ground)
    image = image_of(case.read, ground)
    planetary = planetary_reflectance(image)
    boa_ndvi = indices.ndvi(ground)
    means = aggregate(ground, PIXEL)
    clear = chain.to_toa(means)
    products = {"red_red": ground[0] ** 2, "red_nir": ground[0] * ground[1], "nir_nir": ground[1] ** 2}
    rasters = {
        "lai": aggregate(lai, PIXEL),
        "fpar": aggregate(fpar, PIXEL),
        "ndvi": ndvi(image),
        "boa_ndvi": aggregate(boa_ndvi, PIXEL),
        "ndvi_of_mean": indices.ndvi(means),
        "boa_red": means[0], "boa_nir": means[1],
        "toa_red": planetary[0], "toa_nir": planetary[1],
        "clear_red": clear[0], "clear_nir": clear[1],
    } | {name: aggregate(product.drop_vars("band", errors="ignore"), PIXEL)
         for name, product in products.items()}  # fmt: skip
    values = dict(zip(rasters, friedl1995.pixel_values(*rasters.values()), strict=True))
    numbers = np.arange(values["ndvi"].size)[None]
    chosen = friedl1995_table.draw(numbers, friedl1995_table.SAMPLE, [seed, ARPS.index(arp)], 1)[0, 0]
    sample = {name: value[chosen] for name, value in values.items()}
    of_cells = {"lai": lai.values.ravel(), "fpar": fpar.values.ravel(), "ndvi": ndvi(toa).values.ravel()}
    return {"cells": lai.values, "of_cells": of_cells, "pixels": values, "sample": sample}


def _legend_below(figure, axis):
    """One legend for all panels, where it hides no data."""
    names = axis.get_legend_handles_labels()
    figure.legend(*names, loc="outside lower center", ncols=len(names[0]), frameon=False, fontsize=8)


def _finish(axis):
    axis.title.set_fontsize(9)
    axis.tick_params(labelsize=8)
    for each in (axis.xaxis, axis.yaxis):
        each.label.set_fontsize(9)
        each.set_major_locator(MaxNLocator(5))
    axis.spines[["top", "right"]].set_visible(False)
