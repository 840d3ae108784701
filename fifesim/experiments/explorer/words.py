"""What a page calls its sliders, stages, instruments and layers."""

import math

from fifesim.experiments.scatter.shares import CURVATURE
from fifesim.ground.landscape.autoregression import correlation_length
from fifesim.output.colours import colours_of, stops_of
from fifesim.output.pages import fixed
from fifesim.output.words import axis_label
from fifesim.rasters import cf
from fifesim.sensor.description.instruments import instrument

# Beside the name of a stage: what it does.
STAGES = {
    CURVATURE: "LAI and FPAR go with NDVI along a curve, which no line follows",
    "non-linearity": "bare and dense cells within a pixel do not average along that curve",
    "NDVI scaling": "the NDVI of mean light is not the mean of NDVI",
    "point spread": "a pixel sees its neighbours too",
    "registration": "pixels lie beside the ground that they are compared with",
    "quantisation": "light becomes whole numbers",
    "noise": "the detectors' own",
    "topography": "slopes face the sun, or turn away",
    "atmosphere": "air veils the ground",
    "soil": "soil is brighter here and darker there",
    "dead leaves": "there are more of them here than there",
    "cover": "plants and what lies below them differ from field to field",
    "clumping": "leaves stand in crowns, with gaps between",
    "covariance": "leaf area goes with the lie of the land and with the soil",
}

# What an image is shown in: a quantity, and one of its bands.
VIEWS = {"ndvi": ("ndvi", ""), "red": ("toa_reflectance", "red"), "nir": ("toa_reflectance", "near infrared")}


def layer_words(variables):
    """
    What the truths and views of a page are called, and their colours.

    Parameters
    ----------
    variables : iterable of str
        Names of the truths, keys of `fifesim.rasters.cf.QUANTITIES`.

    Returns
    -------
    layers : dict of dict
        By truth and by key of `VIEWS`: ``name`` to choose it by, ``label``, ``axis`` with the unit, and ``stops`` of
        its colours.
    """
    layers = {name: (name, "") for name in variables} | VIEWS
    return {key: _layer(quantity, band) for key, (quantity, band) in layers.items()}


def _layer(quantity, band):
    label, axis = (f"{band} {text}".strip() for text in (cf.QUANTITIES[quantity].label, axis_label(quantity)))
    return {"name": band or label, "label": label, "axis": axis, "stops": stops_of(colours_of(quantity)[0])}


def slider_words(sweep):
    """
    What the sliders of a page are called.

    Parameters
    ----------
    sweep : fifesim.experiments.explorer.settings.Sweep

    Returns
    -------
    sliders : list of dict
        ``key``, ``name``, ``hint``, ``marks`` below the values, ``texts`` that say them in full, and ``start``, the
        number of the scenario's own.
    """
    own = sweep.scenario
    haze = {"visibility": "Visibility", "aot": "Haze"}[sweep.haze]
    return [
        _slider("arp", "Ground patches", "how far leaf area resembles that beside it", sweep.arps,
                own.ground.arp, lambda arp: _patches(arp, own.grid.cell)),
        _slider("haze", haze, "how far one can see, or how thick the haze is", sweep.hazes,
                getattr(own.atmosphere, sweep.haze), lambda amount: _air(sweep.haze, amount)),
        _slider("sza", "Solar zenith", "of the sun, from overhead", sweep.szas, own.sun_and_view().sza, _sun),
        _slider("instrument", "Instrument", "from small pixels to large", sweep.instruments, own.sensor.instrument,
                lambda name: _instrument(sweep, name)),
        _slider("registration", "Registration error", "how far pixels lie beside the ground they are compared with",
                sweep.offsets, tuple(own.sensor.offset), _displacement),
    ]  # fmt: skip


def _slider(key, name, hint, values, own, said):
    words = [said(value) for value in values]
    marks, texts = [mark for mark, _ in words], [text for _, text in words]
    start = values.index(own) if own in values else 0
    return {"key": key, "name": name, "hint": hint, "marks": marks, "texts": texts, "start": start}


def _patches(arp, cell):
    if arp is None:
        return "map", "as the map has them"
    length = correlation_length(arp, cell)
    return f"{length:.0f} m", f"leaves are alike up to {length:.0f} m, arp {arp:g}"


def _air(key, amount):
    if amount is None:
        return "none", "without haze"
    if key == "aot":
        return f"{amount:g}", f"aerosol optical thickness {amount:g}"
    return f"{amount:g} km", f"one sees {amount:g} km far"


def _sun(sza):
    return f"{sza:.3g}°", f"{sza:.1f}° from overhead"


def _instrument(sweep, name):
    found = instrument(name)
    first = sweep.settings[0]
    size = sweep.at(type(first)(first.arp, first.haze, first.sza, name)).sensor.size
    return found.name, f"{found.title}, {size:g} m"


def _displacement(offset):
    size = math.hypot(*offset)
    mark = {0.25: "¼", 0.5: "½", 0.75: "¾"}.get(size, f"{size:.2g}")
    if not size:
        return mark, "none"
    return mark, f"{fixed(size, 2)} pixel" + ("" if offset[0] == 0 else ", as in the scenario")
