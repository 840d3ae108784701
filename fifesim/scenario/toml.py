"""Scenarios as TOML text: spelled as keys may be, with one line a mistake, and written with every unit."""

import inspect
import tomllib
from pathlib import Path

from pydantic import ValidationError

from fifesim.scenario.keys import Keys
from fifesim.scenario.section import nearest


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
        If it is missing or not TOML.
    """
    path = Path(path)
    try:
        values = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"cannot read the scenario {path}: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path.name} is not valid TOML: {error}") from None
    for name, field in Keys.model_fields.items():
        table = values.get(name)
        for key, value in table.items() if isinstance(table, dict) else ():
            if field.annotation.names_a_file(key, value):
                table[key] = str((path.parent / value).resolve())
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
        raise ValueError("\n".join(_explain(item) for item in error.errors())) from None


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
                    *(f"{band} = {number!r}" for band, number in value.items()),
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
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return repr(value)


def _explain(error):
    """One line that names the key, the value and what is allowed."""
    key = ".".join(str(part) for part in error["loc"])
    if error["type"] == "extra_forbidden":
        known = list(Keys.model_fields)
        if len(error["loc"]) > 1 and error["loc"][0] in Keys.model_fields:
            known = list(Keys.model_fields[error["loc"][0]].annotation.model_fields)
        hint = nearest(str(error["loc"][-1]), known)
        return f"unknown key {key} = {error['input']!r}: {hint}allowed are {', '.join(known)}"
    message = str(error["ctx"]["error"]) if error["type"] == "value_error" else error["msg"]
    if isinstance(error["input"], dict):
        return f"{key}: {message}"
    return f"{key} = {error['input']!r}: {message}"
