"""Text of messages and descriptions: nearest names, validation errors, warnings, log lines and tables in notebooks."""

import inspect
import logging
import re
import sys
import warnings
from contextlib import contextmanager
from contextvars import ContextVar
from difflib import get_close_matches
from functools import wraps
from html import escape
from pathlib import Path

from fifesim.base.files import in_a_line

PARTS: dict = {}
"""Names of a description and of its fields by the argument that takes it, for messages."""


# Names of the same quantities in PROSAIL, PROSPECT, 6S and other programs.
_ELSEWHERE = {
    "structure": "n", "chlorophyll": "cab chl", "carotenoids": "car cxc", "anthocyanins": "ant canth",
    "water": "cw ewt", "dry_matter": "cm lma", "brown": "cbrown cbp fb", "hotspot": "hspot",
    "leaf_angles": "lidfa lidfb typelidf ala lad",
    "background": "rsoil rsoil0 albedo", "moisture": "psoil", "crown_cover": "fc", "sza": "tts", "vza": "tto",
    "visibility": "vis", "aot": "aod aod550 aot550 taer550 tau", "h2o": "wv cwv tcwv pwv watervapour watervapor",
    "o3": "ozone", "altitude": "elevation height", "mtf_at_nyquist": "mtf", "temperature": "tair", "humidity": "rh",
    "net_radiation": "rn", "shortwave": "rg", "successive-orders": "6s 6sv",
    "continental": "rural", "maximum-value": "mvc max maximum",
}  # fmt: skip


# Removed names of arguments and keys, and their replacement.
_REMOVED = {
    "covary": "it was removed, because learned landscapes follow the terrain: remove covary. ",
    "coarser": "it was removed: remove coarser, and give a larger arp. ",
    "arps": "it was removed: remove arps, fields have the arp of [ground]. ",
}


def closest(value, allowed):
    """Name that a misspelt or foreign one probably stands for, ignoring case; empty if none is close."""
    if str(value) in _REMOVED:
        return ""
    names = {str(name).lower(): str(name) for name in allowed}
    typed = str(value).lower().replace("_", "")
    known = next((name for name, others in _ELSEWHERE.items() if typed in others.split()), "")
    for name in (known, f"leaf_{known}"):
        if name in names:
            return names[name]
    return next((names[found] for found in get_close_matches(str(value).lower(), names, n=1)), "")


def nearest(value, allowed):
    """Beginning of a message that suggests the nearest allowed name; empty if none is near."""
    near = closest(value, allowed)
    return f"did you mean {near!r}? " if near else _REMOVED.get(str(value), "")


def value_in_words(value):
    """Short text of a value in a table."""
    if isinstance(value, list | tuple):
        return ", ".join(map(value_in_words, value)) or "none"
    if isinstance(value, dict):
        return ", ".join(f"{name}: {value_in_words(each)}" for name, each in value.items()) or "none"
    return "not given" if value is None else f"{value:.7g}" if isinstance(value, float) else str(value)


def html_table(title, rows, text="", defaults=()):
    """HTML table of a description for notebooks: rows of name, value and meaning; rows of defaults are folded."""
    # Without colours, so that a dark notebook keeps its colours.
    more = f"<details><summary>defaults</summary>{_html_rows(defaults)}</details>" if defaults else ""
    return f"<div><strong>{escape(title)}</strong><div>{escape(text)}</div>{_html_rows(rows)}{more}</div>"


def _html_rows(rows):
    lines = []
    for row in rows:
        cells = (escape(in_a_line(value_in_words(each), 400)) for each in row)
        lines.append("".join(f'<td style="text-align: left; vertical-align: top">{cell}</td>' for cell in cells))
    return f"<table><tbody>{''.join(f'<tr>{line}</tr>' for line in lines)}</tbody></table>"


def unknown_argument(name, signature, options):
    """Message about unknown argument names; empty if there are none."""
    known = [each for each in signature.parameters if each != "self"]
    unknown = next((each for each in options if each not in known), None)
    if unknown is None:
        return ""
    for argument, (description, fields) in PARTS.items():
        near = unknown if unknown in fields else "" if closest(unknown, known) else closest(unknown, fields)
        if argument in known and near:
            return f"{name} has no argument {unknown!r}: type {argument}={description}({near}=...)"
    return f"{name} has no argument {unknown!r}: {nearest(unknown, known)}There are {', '.join(known)}"


def spelled(described):
    """Wrap the initialization of a class so that it suggests the nearest name for a misspelt argument."""
    make = described.__init__
    signature = inspect.signature(make)

    @wraps(make)
    def making(self, *args, **options):
        if wrong := unknown_argument(described.__name__, signature, options):
            raise TypeError(wrong)
        make(self, *args, **options)

    described.__init__ = making
    return described


_WORDS = {
    "bool_type": "must be true or false",
    "bool_parsing": "must be true or false",
    "dataclass_type": "must be a table of keys",
    "dict_type": "must be a table of keys",
    "finite_number": "must be a finite number",
    "float_parsing": "must be a number",
    "float_type": "must be a number",
    "greater_than": "must be above {gt:.12g}",
    "greater_than_equal": "must be at least {ge:.12g}",
    "int_from_float": "must be a whole number",
    "int_parsing": "must be a whole number",
    "int_type": "must be a whole number",
    "less_than": "must be below {lt:.12g}",
    "less_than_equal": "must be at most {le:.12g}",
    "list_type": "must be a list, in brackets",
    "literal_error": "must be {expected}",
    "model_type": "must be a table of keys",
    "string_too_long": "must have at most {max_length} characters",
    "string_too_short": "must have at least {min_length} characters",
    "string_type": "must be text, in quotes",
    "too_long": "takes {max_length} of them at most",
    "too_short": "needs {min_length} of them or more",
    "tuple_type": "must be a list, in brackets",
}


def in_own_words(error):
    """Message for an error of pydantic."""
    known = _WORDS.get(error["type"])
    return known.format(**error.get("ctx", {})) if known else error["msg"]


# Files of frames that are not the user's: of the package, of pydantic, and of methods of dataclasses.
_INSIDE = re.compile(rf"{re.escape(str(Path(__file__).parents[1]))}|<string>|.*[\\/]pydantic[\\/]")


def warn(message, category=UserWarning):
    """Warn that a result may be wrong or a function will go, at the first line outside of the package."""
    frame, level = sys._getframe(1), 2
    while frame.f_back and _INSIDE.match(frame.f_code.co_filename):
        frame, level = frame.f_back, level + 1
    warnings.warn(message, category, stacklevel=level)


LOG = logging.getLogger("fifesim")
"""Logger: steps of long work at INFO, their parts at DEBUG. It has no handlers; the application adds its own."""

_QUIET = ContextVar("fifesim_quiet", default=False)


@contextmanager
def during(variable, value=True):
    """Context in which a variable has a value."""
    token = variable.set(value)
    try:
        yield
    finally:
        variable.reset(token)


def quiet(wanted=True):
    """Context in which long work shows no progress."""
    return during(_QUIET, wanted)


def is_quiet():
    """Whether progress is hidden."""
    return _QUIET.get()
