"""The page: what it shows as one HTML text."""

from pathlib import Path

import numpy as np
from markupsafe import Markup

from fifesim.experiments.explorer.outcomes import NUMBERS
from fifesim.experiments.explorer.packing import packed, stepped
from fifesim.experiments.explorer.words import STAGES as MEANINGS
from fifesim.experiments.explorer.words import VIEWS, layer_words, slider_words
from fifesim.experiments.scatter.shares import CURVATURE
from fifesim.experiments.scatter.stages import STAGES, VARIABLES
from fifesim.output import pages
from fifesim.output.colours import percentile_limits
from fifesim.output.report import title
from fifesim.rasters import grid as grids

_TEMPLATE = Path(__file__).with_name("explore.html.j2")
_SCRIPTS = ("explore_data.js", "explore_drawing.js", "explore.js")
# So many pixels of each image say where colours end.
_SAMPLE = 50


def explorer_page(sweep, outcomes):
    """
    One self-contained HTML page.

    Parameters
    ----------
    sweep : fifesim.experiments.explorer.settings.Sweep
    outcomes : fifesim.experiments.explorer.outcomes.Outcomes

    Returns
    -------
    html : str
    """
    text, data = page_data(sweep, outcomes)
    scenario, shape = sweep.scenario, sweep.scenario.geobox().shape
    run = {
        "count": int(np.prod(sweep.shape)),
        "rows": shape.y,
        "columns": shape.x,
        "cell": scenario.grid.cell,
        "height": shape.y * scenario.grid.cell,
        "width": shape.x * scenario.grid.cell,
        "seed": None if scenario.ground.lai_file else scenario.ground.seed,
        "level": scenario.terrain.dem == "flat",
    }
    own = Path(__file__).parent
    return pages.html(
        _TEMPLATE, title=title(scenario), sliders=data["sliders"], story=_story(data["sliders"], outcomes), run=run,
        data=data, bytes=text,
        style=Markup((own / "explore.css").read_text(encoding="utf-8")),
        script=Markup("\n".join((own / name).read_text(encoding="utf-8") for name in _SCRIPTS)),
    )  # fmt: skip


def page_data(sweep, outcomes):
    """
    What the script of a page reads.

    Parameters
    ----------
    sweep, outcomes
        As in `explorer_page`.

    Returns
    -------
    text : str
        Arrays, from `packing.packed`: ``scenes``; by number of the instrument ``image``, ``lai``, ``fpar`` and
        ``reflectance``; ``lines`` and ``shares``, of the curvature first.
    data : dict
        What JSON can hold: their places, sliders, stages, instruments, ranges of colours, and keys of the scenario.
    """
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
        "numbers": list(NUMBERS),
        "stages": [{"name": name, "meaning": MEANINGS[name]} for name in names],
        "instruments": [_instrument(sweep, k, camera) for k, camera in enumerate(outcomes.cameras)],
        "offsets": [list(offset) for offset in sweep.offsets],
        "szas": list(sweep.szas),
        "scene": {"rows": box.shape.y, "columns": box.shape.x, "cell": grids.cell_size(box)[0]},
        **_ranges(sweep, outcomes),
        "keys": _keys(sweep),
    }
    return text, data


def _story(sliders, outcomes):
    """What becomes of R2 of LAI as a reader does what the page proposes first."""
    r2 = outcomes.lines[..., VARIABLES.index("lai"), NUMBERS.index("r2")]
    place = [slider["start"] for slider in sliders]
    found = {"start": float(r2[tuple(place)]), "patches": None}
    place[-1] = -1
    found["displaced"] = float(r2[tuple(place)])
    if place[0] < len(sliders[0]["texts"]) - 1:
        found["patches"] = float(r2[(-1, *place[1:])])
    return found


def _arrays(outcomes):
    """Images and truths in the steps that a page holds them in, and these steps."""
    arrays, steps = {}, {}
    arrays["scenes"], *steps["scenes"] = stepped(outcomes.scenes, "u1")
    for k, (image, truth, camera) in enumerate(zip(outcomes.images, outcomes.truths, outcomes.cameras, strict=True)):
        arrays[f"image{k}"] = image
        arrays[f"reflectance{k}"] = camera.reflectance
        # Leaf area does not go with the sun.
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
    """Ends of colours and of axes, the same for all settings: what is drawn can be compared."""
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
    """Keys of the scenario that no slider moves; of files their names alone."""
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
