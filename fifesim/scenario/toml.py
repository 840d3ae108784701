"""Scenarios as TOML files: read with one line a mistake, written with every unit."""

import tomllib
from difflib import get_close_matches
from pathlib import Path

from pydantic import ValidationError

from fifesim.scenario.scenario import Scenario, names_a_file


def read_scenario(path):
    """
    Scenario of a TOML file.

    Parameters
    ----------
    path : str or path
        Files that it names lie relative to it.

    Returns
    -------
    scenario : Scenario

    Raises
    ------
    ValueError
        If it is missing or not TOML, or a key or value is wrong: one line a mistake, with the key, the value and what
        is allowed.
    """
    path = Path(path)
    try:
        values = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"cannot read the scenario {path}: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path.name} is not valid TOML: {error}") from None
    for section, key in (("ground", "lai_file"), ("ground", "distribution"), ("terrain", "dem")):
        table = values.get(section)
        name = table.get(key) if isinstance(table, dict) else None
        if isinstance(name, str) and names_a_file(key, name):
            table[key] = str((path.parent / name).resolve())
    return parse_scenario(values)


def parse_scenario(values):
    """
    Scenario of nested mappings.

    Parameters
    ----------
    values : mapping
        As TOML gives it.

    Returns
    -------
    scenario : Scenario

    Raises
    ------
    ValueError
        One line a mistake.

    Examples
    --------
    >>> parse_scenario({"atmosphere": {"visibility": "23 km"}}).atmosphere.visibility
    23.0
    """
    try:
        return Scenario.model_validate(values)
    except ValidationError as error:
        raise ValueError("\n".join(_explain(item) for item in error.errors())) from None


def write_scenario(scenario):
    """
    TOML text of a scenario, every key with its unit and meaning.

    Parameters
    ----------
    scenario : Scenario

    Returns
    -------
    text : str
        Reading it gives the same scenario.
    """
    lines = ["# Scenario of a fifesim run. Run it with: fifesim simulate THIS_FILE -o FOLDER"]
    for name in Scenario.model_fields:
        section = getattr(scenario, name)
        lines += ["", f"[{name}]  # {type(section).__doc__.splitlines()[0]}"]
        tables = []
        for key, known in type(section).model_fields.items():
            value, unit = getattr(section, key), (known.json_schema_extra or {}).get("unit", "")
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
        known = list(Scenario.model_fields)
        if len(error["loc"]) > 1 and error["loc"][0] in Scenario.model_fields:
            known = list(Scenario.model_fields[error["loc"][0]].annotation.model_fields)
        near = get_close_matches(str(error["loc"][-1]), known, n=1)
        hint = f"did you mean {near[0]!r}? " if near else ""
        return f"unknown key {key} = {error['input']!r}: {hint}allowed are {', '.join(known)}"
    message = str(error["ctx"]["error"]) if error["type"] == "value_error" else error["msg"]
    if isinstance(error["input"], dict):
        return f"{key}: {message}"
    return f"{key} = {error['input']!r}: {message}"
