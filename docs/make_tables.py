"""Tables of scenario keys, commands, instruments and citations, made from the code when the pages are built."""

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from textwrap import wrap
from types import UnionType
from typing import Literal, Union, get_args, get_origin

import docstrings
import pandas as pd
import typer
import yaml

import fifesim
from fifesim.atmosphere.mixtures import MODELS
from fifesim.cli import app
from fifesim.ground.canopy.leaf_angles import _CUMULATIVE as LEAF_ANGLES
from fifesim.ground.landscape.distribution import treatments
from fifesim.scenario.keys import FIELD_LIMITS, INTERVALS, StandKeys
from fifesim.scenario.scenario import Scenario
from fifesim.sensor.description import instrument_file
from fifesim.sensor.description.fields import by_axes
from fifesim.sensor.description.instruments import instrument, instrument_names
from fifesim.sensor.description.spatial_response import knows_blur
from fifesim.sensor.description.spectral_response import half_peak
from fifesim.sensor.response.noise import ALL, KINDS

FOLDER = Path(__file__).parent / "tables"
CITATION = Path(__file__).parents[1] / "CITATION.cff"


def write():
    """Write the tables."""
    FOLDER.mkdir(exist_ok=True)
    for table in (scenario_keys, command_line, instruments, citation):
        (FOLDER / f"{table.__name__}.md").write_text(table(), encoding="utf-8")
    for table in (instrument_bands, instrument_sources):
        table().to_csv(FOLDER / f"{table.__name__}.csv", index=False, float_format="%.5g")


def _table(columns, rows):
    """Markdown table."""
    lines = [columns, ["---"] * len(columns), *rows]
    return "\n".join(f"| {' | '.join(_cell(each) for each in line)} |" for line in lines) + "\n"


def _cell(text):
    return str(text).replace("|", r"\|").replace("\n", " ")


# Names that a key accepts apart from files and numbers, in the order of the tables of the code.
NAMES = {
    ("ground", "distribution"): treatments(),
    ("ground", "leaf_angles"): tuple(LEAF_ANGLES),
    ("atmosphere", "aerosol"): (*MODELS, "none"),
    ("sensor", "interval"): INTERVALS,
    ("sensor", "response"): ("system", "detector", "paper"),
    ("sensor", "noise"): (*KINDS, ALL),
}


def scenario_keys():
    """All keys of a scenario, section by section."""
    parts = []
    for name in Scenario.model_fields:
        section = Scenario.section((name, "NAME") if name == "classes" else (name,))
        heading = "classes.NAME" if name == "classes" else name
        parts.append(f"## `[{heading}]`\n\n{section.__doc__}\n")
        known = section.model_fields
        if name == "classes":
            shared = ", ".join(f"`{key}`" for key in StandKeys.model_fields)
            parts.append(f"A class has these keys of `[ground]`: {shared}. It also has:\n")
            known = {
                key: each for key, each in known.items() if key not in StandKeys.model_fields
            }
        rows = [_key_row(name, section, key, each) for key, each in known.items()]
        parts.append(_table(["key", "type", "unit", "range", "default", "meaning"], rows))
    return "\n".join(parts)


def _key_row(name, section, key, known):
    names = _names(name, key, known)
    unit = docstrings.raised(f"[{section.unit(key)}]")[1:-1]
    limits = ", ".join(f"`{each}`" for each in names) or _range(key, known)
    meaning = re.sub(r"\bu([gm])\b", r"µ\1", docstrings.raised(known.description))
    return [f"`{key}`", _type(known, names), unit, limits, _default(known.default), meaning]


def _names(name, key, known):
    """Names that a key accepts."""
    if get_origin(known.annotation) is Literal:
        return get_args(known.annotation)
    if (name, key) in NAMES:
        return NAMES[name, key]
    return (known.json_schema_extra or {}).get("file", {}).get("names", ())


def _type(known, names):
    """Type of the value of a key in words."""
    annotation = known.annotation
    kinds = (
        get_args(annotation) if get_origin(annotation) in (Union, UnionType) else (annotation,)
    )
    words = [_TYPES[get_origin(kind) or kind] for kind in kinds if kind is not type(None)]
    if "file" in (known.json_schema_extra or {}):
        words = ["name", "file"] if names or known.default else ["file"]
    elif names:
        words = [word.replace("text", "name") for word in words]
    if words == ["list"]:
        (item,) = get_args(annotation)
        words = ["list of names"] if item is str else ["two numbers"]
    return " or ".join(words)


_TYPES = {
    float: "number", int: "whole number", bool: "true or false", str: "text", list: "list", dict: "table of numbers",
    Literal: "name",
}  # fmt: skip


def _range(key, known):
    """Allowed numbers of a key: limits in brackets are allowed, limits in parentheses are not."""
    if key in FIELD_LIMITS:
        low, high = FIELD_LIMITS[key]
        return f"[{low:g}, {high:g}]"
    limits = {
        name: getattr(each, name)
        for each in known.metadata
        for name in _SIGNS
        if hasattr(each, name)
    }
    lower = next((name for name in ("ge", "gt") if name in limits), None)
    upper = next((name for name in ("le", "lt") if name in limits), None)
    if lower and upper:
        low, high = _number(limits[lower]), _number(limits[upper])
        return f"{'[' if lower == 'ge' else '('}{low}, {high}{']' if upper == 'le' else ')'}"
    return ", ".join(f"{_SIGNS[name]} {_number(limit)}" for name, limit in limits.items())


_SIGNS = {"ge": "≥", "gt": ">", "le": "≤", "lt": "<"}


def _number(value):
    return "2⁶³" if value == 2**63 else f"{value:.10g}"


def _default(value):
    """Default of a key as a scenario file has it."""
    if value is None:
        return "–"
    if value == {}:
        return "empty"
    return f"`{_written(value)}`"


def _written(value):
    if isinstance(value, list):
        return f"[{', '.join(map(_written, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else _number(value)


def command_line():
    """All commands with their arguments and options, as their help has them."""
    group, parts = typer.main.get_command(app), []
    for name, command in group.commands.items():
        context = command.context_class(command, info_name=f"fifesim {name}")
        usage = command.get_usage(context).removeprefix("Usage: ")
        examples = "\n".join(line.strip() for line in command.epilog.splitlines()[2:])
        blocks = f"```sh\n{usage}\n```\n\nFor example:\n\n```sh\n{examples}\n```\n"
        parts.append(f"## {name}\n\n{command.help}\n\n{blocks}")
        records = [each.get_help_record(context) for each in command.get_params(context)]
        rows = [
            [f"`{option.replace(' range>', '>')}`", _in_parentheses(meaning)]
            for option, meaning in records
            if option != "--help"
        ]
        if rows:
            parts.append(_table(["argument or option", "meaning"], rows))
    return "\n".join(parts)


def _in_parentheses(meaning):
    """Help of an option with its default and range in parentheses."""
    meaning = meaning.replace("[x>=", "[at least ")
    return re.sub(r"\s{2,}\[(.*)\]$", r" (\1)", meaning)


# Quantities of an instrument with their words and values; a number without an entry is shown by its name.
QUANTITIES = {
    "altitude": ("altitude", lambda item: f"{item.altitude / 1000:g} km"),
    "gsd": ("pixel of the gridded product", lambda item: _by_band(item, item.pixel, "g", "m")),
    "interval": (
        "sampling interval at nadir",
        lambda item: _by_band(item, item.ground_intervals, ".4g", "m"),
    ),
    "ifov": (
        "instantaneous field of view at nadir",
        lambda item: _by_band(item, item.ground_fields, ".4g", "m"),
    ),
    "bits": ("radiometric resolution", lambda item: f"{item.bits} bits"),
    "lsf": ("line spread function", lambda item: _blur(item)),
    "geolocation": (
        "geolocation error (rms along each axis)",
        lambda item: f"{item.geolocation:g} m",
    ),
    "scan": ("scan", lambda item: _scan(item.scan)),
    "detectors": (
        "detectors per band",
        lambda item: _by_band(item, lambda band: band.detectors or item.detectors, "", ""),
    ),
    "product": ("scale of the Level-1 product", lambda item: _product(item.product)),
    "srf": ("spectral response", None),
    "full_scale_radiance": ("radiance of the largest digital number", None),
    "min_radiance": ("radiance of digital number 0", None),
    "solar_irradiance": ("solar irradiance", None),
    "noise": ("noise", None),
    "limits": ("nominal limits of the bands", None),
    "gains": ("other gain states", None),
    "paper_lsf": ("line spread function of Friedl et al. (1995)", None),
    "compression": ("compression of digital numbers", None),
}
# An imaging spectrometer has too many bands for a table.
_MOST_BANDS = 22


def instruments():
    """What is known of each instrument: names, sampling with the origin of its errors, and bands."""
    items = [instrument(name) for name in instrument_names()]
    named = ["instrument", "title", "other names", "altitude [km]", "pixels [m]", "bits"]
    sampling = ["sampling interval at nadir", "scan", "blur", "noise", "geolocation error"]
    return "\n".join(
        [
            _table(named, map(_overview, items)),
            f"## Sampling and errors\n\n{_ORIGINS}",
            _table(["instrument", *sampling], map(_sampling, items)),
            "## Bands\n\nNames of the bands, each followed by its centre in µm.\n",
            _table(["instrument", "bands"], map(_bands, items)),
        ]
    )


_ORIGINS = """A number was measured in flight, measured before launch, required by the mission, or assumed. Blur is
unknown if neither the point spread function nor the modulation transfer was published: then only the footprint of the
detector is used, and the image is sharper than a real one. With unknown noise you can only add noise that you describe
yourself. The geolocation error is the error of the gridded product along each axis. It is not applied unless you set
`offset`.
"""


def _overview(item):
    pixels = sorted({item.pixel(band) for band in item.bands})
    return [
        item.name,
        item.title,
        ", ".join(item.aliases),
        f"{item.altitude / 1000:g}",
        ", ".join(f"{size:g}" for size in pixels),
        item.bits,
    ]


def _sampling(item):
    interval = QUANTITIES["interval"][1](item)
    scan = "" if item.scan is None else _scan(item.scan)
    blur = [_state(item, band, "lsf", knows_blur(item, band)) for band in item.bands]
    noise = [_state(item, band, "noise", band.noise is not None) for band in item.bands]
    place = "unknown" if item.geolocation is None else f"{item.geolocation:g} m"
    return [item.name, interval, scan, _counted(blur), _counted(noise), place]


def _state(item, band, number, is_known):
    """Whether a number of a band is known, or its origin if the file states one."""
    if not is_known:
        return "unknown"
    return _origin(item, band, number).partition(";")[0] or "known"


def _counted(states):
    """States of the bands, with the number of bands if they differ."""
    if len(set(states)) == 1:
        return states[0]
    return ", ".join(
        f"{state} ({count} of {len(states)} bands)" for state, count in Counter(states).items()
    )


def instrument_sources():
    """Table of each number of each instrument with its origin, source and publication."""
    rows = []
    for item in map(instrument, instrument_names()):
        for number in given_numbers(item):
            keys, *row = _quantity(item, number)
            published = "; ".join(_words(item.references[key]) for key in keys)
            rows.append([item.name, *row, _origins(item, number), ", ".join(keys), published])
        rows += [
            [item.name, name, "", "unknown", "", text] for name, text in item.not_found.items()
        ]
    columns = ["instrument", "quantity", "value", "origin", "source", "publication"]
    return pd.DataFrame(rows, columns=columns)


def given_numbers(item):
    """Names of the numbers that the description of an instrument has for itself or for a band."""

    def given(each, names):
        return [name for name in names if getattr(each, name, None)]

    required, optional = instrument_file.INSTRUMENT_NUMBERS, instrument_file.OPTIONAL_NUMBERS
    found = {*required, *instrument_file.BAND_NUMBERS, *given(item, optional)}
    for band in item.bands:
        found.update(given(band, optional))
    order = [*QUANTITIES, *required, *instrument_file.BAND_NUMBERS, *optional]
    return [name for name in dict.fromkeys(order) if name in found]


def _quantity(item, number):
    """Source keys, words and value of a number."""
    words, value = QUANTITIES.get(number, (number.replace("_", " "), None))
    if number in instrument_file.BAND_NUMBERS or value is None:
        own = getattr(item, number, None)
        shown = "by band" if own is None else _words(own)
    else:
        shown = value(item)
    keys = [band.sources.get(number) or item.sources.get(number) for band in item.bands]
    keys = [*([item.sources[number]] if number in item.sources else []), *keys]
    return [list(dict.fromkeys(key for key in keys if key)), words, shown]


def _origins(item, number):
    """Origin of a number, with the names of the bands where it differs."""
    found = {}
    for band in item.bands:
        found.setdefault(_origin(item, band, number), []).append(band.name)
    return _with_bands(
        item, {text: names for text, names in found.items() if text or len(found) == 1}
    )


def _origin(item, band, number):
    for each in (band, item):
        for quantity, value in each.origin.items():
            if ("lsf" if quantity == "blur" else quantity) == number:
                return _words(value)
    return ""


def _words(value):
    """Text of a value of any type."""
    if is_dataclass(value):
        value = {each.name: getattr(value, each.name) for each in fields(value)}
    if isinstance(value, Mapping):
        given = {name: _words(each) for name, each in value.items() if each is not None}
        kind = [given.pop("kind")] if "kind" in given else []
        return "; ".join(
            [*kind, *(f"{name.replace('_', ' ')} {text}" for name, text in given.items())]
        )
    if isinstance(value, tuple | list):
        return ", ".join(map(_words, value))
    return f"{value:g}" if isinstance(value, float) else str(value)


def _by_band(item, value, form, unit):
    """Value of a quantity along and across the track, with the names of the bands where it differs."""
    found = {}
    for band in item.bands:
        pair = value(band)
        along, across = pair if isinstance(pair, tuple) else (pair, pair)
        if along is None:
            text = "unknown"
        elif f"{along:{form}}" == f"{across:{form}}":
            text = f"{along:{form}} {unit}"
        else:
            text = f"{along:{form}} {unit} along track, {across:{form}} {unit} across"
        found.setdefault(text.strip(), []).append(band.name)
    return _with_bands(item, found)


def _with_bands(item, found):
    """Texts with the names of their bands, from a dict; the text alone if it holds for all bands."""
    if len(found) == 1:
        return next(iter(found))
    return "; ".join(f"{text} ({_listed(item, names)})" for text, names in found.items())


def _listed(item, names):
    """Names of bands, with a dash for three or more that follow each other."""
    order, runs = [band.name for band in item.bands], []
    for name in names:
        if runs and order.index(runs[-1][-1]) + 1 == order.index(name):
            runs[-1].append(name)
        else:
            runs.append([name])
    return ", ".join(f"{run[0]}–{run[-1]}" if len(run) > 2 else ", ".join(run) for run in runs)


def _blur(item):
    """Kind of the line spread function, and whether it includes more than the detector."""
    kinds = {}
    for band in item.bands:
        given = band.lsf or item.lsf
        axes = dict.fromkeys(each.kind for each in by_axes(given))
        text = " and ".join(_KINDS.get(kind, kind) for kind in axes)
        text += "" if knows_blur(item, band) else ", detector alone"
        kinds.setdefault(text, []).append(band.name)
    return _with_bands(item, kinds)


_KINDS = {"boxcar": "uniform", "gaussian": "Gaussian"}


def _scan(scan):
    swath = f", swath {scan.swath / 1000:g} km" if scan.swath else ""
    return f"{scan.kind}, {scan.max_angle:g}° to either side{swath}"


def _product(product):
    sun = "" if product.sun_corrected else " times the cosine of the solar zenith angle"
    return f"{product.gain:g} × DN {product.offset:+g} is reflectance{sun}; {product.bits} bits"


def _bands(item):
    """Name and bands of an instrument, or their range if they are many."""
    bands = sorted(item.bands, key=lambda band: band.wavelength)
    if len(bands) <= _MOST_BANDS:
        return [item.name, ", ".join(f"{band.name} {band.wavelength:.3f}" for band in bands)]
    first, last = bands[0], bands[-1]
    return [
        item.name,
        f"{len(bands)} bands, {first.name} {first.wavelength:.3f} to {last.name} {last.wavelength:.3f}",
    ]


def instrument_bands():
    """Table of all bands of all instruments."""
    items = [instrument(name) for name in instrument_names()]
    return pd.DataFrame([_band(item, band) for item in items for band in item.bands])


def _band(item, band):
    low, high = half_peak(band.response)
    row = {
        "instrument": item.name,
        "band": band.name,
        "center_um": round(band.wavelength, 4),
        "half_maximum_low_um": round(float(low), 4),
        "half_maximum_high_um": round(float(high), 4),
        "pixel_m": item.pixel(band),
        "min_radiance": band.min_radiance,
        "full_scale_radiance": band.full_scale_radiance,
        "solar_irradiance": band.solar_irradiance,
    }
    if band.noise is not None:
        row["snr"] = band.noise.radiance / band.noise.equivalent_radiance
        row["snr_radiance"] = band.noise.radiance
    return row


def citation():
    """How to cite the package and the paper, from CITATION.cff."""
    cited = yaml.safe_load(CITATION.read_text(encoding="utf-8"))
    (paper,) = cited["references"]
    authors = [f"{each['family-names']}, {each['given-names']}" for each in paper["authors"]]
    package = {
        "title": f"{{{cited['title']}}}",
        "author": " and ".join(f"{{{each['name']}}}" for each in cited["authors"]),
        "note": f"Version {fifesim.__version__}",
    }
    article = {
        "title": f"{{{paper['title']}}}",
        "author": " and ".join(authors),
        "journal": paper["journal"],
        "volume": paper["volume"],
        "pages": f"{paper['start']}--{paper['end']}",
        "year": paper["year"],
        "doi": paper["doi"],
    }
    names = ", ".join(each["name"] for each in cited["authors"])
    doi = f"[doi:{paper['doi']}](https://doi.org/{paper['doi']})"
    return "\n".join(
        [
            f"> {names[0].upper()}{names[1:]}. *{cited['title']}*. Version {fifesim.__version__}.\n",
            f"> {'; '.join(authors)} ({paper['year']}). {paper['title']}. *{paper['journal']}* {paper['volume']}, "
            f"{paper['start']}–{paper['end']}. {doi}\n",
            "```bibtex",
            _bibtex("software", "fifesim", package),
            _bibtex(
                "article", f"{paper['authors'][0]['family-names']}{paper['year']}", article
            ),
            "```\n",
        ]
    )


def _bibtex(kind, key, values):
    """Entry of a bibliography, with lines that fit a page."""
    lines = [f"@{kind}{{{key},"]
    for name, value in values.items():
        lines += wrap(
            f"{name} = {{{value}}},", 92, initial_indent="  ", subsequent_indent="    "
        )
    return "\n".join([*lines, "}"])
