"""Identity of a run: its scenario, input files and package versions, also as tags of its files."""

import hashlib
import json
import os
from contextlib import suppress
from pathlib import Path

from fifesim.base.files import whole_file
from fifesim.grids.opening import archive_of, raster_file
from fifesim.output.folders import BEGUN, UNFINISHED, versions
from fifesim.scenario.scenario import read_scenario
from fifesim.scenario.toml import write_scenario
from fifesim.sensor.description.instruments import tables_of

SCENARIO_TAG, PRODUCT, VERSIONS = "FIFESIM_SCENARIO", "FIFESIM_PRODUCT", "FIFESIM_VERSIONS"


def origin_tags(scenario, product, folder):
    """Tags by which a file of a run can be reproduced."""
    home = os.path.abspath(folder)
    text = write_scenario(scenario.with_paths(lambda path: _relative_path(path, home)))
    return {SCENARIO_TAG: text, PRODUCT: product, VERSIONS: json.dumps(versions())}


def _relative_path(path, home):
    """Path relative to a folder; virtual files of GDAL and paths on other drives stay."""
    if not os.path.isfile(path):
        return path
    try:
        return Path(os.path.relpath(path, home)).as_posix()
    except ValueError:
        return path


SCENARIO, STATE = "scenario.toml", "run.json"
"""File of the scenario, and file of other properties that must not change in an unfinished run."""

# Input files of this size in all are compared by content if only their change time or inode differ. [byte]
_COMPARED = 2**30


class NotThisRun(ValueError):
    """Error: the folder holds another run, which must not be removed."""


def scenario_to_resume(folder):
    """Scenario of an unfinished or finished run, None if there is no run in the folder."""
    found = [path for path in (Path(folder) / UNFINISHED / BEGUN, Path(folder) / SCENARIO) if path.is_file()]
    return read_scenario(found[0]) if found else None


def state_of(inputs, begun, **options):
    """Properties that must agree for the blocks of two runs to fit together, as texts of files by name."""
    known = {
        "versions": versions(),
        "inputs": with_checksums(inputs),
        "scenario": hashlib.blake2b("\n".join(_keys(begun)).encode()).hexdigest(),
    }
    return {STATE: json.dumps(known | options), BEGUN: begun}


def inputs_of(scenario):
    """State of the input files of a scenario, including files that these name, such as the sources of a VRT."""
    # Size [byte], times of the last change of content and of attributes [ns], and inode, by path. A file in an archive
    # has the state of the archive.
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
    """State of files with a checksum of their content, or without where reading would take long."""
    small = sum(state[0] for state in inputs.values()) <= _COMPARED
    return {path: [*state, _checksum(path) if small else None] for path, state in inputs.items()}


def _checksum(path):
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "blake2b").hexdigest()


def changed_inputs(before, now):
    """Paths of input files that appeared, disappeared or changed."""
    # A copy that keeps its time of modification changes the time of its attributes, the inode, or both. So do chmod, a
    # hard link and a move to another disk, for which the checksum decides.
    return [
        path
        for path in sorted(before | now)
        if path not in before or path not in now or not _is_same(path, before[path], now[path])
    ]


def _is_same(path, before, now):
    """Whether a file has the same size, time and inode, or else the same size, time and content."""
    *state, checksum = before
    return state[:2] == now[:2] and (state == now[:4] or (checksum is not None and checksum == _checksum(path)))


def begin(unfinished, identity):
    """Begin a run, or check that the one begun is the same."""
    if (unfinished / BEGUN).is_file():
        _check_same(unfinished, identity)
        return
    # The last file marks the run as begun.
    for name, text in identity.items():
        with whole_file(unfinished / name) as new:
            new.write_text(text, encoding="utf-8")


def kept_json(path):
    """Object in a JSON file of a run, empty if the file is missing or invalid."""
    try:
        state = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return state if isinstance(state, dict) else {}


def _check_same(unfinished, identity):
    kept, state = kept_json(unfinished / STATE), json.loads(identity[STATE])
    try:
        begun = (unfinished / BEGUN).read_text(encoding="utf-8")
        same = {key: kept[key] == state[key] for key in state}
        same["inputs"] = not changed_inputs(kept["inputs"], state["inputs"])
    except (ValueError, KeyError, TypeError):
        raise NotThisRun(f"{unfinished / STATE} is invalid: start again with --overwrite") from None
    if _keys(begun) != _keys(identity[BEGUN]):
        raise NotThisRun(
            f"the unfinished run has another scenario, with {_other_lines(begun, identity[BEGUN])}: "
            "leave out SCENARIO to continue it, or start again with --overwrite"
        )
    reasons = {
        "versions": "was started with other package versions: start again with --overwrite",
        "inputs": "was started with an input file that has changed: start again with --overwrite",
        "scenario": f"has a file {BEGUN} that changed since it was written: start again with --overwrite",
        "scene": "was started with another setting of --scene: use the same",
        "chips": f"was started with {kept.get('chips')} chips: use the same number",
    }
    for key in state:
        if not same[key]:
            raise NotThisRun(f"the run to resume {reasons[key]}")


def _keys(text):
    """Lines of a TOML text without comments."""
    return [line.strip() for line in text.splitlines() if not line.startswith("#")]


def _other_lines(old, new):
    """Some of the lines that only the first of two texts has, without their comments."""
    lines = set(_keys(old)) - set(_keys(new))
    return ", ".join((sorted(line.partition("#")[0].strip() for line in lines) or ["keys"])[:3])


def check_inputs(before, now):
    """Raise ValueError if input files changed while they were read."""
    if changed := changed_inputs(before, now):
        raise ValueError(
            f"{changed[0]} changed while it was read, so this run is discarded: start again when the file is complete"
        )


def check_finished(path, old, new, inputs, item=None):
    """Raise ValueError if a finished run, with its STAC item if it has one, is not the requested one."""
    cure = "name another folder with -o, or run it again with --overwrite"
    with suppress(AttributeError, KeyError, TypeError):
        before, here = item["properties"]["processing:software"], versions()
        if odd := [f"{name} {before.get(name)}" for name in sorted(here) if before.get(name) != here[name]]:
            raise ValueError(f"{path.parent} has a finished run of other package versions, {', '.join(odd)}: {cure}")
    if old != new:
        raise ValueError(f"{path.parent} has a finished run of another scenario, with {_other_lines(old, new)}: {cure}")
    written = path.stat().st_mtime_ns
    for name, (_, modified, changed, *_) in inputs.items():
        if max(modified, changed) > written:
            raise ValueError(f"{path.parent} has a finished run that is older than its input {name}: {cure}")
