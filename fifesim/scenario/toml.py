"""Scenarios as text: TOML with units, spelling checks with one line per mistake, and descriptions for prompts."""

import inspect
import os
from copy import deepcopy
from functools import reduce
from pathlib import Path
from textwrap import TextWrapper

import tomlkit
from pydantic import ValidationError

from fifesim.base.arguments import likely_units
from fifesim.base.files import in_a_line, read_toml, shown
from fifesim.base.messages import closest, html_table, in_own_words, nearest, value_in_words
from fifesim.scenario.keys import STAND, Keys

# Maximum length of the message on all mistakes of a scenario. [character]
_LONGEST = 500
# Types of errors whose message is followed by the meaning of the key.
_OTHER_KINDS = ("dict_type", "list_type", "string_type")
# Types of errors whose message is followed by the likely unit.
_OUTSIDE = ("greater_than_equal", "less_than_equal")


def load_values(path):
    """Values of a TOML file. Relative paths in it become absolute."""
    path = Path(path)
    try:
        values = read_toml(path)
    except OSError as error:
        raise ValueError(in_a_line(f"cannot read the scenario {path}: {error.strerror}")) from None
    return with_folder(values, path.parent)


def with_folder(values, folder):
    """Make the file paths of a scenario absolute, in place."""
    for _, table, key in list(named_files(values)):
        table[key] = full_path(table[key], folder)
    return values


def full_path(path, folder="."):
    """Absolute path of a file in a scenario, without resolving links. GDAL's virtual paths are unchanged."""
    return path if path.startswith("/vsi") else os.path.abspath(os.path.join(folder, path))


def named_files(values):
    """Iterate over the keys of a scenario that name files: place, table and key."""
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


def mistakes(error, values, model):
    """Mistakes of a scenario, one line each."""
    # A section with an unknown key is not checked as a whole. Check the values again after correcting near misses and
    # removing other unknown keys.
    found = error.errors()
    lines, unknown = [_explain(item) for item in found], [item for item in found if item["type"] == "extra_forbidden"]
    if unknown:
        rest = deepcopy(dict(values))
        for item in unknown:
            *place, key = item["loc"]
            table = reduce(lambda found, name: found[name], place, rest)
            table.setdefault(closest(key, _section_keys(item["loc"])) or key, table.pop(key))
            table.pop(key, None)
        try:
            model(**rest)
        except ValidationError as others:
            lines += [_explain(item) for item in others.errors()]
        except ValueError as others:
            lines += str(others).splitlines()
    return _shortened(list(dict.fromkeys(lines)))


def _shortened(lines):
    """The first lines, and the number of omitted lines."""
    kept = lines[:1]
    for line in lines[1:]:
        if len("\n".join((*kept, line))) > _LONGEST - len("\nand 1000000 more"):
            return "\n".join((*kept, f"and {len(lines) - len(kept)} more"))
        kept.append(line)
    return "\n".join(kept)


def check_spelling(path):
    """Raise ValueError for a scenario with wrong keys, types or ranges, without the slower physical checks."""
    values = load_values(path)
    try:
        Keys.model_validate(values)
    except ValidationError as error:
        raise ValueError(mistakes(error, values, Keys)) from None


def write_scenario(scenario):
    """TOML text of a scenario, with the unit and meaning of every key; reading it gives the same scenario."""
    heading = [scenario.provenance(), "Scenario of a fifesim run. Run it with: fifesim simulate THIS_FILE -o FOLDER"]
    unused, sections = scenario.unused, scenario.sections()
    return _document(heading, {place: _described(own, unused.get(place, ())) for place, own in sections.items()})


def in_lines(scenario):
    """Changed keys of a scenario, its landscape and its bands, in a few lines."""
    changed, own = {}, scenario.sensor
    for place, table in scenario.sections().items():
        values = {key: getattr(table, key) for key in table.written if _is_changed(place, table, key)}
        if place[0] == "classes":
            changed.setdefault("classes", {})[place[1]] = values
        elif values:
            changed[place[0]] = values
    given = ", ".join(f"{name}={value!r}" for name, value in changed.items())
    texts = f"Scenario({given})", scenario.provenance(), f"{own.instrument}, bands {', '.join(own.bands)}"
    lines = TextWrapper(100, "", "  ", break_long_words=False, break_on_hyphens=False)
    return "\n  ".join(lines.fill(in_a_line(text, 600)) for text in texts)


def in_html(scenario):
    """Table of the keys of a scenario for notebooks, with the unchanged ones folded."""
    rows = {True: [], False: []}
    for place, table in scenario.sections().items():
        for key, known in table.written.items():
            value = getattr(table, key)
            unit = table.unit(key).removesuffix("1") if isinstance(value, float) else ""
            row = ".".join((*place, key)), f"{value_in_words(value)} {unit}".rstrip(), known.description
            rows[_is_changed(place, table, key)].append(row)
    return html_table("Scenario", rows[True], scenario.provenance(), rows[False])


def _is_changed(place, table, key):
    """Whether a key differs from its default, or is given where a missing key means something else."""
    given = place[0] == "classes" or (key in table.model_fields_set and key in (*STAND, "altitude", "dem"))
    return given or getattr(table, key) != table.written[key].default


def write_tables(heading, tables):
    """TOML text of tables without descriptions of their keys."""
    given = {place: {key: each for key, each in table.items() if each is not None} for place, table in tables.items()}
    return _document([heading], {place: tomlkit.item(table) for place, table in given.items() if table})


def _document(heading, tables):
    """TOML text of comment lines and of tables by their names, which have one or two parts."""
    document = tomlkit.document()
    for line in heading:
        document.add(tomlkit.comment(line))
    for (name, *inside), table in tables.items():
        if inside:
            above = document.setdefault(name, tomlkit.table(is_super_table=True))
            above.add(inside[0], table)
        else:
            document.add(name, table)
    return document.as_string()


def _described(section, unused):
    """Table of a section without unused keys, with the meaning of each key in a comment."""
    table = tomlkit.table().comment(inspect.getdoc(type(section)).splitlines()[0])
    # A key after a nested table would become part of that table.
    for key, known in sorted(section.written.items(), key=lambda item: isinstance(getattr(section, item[0]), dict)):
        if key in unused:
            continue
        value, unit = getattr(section, key), section.unit(key)
        meaning = f"{unit}; {known.description}" if unit else known.description
        if value is None:
            table.add(tomlkit.comment(f"{key} =   # {meaning}"))
        else:
            table.add(key, tomlkit.item(value).comment(meaning))
    return table


def _section_keys(place):
    """Names of the keys in the section of a key."""
    return list(((Keys.section(place[:-1]) if len(place) > 1 else None) or Keys).model_fields)


def _explain(error):
    """One line with the key, the value and the allowed values."""
    place, value = [str(part) for part in error["loc"]], error["input"]
    key = in_a_line(".".join(place), 100)
    if error["type"] == "extra_forbidden":
        known = _section_keys(place)
        hint = nearest(place[-1], known)
        return in_a_line(f"unknown key {key} = {shown(value)}: {hint}allowed are {', '.join(known)}")
    message = str(error["ctx"]["error"]) if error["type"] == "value_error" else in_own_words(error)
    section = Keys.section(place[:-1]) if len(place) > 1 else None
    known = section.model_fields.get(place[-1]) if section else None
    if known and error["type"] in _OTHER_KINDS:
        message += f" ({known.description})"
    if known and error["type"] in _OUTSIDE and "range" in (known.json_schema_extra or {}):
        hint = likely_units(place[-1], float(value), known.json_schema_extra["range"])
        message += f": {hint}" if hint else ""
    if isinstance(value, str):
        # Messages of libraries repeat the complete value.
        message = message.replace(repr(value), shown(value))
    if isinstance(value, dict):
        return in_a_line(": ".join(filter(None, (key, message))))
    return in_a_line(f"{key} = {shown(value)}: {message}")
