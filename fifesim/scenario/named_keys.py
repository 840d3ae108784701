"""Keys of a scenario by name: where they lie, what they are, and a scenario with another value of one."""

from typing import NamedTuple

import numpy as np

from fifesim.base.foreign import shown
from fifesim.base.spelling import nearest
from fifesim.scenario.ground_keys import ByName
from fifesim.scenario.keys import Keys
from fifesim.scenario.scenario import Scenario, parse_scenario


class NamedKey(NamedTuple):
    """A key of a scenario, or one entry of a key that is a table, such as ``ground.leaf.chlorophyll``."""

    place: tuple[str, ...]
    key: str
    entry: str | None = None

    @property
    def path(self):
        """Names from the section down, a tuple of str."""
        return (*self.place, self.key) + (() if self.entry is None else (self.entry,))

    @property
    def name(self):
        """The names with dots between them."""
        return ".".join(self.path)

    @property
    def section(self):
        """What knows the keys of the table, a `fifesim.scenario.section.Section`."""
        return Keys.section(self.place)

    @property
    def attributes(self):
        """Meaning and unit, a dict as a coordinate has it: what plots write beside it."""
        # The description's first words name the key; ranges and hints follow them.
        meaning = self.section.model_fields[self.key].description.split(";")[0]
        entry = f"{self.key.replace('_', ' ')}: {self.entry}"
        found = {"long_name": entry if self.entry else meaning, "units": self.section.unit(self.key)}
        return {name: text for name, text in found.items() if text}


def find_key(name, called="the axis"):
    """
    A key of a scenario by name.

    Parameters
    ----------
    name : str
        ``"visibility"``; ``"ground.seed"`` where several sections have the key, ``"classes.grass.brown"`` of a class;
        an entry of a table by its name behind it, ``"ground.leaf.chlorophyll"``.
    called : str, optional
        What a message calls the name.

    Returns
    -------
    key : NamedKey

    Raises
    ------
    ValueError
        If no section has it, or several have.
    """
    parts = tuple(str(name).split("."))
    tables = [(each,) for each in Keys.model_fields if each != "classes"]
    if parts[0] == "classes":
        tables, parts = [parts[:2]], parts[2:]
    elif parts[:1] in tables and len(parts) > 1:
        tables, parts = [parts[:1]], parts[1:]
    found = [NamedKey(table, *parts) for table in tables if _has(Keys.section(table), parts)]
    if len(found) == 1:
        return found[0]
    if found:
        written = " or ".join(each.name for each in found)
        raise ValueError(f"{called} {shown(name)} is a key of several sections: write {written}")
    known = {each for place in Scenario().sections() for each in Keys.section(place).model_fields}
    hint = nearest(parts[-1] if parts else "classes", sorted(known))
    raise ValueError(
        f"{called} {shown(name)} is no key of a scenario: {hint}`fifesim scenario` prints all that there are"
    )


def _has(section, parts):
    """Whether a section has a key, and the key entries where one is named."""
    if section is None or not parts or parts[0] not in section.model_fields or "" in parts:
        return False
    return len(parts) == 1 or (len(parts) == 2 and section.model_fields[parts[0]].annotation == ByName)


def values_of(scenario):
    """
    What a scenario says, without what it leaves to defaults.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario

    Returns
    -------
    values : dict
        Nested, as `parse_scenario` takes it.
    """
    return scenario.model_dump(exclude_unset=True)


def put(values, path, value):
    """
    Put a value into nested mappings, in place.

    Parameters
    ----------
    values : dict
        As `values_of` gives it.
    path : sequence of str
        Of a key, from the section down.
    value : object
        Numbers of numpy become those of Python, which a scenario takes.
    """
    *tables, last = path
    for name in tables:
        values = values.setdefault(name, {})
    values[last] = value.tolist() if isinstance(value, np.generic | np.ndarray) else value


def changed(key, scenario, value):
    """
    A scenario with another value of a key.

    Parameters
    ----------
    key : NamedKey
    scenario : fifesim.scenario.scenario.Scenario
    value : object

    Returns
    -------
    scenario : fifesim.scenario.scenario.Scenario

    Raises
    ------
    ValueError
        If the value is not allowed.
    """
    values = values_of(scenario)
    put(values, key.path, value)
    return parse_scenario(values)


def in_text(value):
    """
    A value as one cell of a table has it: text where it is a list.

    Parameters
    ----------
    value : object

    Returns
    -------
    value : object

    Examples
    --------
    >>> in_text([0.2, 0.0]), in_text([]), in_text(45.0)
    ('0.2, 0.0', 'none', 45.0)
    """
    if np.ndim(value) == 0:
        return value
    return ", ".join(str(part) for part in np.ravel(value).tolist()) or "none"
