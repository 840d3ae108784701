"""Pictures and the HTML page of a run."""

from pathlib import Path

import numpy as np

from fifesim.analysis.rasters.pairs import matched
from fifesim.chain.engines import TYPICAL_LAI, engine_error
from fifesim.output import pages
from fifesim.output.colours import percentile_limits
from fifesim.output.composites import false_colour_names
from fifesim.output.figures import fit_figure, histogram_figures, reflectance_change
from fifesim.output.maps import encoded, image_map, relief_map, stretch_of, value_map
from fifesim.output.pairing import pairing_rows
from fifesim.output.words import axis_label, capital
from fifesim.rasters import cf
from fifesim.rasters import grid as grids
from fifesim.scenario.simulation import setup_of
from fifesim.scenario.synthetic import summary
from fifesim.sensor.description.listing import blur_in_words, noise_in_words, sensor_in_words

_TEMPLATE = Path(__file__).with_name("report.html.j2")
# Of figures, which are shown at half of it or less.
_DPI = 200
# Maps show every so many pixels of an image that has more rows or columns. [pixel]
_MOST = 600
# Difference of 5S from successive orders from which a reader is told to change. [1]
_ENGINE_BOUND = 0.02


def run_page(scenario, image, truth, detail, terrain, level, fits, reasons):
    """
    One self-contained HTML page on a run, and a picture of its image.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
    image : xarray.Dataset
        ``dn`` and perhaps ``ndvi``, lazy or in memory.
    truth : xarray.Dataset
        ``lai`` and ``fpar`` over the ground of the pixels.
    detail : xarray.DataArray, dims (y, x)
        LAI of the cells in the middle.
    terrain : xarray.Dataset or None
        ``dem``, ``slope`` and ``kt`` over pixels, and how far the elevation is known; None if flat.
    level : xarray.DataArray or None
        Digital numbers on level ground, over as many pixels; None if flat.
    fits : mapping of str to fifesim.analysis.regression.Regression
        Of the true means on NDVI.
    reasons : mapping of str to str
        Why there is none of them, by name.

    Returns
    -------
    quicklook : bytes
        The image without a frame, a PNG: in false colours, else its NDVI, else one band in grey.
    html : str
    """
    # Pixels and their truth are paired by row and column.
    step = max(_step(image), _step(truth))
    shown, means = _thinned(image, step), _thinned(truth, step)
    whole, *close = _seen(shown, _below(image, detail), detail)
    figures = {name: pages.png(fit_figure(shown, means, name, fit), _DPI) for name, fit in fits.items()}
    html = pages.html(
        _TEMPLATE,
        title=title(scenario),
        provenance=scenario.provenance(),
        finding=finding(truth, fits, reasons),
        pairing=pairing(scenario, image, truth),
        summary=_summary(scenario, image, truth, fits, reasons)
        + pairing_rows(scenario, fits)
        + _ground(terrain)
        + engine_rows(scenario),
        seen={"whole": whole, "close": close, "colours": false_colour_names(image["dn"])},
        maps=_maps(shown, means, fits),
        terrain=[] if terrain is None else _terrain_maps(image, terrain, level),
        band=str(image["dn"]["band"].values[-1]),
        histograms=[pages.png(figure, _DPI) for figure in histogram_figures(shown, means, detail)],
        fits=[(_label(name), fit, figures[name]) for name, fit in fits.items()],
        parameters=_parameters(scenario),
        history=image["dn"].attrs.get("history", "").splitlines(),
    )
    return encoded(whole.pixels, lossless=True), html


def finding(truth, fits, reasons):
    """
    What a run shows, in a sentence or two.

    Parameters
    ----------
    truth : xarray.Dataset
    fits : mapping of str to fifesim.analysis.regression.Regression
    reasons : mapping of str to str
        Why there is none of them, by name.

    Returns
    -------
    text : str
    """
    if not fits:
        why = "; ".join(dict.fromkeys(reasons.values()))
        return f"No line was fitted: {why}" if why else "The bands make no NDVI, so that no line was fitted."
    shares = [f"{100 * fit.r2:.1f} % of the variance of true {_label(name)}" for name, fit in fits.items()]
    text = f"A straight line on the NDVI of this image explains {' and '.join(shares)}."
    name, fit = next(iter(fits.items()))
    mean = float(truth[name].mean())
    share = f", {100 * fit.residual_deviation / mean:.0f} % of the mean" if mean > 0 else ""
    return f"{text} What it misses of {_label(name)} has a standard deviation of {fit.residual_deviation:.3f}{share}."


def pairing(scenario, image, truth):
    """
    Which pixel is compared with which ground, in words.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
    image, truth : xarray.Dataset

    Returns
    -------
    text : str
    """
    block, cell = grids.cell_size(grids.geobox(truth["lai"]))[1], grids.cell_size(scenario.geobox())[1]
    pairs = ((image[axis].values, truth[axis].values) for axis in ("y", "x"))
    apart = [np.abs(np.subtract(*(each[: min(map(len, pair))] for each in pair))).max() for pair in pairs]
    text = (
        "Each point pairs a pixel of the image with the block of ground in the same row and column of the truth: the "
        f"mean of {block / cell:.3g} x {block / cell:.3g} cells of {cell:.3g} m, a square of {block:g} m. "
    )
    if max(apart) < 1e-3 * block:
        text += "Pixels and blocks have the same centres"
    else:
        text += f"Centres lie up to {np.hypot(*apart):.1f} m apart"
    if any(scenario.sensor.offset):
        down, right = scenario.sensor.offset
        text += f", and the pixels see ground {down:g} pixels further south and {right:g} further east than they say"
    return text + "."


def _seen(shown, part, detail):
    """The whole image; the cells in its middle, and the pixels over them."""
    box = grids.geobox(detail).boundingbox
    cell, pixel = (grids.cell_size(grids.geobox(each))[1] for each in (detail, part["dn"]))
    high = max(percentile_limits(detail)[1], 1e-6)
    cells = value_map(detail, f"{_label('lai')} in cells of {cell:.2f} m", limits=(0.0, high))
    titles = "The image", f"The same ground in pixels of {pixel:g} m"
    names = false_colour_names(shown["dn"])
    if not names and "ndvi" in shown:
        limits = percentile_limits(shown["ndvi"])
        whole, pixels = (
            value_map(each["ndvi"], f"{said}: {_label('ndvi')}", limits=limits, frame=frame)
            for each, said, frame in zip((shown, part), titles, (box, None), strict=True)
        )
        return whole, cells, pixels
    stretch = stretch_of(shown["dn"])
    said = "" if names else f": {stretch[0][0]}"
    return (
        image_map(shown["dn"], titles[0] + said, stretch, box),
        cells,
        image_map(part["dn"], titles[1] + said, stretch),
    )


def _maps(shown, means, fits):
    """True leaf area index, NDVI, and what a line on it makes of the ground."""
    maps = [value_map(means["lai"], f"True {_label('lai')}")]
    if "ndvi" not in shown:
        return [*maps, value_map(means["fpar"], f"True {_label('fpar')}")]
    maps.append(value_map(shown["ndvi"], f"{_label('ndvi')} of the image"))
    if "lai" in fits:
        values, ndvi = matched(means["lai"], shown["ndvi"], "index")
        error = means["lai"].isel(y=slice(values.sizes["y"]), x=slice(values.sizes["x"]))
        error = error.copy(data=fits["lai"].predict(ndvi.values) - values.values)
        maps.append(value_map(error, f"{_label('lai')} by the line, less the true one", "RdBu", middle=0.0))
    return maps


def _terrain_maps(image, terrain, level):
    """Elevation, slope, Kt, and the image less that of level ground."""
    band = str(image["dn"]["band"].values[-1])
    dn = image["dn"].sel(y=level["y"], x=level["x"]).compute()
    change = reflectance_change(dn, level, band)
    return [
        relief_map(terrain["dem"], f"{capital(axis_label('dem'))}, lit from the north-west"),
        value_map(terrain["slope"], f"{capital(axis_label('slope'))}, mean of the cells"),
        value_map(terrain["kt"].sel(band=band), f"{_label('kt')} in {band}, mean of the cells"),
        value_map(change, f"What terrain did to the reflectance in {band}", "RdBu_r", middle=0.0),
    ]


def engine_rows(scenario):
    """
    What the closed forms cost a run, beside successive orders.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario

    Returns
    -------
    rows : list of (str, str)
        One, that names the bands beyond 2 %; none where another engine is used.

    See Also
    --------
    fifesim.chain.engines.engine_error
    """
    if scenario.atmosphere.engine != "5S":
        return []
    error = engine_error(setup_of(scenario))
    text = ", ".join(f"{band} {100 * each:+.1f} %" for band, each in error.items())
    outside = ", ".join(band for band, each in error.items() if abs(each) > _ENGINE_BOUND)
    advice = f'beyond 2 % in {outside}: engine = "successive-orders" is closer' if outside else "within 2 %"
    return [(f"5S less successive orders, over a canopy of leaf area {TYPICAL_LAI:g}", f"{text}; {advice}")]


def title(scenario):
    """
    Title of a run or a budget: ground, instrument and synthetic parts.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario

    Returns
    -------
    title : str
    """
    ground = scenario.ground
    scene = Path(ground.lai_file).name if ground.lai_file else f"{ground.distribution}, arp {ground.arp:g}"
    if scenario.landscape.cover != "none":
        scene = f"{', '.join(scenario.class_table())} in {Path(scenario.landscape.cover).name}"
    seen, synthetic = f"{scene}, seen by {Path(scenario.sensor.instrument).name}", summary(scenario)
    return f"{seen} ({synthetic})" if synthetic else seen


def _label(name):
    return cf.QUANTITIES[name].label


def _step(rasters):
    return -(-max(rasters.sizes[axis] for axis in ("y", "x")) // _MOST)


def _thinned(rasters, step):
    """Every so many pixels, in memory: a picture shows no more, and numbers in text are of all of them."""
    return rasters.isel({axis: slice(step // 2, None, step) for axis in ("y", "x")}).compute()


def _summary(scenario, image, truth, fits, reasons):
    """Rows of a small table: what a reader wants to know first."""
    grid, pixels = scenario.grid, image["dn"]
    valid = float((pixels != 0).all("band").mean())
    size = f"{pixels.sizes['y']} x {pixels.sizes['x']}"
    own = scenario.sensor
    rows = [
        ("Scene", f"{grid.width / 1000:g} km x {grid.height / 1000:g} km in cells of {grid.cell:.3g} m, {grid.crs}"),
        ("Image", f"{size} pixels of {scenario.sensor.pixel:g} m, {100 * valid:.1f} % of them with data"),
        ("Sensor", sensor_in_words(own.description, own.bands)),
        ("Blur", blur_in_words(own.description, own.bands)),
        ("Noise", noise_in_words(own.description, own.bands, own.noise)),
        ("Sun", f"zenith {float(pixels['sza']):.1f} degrees, azimuth {float(pixels['saa']):.1f} degrees from north"),
    ]
    for name, values in [*truth.data_vars.items(), *([("ndvi", image["ndvi"])] if "ndvi" in image else [])]:
        label = f"{capital(_label(name))} of the pixels"
        mean, deviation = (pages.fixed(float(each), 3) for each in (values.mean(), values.std()))
        rows.append((label, f"mean {mean}, standard deviation {deviation}"))
    found = {name: f"{fit.r2:.3f}" for name, fit in fits.items()} | {name: f"none, {reasons[name]}" for name in reasons}
    return rows + [(f"R² of {_label(name)} on NDVI", text) for name, text in found.items()]


def _ground(terrain):
    """Rows on the elevation."""
    if terrain is None:
        return [("Ground", "flat")]
    dem, kt = terrain["dem"], terrain["kt"]
    known = ", ".join(f"{side[6:]} {distance / 1000:.3g} km" for side, distance in terrain.attrs.items())
    return [
        ("Elevation of the pixels", f"{float(dem.min()):.0f} to {float(dem.max()):.0f} m"),
        ("Elevation known beyond the scene, for horizons", known),
        ("Kt of the pixels", f"{float(kt.min()):.3f} to {float(kt.max()):.3f}"),
    ]


def _parameters(scenario):
    """Key, value, unit and meaning of every parameter, by section."""
    sections = []
    for place, section in scenario.sections().items():
        rows = []
        for key, known in section.said.items():
            value, unit = getattr(section, key), section.unit(key)
            if isinstance(value, dict):
                value = ", ".join(f"{band} {number:g}" for band, number in value.items())
            elif isinstance(value, list):
                value = ", ".join(map(str, value)) or "none"
            elif isinstance(value, float):
                value = f"{value:.10g}"
            elif isinstance(value, bool):
                value = "yes" if value else "no"
            elif section.names_a_file(key, value):
                value = Path(value).name
            rows.append((key, "not given" if value is None else value, unit, known.description))
        sections.append((".".join(place), rows))
    return sections


def _below(image, detail):
    """The pixels of some cells, in memory."""
    box = grids.geobox(detail).boundingbox
    return image.sel(x=slice(box.left, box.right), y=slice(box.top, box.bottom)).compute()
