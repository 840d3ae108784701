"""Identity of a run: its scenario, the state of its input files, and the versions of the packages."""

import hashlib
import json
import os
from pathlib import Path

from fifesim.output.folders import BEGUN, UNFINISHED
from fifesim.output.provenance import versions
from fifesim.rasters.opening import archive_of, raster_file
from fifesim.scenario.scenario import read_scenario
from fifesim.scenario.toml import write_scenario
from fifesim.sensor.description.instruments import tables_of

SCENARIO, STATE = "scenario.toml", "run.json"
"""File of the scenario in the results, and file of what else must be the same in an unfinished run."""

# Input files of this size in all are compared by content if only their change time or inode differ. [byte]
_COMPARED = 2**30


class NotThisRun(ValueError):
    """The run to resume is another one, which is none of this one's business to remove."""


def scenario_to_resume(folder):
    """
    Scenario of an unfinished or finished run.

    Parameters
    ----------
    folder : pathlib.Path
        Folder of the results.

    Returns
    -------
    scenario : fifesim.scenario.scenario.Scenario or None
        None if there is no run in the folder.
    """
    found = [path for path in (Path(folder) / UNFINISHED / BEGUN, Path(folder) / SCENARIO) if path.is_file()]
    return read_scenario(found[0]) if found else None


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
    state = {"versions": versions(), "inputs": with_checksums(inputs_of(scenario)), "scene": bool(scene)}
    return {STATE: json.dumps(state), BEGUN: write_scenario(scenario)}


def inputs_of(scenario):
    """
    State of the files that a scenario reads, including files that they name: sources of a VRT, tables of an instrument.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario

    Returns
    -------
    inputs : dict of str to list of int
        Size [byte], times of the last change of content and of attributes [ns], and inode, by path. A file in an
        archive has the state of the archive.
    """
    found = {}
    for (*_, key), name in scenario.files.items():
        for path in _read_with(key, name) if os.path.isfile(name) or name.startswith("/vsi") else ():
            on_disk = archive_of(path) if str(path).startswith("/vsi") else path
            if on_disk and os.path.isfile(on_disk):
                status = os.stat(on_disk)
                found[str(on_disk)] = [status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino]
    return found


def _read_with(key, name):
    if key == "instrument":
        return [name, *tables_of(name)]
    if key in ("lai_file", "dem", "cover"):
        with raster_file(name).opened() as source:
            return [name, *source.files]
    return [name]


def with_checksums(inputs):
    """
    State of files with a checksum of their content; without it where reading all of them would take long.

    Parameters
    ----------
    inputs : dict of str to list of int
        From `inputs_of`.

    Returns
    -------
    inputs : dict of str to list
    """
    small = sum(state[0] for state in inputs.values()) <= _COMPARED
    return {path: [*state, _checksum(path) if small else None] for path, state in inputs.items()}


def _checksum(path):
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "blake2b").hexdigest()


def changed_inputs(before, now):
    """
    Input files that are not what they were.

    Parameters
    ----------
    before : dict of str to list
        From `with_checksums`.
    now : dict of str to list of int
        From `inputs_of`.

    Returns
    -------
    paths : list of str
        Files that appeared, disappeared or changed.

    Notes
    -----
    A copy that keeps its time of modification changes the time of its attributes, the inode, or both. So do chmod, a
    hard link, a move to another disk, and file systems that number files anew when they are mounted. In these cases
    the content decides if there is a checksum of it. A file that was written anew has changed, even to the same
    content: the run may have read it half-written.
    """
    return [
        path
        for path in sorted(before | now)
        if path not in before or path not in now or not _is_same(path, before[path], now[path])
    ]


def _is_same(path, before, now):
    """Whether a file has the size, time and identity that it had, or else the size, time and content."""
    *state, checksum = before
    if state[:2] != now[:2]:
        return False
    return state == now[:4] or (checksum is not None and checksum == _checksum(path))


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


def kept_state(unfinished):
    """
    State of an unfinished run.

    Parameters
    ----------
    unfinished : pathlib.Path
        Hidden folder of the run.

    Returns
    -------
    state : dict
        Empty if the file is missing, or holds what no run writes.
    """
    try:
        state = json.loads((unfinished / STATE).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return state if isinstance(state, dict) else {}


def _check_same(unfinished, identity):
    kept, state = kept_state(unfinished), json.loads(identity[STATE])
    try:
        begun = (unfinished / BEGUN).read_text(encoding="utf-8")
        same = {key: kept[key] == state[key] for key in state}
        same["inputs"] = not changed_inputs(kept["inputs"], state["inputs"])
    except (ValueError, KeyError, TypeError):
        raise NotThisRun(f"{unfinished / STATE} is not what a run writes: begin again with --overwrite") from None
    if _keys(begun) != _keys(identity[BEGUN]):
        raise NotThisRun(
            f"the run to resume is of another scenario, with {_other_lines(begun, identity[BEGUN])}: "
            "leave out SCENARIO to go on with that one, or begin again with --overwrite"
        )
    said = {
        "versions": "was begun with other versions of its packages: begin again with --overwrite",
        "inputs": "was begun with an input file that has changed: begin again with --overwrite",
        "scene": "was begun with --scene or without it: give it as it was",
        "chips": f"was begun with {kept.get('chips')} chips: give it as it was",
    }
    for key in state:
        if not same[key]:
            raise NotThisRun(f"the run to resume {said[key]}")


def _keys(text):
    """Lines of a text in TOML that have keys, in their order: comments are no part of a scenario."""
    return [line.strip() for line in text.splitlines() if not line.startswith("#")]


def _other_lines(old, new):
    """Some of the lines that only the old of two texts has, without their comments."""
    lines = set(_keys(old)) - set(_keys(new))
    return ", ".join((sorted(line.partition("#")[0].strip() for line in lines) or ["keys"])[:3])


def check_inputs(before, now):
    """
    Refuse results of files that changed while they were read.

    Parameters
    ----------
    before : dict of str to list
        From `with_checksums`, at the start.
    now : dict of str to list of int
        From `inputs_of`.

    Raises
    ------
    ValueError
        If a file is not what it was.
    """
    if changed := changed_inputs(before, now):
        raise ValueError(
            f"{changed[0]} changed while it was read, so that nothing of this run is kept: "
            "begin again when the file is whole"
        )


def check_finished(path, old, new, inputs):
    """
    Refuse to resume a finished run that is not the one asked for.

    Parameters
    ----------
    path : pathlib.Path
        File of the scenario or study in the folder of the results, written at the end of the run.
    old, new : str
        Text of the scenario or study, of the finished run and of the one asked for.
    inputs : dict of str to list of int
        From `inputs_of`.

    Raises
    ------
    ValueError
        If it is another run, or if an input file is newer than the results.
    """
    cure = "name another folder with -o, or run it again with --overwrite"
    if old != new:
        raise ValueError(
            f"{path.parent} holds the finished run of another scenario, with {_other_lines(old, new)}: {cure}"
        )
    written = path.stat().st_mtime_ns
    for name, (_, modified, changed, *_) in inputs.items():
        if max(modified, changed) > written:
            raise ValueError(f"{path.parent} holds a finished run that is older than its input {name}: {cure}")
