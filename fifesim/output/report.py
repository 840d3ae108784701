"""Pictures and the HTML page of a run."""

from pathlib import Path

from fifesim.chain.engines import TYPICAL_LAI, engine_error
from fifesim.output import pages
from fifesim.output.figures import NAMES, detail_figure, fit_figure, histogram_figure, map_figure, terrain_figure
from fifesim.output.pairing import pairing_rows
from fifesim.rasters import grid as grids
from fifesim.scenario.simulation import setup_of
from fifesim.sensor.description.listing import blur_in_words, noise_in_words

_TEMPLATE = Path(__file__).with_name("report.html.j2")
_DPI = 130
# Figures show every so many pixels of an image that has more rows or columns. [pixel]
_MOST = 600
# Difference of 5S from successive orders from which a reader is told to change. [1]
_ENGINE_BOUND = 0.02


def run_page(scenario, image, truth, detail, terrain, level, fits, reasons):
    """
    One self-contained HTML page on a run, and its first picture.

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
        The scene and its image, a PNG.
    html : str
    """
    # Pixels and their truth are paired by row and column.
    step = max(_step(image), _step(truth))
    shown, means = _thinned(image, step), _thinned(truth, step)
    figures = {
        "detail": detail_figure(shown, _below(image, detail), detail),
        "maps": map_figure(shown, means),
        "histograms": histogram_figure(shown, means, detail),
    }
    if terrain is not None:
        figures["terrain"] = terrain_figure(image, terrain, level)
    if fits:
        figures["fits"] = fit_figure(shown, means, fits)
    pictures = {name: pages.png(figure, _DPI) for name, figure in figures.items()}
    html = pages.html(
        _TEMPLATE,
        title=title(scenario),
        summary=_summary(scenario, image, truth, fits, reasons)
        + pairing_rows(scenario, fits)
        + _ground(terrain)
        + engine_rows(scenario),
        figures=pictures,
        fits=[(NAMES[name], fit) for name, fit in fits.items()],
        parameters=_parameters(scenario),
        history=image["dn"].attrs.get("history", "").splitlines(),
    )
    return pictures["detail"], html


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
    What a run or a budget is of, in words.

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
    return f"{scene}, seen by {Path(scenario.sensor.instrument).name}"


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
        ("Blur", blur_in_words(own.description, own.bands)),
        ("Noise", noise_in_words(own.description, own.bands, own.noise)),
        ("Sun", f"zenith {float(pixels['sza']):.1f} degrees, azimuth {float(pixels['saa']):.1f} degrees from north"),
    ]
    for name, values in [*truth.data_vars.items(), *([("ndvi", image["ndvi"])] if "ndvi" in image else [])]:
        label = f"{NAMES[name][0].upper()}{NAMES[name][1:]} of the pixels"
        mean, deviation = (pages.fixed(float(each), 3) for each in (values.mean(), values.std()))
        rows.append((label, f"mean {mean}, standard deviation {deviation}"))
    found = {name: f"{fit.r2:.3f}" for name, fit in fits.items()} | {name: f"none, {reasons[name]}" for name in reasons}
    return rows + [(f"R² of {NAMES[name]} on NDVI", text) for name, text in found.items()]


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
    return image["dn"].sel(x=slice(box.left, box.right), y=slice(box.top, box.bottom)).compute()
