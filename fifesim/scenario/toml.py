"""Scenarios as TOML text: spelled as keys may be, with one line a mistake, and written with every unit."""

import inspect
import json
import re
from pathlib import Path

from pydantic import ValidationError

from fifesim.base.foreign import in_a_line, read_toml, shown
from fifesim.scenario.keys import Keys
from fifesim.scenario.section import nearest

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
# The longest that is said of the mistakes of a scenario; a line of one is shorter.
_LONGEST = 500


def load_values(path):
    """
    Values of a TOML file.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    values : dict
        Files that it names lie relative to it, and have their full paths here.

    Raises
    ------
    ValueError
        If it is missing, no regular file, too large, or not TOML.
    """
    path = Path(path)
    try:
        values = read_toml(path)
    except OSError as error:
        raise ValueError(in_a_line(f"cannot read the scenario {path}: {error.strerror}")) from None
    folder = path.parent.absolute()
    for name, field in Keys.model_fields.items():
        table = values.get(name)
        for key, value in table.items() if isinstance(table, dict) else ():
            # A link stays one: what it leads to may have another suffix.
            if field.annotation.names_a_file(key, value) and value:
                table[key] = str(folder / value)
    return values


def validated(model, values):
    """
    A model of nested mappings, whose mistakes are one line each.

    Parameters
    ----------
    model : type
        `Keys`, which knows spelling, types and ranges, or a Scenario, which knows what values mean.
    values : mapping
        As TOML gives it.

    Returns
    -------
    found : model

    Raises
    ------
    ValueError
        One line a mistake, with the key, the value and what is allowed.
    """
    try:
        return model.model_validate(values)
    except ValidationError as error:
        raise ValueError(mistakes(error)) from None


def mistakes(error):
    """
    Mistakes of a scenario, a line each.

    Parameters
    ----------
    error : pydantic.ValidationError

    Returns
    -------
    lines : str
        As many as can be read at once.
    """
    return _shortened([_explain(item) for item in error.errors()])


def _shortened(lines):
    """As many of some lines as can be read at once, and how many more there are."""
    kept = lines[:1]
    for line in lines[1:]:
        if len("\n".join((*kept, line))) > _LONGEST - len("\nand 1000000 more"):
            return "\n".join((*kept, f"and {len(lines) - len(kept)} more"))
        kept.append(line)
    return "\n".join(kept)


def check_spelling(path):
    """
    Refuse a scenario whose keys, types or ranges are wrong; this asks no physics, and is quick.

    Parameters
    ----------
    path : str or path
        TOML file.

    Raises
    ------
    ValueError
        As in `load_values` and `validated`.
    """
    validated(Keys, load_values(path))


def write_scenario(scenario):
    """
    TOML text of a scenario, every key with its unit and meaning.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario

    Returns
    -------
    text : str
        Reading it gives the same scenario.
    """
    lines = ["# Scenario of a fifesim run. Run it with: fifesim simulate THIS_FILE -o FOLDER"]
    for name in Keys.model_fields:
        section = getattr(scenario, name)
        lines += ["", f"[{name}]  # {inspect.getdoc(type(section)).splitlines()[0]}"]
        tables = []
        for key, known in type(section).model_fields.items():
            value, unit = getattr(section, key), section.unit(key)
            meaning = f"{unit}; {known.description}" if unit else known.description
            if isinstance(value, dict):
                tables += [
                    "",
                    f"[{name}.{key}]  # {meaning}",
                    *(f"{_toml_key(part)} = {_toml(number)}" for part, number in value.items()),
                ]
            elif value is None:
                lines.append(f"# {key} =   # {meaning}")
            else:
                lines.append(f"{key} = {_toml(value)}  # {meaning}")
        lines += tables
    return "\n".join(lines) + "\n"


def _toml(value):
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        # JSON escapes as TOML does, all but one character.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return repr(value)


def _toml_key(name):
    return name if _BARE_KEY.fullmatch(name) else _toml(name)


def _explain(error):
    """One line that names the key, the value and what is allowed."""
    place, value = [str(part) for part in error["loc"]], error["input"]
    key = in_a_line(".".join(place), 100)
    if error["type"] == "extra_forbidden":
        known = list(Keys.model_fields)
        if len(place) > 1 and place[0] in Keys.model_fields:
            known = list(Keys.model_fields[place[0]].annotation.model_fields)
        hint = nearest(place[-1], known)
        return in_a_line(f"unknown key {key} = {shown(value)}: {hint}allowed are {', '.join(known)}")
    message = str(error["ctx"]["error"]) if error["type"] == "value_error" else error["msg"]
    if isinstance(value, str):
        # What others say of a value repeats it whole.
        message = message.replace(repr(value), shown(value))
    return in_a_line(f"{key}: {message}" if isinstance(value, dict) else f"{key} = {shown(value)}: {message}")
