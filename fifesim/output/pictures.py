"""Figures for interactive work: a raster, a regression, and a comparison of instruments."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import Colormap
from matplotlib.figure import Figure

from fifesim.analysis.regression import Regression
from fifesim.analysis.regression_labels import matched
from fifesim.base.arguments import Kind, Pairing
from fifesim.base.scan_pixels import corners
from fifesim.chain.comparison import image_origins, recorded_images, shows_ndvi
from fifesim.chain.steps import ndvi
from fifesim.grids import grid as grids
from fifesim.grids import swaths
from fifesim.grids.reductions import computed
from fifesim.output import colours
from fifesim.output.maps import Composite, check_composite, composite_bands, rgb, thinned, valid

Scored: TypeAlias = Annotated[
    xr.Dataset,
    Kind("an xarray.Dataset, as fifesim.score gives it", lambda value: isinstance(value, xr.Dataset), numbers=None),
]

Designs: TypeAlias = Annotated[
    xr.Dataset,
    Kind(
        "an xarray.Dataset, as fifesim.trade gives it",
        lambda value: isinstance(value, xr.Dataset) and "r2" in value,
        numbers=None,
    ),
]
DesignCost: TypeAlias = Annotated[
    xr.DataArray, Kind("an xarray.DataArray over designs", lambda value: isinstance(value, xr.DataArray))
]

# Maximum pixels along the longer side of a picture.
_SIZE = 1500

# Width of a figure. [inch]
_WIDTH = 6.4

# Larger maps have axes in kilometres. [m]
_KILOMETRES = 3000.0


def plot(
    raster: xr.DataArray,
    *,
    band: str | None = None,
    composite: Composite = "false colour",
    stretch: tuple[float, float] | None = None,
    cmap: str | Colormap | None = None,
    limits: tuple[float, float] | None = None,
    axes: Axes | None = None,
    size: int = _SIZE,
) -> Axes:
    """
    Plot a raster as a map: an image as a colour composite, a band or quantity with its colour map.

    Parameters
    ----------
    raster : xarray.DataArray, dims ([band], y, x) or ([band], line, sample)
        Raster to plot. Large rasters are subsampled before loading.
    band : str, optional
        Band to plot; by default a colour composite, or the only band.
    composite, stretch : optional
        As in `fifesim.output.maps.rgb`; for a single band or quantity, the default percentiles are 1 and 99.
    cmap : str or matplotlib.colors.Colormap, optional
        Colour map; by default from the quantity.
    limits : (float, float), optional
        Values of the first and the last colour; by default the percentiles of ``stretch``.
    axes : matplotlib.axes.Axes, optional
        A new figure by default.
    size : int, optional
        Pixels drawn along the longer side at most.

    Returns
    -------
    axes : matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If the raster has other dimensions, or a band is missing.

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> axes = lai.fifesim.plot()
    >>> axes.get_aspect()
    1.0
    """
    raster = _checked(raster, band)
    check_composite(composite)
    names = composite_bands(raster, composite) if "band" in raster.dims else []
    few = raster.sel(band=list(dict.fromkeys(names))) if names else valid(raster)
    shown = computed(thinned(few, size))[0]
    if axes is None:
        height = float(np.clip(0.9 + 0.72 * _WIDTH * _ratio(shown), 2.4, 9.0))
        _, axes = plt.subplots(figsize=(_WIDTH, height), layout="constrained")
    axes.set_facecolor(colours.NO_DATA)
    if names:
        picture = rgb(shown, names, stretch=stretch)
        _draw(axes, picture, rgba=np.dstack([np.nan_to_num(picture.values), picture.notnull().all("rgb").values]))
        what = picture.attrs["long_name"]
    else:
        if isinstance(cmap, str) and cmap not in colormaps:
            raise ValueError(f"cmap: matplotlib has no colour map {cmap!r}, type for instance cmap='viridis'")
        own, middle = colours.colours_of(shown.name)
        if limits is None:
            middle = middle if cmap is None else None
            limits = colours.percentile_limits(shown, stretch or colours.PERCENTILES, middle)
        low, high = map(float, limits)
        drawn = _draw(axes, shown, own if cmap is None else cmap, (low, high))
        beyond = bool((shown < low).any()), bool((shown > high).any())
        extend = {(True, True): "both", (True, False): "min", (False, True): "max"}.get(beyond, "neither")
        words = f"{colours.short_name(shown)} {colours.unit(shown)}".strip()
        axes.figure.colorbar(drawn, ax=axes, shrink=0.8, label=words, extend=extend)
        what = colours.long_name(shown)
    where = colours.subject(raster)
    axes.set_title(what + (f"\n{where}" if where else ""), fontsize="medium")
    return axes


def plot_fit(
    fit: Regression,
    y: xr.DataArray | None = None,
    x: xr.DataArray | None = None,
    *,
    pair: Pairing = "coordinates",
    level: float = 0.95,
    axes: Axes | None = None,
) -> Axes:
    """
    Plot a regression line with its prediction interval, and optionally the pixels.

    Parameters
    ----------
    fit : fifesim.analysis.regression.Regression
    y, x : xarray.DataArray, dims (y, x), optional
        Rasters given to `fifesim.regress`. Large rasters are subsampled before they are computed.
    pair : {"coordinates", "index"}, optional
        As in `fifesim.regress`.
    level : float, optional
        Level of the prediction interval. [1]
    axes : matplotlib.axes.Axes, optional
        A new figure by default.

    Returns
    -------
    axes : matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If one raster is given without the other, or they do not match.

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    >>> image = rho.fifesim.to_toa().fifesim.sense("TM")
    >>> truth, ndvi = lai.fifesim.aggregate(30), image.fifesim.ndvi()
    >>> axes = fifesim.output.plot_fit(fifesim.regress(truth, ndvi), truth, ndvi)
    >>> axes.get_xlabel()
    'Normalized difference vegetation index'
    """
    if (y is None) != (x is None):
        raise ValueError("fit.plot() draws the line alone, fit.plot(y, x) the pixels too: give both rasters or none")
    if axes is None:
        _, axes = plt.subplots(figsize=(5.8, 4.4), layout="constrained")
    labels = "y", "x"
    spread = 2.5 * np.sqrt(fit.x_sum_of_squares / fit.n)
    span = fit.x_mean - spread, fit.x_mean + spread
    if y is not None:
        labels = [f"{colours.capital(colours.long_name(each))} {colours.unit(each)}".rstrip() for each in (y, x)]
        pairs = computed(*(thinned(each, _SIZE) for each in matched(y, x, pair)))
        ordinate, abscissa = (np.asarray(each, float).ravel() for each in pairs)
        both = np.isfinite(ordinate) & np.isfinite(abscissa)
        span = abscissa[both].min(), abscissa[both].max()
        density = axes.hexbin(
            abscissa[both], ordinate[both], gridsize=60, mincnt=1, bins="log", cmap="Greys", linewidths=0.1
        )
        axes.figure.colorbar(density, ax=axes, shrink=0.8, label="pixels")
    colours.draw_line(axes, fit, span, level, alpha=0.3)
    sign = "+" if fit.slope >= 0 else "−"
    title = f"y = {fit.intercept:.4g} {sign} {abs(fit.slope):.4g} x,  R² = {fit.r2:.3f},  n = {fit.n}"
    title = title.replace("-", "−")
    axes.set(xlabel=labels[1], ylabel=labels[0])
    axes.set_title(title, fontsize="medium")
    # The range includes the line and its interval; below 0 only if pixels are.
    low, high = axes.get_ylim()
    low = low if y is None or ordinate[both].min() < 0 else max(low, 0)
    axes.set_ylim(low, high + 0.22 * (high - low))
    axes.legend(frameon=False, loc="upper center", ncols=2, fontsize="small")
    return axes


def plot_trade(
    results: Designs,
    cost: DesignCost,
    *,
    variable: Literal["lai", "fpar", "gpp"] = "lai",
    axes: Axes | None = None,
) -> Axes:
    """
    Plot R2 of the designs of a trade study by their cost, and the best of them.

    Parameters
    ----------
    results : dataset
        Result of `fifesim.trade`.
    cost : array
        Cost of each design, over some or all of its dimensions, such as ``results.snr**2 / results.pixel**2``.
    variable : {"lai", "fpar", "gpp"}, optional
    axes : matplotlib.axes.Axes, optional
        A new figure by default.

    Returns
    -------
    axes : matplotlib.axes.Axes
        One colour for each value of the first dimension of the designs; the line joins the Pareto front, the designs
        that no cheaper one equals.

    Raises
    ------
    ValueError
        If the cost has other dimensions than the designs, or is not positive and finite.

    Examples
    --------
    >>> import fifesim
    >>> found = fifesim.trade("TM", {"pixel": [20, 30, 60], "snr": [20, 50, 100], "registration": [5.0]})
    >>> axes = fifesim.output.plot_trade(found, found.snr**2 / found.pixel**2)
    >>> axes.get_ylabel()
    'R² of LAI on NDVI'
    """
    r2 = results["r2"].sel(variable=variable, drop=True)
    if unknown := [str(dim) for dim in cost.dims if dim not in r2.dims]:
        raise ValueError(f"cost has dimensions {', '.join(unknown)}, the designs have {', '.join(map(str, r2.dims))}")
    if not ((cost > 0) & np.isfinite(cost)).all():
        raise ValueError("cost must be positive and finite for each design")
    if axes is None:
        _, axes = plt.subplots(figsize=(5.8, 4.4), layout="constrained")
    r2, cost = xr.broadcast(r2, cost)
    first = r2.dims[0]
    for number, value in enumerate(r2[first].values):
        unit = colours.unit(r2[first]).strip("[]")
        axes.scatter(cost[number], r2[number], s=12, label=f"{first} {value} {unit}".rstrip())
    order = np.lexsort((-r2.values.ravel(), cost.values.ravel()))
    paid, best = cost.values.ravel()[order], np.maximum.accumulate(r2.values.ravel()[order])
    front = np.concatenate([[True], best[1:] > best[:-1]])
    axes.plot(paid[front], best[front], color="black", linewidth=1, label="best designs")
    axes.set(xscale="log", xlabel=cost.attrs.get("long_name", "cost"))
    axes.set_ylabel(f"R² of {variable.upper()} on NDVI")
    # Room for the legend.
    low, high = axes.get_ylim()
    axes.set_ylim(low - 0.22 * (high - low), high)
    axes.legend(frameon=False, loc="lower center", ncols=3, fontsize="small")
    return axes


def plot_score(scores: Scored) -> Figure:
    """
    Plot how well intervals and distributions of an estimate agree with the truth.

    Parameters
    ----------
    scores : dataset
        Result of `fifesim.score` for an estimate with intervals, a standard deviation or members. Groups are
        drawn one by one.

    Returns
    -------
    figure : matplotlib.figure.Figure
        Coverage by the level of the intervals, with error bars of two standard errors where they are known; and the
        density of the probability integral transform, which is 1 for a calibrated estimate.

    Raises
    ------
    ValueError
        If the scores have neither ``coverage`` nor ``pit``, or several dimensions of groups.

    Examples
    --------
    >>> import fifesim
    >>> import numpy as np
    >>> import xarray as xr
    >>> rng = np.random.default_rng(1)
    >>> truth = xr.DataArray(rng.normal(2, 1, (20, 500)), dims=("landscape", "pixel"), name="lai")
    >>> guess = truth + rng.normal(0, 0.3, truth.shape)
    >>> figure = fifesim.output.plot_score(fifesim.score(xr.Dataset({"lai": guess, "sd": 0.3 + 0 * guess}), truth))
    >>> figure.axes[0].get_xlabel()
    'Probability of a value below the truth'
    """
    shown = [name for name in ("coverage", "pit") if name in scores.data_vars]
    if not shown:
        raise ValueError("scores have neither coverage nor pit: give the estimate intervals or a standard deviation")
    groups = [str(dim) for dim in scores[shown[0]].dims if dim not in ("level", "pit_bin")]
    if len(groups) > 1:
        raise ValueError(f"scores have groups along {', '.join(groups)}: select one of each but one")
    rows = [("", scores)]
    if groups:
        labels = scores[groups[0]].values
        rows = [(f"{groups[0]} {label}", scores.isel({groups[0]: at})) for at, label in enumerate(labels)]
    figure, panels = plt.subplots(1, len(shown), figsize=(4.4 * len(shown), 4.0), layout="constrained", squeeze=False)
    for axes, name in zip(panels[0], shown, strict=True):
        (_draw_coverage if name == "coverage" else _draw_pit)(axes, rows)
    if groups:
        panels[0, 0].legend(frameon=False, fontsize="small")
    return figure


def _draw_coverage(axes, rows):
    """Coverage by level, with the line of a calibrated estimate."""
    axes.plot([0, 1], [0, 1], color="0.6", linewidth=1)
    for label, scores in rows:
        level, coverage, error = (np.atleast_1d(scores[name]) for name in ("level", "coverage", "coverage_se"))
        axes.errorbar(level, coverage, 2 * np.nan_to_num(error), marker="o", capsize=2, label=label)
    axes.set(xlim=(0, 1), ylim=(0, 1), aspect="equal")
    axes.set(xlabel="Level of the interval", ylabel="Fraction of true values inside")


def _draw_pit(axes, rows):
    """Density of the probability integral transform."""
    axes.axhline(1, color="0.6", linewidth=1)
    for label, scores in rows:
        axes.stairs(scores["pit"].values, np.linspace(0, 1, scores.sizes["pit_bin"] + 1), label=label)
    axes.set(xlim=(0, 1), ylim=(0, None))
    axes.set(xlabel="Probability of a value below the truth", ylabel="Density")


def plot_comparison(images: xr.DataTree, *, limits: tuple[float, float] | None = None) -> Figure:
    """
    Plot the NDVI of a scene from several instruments side by side, on one colour scale.

    Parameters
    ----------
    images : xarray.DataTree
        From `fifesim.compare`.
    limits : (float, float), optional
        NDVI of the first and the last colour.

    Returns
    -------
    figure : matplotlib.figure.Figure

    Raises
    ------
    ValueError
        If no image has a red and a near infrared band.

    Notes
    -----
    Large images are subsampled; mean and standard deviation refer to the plotted pixels. The title of a panel states
    the origin and uncertainty of the blur of the instrument, a dash if it is unknown.

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> images = lai.fifesim.compare(["TM", "OLI"])
    >>> figure = images.fifesim.plot_comparison()
    >>> len(figure.axes) >= 2
    True
    """
    recorded = {name: image for name, image in recorded_images(images).items() if shows_ndvi(image)}
    if not recorded:
        raise ValueError(
            "no image has a red and a near infrared band: compare them with bands={instrument: [red, nir]}"
        )
    found = {name: ndvi(thinned(image, 800)) for name, image in recorded.items()}
    maps = dict(zip(found, computed(*found.values()), strict=True))
    if limits is None:
        values = np.concatenate([each.values.ravel() for each in maps.values()])
        limits = colours.percentile_limits(values)
    columns = min(len(maps), 4)
    rows = -(-len(maps) // columns)
    width = 3.0 * columns + 0.8
    height = rows * (3.0 * max(_ratio(each) for each in maps.values()) + 0.8)
    figure, panels = plt.subplots(rows, columns, figsize=(width, height), layout="constrained", squeeze=False)
    for axes in panels.ravel()[len(maps) :]:
        axes.set_axis_off()
    for axes, (name, array) in zip(panels.ravel(), maps.items(), strict=False):
        axes.set_facecolor(colours.NO_DATA)
        drawn = _draw(axes, array, colours.colours_of("ndvi")[0], limits)
        pixel = grids.cell_size(grids.geobox(recorded[name]))[0]
        mean, deviation = float(array.mean()), float(array.std())
        blur = image_origins(recorded[name])["blur"]
        title = f"{name}, {pixel:g} m\nmean {mean:.3f}, sd {deviation:.3f}\nblur {blur}"
        axes.set_title(title, fontsize="medium")
    for axes in panels[:, 1:].ravel():
        axes.set_ylabel("")
    figure.colorbar(drawn, ax=panels, shrink=0.8, label=colours.axis_label("ndvi"), extend="both")
    return figure


def _checked(raster, band):
    """Raster that can be drawn: of several bands, or of one quantity."""
    if band is not None:
        if "band" not in raster.dims or band not in raster["band"].values:
            have = ", ".join(map(str, np.atleast_1d(raster["band"].values))) if "band" in raster.coords else "none"
            raise ValueError(f"there is no band {band!r}: the raster has {have}")
        raster = raster.sel(band=band)
    elif raster.sizes.get("band") == 1:
        raster = raster.isel(band=0)
    allowed = [{"band", *axes} for axes in (("y", "x"), swaths.DIMS)]
    if not any(set(raster.dims) in (each, each - {"band"}) for each in allowed):
        raise ValueError(
            f"a map has dimensions ([band], y, x), got {raster.dims}: select one layer of the others with .isel"
        )
    return raster.transpose(..., *(swaths.DIMS if "line" in raster.dims else ("y", "x")))


def _draw(axes, array, cmap=None, limits=(None, None), rgba=None):
    """Draw a raster as a map with equal scales in metres or kilometres, by a colour map or in given colours."""
    values, (low, high) = array.values if rgba is None else rgba, limits
    if "line" in array.dims and "x" not in array.coords:
        latitude, longitude, values = _mesh(array, ("latitude", "longitude"), values)
        drawn = axes.pcolormesh(longitude, latitude, values, cmap=cmap, vmin=low, vmax=high)
        axes.set(xlabel="Longitude [°]", ylabel="Latitude [°]", aspect=1 / np.cos(np.radians(latitude.mean())))
        return drawn
    if "line" in array.dims:
        y, x, values = _mesh(array, ("y", "x"), values)
        unit_size, name = _length(np.ptp(x), np.ptp(y))
        drawn = axes.pcolormesh(x / unit_size, y / unit_size, values, cmap=cmap, vmin=low, vmax=high)
    else:
        box = grids.geobox(array).boundingbox
        unit_size, name = _length(box.span_x, box.span_y)
        extent = [edge / unit_size for edge in (box.left, box.right, box.bottom, box.top)]
        drawn = axes.imshow(values, extent=extent, interpolation="nearest", cmap=cmap, vmin=low, vmax=high)
    axes.set(xlabel=f"Easting [{name}]", ylabel=f"Northing [{name}]", aspect="equal")
    axes.ticklabel_format(useOffset=False, style="plain")
    axes.locator_params(nbins=4)
    axes.tick_params(labelsize="small")
    return drawn


def _mesh(array, places, values):
    """Corners of the pixels of a scan as a mesh, and their values, with an empty row between two sweeps."""
    sweep = array["sweep"].values if "sweep" in array.coords else np.zeros(array.sizes["line"], int)
    ends = np.append(np.diff(sweep) != 0, True)
    # The upper edge of each line, and the lower edge of the last line of a sweep.
    order = np.flatnonzero(np.stack([np.ones_like(ends), ends], axis=1))
    edges = corners(*(array[name].values for name in places), sweep)
    up, right = (each.reshape(-1, each.shape[-1])[order] for each in edges)
    blank = np.zeros(values.shape[1:]) if values.ndim > 2 else np.full(values.shape[1:], np.nan)
    return up, right, np.insert(np.asarray(values, float), np.flatnonzero(ends[:-1]) + 1, blank, axis=0)


def _length(width, height):
    return (1000.0, "km") if max(width, height) > _KILOMETRES else (1.0, "m")


def _ratio(array):
    """Ratio of height to width of a map."""
    if "line" in array.dims:
        up, right = ("y", "x") if "x" in array.coords else ("latitude", "longitude")
        return float(np.ptp(array[up].values) / max(np.ptp(array[right].values), 1e-6))
    down, across = grids.cell_size(grids.geobox(array))
    return array.sizes["y"] * down / (array.sizes["x"] * across)
