"""Scenarios as TOML text: spelled as keys may be, with one line a mistake, and written with every unit."""

import inspect
import json
import os
import re
from copy import deepcopy
from functools import reduce
from pathlib import Path

from pydantic import ValidationError

from fifesim.base.foreign import in_a_line, read_toml, shown
from fifesim.base.refusals import in_own_words
from fifesim.base.spelling import closest, nearest
from fifesim.scenario.keys import Keys

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
# The longest that is said of the mistakes of a scenario; a line of one is shorter.
_LONGEST = 500
# A value of another kind than its key takes is told what the key says.
_OTHER_KINDS = ("dict_type", "list_type", "string_type")


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
    return with_folder(values, path.parent)


def with_folder(values, folder):
    """
    Values of a scenario with the full paths of the files that they name.

    Parameters
    ----------
    values : dict
        As TOML gives it.
    folder : str or path
        That they lie relative to.

    Returns
    -------
    values : dict
        The same, changed.
    """
    for _, table, key in list(named_files(values)):
        table[key] = full_path(table[key], folder)
    return values


def full_path(path, folder="."):
    """
    Full path of a file that a scenario names.

    Parameters
    ----------
    path : str
    folder : str or path, optional
        Folder that the path is relative to.

    Returns
    -------
    path : str
        Links are not resolved: the file that one leads to may have another suffix. Paths of GDAL's virtual file
        systems do not change, since they are no paths of this machine.

    Examples
    --------
    >>> full_path("../lai.tif", "/data/runs"), full_path("/vsizip//data/maps.zip/lai.tif", "/data/runs")
    ('/data/lai.tif', '/vsizip//data/maps.zip/lai.tif')
    """
    return path if path.startswith("/vsi") else os.path.abspath(os.path.join(folder, path))


def named_files(values):
    """
    Keys of a scenario that name files.

    Parameters
    ----------
    values : dict
        As TOML gives it.

    Yields
    ------
    place : tuple of str
        Of the table.
    table : dict
    key : str
        Of the path in the table.
    """
    for place, table in _tables(values):
        section = Keys.section(place)
        for key, value in table.items() if section else ():
            if section.names_a_file(key, value) and value:
                yield place, table, key


def _tables(values):
    """Tables of keys, with their places."""
    for name, table in values.items():
        inside = name == "classes" and isinstance(table, dict)
        found = [((name, key), each) for key, each in table.items()] if inside else [((name,), table)]
        yield from ((place, each) for place, each in found if isinstance(each, dict))


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
        raise ValueError(mistakes(error, values, model)) from None


def mistakes(error, values, model):
    """
    Mistakes of a scenario, a line each.

    A section with an unknown key is not checked as a whole, so the values are checked again with these keys corrected
    where their spelling is close to a key, and without the others.

    Parameters
    ----------
    error : pydantic.ValidationError
    values : mapping
        From which the model was made.
    model : type
        As in `validated`.

    Returns
    -------
    lines : str
        As many as can be read at once.
    """
    found = error.errors()
    lines, unknown = [_explain(item) for item in found], [each for each in found if each["type"] == "extra_forbidden"]
    if unknown:
        rest = deepcopy(dict(values))
        for item in unknown:
            *place, key = item["loc"]
            table = reduce(lambda found, name: found[name], place, rest)
            table.setdefault(closest(key, _known(item["loc"])) or key, table.pop(key))
            table.pop(key, None)
        try:
            model(**rest)
        except ValidationError as others:
            lines += [_explain(item) for item in others.errors()]
        except ValueError as others:
            lines += str(others).splitlines()
    return _shortened(list(dict.fromkeys(lines)))


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
        Reading it gives the same scenario. The first line states the synthetic parts.
    """
    lines = [f"# {scenario.provenance()}"]
    lines += ["# Scenario of a fifesim run. Run it with: fifesim simulate THIS_FILE -o FOLDER"]
    for place, section in scenario.sections().items():
        lines += ["", *_table(".".join(map(_toml_key, place)), section)]
    return "\n".join(lines) + "\n"


def plain_table(place, values):
    """
    Lines of a TOML table.

    Parameters
    ----------
    place : sequence of str
        Its name.
    values : mapping
        Numbers, texts, lists and tables of them, by key; what is None is left out.

    Returns
    -------
    lines : list of str

    Examples
    --------
    >>> plain_table(["draw"], {"brown": {"uniform": [0.0, 0.5]}})
    ['[draw]', 'brown = { uniform = [0.0, 0.5] }']
    """
    keys = (f"{_toml_key(key)} = {_toml(value)}" for key, value in values.items() if value is not None)
    return [f"[{'.'.join(map(_toml_key, place))}]", *keys]


def _table(name, section):
    """Lines of a table and of those in it."""
    lines, tables = [f"[{name}]  # {inspect.getdoc(type(section)).splitlines()[0]}"], []
    for key, known in section.said.items():
        value, unit = getattr(section, key), section.unit(key)
        meaning = f"{unit}; {known.description}" if unit else known.description
        if isinstance(value, dict):
            parts = (f"{_toml_key(part)} = {_toml(number)}" for part, number in value.items())
            tables += ["", f"[{name}.{key}]  # {meaning}", *parts]
        elif value is None:
            lines.append(f"# {key} =   # {meaning}")
        else:
            lines.append(f"{key} = {_toml(value)}  # {meaning}")
    return lines + tables


def _toml(value):
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        # JSON escapes as TOML does, all but one character.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_toml_key(key)} = {_toml(each)}" for key, each in value.items()) + " }"
    return repr(value)


def _toml_key(name):
    return name if _BARE_KEY.fullmatch(name) else _toml(name)


def _meaning(place):
    """What a key says, in brackets; nothing of one that is not known."""
    section = Keys.section(place[:-1])
    known = section.model_fields.get(place[-1]) if section else None
    return f" ({known.description})" if known else ""


def _known(place):
    """Names of the keys in the section of a key."""
    return list(((Keys.section(place[:-1]) if len(place) > 1 else None) or Keys).model_fields)


def _explain(error):
    """One line that names the key, the value and what is allowed."""
    place, value = [str(part) for part in error["loc"]], error["input"]
    key = in_a_line(".".join(place), 100)
    if error["type"] == "extra_forbidden":
        known = _known(place)
        hint = nearest(place[-1], known)
        return in_a_line(f"unknown key {key} = {shown(value)}: {hint}allowed are {', '.join(known)}")
    message = str(error["ctx"]["error"]) if error["type"] == "value_error" else in_own_words(error)
    if error["type"] in _OTHER_KINDS and len(place) > 1:
        message += _meaning(place)
    if isinstance(value, str):
        # What others say of a value repeats it whole.
        message = message.replace(repr(value), shown(value))
    if isinstance(value, dict):
        return in_a_line(": ".join(filter(None, (key, message))))
    return in_a_line(f"{key} = {shown(value)}: {message}")
