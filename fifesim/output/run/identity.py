"""What a run is of: its scenario, its input files as they are, and the versions of what computes it."""

import json
import os
from pathlib import Path

from fifesim.output.folders import BEGUN, UNFINISHED
from fifesim.output.provenance import versions
from fifesim.rasters.opening import raster_file
from fifesim.scenario.scenario import read_scenario
from fifesim.scenario.toml import write_scenario
from fifesim.sensor.description.instruments import tables_of

STATE = "run.json"
"""File of what else must be the same."""


class NotThisRun(ValueError):
    """The run to resume is another one, which is none of this one's business to remove."""


def scenario_to_resume(folder):
    """
    Scenario of a run that was stopped.

    Parameters
    ----------
    folder : pathlib.Path
        Of its results.

    Returns
    -------
    scenario : fifesim.scenario.scenario.Scenario or None
        None where no run was stopped.
    """
    path = Path(folder) / UNFINISHED / BEGUN
    return read_scenario(path) if path.is_file() else None


def identity_of(scenario, scene):
    """
    What must be the same for blocks of two runs to fit together.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
        Complete.
    scene : bool
        With the products of the scene.

    Returns
    -------
    identity : dict of str to str
        Texts of files by name.
    """
    state = {"versions": versions(), "inputs": inputs_of(scenario), "scene": bool(scene)}
    return {STATE: json.dumps(state), BEGUN: write_scenario(scenario)}


def inputs_of(scenario):
    """
    Files that a scenario reads, those among them that others name included: sources of a VRT, tables of an instrument.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario

    Returns
    -------
    inputs : dict of str to [int, int]
        Size [byte] and time of the last change [ns] by path.
    """
    found = {}
    for (*_, key), name in scenario.files.items():
        for path in filter(os.path.isfile, _read_with(key, name) if os.path.isfile(name) else ()):
            status = os.stat(path)
            found[str(path)] = [status.st_size, status.st_mtime_ns]
    return found


def _read_with(key, name):
    if key == "instrument":
        return [name, *tables_of(name)]
    if key in ("lai_file", "dem", "cover"):
        with raster_file(name).opened() as source:
            return [name, *source.files]
    return [name]


def begin(unfinished, identity):
    """
    Begin a run, or see that it is the one that was begun.

    Parameters
    ----------
    unfinished : pathlib.Path
        Its hidden folder.
    identity : dict of str to str
        From `identity_of`.

    Raises
    ------
    NotThisRun
        If another run was begun.
    """
    if (unfinished / BEGUN).is_file():
        _check_same(unfinished, identity)
        return
    for name, text in identity.items():
        (unfinished / f"{name}.partial").write_text(text, encoding="utf-8")
    # By the last of them it is begun.
    for name in identity:
        os.replace(unfinished / f"{name}.partial", unfinished / name)


def _check_same(unfinished, identity):
    try:
        before = {name: (unfinished / name).read_text(encoding="utf-8") for name in identity}
        kept, state = (json.loads(each[STATE]) for each in (before, identity))
        changed = [key for key in state if kept[key] != state[key]]
    except (OSError, ValueError, KeyError, TypeError):
        raise NotThisRun(f"{unfinished / STATE} is not what a run writes: begin again with --overwrite") from None
    if before[BEGUN] != identity[BEGUN]:
        old, new = ({line.strip() for line in each[BEGUN].splitlines()} for each in (before, identity))
        lines = sorted(line.partition("#")[0].strip() for line in old - new) or ["keys"]
        raise NotThisRun(
            f"the run to resume is of another scenario, with {', '.join(lines[:3])}: "
            "leave out SCENARIO to go on with that one, or begin again with --overwrite"
        )
    said = {
        "versions": "was begun with other versions of its packages: begin again with --overwrite",
        "inputs": "was begun with an input file that has changed: begin again with --overwrite",
        "scene": "was begun with --scene or without it: give it as it was",
        "chips": f"was begun with {kept.get('chips')} chips: give it as it was",
    }
    for key in changed:
        raise NotThisRun(f"the run to resume {said[key]}")


def check_inputs(scenario, identity):
    """
    Refuse results of files that changed while they were read.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
    identity : dict of str to str
        From `identity_of`, at the start.

    Raises
    ------
    ValueError
        If a file is not what it was.
    """
    before, now = json.loads(identity[STATE])["inputs"], inputs_of(scenario)
    changed = [name for name in sorted(before | now) if before.get(name) != now.get(name)]
    if changed:
        raise ValueError(
            f"{changed[0]} changed while it was read, so that nothing of this run is kept: "
            "begin again when the file is whole"
        )
