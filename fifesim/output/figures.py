"""Figures of a run: maps, frequencies and regressions."""

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LightSource, ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from fifesim.analysis.rasters.pairs import matched
from fifesim.base.bands import GREEN, NEAR_INFRARED, RED, nearest
from fifesim.rasters import grid as grids
from fifesim.sensor.raster import to_reflectance

_NO_DATA = (0.85, 0.85, 0.85)
# Without the blue of the map's seas.
_LAND = ListedColormap(colormaps["gist_earth"](np.linspace(0.3, 0.95, 256)))
_LINE, _BAND = "#b2182b", "#f4a582"

NAMES = {
    "lai": "leaf area index",
    "fpar": "FPAR",
    "green_fpar": "FPAR of green leaves",
    "brown": "dead share of the leaf area",
    "crown_cover": "crown cover",
    "soil": "brightness of the soil",
    "moisture": "moisture of the soil",
    "ndvi": "NDVI",
}
"""Quantities in words."""


def detail_figure(image, part, detail):
    """
    Cells, the pixels that average them, and where in the image they lie.

    Parameters
    ----------
    image : xarray.Dataset
        ``dn``, in memory.
    part : xarray.DataArray, dims (band, y, x)
        Pixels of the cells.
    detail : xarray.DataArray, dims (y, x)
        LAI of the cells.

    Returns
    -------
    figure : matplotlib.figure.Figure
    """
    figure = Figure(figsize=(11, _height(image["dn"])), layout="constrained")
    axes = figure.subplots(1, 3)
    high = max(float(detail.quantile(0.995)) if detail.notnull().any() else 1.0, 1e-6)
    cells = _map(axes[0], detail, cmap="YlGn", vmin=0, vmax=high)
    size = grids.cell_size(grids.geobox(detail))[1]
    axes[0].set_title(f"Leaf area index, cells of {size:.2f} m")
    figure.colorbar(cells, ax=axes[0], shrink=0.8, label="LAI [m² m⁻²]")
    box = grids.geobox(detail).boundingbox
    stretch = _stretch(image["dn"])
    _composite(axes[1], part, stretch)
    pixel = grids.cell_size(grids.geobox(part))[1]
    axes[1].set_title(f"The same ground in pixels of {pixel:g} m")
    _composite(axes[2], image["dn"], stretch)
    axes[2].add_patch(
        Rectangle((box.left / 1000, box.bottom / 1000), (box.right - box.left) / 1000, (box.top - box.bottom) / 1000,
                  fill=False, edgecolor="black", linewidth=1.2)
    )  # fmt: skip
    axes[2].set_title(f"Image: {_composite_name(image['dn'])}")
    return figure


def map_figure(image, truth):
    """
    Maps of the truth and of NDVI.

    Parameters
    ----------
    image, truth : xarray.Dataset
        In memory.

    Returns
    -------
    figure : matplotlib.figure.Figure
    """
    maps = [
        (truth["lai"], "YlGn", "True leaf area index", "LAI [m² m⁻²]"),
        (truth["fpar"], "YlGn", "True FPAR", "FPAR"),
    ]
    if "ndvi" in image:
        maps.append((image["ndvi"], "YlGn", "NDVI of the image", "NDVI"))
    figure = Figure(figsize=(11, _height(image["dn"])), layout="constrained")
    for axis, (array, cmap, title, label) in zip(figure.subplots(1, len(maps), squeeze=False)[0], maps, strict=True):
        drawn = _map(axis, array, cmap=cmap, **_limits(array))
        axis.set_title(title)
        figure.colorbar(drawn, ax=axis, shrink=0.8, label=label)
    return figure


def terrain_figure(image, terrain, level):
    """
    Shaded relief, slope, Kt, and the image less that of level ground.

    Parameters
    ----------
    image : xarray.Dataset
        ``dn``, of at least the pixels of ``level``.
    terrain : xarray.Dataset
        ``dem``, ``slope`` and ``kt``, in memory.
    level : xarray.DataArray, dims (band, y, x)
        Digital numbers on level ground, in memory.

    Returns
    -------
    figure : matplotlib.figure.Figure
    """
    figure = Figure(figsize=(11, 2 * _height(terrain["dem"])), layout="constrained")
    axes = figure.subplots(2, 2).ravel()
    dem, band = terrain["dem"], str(image["dn"]["band"].values[-1])
    down, across = grids.cell_size(grids.geobox(dem))
    # Lit from the north-west, as maps are; hills and valleys change places when lit from below.
    tint = ScalarMappable(Normalize(*_limits_of(dem)), _LAND)
    lit = LightSource(azdeg=315, altdeg=45).shade_rgb(
        tint.to_rgba(dem.values)[..., :3], np.nan_to_num(dem.values, nan=float(dem.mean())),
        blend_mode="soft", vert_exag=3, dx=across, dy=down,
    )  # fmt: skip
    axes[0].set_facecolor(_NO_DATA)
    axes[0].imshow(np.dstack([lit, np.isfinite(dem.values)]), extent=_extent(dem), interpolation="nearest")
    _map_axes(axes[0])
    axes[0].set_title("Shaded relief and elevation")
    figure.colorbar(tint, ax=axes[0], shrink=0.8, label="m")
    dn = image["dn"].sel(y=level["y"], x=level["x"]).compute()
    change = reflectance_change(dn, level, band)
    reach = max(float(np.nanmax(np.abs(_limits_of(change)))), 1e-6)
    for axis, array, title, label, style in (
        (
            axes[1],
            terrain["slope"],
            "Slope, mean of the cells",
            "degrees",
            {"cmap": "YlOrBr", **_limits(terrain["slope"])},
        ),
        (axes[2], terrain["kt"].sel(band=band), f"Kt in {band}, mean of the cells", "Kt", _around(terrain["kt"], 1.0)),
        (
            axes[3],
            change,
            f"What terrain did to {band}",
            "reflectance",
            {"cmap": "RdBu_r", "vmin": -reach, "vmax": reach},
        ),
    ):
        drawn = _map(axis, array, **style)
        axis.set_title(title)
        figure.colorbar(drawn, ax=axis, shrink=0.8, label=label)
    return figure


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
    return to_reflectance(dn).sel(band=band) - to_reflectance(level).sel(band=band)


def _limits_of(array):
    return list(_limits(array).values())


def _around(array, middle):
    """Colours that diverge from a middle, over what most of the values span."""
    half = max(*(abs(limit - middle) for limit in _limits_of(array)), 1e-6)
    return {"cmap": "RdBu_r", "vmin": middle - half, "vmax": middle + half}


def histogram_figure(image, truth, detail):
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
    figure : matplotlib.figure.Figure
    """
    figure = Figure(figsize=(11, 3.2), layout="constrained")
    axes = figure.subplots(1, 3)
    top = float(np.nanmax(detail)) if detail.notnull().any() else 1.0
    bins = np.linspace(0, max(top, 1e-6), 60)
    for values, label, color in (
        (detail, "cells in the middle", "#a6d96a"),
        (truth["lai"], "means over pixels", "#1a9850"),
    ):
        axes[0].hist(
            _finite(values), bins=bins, density=True, alpha=0.7, label=label, color=color, histtype="stepfilled"
        )
    axes[0].set(xlabel="LAI [m² m⁻²]", ylabel="density", title="Leaf area index")
    axes[0].legend(frameon=False)
    axes[1].hist(_finite(truth["fpar"]), bins=60, density=True, histtype="stepfilled", color="#1a9850")
    axes[1].set(xlabel="FPAR", ylabel="density", title="True FPAR of the pixels")
    for band, color in zip(image["dn"]["band"].values, _colors(image["dn"].sizes["band"]), strict=True):
        counts = image["dn"].sel(band=band).values
        dn, number = np.unique(counts[counts > 0], return_counts=True)
        axes[2].step(dn, number / max(number.sum(), 1), where="mid", label=str(band), color=color)
    axes[2].set(xlabel="digital number", ylabel="share of pixels", title="Image")
    axes[2].legend(frameon=False)
    return figure


def fit_figure(image, truth, fits):
    """
    Pixels by NDVI and truth, and the regressions.

    Parameters
    ----------
    image, truth : xarray.Dataset
        In memory.
    fits : mapping of str to fifesim.analysis.regression.Regression

    Returns
    -------
    figure : matplotlib.figure.Figure
    """
    figure = Figure(figsize=(11, 4.4), layout="constrained")
    for axis, (name, fit) in zip(figure.subplots(1, len(fits), squeeze=False)[0], fits.items(), strict=True):
        y, x = (each.values.ravel() for each in matched(truth[name], image["ndvi"], "index"))
        valid = np.isfinite(x) & np.isfinite(y)
        points = axis.hexbin(x[valid], y[valid], gridsize=70, mincnt=1, bins="log", cmap="Greys", linewidths=0.1)
        figure.colorbar(points, ax=axis, shrink=0.8, label="pixels")
        line = np.linspace(x[valid].min(), x[valid].max(), 50)
        axis.fill_between(
            line, *fit.prediction_interval(line), color=_BAND, alpha=0.3, label="95 % prediction interval"
        )
        axis.plot(line, fit.predict(line), color=_LINE, linewidth=2, label="least-squares line")
        sign = "+" if fit.slope >= 0 else "−"
        axis.set(
            xlabel="NDVI at the top of the atmosphere",
            ylabel=f"True {NAMES[name]}",
            title=f"{fit.intercept:.3f} {sign} {abs(fit.slope):.3f} NDVI,  R² = {fit.r2:.3f},  n = {fit.n}",
        )
        axis.legend(frameon=False, loc="upper left")
    return figure


def _map(axis, array, **style):
    """A raster as a map with axes in km; no data is grey."""
    axis.set_facecolor(_NO_DATA)
    drawn = axis.imshow(array.values, extent=_extent(array), interpolation="nearest", **style)
    _map_axes(axis)
    return drawn


def _composite(axis, dn, stretch):
    axis.set_facecolor(_NO_DATA)
    reflectance = to_reflectance(dn)
    bands = [(reflectance.sel(band=name).values - low) / (high - low) for name, low, high in stretch]
    valid = (dn != 0).all("band").values
    axis.imshow(
        np.dstack([np.clip(np.nan_to_num(np.dstack(bands)), 0, 1), valid]), extent=_extent(dn), interpolation="nearest"
    )
    _map_axes(axis)


def _stretch(dn):
    """
    Bands for red, green and blue, with the reflectances that become dark and bright.

    All three span the same range about their own middle: stretched each by itself, bands that vary against each other
    leave nothing but pure colours.
    """
    chosen = list(_composite_bands(dn).values())
    names = [*chosen, *chosen[-1:] * 2][:3]
    reflectance = to_reflectance(dn)
    spans = []
    for name in names:
        values = _finite(reflectance.sel(band=name))
        spans.append(np.percentile(values, (1, 50, 99)) if values.size else (0.0, 0.5, 1.0))
    half = max(*(max(high - middle, middle - low) for low, middle, high in spans), 1e-3)
    return [(name, middle - half, middle + half) for name, (_, middle, _) in zip(names, spans, strict=True)]


def _composite_bands(dn):
    """Names of the bands of a colour infrared composite, as far as there are any; else the first band."""
    numbers = {window.name: nearest(dn["wavelength"].values, window) for window in (NEAR_INFRARED, RED, GREEN)}
    names = dn["band"].values
    return {color: names[number] for color, number in numbers.items() if number is not None} or {"grey": names[0]}


def _composite_name(dn):
    return ", ".join(map(str, _composite_bands(dn).values()))


def _map_axes(axis):
    axis.set(xlabel="easting [km]", ylabel="northing [km]")
    axis.ticklabel_format(useOffset=False, style="plain")
    axis.locator_params(nbins=5)
    axis.tick_params(labelsize=8)


def _height(array):
    """Height of three maps side by side [inch]."""
    rows, columns = array.sizes["y"], array.sizes["x"]
    return float(np.clip(0.7 + 2.9 * rows / columns, 2.2, 7.0))


def _extent(array):
    box = grids.geobox(array).boundingbox
    return [edge / 1000 for edge in (box.left, box.right, box.bottom, box.top)]


def _limits(array):
    values = _finite(array)
    low, high = np.percentile(values, (0.5, 99.5)) if values.size else (0.0, 1.0)
    return {"vmin": float(low), "vmax": float(high)}


def _finite(array):
    values = np.asarray(array.values, float).ravel()
    return values[np.isfinite(values)]


def _colors(count):
    return [("#2166ac", "#b2182b", "#1a9850", "#762a83", "#e08214", "#35978f")[index % 6] for index in range(count)]
