"""Report of a run as one HTML page, with its maps, figures and regressions."""

import base64
import io
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from fifesim.analysis.regression_labels import matched, regress
from fifesim.base import files
from fifesim.chain.comparison import TYPICAL_LAI, engine_error
from fifesim.grids import cf, projection
from fifesim.grids import grid as grids
from fifesim.grids.reductions import computed
from fifesim.output.colours import axis_label, capital, draw_line, finite, percentile_limits, position
from fifesim.output.folders import versions
from fifesim.output.maps import encoded, false_colour_names, image_map, relief_map, rendered, stretch_of, value_map
from fifesim.scenario.ensemble import realise
from fifesim.scenario.scenario import grid_keys, is_on_site, summary, time_in_words
from fifesim.scenario.simulation import setup_of
from fifesim.sensor.description.listing import blur_in_words, noise_in_words, sensor_in_words
from fifesim.sensor.description.provenance import geolocation_in_words, origins_in_words
from fifesim.sensor.description.spatial_response import knows_blur
from fifesim.sensor.labels import to_reflectance

# Colours of the palette of a picture.
_SHADES = 256


def page_html(template, **values):
    """Render a self-contained page from a template with values; ``versions`` is defined in all."""
    filters = {"fixed": fixed, "plus_minus": plus_minus, "embedded": _embedded}
    return rendered(template, filters, versions=versions(), **values)


def png(figure, dpi):
    """Bytes of a PNG file of a figure, reproducible, with a palette."""
    figure.set_dpi(dpi)
    # Unlike savefig, this computes the layout and draws only once.
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    drawn, buffer = Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3]), io.BytesIO()
    drawn.quantize(_SHADES, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(buffer, "png")
    return buffer.getvalue()


def fixed(value, digits=2, sign=False):
    """Text of a number with a true minus sign; a dash if it is unknown."""
    if value is None or not np.isfinite(value):
        return "–"
    text = f"{value:{'+' if sign else ''}.{digits}f}"
    if float(text) == 0:
        text = text.lstrip("+-")
    return text.replace("-", "−")


def plus_minus(value, digits=1):
    """Text of a standard error, to be placed after its number."""
    return f" ± {value:.{digits}f}" if np.isfinite(value) else ""


def _embedded(picture):
    """Data URL of a PNG or WebP picture."""
    kind = "webp" if picture[8:12] == b"WEBP" else "png"
    return f"data:image/{kind};base64," + base64.b64encode(picture).decode("ascii")


# Cells along the edge of the part paired as in the paper, as in `fifesim reproduce`, and length of the edge. [m]
_CELLS, _EDGE = 333, 1110.0
# Least number of pixels along an edge for a regression to be meaningful.
_FEWEST_PIXELS = 10
_PAPERS_INSTRUMENT = "TM"


def published(scenario, fits):
    """Published R2 for the ground of a run, R2 here and with the paper's pairing; None if it is not comparable."""
    paper, own = _paper_r2(scenario), scenario.sensor
    of_paper = own.description.name == _PAPERS_INSTRUMENT and own.response == "paper"
    if paper is None or "lai" not in fits or own.interval != "product" or not of_paper:
        return None
    interval = own.description.ground_intervals(own.description.select(own.bands)[0])[0]
    return {
        "r2": paper,
        "here": fits["lai"].r2,
        "interval": interval,
        "edge": _EDGE,
        "drifting": _papers_pairing(scenario),
    }


def _paper_r2(scenario):
    """Published R2 of LAI for the ground of a scenario, None if there is none."""
    ground = scenario.ground
    if ground.lai_file or not scenario.is_one():
        return None
    table = files.table("friedl1995_table2.csv").set_index(["variable", "distribution", "arp"])["r2"]
    return table.get(("lai", ground.distribution, ground.arp))


def _papers_pairing(scenario):
    """Cells along the edge of a part of the ground, and R2 of LAI with pixels at the native sampling interval."""
    box = scenario.geobox()
    cells = min(_CELLS, *box.shape)
    if cells * max(grids.cell_size(box)) < _FEWEST_PIXELS * scenario.sensor.size:
        return None
    sensor = scenario.sensor.model_copy(update={"interval": "native", "offset": [0.0, 0.0]})
    terrain = scenario.terrain.model_copy(update={"dem": "flat", "fill": None, "vertical_units": None})
    part = {"grid": grid_keys(box[:cells, :cells]), "terrain": terrain, "sensor": sensor}
    run = realise(scenario.model_copy(update=part))
    truth, image = matched(run["truth"]["lai"], run["image"]["ndvi"], "index")
    return cells, regress(truth, image, pair="index").r2


_COLORS = ("#2166ac", "#b2182b", "#1a9850", "#762a83", "#e08214", "#35978f")

# Fixed positions of axes and colour bar, because automatic layout takes longer than drawing. [1]
_PANEL, _BESIDE = (0.15, 0.17, 0.82, 0.72), (0.88, 0.14, 0.025, 0.66)
_PLOT = (0.125, 0.14, 0.73, 0.77)


def fit_figure(image, truth, name, fit):
    """Figure of truth against NDVI of the pixels, with the regression."""
    y, x = (each.values.ravel() for each in matched(truth[name], image["ndvi"], "index"))
    both = np.isfinite(x) & np.isfinite(y)
    figure = Figure(figsize=(5.2, 4.1))
    axis = figure.add_axes(_PLOT)
    _density(axis, figure.add_axes(_BESIDE), x[both], y[both])
    draw_line(axis, fit, (x[both].min(), x[both].max()))
    sign = "+" if fit.slope >= 0 else "−"
    index = cf.QUANTITIES["ndvi"].label
    title = f"{fit.intercept:.3f} {sign} {abs(fit.slope):.3f} {index},  n = {fit.n}"
    axis.set(xlabel=f"{index} at the top of the atmosphere", ylabel=f"True {axis_label(name)}")
    axis.set_title(title.replace("-", "−"), fontsize=10)
    # The range includes everything drawn, and excludes values below the physical minimum.
    low, high = axis.get_ylim()
    lowest = cf.QUANTITIES[name].lowest
    low = low if lowest is None else max(low, lowest)
    axis.set_ylim(low, high + 0.16 * (high - low))
    axis.legend(frameon=False, loc="upper left", fontsize=8.5, ncols=2, columnspacing=1.2)
    return figure


def _density(axis, beside, x, y):
    """Draw the density of pixels as an image; hexagons would be drawn one by one."""
    bins = int(np.clip(np.sqrt(x.size) / 3, 25, 72))
    count, across, up = np.histogram2d(x, y, bins=bins)
    shown = np.log10(np.where(count > 0, count, np.nan)).T
    extent = [across[0], across[-1], up[0], up[-1]]
    most = max(float(np.nanmax(shown)), 0.5)
    # The lightest colour is grey, so that a single pixel is visible.
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
    """Figures of the frequencies of leaf area index, FPAR and digital numbers."""
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
    absorbed = finite(truth["fpar"])
    # Rounding of equal values leaves a range that is too narrow for bins.
    bins = 60 if absorbed.size and np.ptp(absorbed) > 1e-6 else np.linspace(0, 1, 61)
    fpar.hist(absorbed, bins=bins, density=True, histtype="stepfilled", color="#1a9850")
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


_TEMPLATE = Path(__file__).with_name("report.html.j2")
# Resolution of figures, twice the displayed resolution. [dots per inch]
_DPI = 200
# Maximum rows or columns of maps; larger images are subsampled. [pixel]
_MOST = 600
# Error of 5S beyond which the report suggests another engine. [1]
_ENGINE_BOUND = 0.02


def run_page(scenario, image, truth, detail, terrain, level, fits, reasons, files=()):
    """Quicklook PNG and self-contained HTML page of a run."""
    # Pixels and their truth are paired by row and column.
    step = -(-max(rasters.sizes[axis] for rasters in (image, truth) for axis in ("y", "x")) // _MOST)
    shown, means = _thinned(image, step), _thinned(truth, step)
    whole, *close = _overview_maps(shown, image, detail)
    figures = {name: png(fit_figure(shown, means, name, fit), _DPI) for name, fit in fits.items()}
    own, dn = scenario.sensor, image["dn"]
    html = page_html(
        _TEMPLATE,
        scenario=scenario,
        dn=dn,
        title=headline(scenario),
        ground=ground_in_words(scenario),
        reasons={_label(name): why for name, why in reasons.items()},
        error=np.nanpercentile(_line_error(shown, means, fits["lai"]), [5, 95]) if "lai" in fits else None,
        too_sharp=[band.name for band in own.description.select(own.bands) if not knows_blur(own.description, band)],
        engine=engine_rows(scenario),
        pairing=_paired(scenario, image, truth),
        published=published(scenario, fits),
        valid=float((dn != 0).all("band").mean()),
        saturated=(dn >= 2**own.description.bits - 1).any("band"),
        inputs=input_rows(scenario),
        geolocation=geolocation_in_words(own.description),
        files=files,
        statistics=_statistics(image, truth),
        seen={"whole": whole, "close": close, "colours": false_colour_names(dn)},
        maps=_maps(shown, means, fits),
        relief=terrain,
        terrain=[] if terrain is None else _terrain_maps(image, terrain, level),
        histograms=[png(figure, _DPI) for figure in histogram_figures(shown, means, detail)],
        fits=[(_label(name), fit, figures[name], float(truth[name].mean())) for name, fit in fits.items()],
    )
    return encoded(whole.pixels, lossless=True), html


def headline(scenario):
    """Title of a page: instrument, place, date, and the synthetic parts."""
    time = scenario.geometry.time
    when = "" if time is None else f", {time_in_words(time)}"
    synthetic = summary(scenario)
    place = "FIFE site" if is_on_site(scenario) else position(*projection.middle(scenario.geobox()))
    text = f"Simulated {scenario.sensor.description.title} image, {place}{when}"
    return f"{text} ({synthetic})" if synthetic else text


def _line_error(shown, means, fit):
    """LAI from a line on NDVI minus true LAI, dims (y, x). [m2 m-2]"""
    values, ndvi = matched(means["lai"], shown["ndvi"], "index")
    error = means["lai"].isel(y=slice(values.sizes["y"]), x=slice(values.sizes["x"]))
    return error.copy(data=fit.predict(ndvi.values) - values.values)


def _paired(scenario, image, truth):
    """Cells along the edge of a block, and sizes of cells and blocks and the distance of pixels from them. [m]"""
    block, cell = grids.cell_size(grids.geobox(truth["lai"]))[1], grids.cell_size(scenario.geobox())[1]
    pairs = ((image[axis].values, truth[axis].values) for axis in ("y", "x"))
    apart = [np.abs(np.subtract(*(each[: min(map(len, pair))] for each in pair))).max() for pair in pairs]
    far = float(np.hypot(*apart)) if max(apart) >= 1e-3 * block else 0.0
    return {"cells": block / cell, "cell": cell, "block": block, "apart": far}


def _overview_maps(shown, image, detail):
    """Maps of the whole image, of the cells in its middle, and of the pixels over them."""
    box = grids.geobox(detail).boundingbox
    part = image.sel(x=slice(box.left, box.right), y=slice(box.top, box.bottom)).compute()
    cell, pixel = (grids.cell_size(grids.geobox(each))[1] for each in (detail, part["dn"]))
    high = max(percentile_limits(detail)[1], 1e-6)
    cells = value_map(detail, f"{_label('lai')} in cells of {cell:.2f} m", limits=(0.0, high))
    titles = "The image", f"The same ground in pixels of {pixel:g} m"
    names = false_colour_names(shown["dn"])
    if not names and "ndvi" in shown:
        limits = percentile_limits(shown["ndvi"])
        whole, pixels = (
            value_map(pixels["ndvi"], f"{title}: {_label('ndvi')}", limits=limits, frame=frame)
            for pixels, title, frame in zip((shown, part), titles, (box, None), strict=True)
        )
        return whole, cells, pixels
    stretch = stretch_of(shown["dn"])
    band = "" if names else f": {stretch[0][0]}"
    whole, pixels = (
        image_map(shown["dn"], titles[0] + band, stretch, box),
        image_map(part["dn"], titles[1] + band, stretch),
    )
    return whole, cells, pixels


def _maps(shown, means, fits):
    """Maps of true leaf area index, NDVI, and the estimate by a line."""
    maps = [value_map(means["lai"], f"True {_label('lai')}")]
    if "ndvi" not in shown:
        return [*maps, value_map(means["fpar"], f"True {_label('fpar')}")]
    maps.append(value_map(shown["ndvi"], f"{_label('ndvi')} of the image"))
    if "lai" in fits:
        error = _line_error(shown, means, fits["lai"])
        maps.append(value_map(error, f"{_label('lai')} from the line minus true {_label('lai')}", "RdBu_r", middle=0.0))
    return maps


def _terrain_maps(image, terrain, level):
    """Maps of elevation, slope, Kt, and the difference of the image from level ground."""
    band = str(image["dn"]["band"].values[-1])
    dn = image["dn"].sel(y=level["y"], x=level["x"]).compute()
    with_terrain, flat = (to_reflectance(each.sel(band=[band])) for each in (dn, level))
    change = (with_terrain - flat).isel(band=0)
    return [
        relief_map(terrain["dem"], f"{capital(axis_label('dem'))}, lit from the north-west"),
        value_map(terrain["slope"], f"{capital(axis_label('slope'))}, mean of the cells"),
        value_map(terrain["kt"].sel(band=band), f"{_label('kt')} in {band}, mean of the cells"),
        value_map(change, f"Effect of terrain on reflectance in {band}", "RdBu_r", middle=0.0),
    ]


def engine_rows(scenario):
    """Row on the error of 5S against successive orders, naming bands beyond 2 %; none for other engines."""
    if scenario.atmosphere.engine != "5S":
        return []
    error = engine_error(setup_of(scenario))
    text = ", ".join(f"{band} {fixed(100 * each, 1, True)} %" for band, each in error.items())
    outside = ", ".join(band for band, each in error.items() if abs(each) > _ENGINE_BOUND)
    advice = f'beyond 2 % in {outside}: engine = "successive-orders" is closer' if outside else "within 2 %"
    return [(f"5S minus successive orders, for a canopy with LAI {TYPICAL_LAI:g}", f"{text}; {advice}")]


def input_rows(scenario):
    """Inputs of a complete scenario in words, by name."""
    own, air, grid = scenario.sensor, scenario.model_atmosphere(), scenario.grid
    haze = f"aerosol thickness {air.aot:g}" if air.visibility is None else f"visibility {air.visibility:g} km"
    return {
        "Scene": f"{grid.width / 1000:g} km x {grid.height / 1000:g} km in cells of {grid.cell:.3g} m",
        "Ground": ground_in_words(scenario),
        "Terrain": "level" if scenario.terrain.dem == "flat" else Path(scenario.terrain.dem).name,
        "Sensor": sensor_in_words(own.description, own.bands),
        "Blur": blur_in_words(own.description, own.bands),
        "Noise": noise_in_words(own.description, own.bands, own.noise),
        "Registration error": "{:g} and {:g} pixels southward and eastward".format(*own.offset),
        "Origin of the description": origins_in_words(own.description, own.bands),
        "Atmosphere": f"{air.profile} atmosphere, {air.aerosol} aerosol, {haze}, {air.engine}",
    }


def ground_in_words(scenario):
    """Classes and leaf area of the ground of a scenario."""
    ground = scenario.ground
    if scenario.learned:
        return f"Landscape learned from {Path(scenario.learned).name}"
    if scenario.landscape.cover != "none":
        return f"{', '.join(scenario.class_table())} in {Path(scenario.landscape.cover).name}"
    return Path(ground.lai_file).name if ground.lai_file else f"{ground.distribution}, arp {ground.arp:g}"


def title(scenario):
    """Title of a run or a budget: ground, instrument and synthetic parts."""
    scene = ground_in_words(scenario)
    seen, synthetic = f"{scene}, seen by {Path(scenario.sensor.instrument).name}", summary(scenario)
    return f"{seen} ({synthetic})" if synthetic else seen


def _label(name):
    return cf.QUANTITIES[name].label


def _thinned(rasters, step):
    """Every n-th pixel in memory, for pictures only; numbers in the text use all pixels."""
    return rasters.isel({axis: slice(step // 2, None, step) for axis in ("y", "x")}).compute()


def _statistics(image, truth):
    """Label, mean and standard deviation of each quantity of the pixels."""
    rasters = dict(truth.data_vars) | ({"ndvi": image["ndvi"]} if "ndvi" in image else {})
    (found,) = computed({name: (values.mean(), values.std()) for name, values in rasters.items()})
    return [(capital(_label(name)), *map(float, each)) for name, each in found.items()]
