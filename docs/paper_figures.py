"""Figures 3 to 9 of Friedl et al. (1995), from the result of `fifesim.reproduce`, for the gallery."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from fifesim.analysis import regression, scaling
from fifesim.experiments.friedl1995 import table as friedl1995_table
from fifesim.experiments.friedl1995.case import VARIABLES

# Colours of Okabe and Ito, suitable for colour-blind readers; dashes and markers differ in grey too.
_COLORS = ("#0072B2", "#D55E00", "#009E73")
_DASHES = ("-", "--", ":")
_BLACK, _GREY = "#222222", "#767676"
_DOT = {"s": 9, "linewidths": 0, "alpha": 0.75}

_LABELS = {"lai": "LAI [m² m⁻²]", "fpar": "FPAR", "ndvi": "NDVI"}
_FIGURE_WIDTH = 7.2

FIGURE_NUMBERS = range(3, 10)


def plot(number, found, reading="native"):
    """
    Plot a figure of the paper.

    Parameters
    ----------
    number : int
        3, densities of LAI; 4, LAI of the ground; 5, LAI and FPAR against NDVI; 6, densities of cells and pixels;
        7, relative equivalent noise; 8, scaling of NDVI; 9, reflectance of image and ground.
    found : xarray.Dataset
        Result of `fifesim.reproduce`.
    reading : str, optional
        Reading of Table 1 in ``found``.

    Returns
    -------
    figure : matplotlib.figure.Figure
    """
    return _DRAWN[number](found, reading)


def sample(found, reading, arp):
    """Sample of 200 pixels of a scene of the figures, by name, shape (n,)."""
    scene = found.sel(reading=reading, arp=arp)
    chosen = scene["sampled"].values.astype(bool)
    return {
        name[6:]: scene[name].values[chosen]
        for name in scene.data_vars
        if str(name).startswith("pixel_")
    }


def _figure3(found, reading):
    """Densities of LAI of the three treatments."""
    figure = Figure(figsize=(4.6, 3.2), layout="constrained")
    axis = figure.subplots()
    for (name, each), color, dash in zip(
        found["density"].groupby("distribution"), _COLORS, _DASHES, strict=True
    ):
        known = each.squeeze().dropna("leaf_area")
        at, low = known["leaf_area"].values, known.values[0]
        # Draw the density down to zero at its cutoff.
        axis.plot([at[0], *at, at[-1]], [0 if at[0] > 0 or low else low, *known.values, 0], dash, color=color,
                  label=str(name).replace("-", ", "))  # fmt: skip
    _finish(
        axis, xlabel=_LABELS["lai"], ylabel="density [m² m⁻²]⁻¹", xlim=(0, None), ylim=(0, None)
    )
    axis.legend(frameon=False, fontsize=8)
    return figure


def _figure4(found, reading):
    """LAI of the cells at three values of arp."""
    figure = Figure(figsize=(_FIGURE_WIDTH, 2.75), layout="constrained")
    axes = figure.subplots(1, found.sizes["arp"], sharey=True)
    high, size = float(found["cell_lai"].max()), found.attrs["cell"]
    for axis, arp in zip(axes, found["arp"].values, strict=True):
        shown = found["cell_lai"].sel(arp=arp).values[:120, :120]
        extent = np.array([0, shown.shape[1], 0, shown.shape[0]]) * size
        drawn = axis.imshow(
            shown, cmap="YlGn", vmin=0, vmax=high, extent=extent, interpolation="nearest"
        )
        axis.set(xlabel="easting [m]", title=f"arp {arp:g}")
        axis.title.set_fontsize(9)
        axis.xaxis.set_major_locator(MaxNLocator(4))
        axis.yaxis.set_major_locator(MaxNLocator(4))
        axis.tick_params(labelsize=8)
    axes[0].set_ylabel("northing [m]")
    figure.colorbar(drawn, ax=axes, label=_LABELS["lai"], shrink=0.9)
    return figure


def _figure5(found, reading):
    """LAI and FPAR against NDVI at the ground and at the top of the atmosphere."""
    figure = Figure(figsize=(_FIGURE_WIDTH, 8.2), layout="constrained")
    axes = figure.subplots(found.sizes["arp"], len(VARIABLES))
    for row, arp in zip(axes, found["arp"].values, strict=True):
        values = sample(found, reading, arp)
        for axis, variable in zip(row, VARIABLES, strict=True):
            truth, toa, boa = values[variable], values["ndvi"], values["boa_ndvi"]
            axis.scatter(boa, truth, color=_COLORS[0], marker="^", label="ground (BOA)", **_DOT)
            axis.scatter(toa, truth, color=_COLORS[1], marker="o", label="sensor (TOA)", **_DOT)
            fit = regression.fit(regression.row_sums(truth[None], toa[None], truth.mean(), toa.mean()), truth.mean(),
                                 toa.mean())  # fmt: skip
            at = np.linspace(toa.min(), toa.max(), 60)
            axis.plot(
                at, fit.predict(at), "--", color=_BLACK, linewidth=1.3, label="line through TOA"
            )
            for limit, name in zip(
                fit.confidence_interval(at), ("95 % confidence", None), strict=True
            ):
                axis.plot(at, limit, color=_BLACK, linewidth=0.9, label=name)
            low, high = fit.prediction_interval(at)
            axis.fill_between(
                at, low, high, color=_GREY, alpha=0.2, linewidth=0, label="95 % prediction"
            )
            title = f"arp {arp:g}: R² = {fit.r2:.2f} (TOA), {np.corrcoef(boa, truth)[0, 1] ** 2:.3f} (BOA)"
            _finish(axis, xlabel=_LABELS["ndvi"], ylabel=_LABELS[variable], title=title)
    _legend_below(figure, axes[0, 0])
    return figure


def _figure6(found, reading):
    """Densities of LAI, FPAR and NDVI of the cells and of the pixels."""
    figure = Figure(figsize=(_FIGURE_WIDTH, 3.1), layout="constrained")
    first = found["arp"].values[0]
    for axis, variable in zip(figure.subplots(1, 3), (*VARIABLES, "ndvi"), strict=True):
        cells = found[f"cell_{variable}"].isel(arp=-1).values.ravel()
        # LAI and FPAR are not negative and have high densities near zero.
        options = {"reflect": variable != "ndvi"}
        at = np.linspace(cells.min(), cells.max(), 500)
        counts, edges = np.histogram(cells, bins=400)
        bandwidth = scaling.silverman_bandwidth(
            cells.std(), np.subtract(*np.percentile(cells, (75, 25))), cells.size
        )
        of_cells = scaling.gaussian_density(
            (edges[1:] + edges[:-1]) / 2, at, bandwidth, counts, **options
        )
        axis.plot(at, of_cells, color=_BLACK, linewidth=1, label="cells")
        for arp, color, dash in zip(found["arp"].values, _COLORS, _DASHES, strict=True):
            values = sample(found, reading, arp)
            of_pixels = scaling.sample_density(values[variable], at, **options)
            axis.plot(at, of_pixels, dash, color=color, label=f"pixels, arp {arp:g}")
            if variable == "ndvi":
                smooth = scaling.sample_density(values["analogue_ndvi"], at)
                axis.plot(
                    at,
                    smooth,
                    color=_GREY,
                    linewidth=0.9,
                    label="before quantisation" if arp == first else None,
                )
        unit = " [m² m⁻²]⁻¹" if variable == "lai" else ""
        _finish(axis, xlabel=_LABELS[variable], ylabel=f"density {unit}", ylim=(0, None))
    _legend_below(figure, figure.axes[-1])
    return figure


def _figure7(found, reading):
    """Relative equivalent noise by increments of LAI and FPAR."""
    figure = Figure(figsize=(_FIGURE_WIDTH, 3.0), layout="constrained")
    for axis, variable in zip(figure.subplots(1, 2), VARIABLES, strict=True):
        for arp, color, dash, marker in zip(
            found["arp"].values, _COLORS, _DASHES, "osD", strict=True
        ):
            values, increment = (
                sample(found, reading, arp),
                friedl1995_table.INCREMENTS[variable],
            )
            at, noise = friedl1995_table.mean_noise(values[variable], values["ndvi"], increment)
            axis.plot(at, noise, dash, color=color, marker=marker, markersize=4, linewidth=1.2,
                      label=f"arp {arp:g}, mean {noise.mean():.2f}")  # fmt: skip
        _finish(
            axis, xlabel=_LABELS[variable], ylabel=f"REN of {variable.upper()}", ylim=(0, None)
        )
        axis.legend(frameon=False, fontsize=8)
    return figure


def _figure8(found, reading):
    """NDVI of the mean reflectance against the mean NDVI of the cells, and their difference."""
    figure = Figure(figsize=(_FIGURE_WIDTH, 4.6), layout="constrained")
    axes = figure.subplots(2, found.sizes["arp"], height_ratios=(1.25, 1))
    for column, arp in zip(axes.T, found["arp"].values, strict=True):
        values = sample(found, reading, arp)
        mean, of_mean, red, nir = (
            values[name] for name in ("boa_ndvi", "ndvi_of_mean", "boa_red", "boa_nir")
        )
        column[0].scatter(mean, of_mean, color=_COLORS[0], **_DOT)
        ends = np.array([mean.min(), mean.max()])
        column[0].plot(ends, ends, color=_BLACK, linewidth=0.9)
        column[0].set_title(f"arp {arp:g}")
        column[0].set_aspect("equal", "datalim")
        mixed = values["red_nir"] - red * nir
        covariance = np.array(
            [[values["red_red"] - red**2, mixed], [mixed, values["nir_nir"] - nir**2]]
        )
        predicted = -scaling.second_order_bias(scaling.ndvi_hessian(red, nir), covariance)
        column[1].axhline(0, color=_BLACK, linewidth=0.9)
        column[1].scatter(mean, of_mean - mean, color=_COLORS[0], label="simulated", **_DOT)
        column[1].scatter(mean, predicted, facecolors="none", edgecolors=_COLORS[1], s=10, linewidths=0.5,
                          label="second order")  # fmt: skip
        column[1].set_xlabel("mean NDVI of the cells")
        for axis in column:
            _finish(axis)
    axes[0, 0].set_ylabel("NDVI of mean reflectance")
    axes[1, 0].set_ylabel("difference")
    _legend_below(figure, axes[1, 0])
    return figure


def _figure9(found, reading):
    """Reflectance at the top of the atmosphere against mean surface reflectance."""
    figure = Figure(figsize=(_FIGURE_WIDTH, 5.0), layout="constrained")
    axes = figure.subplots(2, found.sizes["arp"])
    for row, name, words in zip(axes, ("red", "nir"), ("red", "near infrared"), strict=True):
        for axis, arp in zip(row, found["arp"].values, strict=True):
            values = sample(found, reading, arp)
            # Effect of the atmosphere alone on the mean surface reflectance.
            boa, toa, clear = (values[f"{kind}_{name}"] for kind in ("boa", "toa", "clear"))
            axis.scatter(boa, toa, color=_COLORS[1], label="simulated image", **_DOT)
            at, order = np.array([boa.min(), boa.max()]), np.argsort(boa)
            axis.plot(
                boa[order], clear[order], color=_BLACK, linewidth=1.1, label="atmosphere alone"
            )
            axis.plot(at, at, ":", color=_GREY, linewidth=1, label="1 : 1")
            title = f"arp {arp:g}: R² = {np.corrcoef(boa, toa)[0, 1] ** 2:.2f}"
            _finish(axis, xlabel=f"{words}, ground", title=title)
        row[0].set_ylabel(f"{words}, TOA")
    _legend_below(figure, figure.axes[0])
    return figure


_DRAWN = dict(
    zip(
        FIGURE_NUMBERS,
        (_figure3, _figure4, _figure5, _figure6, _figure7, _figure8, _figure9),
        strict=True,
    )
)


def _legend_below(figure, axis):
    """One legend for all panels, below the figure."""
    names = axis.get_legend_handles_labels()
    figure.legend(
        *names, loc="outside lower center", ncols=len(names[0]), frameon=False, fontsize=8
    )


def _finish(axis, **properties):
    """Set properties of an axis, and its fonts, ticks and frame."""
    axis.set(**properties)
    axis.title.set_fontsize(9)
    axis.tick_params(labelsize=8)
    for each in (axis.xaxis, axis.yaxis):
        each.label.set_fontsize(9)
        each.set_major_locator(MaxNLocator(5))
    axis.spines[["top", "right"]].set_visible(False)
