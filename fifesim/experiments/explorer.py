"""Interactive page with sliders: texts, packed arrays, and writing to a file."""

from __future__ import annotations

import base64
import math
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
from markupsafe import Markup

from fifesim.base.arguments import FilePath
from fifesim.base.files import check_suffix, whole_file
from fifesim.experiments.explorer_settings import LINE_NUMBERS, outcomes_of, sweep_of
from fifesim.experiments.scatter.shares import CURVATURE
from fifesim.experiments.scatter.stages import STAGES, VARIABLES
from fifesim.grids import cf
from fifesim.grids import grid as grids
from fifesim.ground.landscape.autoregression import correlation_length
from fifesim.output import report
from fifesim.output.colours import axis_label, colours_of, percentile_limits, stops_of
from fifesim.output.progress import steps
from fifesim.output.report import fixed, title
from fifesim.scenario.scenario import Scenario
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.description.provenance import origin_text

# Storage in a page: bytes, pairs of bytes with all low bytes first, and numbers of four or eight bytes.
_KINDS = {np.dtype("u1"): "u1", np.dtype("u2"): "u2", np.dtype("f4"): "f4", np.dtype("f8"): "f8"}
_ALIGNED = 8
# Number of quantization steps; 0 is no data.
_LEVELS = {"u1": 254, "u2": 65534}


def packed(arrays):
    """Pack arrays into a text: Base64 of a zlib stream, with kind, shape and start [byte] of each array."""
    # Every array begins at a multiple of eight bytes.
    whole, places = bytearray(), {}
    for name, array in arrays.items():
        if array.dtype not in _KINDS:
            raise ValueError(f"{name} is of type {array.dtype}: packed takes uint8, uint16, float32 or float64")
        kind = _KINDS[array.dtype]
        places[name] = {"kind": kind, "shape": list(array.shape), "start": len(whole)}
        little = np.ascontiguousarray(array).astype(f"<{kind}").tobytes()
        # High bytes compress well when stored together.
        whole += little[::2] + little[1::2] if kind == "u2" else little
        whole += bytes(-len(whole) % _ALIGNED)
    return base64.b64encode(zlib.compress(bytes(whole), 9)).decode("ascii"), places


def stepped(values, kind):
    """Codes 1 + (v - low) / step of values in equal steps, 0 for NaN, with low and step."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    step = (high - low) / _LEVELS[kind] or 1.0
    codes = np.where(np.isfinite(values), 1 + np.rint((values - low) / step), 0)
    return codes.astype(kind), low, step


# Effect of each stage.
STAGE_WORDS = {
    CURVATURE: "the relation of LAI and FPAR with NDVI is curved, and a line cannot follow it",
    "non-linearity": "averages of bare and dense cells within a pixel do not follow that curve",
    "NDVI scaling": "the NDVI of mean reflectance differs from the mean NDVI",
    "point spread": "a pixel receives light from its neighbours",
    "registration": "pixels are displaced from the ground they are compared with",
    "quantisation": "radiance is rounded to whole numbers",
    "noise": "random errors of the detectors",
    "topography": "slopes face the sun or turn away from it",
    "atmosphere": "haze and gases reduce the contrast",
    "coupling": "the ground reflects skylight by direction",
    "clouds": "thin clouds pass the mask",
    "shadows": "shadows of thin clouds pass the mask",
    "soil": "soil brightness varies",
    "dead leaves": "their fraction varies",
    "cover": "plants and background differ between fields",
    "clumping": "leaves stand in crowns, with gaps between",
}

# Views of an image: quantity and band.
VIEWS = {"ndvi": ("ndvi", ""), "red": ("toa_reflectance", "red"), "nir": ("toa_reflectance", "near infrared")}


def layer_words(variables):
    """Names, labels, units and colours of the truths and views of a page."""
    layers = {name: (name, "") for name in variables} | VIEWS
    return {key: _layer(quantity, band) for key, (quantity, band) in layers.items()}


def _layer(quantity, band):
    label, axis = (f"{band} {text}".strip() for text in (cf.QUANTITIES[quantity].label, axis_label(quantity)))
    return {"name": band or label, "label": label, "axis": axis, "stops": stops_of(colours_of(quantity)[0])}


def slider_words(sweep):
    """Names, hints, marks and start positions of the sliders of a page."""
    own = sweep.scenario
    haze = {"visibility": "Visibility", "aot": "Haze"}[sweep.haze]
    return [
        _slider("arp", "Ground patches", "distance over which leaf area is correlated", sweep.arps,
                own.ground.arp, lambda arp: _patches(arp, own)),
        _slider("haze", haze, "visibility, or aerosol optical thickness", sweep.hazes,
                getattr(own.atmosphere, sweep.haze), lambda amount: _air(sweep.haze, amount)),
        _slider("sza", "Solar zenith", "solar zenith angle", sweep.szas, own.sun_and_view().sza, _sun),
        _slider("instrument", "Instrument", "from small to large pixels", sweep.instruments, own.sensor.instrument,
                lambda name: _instrument_title(sweep, name)),
        _slider("registration", "Registration error", "distance of pixels from the ground they are compared with",
                sweep.offsets, tuple(own.sensor.offset), _displacement),
    ]  # fmt: skip


def _slider(key, name, hint, values, own, mark_and_text):
    marks, texts = map(list, zip(*map(mark_and_text, values), strict=True))
    start = values.index(own) if own in values else 0
    return {"key": key, "name": name, "hint": hint, "marks": marks, "texts": texts, "start": start}


def _patches(arp, scenario):
    if arp is None:
        return ("learned", "as learned from a map") if scenario.learned else ("map", "as in the map")
    length = correlation_length(arp, scenario.grid.cell)
    return f"{length:.0f} m", f"leaf area is correlated up to {length:.0f} m, arp {arp:g}"


def _air(key, amount):
    if amount is None:
        return "none", "without haze"
    if key == "aot":
        return f"{amount:g}", f"aerosol optical thickness {amount:g}"
    return f"{amount:g} km", f"visibility {amount:g} km"


def _sun(sza):
    return f"{sza:.3g}°", f"{sza:.1f}° from overhead"


def _instrument_title(sweep, name):
    found, own = instrument(name), sweep.at(replace(sweep.settings[0], instrument=name)).sensor
    return found.name, f"{found.title}, {own.size:g} m; blur: {origin_text(found, 'blur', own.bands)}"


def _displacement(offset):
    size = math.hypot(*offset)
    mark = {0.25: "¼", 0.5: "½", 0.75: "¾"}.get(size, f"{size:.2g}")
    if not size:
        return mark, "none"
    return mark, f"{fixed(size, 2)} pixel" + ("" if offset[0] == 0 else ", as in the scenario")


_TEMPLATE = Path(__file__).with_name("explore.html.j2")
_SCRIPTS = ("explore_data.js", "explore_drawing.js", "explore.js")
# Pixels per image from which colour limits are computed.
_SAMPLE = 50


def explorer_page(sweep, outcomes):
    """One self-contained HTML page with sliders."""
    text, data = page_data(sweep, outcomes)
    own = Path(__file__).parent
    return report.page_html(
        _TEMPLATE, title=title(sweep.scenario), sliders=data["sliders"], story=_story(data["sliders"], outcomes),
        scenario=sweep.scenario, count=math.prod(sweep.shape), data=data, bytes=text,
        style=Markup((own / "explore.css").read_text(encoding="utf-8")),
        script=Markup("\n".join((own / name).read_text(encoding="utf-8") for name in _SCRIPTS)),
    )  # fmt: skip


def page_data(sweep, outcomes):
    """Data that the script of a page reads: the packed arrays as text, and their description."""
    shares = np.concatenate([outcomes.curvature[..., None], outcomes.shares], axis=-1)
    shown = [k for k, _ in enumerate((CURVATURE, *STAGES)) if shares[..., k].any()]
    names = [(CURVATURE, *STAGES)[k] for k in shown]
    arrays, steps = _arrays(outcomes)
    arrays |= {"lines": outcomes.lines, "shares": np.ascontiguousarray(shares[..., shown])}
    text, places = packed(arrays)
    box = sweep.scenario.geobox()
    data = {
        "places": places,
        "steps": steps,
        "sliders": slider_words(sweep),
        "variables": list(VARIABLES),
        "views": list(VIEWS),
        "layers": layer_words(VARIABLES),
        "numbers": list(LINE_NUMBERS),
        "stages": [{"name": name, "meaning": STAGE_WORDS[name]} for name in names],
        "instruments": [_instrument(sweep, k, camera) for k, camera in enumerate(outcomes.cameras)],
        "offsets": [list(offset) for offset in sweep.offsets],
        "szas": list(sweep.szas),
        "scene": {"rows": box.shape.y, "columns": box.shape.x, "cell": grids.cell_size(box)[0]},
        **_ranges(sweep, outcomes),
        "keys": _keys(sweep),
    }
    return text, data


def _story(sliders, outcomes):
    """R2 of LAI in the order of the settings that the page proposes first."""
    r2 = outcomes.lines[..., VARIABLES.index("lai"), LINE_NUMBERS.index("r2")]
    place = [slider["start"] for slider in sliders]
    found = {"start": float(r2[tuple(place)]), "patches": None}
    place[-1] = -1
    found["displaced"] = float(r2[tuple(place)])
    if place[0] < len(sliders[0]["texts"]) - 1:
        found["patches"] = float(r2[(-1, *place[1:])])
    return found


def _arrays(outcomes):
    """Images and truths quantized for a page, and the quantization steps."""
    arrays, steps = {}, {}
    arrays["scenes"], *steps["scenes"] = stepped(outcomes.scenes, "u1")
    for k, (image, truth, camera) in enumerate(zip(outcomes.images, outcomes.truths, outcomes.cameras, strict=True)):
        arrays[f"image{k}"] = image
        arrays[f"reflectance{k}"] = camera.reflectance
        # Leaf area does not depend on the sun.
        arrays[f"lai{k}"], *steps[f"lai{k}"] = stepped(truth[:, 0, 0], "u2")
        arrays[f"fpar{k}"], *steps[f"fpar{k}"] = stepped(truth[:, :, 1], "u2")
    return arrays, steps


def _instrument(sweep, number, camera):
    own = camera.scenario.sensor
    keys = sweep.values(sweep.settings[number])["sensor"]
    if "instrument" in own.files:
        keys["instrument"] = Path(own.instrument).name
    return {
        "name": own.description.name,
        "pixel": own.size,
        "bits": own.description.bits,
        "bands": camera.bands,
        "keys": keys,
    }


def _ranges(sweep, outcomes):
    """Limits of colours and axes, common to all settings so that they can be compared."""
    ndvi, bands = [], []
    mu_s = np.cos(np.radians(sweep.szas))[None, None, :, None, None, None]
    for image, camera in zip(outcomes.images, outcomes.cameras, strict=True):
        pixels = image.reshape(*image.shape[:5], -1)
        pixels = pixels[..., :: max(pixels.shape[-1] // _SAMPLE, 1)]
        red, nir = (camera.reflectance[k][pixels[..., k, :]] / mu_s for k in (0, 1))
        bands.append(np.stack([red.ravel(), nir.ravel()]))
        ndvi.append(((nir - red) / (nir + red)).ravel())
    red, nir = np.concatenate(bands, axis=1)
    truths = [np.concatenate([truth[:, :, k].ravel() for truth in outcomes.truths]) for k in (0, 1)]
    found = {"scene": outcomes.scenes, "ndvi": np.concatenate(ndvi), "red": red, "nir": nir}
    found |= dict(zip(VARIABLES, truths, strict=True))
    return {
        "ranges": {name: percentile_limits(values) for name, values in found.items()},
        "axes": {name: percentile_limits(found[name], (0, 100)) for name in ("ndvi", *VARIABLES)},
    }


def _keys(sweep):
    """Keys of the scenario that no slider changes, with files by name."""
    scenario = sweep.scenario
    values = scenario.model_dump(exclude_unset=True) | {"grid": scenario.grid.model_dump()}
    for place, section in scenario.sections().items():
        table = values
        for part in place:
            table = table.get(part, {})
        table |= {key: Path(path).name for key, path in section.files.items() if key in table}
    sun = scenario.sun_and_view()
    values["geometry"] = values.get("geometry", {}) | {"saa": sun.saa}
    return {"haze": sweep.haze, "arps": list(sweep.arps), "hazes": list(sweep.hazes), "tables": values}


def explore(scenario: Scenario | None = None, path: FilePath = "explore.html", *, overwrite: bool = False) -> Path:
    """
    Write an interactive page with sliders over simulations of a scenario; computes.

    The page shows scene, image, scatter plot and scatter budget for each combination of patch size, haze, sun,
    instrument and registration error. It works offline in a browser.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario, optional
        Initial values of the sliders; the page shows the centre of its grid. By default the
        scenario of ``fifesim simulate``.
    path : str or path, optional
        Path of the HTML file.
    overwrite : bool, optional
        Replace an existing file.

    Returns
    -------
    path : pathlib.Path

    Raises
    ------
    ValueError
        If the file exists, or the scenario cannot be shown. Nothing is written in this case.

    See Also
    --------
    fifesim.budget, fifesim.scenario.sweep

    Examples
    --------
    Some minutes of simulations:

    >>> import fifesim
    >>> fifesim.experiments.explore(fifesim.Scenario(), "mine.html")  # doctest: +SKIP
    """
    path = Path(path)
    check_file(path, overwrite)
    sweep = sweep_of(scenario)
    html = explorer_page(sweep, outcomes_of(sweep, lambda settings: steps(settings, "simulating")))
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as new:
        new.write_text(html, encoding="utf-8")
    return path


def check_file(path, overwrite):
    """Raise ValueError if the file of a page exists and may not be overwritten."""
    if path.is_dir():
        raise ValueError(f"{str(path)!r} is a folder, and explore writes one page: type -o {path}/explore.html")
    check_suffix(path, "page", ".html", ".htm")
    if path.exists() and not overwrite:
        raise ValueError(f"the page {str(path)!r} exists: name another with -o, or add --overwrite")
