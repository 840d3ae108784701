"""Studies: a scenario and the distributions of the keys that vary between chips."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal, TypeAlias

from fifesim.base.arguments import FilePath, Kind, check_fields
from fifesim.base.files import shown
from fifesim.base.lattice import check_seed
from fifesim.base.messages import nearest
from fifesim.scenario.distributions import distribution_of
from fifesim.scenario.keys import COVERS, LAND_FORMS, OFFSET_PARTS
from fifesim.scenario.scenario import Scenario, find_key, grid_keys, parse_scenario, put, values_of
from fifesim.scenario.simulation import warn_of_scenario_pixels
from fifesim.scenario.toml import full_path, load_values, write_tables

_HEADING = "Study of a fifesim dataset. Make it with: fifesim dataset THIS_FILE -o chips.zarr -n 1000"
_SPLIT = MappingProxyType({"train": 0.8, "validation": 0.1, "test": 0.1})

# Keys that determine the shape of a chip, or the map from which it is cropped.
_FIXED = {
    ("ground", "lai_file"),
    ("ground", "method"),
    ("landscape", "cover"),
    ("terrain", "dem"),
    *(("sensor", key) for key in ("instrument", "bands", "pixel", "interval")),
}
_SUN = ("time", "latitude", "longitude", "sza", "saa")
_BY_BAND = (("leaf_reflectance", "leaf_transmittance"), ("background",))


@dataclass(frozen=True)
class Study:
    """
    A scenario with the size of one chip, and distributions for the keys that vary between chips.

    Parameters
    ----------
    scenario : fifesim.Scenario
        Common values. Its grid has the size of a chip. The chips of a landscape are non-overlapping windows around this
        grid.
    draws : mapping
        Distributions by key, with names as in `fifesim.scenario.sweep`: ``{"visibility": {"uniform": [10, 60]},
        "ground.brown": {"normal": [0.2, 0.1], "within": [0, 1]}}``. Other distributions are ``log-uniform``,
        ``integers`` and ``choice``, optionally with ``weights``. ``arp`` is drawn once per
        landscape, other keys once per chip.
    sequence : {"sobol", "random"}, optional
        Sequence of points from which values are drawn.
    seed : int, optional
        Seed of the draws.
    landscapes : int, optional
        Number of landscapes. They have consecutive seeds, starting with the seed of the scenario.
    split : mapping of str to float, optional
        Fraction of the landscapes in each part of the dataset; by default train 0.8, validation 0.1, test 0.1.

    Raises
    ------
    ValueError
        If a key or distribution is invalid, or its values are out of range.
    TypeError
        If `scenario` is not a Scenario.

    See Also
    --------
    fifesim.scenario.chips_of, fifesim.dataset

    Examples
    --------
    >>> from fifesim import Scenario, Study
    >>> chip = Scenario(grid={"width": 180, "height": 180}, terrain={"dem": "flat"})
    >>> study = Study(chip, {"visibility": {"uniform": [10, 60]}}, landscapes=10)
    >>> study.quotas()
    {'train': 8, 'validation': 1, 'test': 1}
    """

    scenario: Scenario
    draws: Mapping[str, Mapping]
    sequence: Literal["sobol", "random"] = "sobol"
    seed: int = 0
    landscapes: int = 50
    split: Mapping[str, float] = field(default_factory=lambda: dict(_SPLIT))

    def __post_init__(self):
        check_seed(self.seed)
        check_fields(self, "scenario", "sequence", "landscapes", "split")
        _check_ground(self.scenario)
        _check_plan(self)
        drawn = dict(_draws(self.draws, self.scenario))
        object.__setattr__(self, "draws", {key.name: distribution.table for key, distribution in drawn.items()})
        object.__setattr__(self, "drawn", drawn)
        _check_extremes(self)
        warn_of_scenario_pixels(self.scenario)

    @cached_property
    def values(self) -> dict[str, Any]:
        """Values common to all chips, nested as in a scenario. Sun and altitude refer to the grid of the scenario."""
        return _settled(self.scenario, {key.path for key in self.drawn})  # type: ignore[attr-defined]

    def quotas(self) -> dict[str, int]:
        """Number of landscapes in each part of the dataset, a dict of int by name."""
        shares = {name: share * self.landscapes for name, share in self.split.items()}
        found = {name: max(int(share + 1e-9), 1) for name, share in shares.items()}
        while sum(found.values()) < self.landscapes:
            found[max(found, key=lambda name: shares[name] - found[name])] += 1
        while sum(found.values()) > self.landscapes:
            several = [name for name, number in found.items() if number > 1]
            found[max(several, key=lambda name: found[name] - shares[name])] -= 1
        return found

    def to_toml(self) -> str:
        """The study as TOML text. Reading it gives the same study."""
        plan = {"sequence": self.sequence, "seed": self.seed, "landscapes": self.landscapes, "split": dict(self.split)}
        tables = {("dataset",): plan, ("draw",): self.draws}
        for place, section in self.scenario.sections().items():
            tables[place] = section.with_paths(full_path).model_dump(exclude_unset=True)
        return write_tables(_HEADING, tables)

    def scenario_with(self, drawn: Mapping[tuple[str, ...], Any]) -> Scenario:
        """
        Scenario with drawn values, on the grid of the study.

        Parameters
        ----------
        drawn : mapping of tuple of str to object
            Drawn values by the path of their key.

        Returns
        -------
        scenario : fifesim.scenario.scenario.Scenario

        Raises
        ------
        ValueError
            If a value is not allowed.
        """
        values = deepcopy(self.values)
        for path, value in drawn.items():
            put(values, path, value)
        return parse_scenario(values)


StudyLike: TypeAlias = Annotated[
    FilePath | Study, Kind("the path of a study, such as 'study.toml', or a fifesim.Study")
]


def read_study(path: FilePath) -> Study:
    """
    Read a study from a TOML file: a scenario with the tables ``[draw]`` and ``[dataset]``.

    Parameters
    ----------
    path : str or path
        TOML file. Paths in it are relative to its folder.

    Returns
    -------
    study : Study

    Raises
    ------
    ValueError
        If the file is missing or not TOML, or a key, value or distribution is wrong.

    Examples
    --------
    >>> from fifesim.scenario import read_study
    >>> study = read_study("study.toml")  # doctest: +SKIP
    """
    return _study_of(load_values(path), Path(path).parent)


def parse_study(text):
    """Study from the TOML text of `Study.to_toml`."""
    return _study_of(tomllib.loads(text), Path())


def _study_of(values, folder):
    """Study from the values of a TOML file in a folder."""
    plan, draws = values.pop("dataset", {}), values.pop("draw", None)
    known = ("sequence", "seed", "landscapes", "split")
    wrong = [
        f"unknown key dataset.{name}: {nearest(str(name), known)}allowed are {', '.join(known)}"
        for name in (plan if isinstance(plan, dict) else [plan])
        if name not in known
    ]
    try:
        scenario = parse_scenario(values)
    except ValueError as error:
        wrong.append(str(error))
    if wrong:
        raise ValueError("\n".join(wrong))
    if isinstance(draws, Mapping):
        draws = {name: _with_whole_paths(name, table, folder) for name, table in _flat(draws)}
    return Study(scenario, draws, **plan)


def _with_whole_paths(name, table, folder):
    """Distribution with absolute paths if it is a choice of files."""
    key = find_key(name, called="draw:")
    if not isinstance(table, Mapping) or not isinstance(table.get("choice"), list) or key.entry:
        return table
    choices = [full_path(each, folder) if key.section.names_a_file(key.key, each) else each for each in table["choice"]]
    return table | {"choice": choices}


def _check_ground(scenario):
    """Raise ValueError for maps of real ground. They are a single landscape, and a study needs many."""
    for section, key, names in (
        ("ground", "lai_file", (None,)), ("terrain", "dem", LAND_FORMS), ("landscape", "cover", COVERS),
    ):  # fmt: skip
        value = getattr(getattr(scenario, section), key)
        if value not in names:
            drawn = " or ".join(name for name in names if name) or "none"
            raise ValueError(
                f"{section}.{key} = {shown(value)}: chips of one map would share ground between training and test; a "
                f"study needs {drawn}"
            )
    if scenario.ground.method != "streaming":
        raise ValueError('ground.method = "periodic" has no windows for chips: use method = "streaming"')
    lacking = [key for key in ("width", "height") if key not in scenario.grid.model_fields_set]
    if lacking:
        raise ValueError(f"grid.{lacking[0]} is missing: give the size of a chip, such as width = 1110, height = 1110")


def _check_plan(study):
    """Check number of landscapes and split."""
    split, landscapes = study.split, study.landscapes
    if not isinstance(landscapes, int) or isinstance(landscapes, bool) or landscapes < 1:
        raise ValueError(f"dataset.landscapes = {shown(landscapes)}: must be an integer of at least 1")
    shares = list(split.values()) if isinstance(split, Mapping) else []
    are_positive = bool(shares) and all(isinstance(share, int | float) and share > 0 for share in shares)
    if not are_positive or abs(sum(shares) - 1) > 1e-6:
        raise ValueError(
            f"dataset.split = {shown(split)} must be fractions that sum to 1, such as {{ train = 0.8, test = 0.2 }}"
        )
    if landscapes < len(split):
        raise ValueError(
            f"dataset.landscapes = {landscapes} are too few for the parts {', '.join(split)}: "
            f"use {len(split)} or more, or change the split"
        )


def _draws(draws, scenario):
    """Drawn keys and their distributions."""
    if not isinstance(draws, Mapping) or not draws:
        raise ValueError("a study needs a table [draw], such as visibility = { uniform = [10, 60] }")
    known = set()
    for name, table in _flat(draws):
        key = find_key(name, called="draw:")
        _check_may_be_drawn(key, scenario)
        if key in known:
            raise ValueError(f"draw.{key.name} is given twice")
        known.add(key)
        try:
            yield key, distribution_of(table, None if key.entry else partial(key.section.in_unit, key.key))
        except ValueError as error:
            raise ValueError(f"draw.{key.name}: {error}") from None


def _flat(table, above=""):
    """Iterate over distributions in nested tables, with dotted names."""
    for name, found in table.items():
        if isinstance(found, Mapping) and found and all(isinstance(each, Mapping) for each in found.values()):
            yield from _flat(found, f"{above}{name}.")
        else:
            yield f"{above}{name}", found


def _check_may_be_drawn(key, scenario):
    if key.path[-1] == "seed":
        raise ValueError(f"draw.{key.name}: seeds are assigned automatically, starting with {key.name}: remove it")
    if key.path in _FIXED or key.place == ("grid",):
        raise ValueError(f"draw.{key.name} must be equal for all chips: give one value under [{'.'.join(key.place)}]")
    if key.place[0] == "classes" and key.place[1] not in scenario.classes:
        known = ", ".join(scenario.classes) or "none"
        raise ValueError(f"draw.{key.name}: there is no section [{'.'.join(key.place)}]; the classes are {known}")


def _settled(scenario, drawn):
    """Values common to all chips, with explicit sun and atmosphere."""
    # Chips lie outside the grid of the scenario, but must have the same sun and atmosphere.
    whole, values = scenario.complete(), values_of(scenario)
    latitude, longitude = scenario.sun_place()
    sun = {"time": whole.geometry.time, "latitude": latitude, "longitude": longitude}
    if not any(("geometry", key) in drawn for key in _SUN):
        light = scenario.sun_and_view()
        sun |= {"sza": light.sza, "saa": light.saa}
    settled = {("geometry", key): value for key, value in sun.items() if value is not None}
    settled |= {("atmosphere", "altitude"): scenario.atmosphere.altitude, ("terrain", "dem"): scenario.terrain.dem}
    settled |= {("grid", key): value for key, value in grid_keys(scenario.geobox())}
    for keys in _BY_BAND:
        # If one band is drawn, values of the other bands are also needed.
        if any(path[:2] == ("ground", key) for path in drawn for key in keys if len(path) == 3):
            settled |= {("ground", key): dict(getattr(whole.ground, key)) for key in keys}
    if any(path[:2] == ("sensor", "offset") for path in drawn):
        settled[("sensor", "offset")] = dict(zip(OFFSET_PARTS, whole.sensor.offset, strict=True))
    for path, value in settled.items():
        put(values, path, value)
    return values


def _check_extremes(study):
    """Check each key at the ends of its distribution, with the other keys at their medians."""
    middle = {key: distribution.usual for key, distribution in study.drawn.items()}
    cases = [(middle, "draw, all keys at their median or first choice: ")]
    for key, distribution in study.drawn.items():
        for value in distribution.extremes:
            where = f"draw.{key.name} = {shown(distribution.table)} at {shown(value)}: "
            cases.append((middle | {key: value}, where))
    for drawn, where in cases:
        try:
            study.scenario_with({key.path: value for key, value in drawn.items()}).complete()
        except ValueError as error:
            raise ValueError(f"{where}{error}") from None
