"""Reproduction of a file of a run from its tags, with a comparison bit by bit."""

import json
import os
import tempfile
import tomllib
from pathlib import Path
from typing import NamedTuple

import numpy as np
import rasterio

from fifesim.base.files import in_a_line, shown
from fifesim.grids.opening import errors_of_gdal, raster_file
from fifesim.output.folders import versions
from fifesim.output.identity import PRODUCT, SCENARIO_TAG, VERSIONS
from fifesim.output.run_folder import simulate_to_folder
from fifesim.scenario.scenario import parse_scenario
from fifesim.scenario.toml import named_files, with_folder

# Longer tags were not written by fifesim. [character]
_LONGEST = 1_000_000


class Rerun(NamedTuple):
    """Result of the comparison of a file with its reproduction."""

    cells: int  # in all bands
    differing: int
    largest: float  # difference
    versions: dict  # of packages that differ, in the original run and here; "none" if missing


def rerun(path, output=None, *, overwrite=False, threads=None):
    """Reproduce a file of a run from the scenario in its tags, and compare the values bit by bit."""
    path = Path(path)
    scenario, product, before = read_origin(path)
    output = None if output is None else Path(output)
    if output is not None and output.exists() and not overwrite:
        raise ValueError(f"there is a file {in_a_line(output, 150)}: name another with -o, or add --overwrite")
    home = (path if output is None else output).absolute().parent
    with tempfile.TemporaryDirectory(prefix=".rerun-", dir=home if output is not None else None) as folder:
        run = Path(folder) / "run"
        simulate_to_folder(scenario, run, threads=threads, home=home)
        differing, cells, largest = _compared(path, run / product)
        if output is not None:
            os.replace(run / product, output)
    here = versions()
    pairs = {name: (before.get(name, "none"), here.get(name, "none")) for name in before | here}
    return Rerun(cells, differing, largest, {name: pair for name, pair in pairs.items() if pair[0] != pair[1]})


def read_origin(path):
    """Scenario, product and versions of a file of a run, from its tags."""
    file = raster_file(path)
    with errors_of_gdal(f"cannot read {file.name}"), file.opened() as source:
        tags = source.tags()
    if not {SCENARIO_TAG, PRODUCT, VERSIONS} <= set(tags):
        raise ValueError(
            f"{file.name} has no provenance: image.tif and truth.tif of fifesim simulate have it since "
            "version 0.2; for older ones, run the scenario.toml in the same folder"
        )
    try:
        product, before = tags[PRODUCT], json.loads(tags[VERSIONS])
        if max(len(tags[SCENARIO_TAG]), len(tags[VERSIONS])) > _LONGEST or product not in ("image.tif", "truth.tif"):
            raise ValueError("a product that no run has")
        if not isinstance(before, dict) or not all(isinstance(each, str) for each in before.values()):
            raise ValueError("no versions")
        values = tomllib.loads(tags[SCENARIO_TAG])
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{file.name} has tags that fifesim did not write: {in_a_line(error, 100)}") from None
    folder = Path(path).absolute().parent
    _check_inputs(values, folder, file.name)
    try:
        return parse_scenario(with_folder(values, folder)), product, before
    except ValueError as error:
        maker, here = before.get("fifesim", "unknown"), versions()["fifesim"]
        if maker == here:
            raise
        raise ValueError(
            f"{file.name} was made by fifesim {in_a_line(maker, 20)}, here is {here}, which refuses its scenario: "
            f"{in_a_line(str(error).splitlines()[0], 200)}"
        ) from None


def _check_inputs(values, folder, name):
    """Raise ValueError if an input file of the scenario is missing at its path relative to the file."""
    for place, table, key in named_files(values):
        there = os.path.normpath(folder / table[key])
        if not os.path.exists(there) and not there.startswith("/vsi"):
            raise ValueError(
                f"{name} was made from {'.'.join((*place, key))} = {shown(table[key])}, relative to its"
                f" folder, but {in_a_line(there, 120)} does not exist: rerun it in its original folder, or copy that "
                "file"
            )


def outcome_in_words(path, found):
    """Sentence on whether a reproduced file is identical."""
    other = ", ".join(f"{name} {before}, here {here}" for name, (before, here) in found.versions.items())
    made = f"; it was made with {other}" if other else ""
    if found.differing == 0:
        return f"{path} made again: the same bits in all of {found.cells} values{made}"
    return (
        f"{path} made again: {found.differing} of {found.cells} values differ, by {found.largest:.3g} at most"
        f"{made or '; the versions are the same: did an input file change?'}"
    )


def _compared(one, other):
    """Number of differing values of two files, number of values, and largest difference, block by block."""
    differing, cells, largest = 0, 0, 0.0
    with rasterio.open(one) as first, rasterio.open(other) as second:
        for name in ("count", "shape", "dtypes", "crs"):
            before, now = getattr(first, name), getattr(second, name)
            if before != now:
                raise ValueError(f"{one} has the {name} {before}, its scenario gives {now}: the file was changed since")
        if not first.transform.almost_equals(second.transform, 1e-6):
            raise ValueError(f"{one} lies elsewhere than its scenario says: the file was changed since")
        for _, window in second.block_windows(1):
            before, now = first.read(window=window), second.read(window=window)
            same = (before == now) | ((before != before) & (now != now))
            differing += int(np.count_nonzero(~same))
            cells += same.size
            if not same.all():
                apart = np.abs(before[~same].astype(float) - now[~same].astype(float))
                largest = max(largest, float(np.nanmax(apart, initial=0.0)))
    return differing, cells, largest
