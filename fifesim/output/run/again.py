"""A file of a run made again from its own tags, and whether its bits are the same."""

import json
import os
import tempfile
import tomllib
from pathlib import Path
from typing import NamedTuple

import numpy as np
import rasterio

from fifesim.base.foreign import in_a_line, shown
from fifesim.output.provenance import versions
from fifesim.output.run.folder import simulate_to_folder
from fifesim.output.run.origin import PRODUCT, SCENARIO, VERSIONS
from fifesim.rasters.opening import ErrorsOfGdal, raster_file
from fifesim.scenario.scenario import parse_scenario
from fifesim.scenario.toml import named_files, with_folder

# A tag that is longer was not written here. [character]
_LONGEST = 1_000_000


class Rerun(NamedTuple):
    """
    A file made again beside the one that was there.

    Parameters
    ----------
    cells : int
        Over all bands.
    differing : int
        Of them.
    largest : float
        Difference.
    versions : dict of str to (str, str)
        What it was made with and what is here, of packages where these are two; "none" where there is none.
    """

    cells: int
    differing: int
    largest: float
    versions: dict


def rerun(path, output=None, *, overwrite=False, threads=None):
    """
    Make a file of a run again from the scenario in its tags, and compare the values bit by bit.

    Parameters
    ----------
    path : str or path
        ``image.tif`` or ``truth.tif`` of a run.
    output : str or path, optional
        Where the new file goes; by default nothing stays of it.
    overwrite : bool, optional
        Replace a file of that name.
    threads : int, optional
        One for each core by default.

    Returns
    -------
    found : Rerun

    Raises
    ------
    ValueError
        If the file has no scenario in its tags, the scenario cannot be simulated, such as for want of an input, or
        there is such an output and ``overwrite`` is not given.
    """
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
    names = [name for name in (*before, *here) if before.get(name) != here.get(name)]
    differ = {name: (before.get(name, "none"), here.get(name, "none")) for name in dict.fromkeys(names)}
    return Rerun(cells, differing, largest, differ)


def read_origin(path):
    """
    What a file of a run was made of.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    scenario : fifesim.scenario.scenario.Scenario
        Its files lie relative to the file.
    product : str
        Name of the file in the folder of a run.
    versions : dict of str to str
        Of the packages that made it.

    Raises
    ------
    ValueError
        If the tags do not say it.
    """
    file = raster_file(path)
    with ErrorsOfGdal(f"cannot read {file.name}"), file.opened() as source:
        tags = source.tags()
    if not {SCENARIO, PRODUCT, VERSIONS} <= set(tags):
        raise ValueError(
            f"{file.name} does not say what it was made of: image.tif and truth.tif of fifesim simulate do, from "
            "version 0.2; for older ones, run the scenario.toml that lies beside them"
        )
    try:
        product, before = tags[PRODUCT], json.loads(tags[VERSIONS])
        if max(len(tags[SCENARIO]), len(tags[VERSIONS])) > _LONGEST or product not in ("image.tif", "truth.tif"):
            raise ValueError("a product that no run has")
        if not isinstance(before, dict) or not all(isinstance(each, str) for each in before.values()):
            raise ValueError("no versions")
        values = tomllib.loads(tags[SCENARIO])
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
    """Files that a scenario names lie where they lay, seen from the file that was made of them."""
    for place, table, key in named_files(values):
        there = os.path.normpath(folder / table[key])
        if not os.path.exists(there) and not there.startswith("/vsi"):
            raise ValueError(
                f"{name} was made of {'.'.join((*place, key))} = {shown(table[key])}, seen from the folder that it lies"
                f" in, and there is no such file {in_a_line(there, 120)}: rerun it where the run wrote it, or put that "
                "file there"
            )


def in_words(path, found):
    """
    Whether a file is the same again, in words.

    Parameters
    ----------
    path : str or path
    found : Rerun

    Returns
    -------
    text : str
    """
    other = ", ".join(f"{name} {before}, here {here}" for name, (before, here) in found.versions.items())
    made = f"; it was made with {other}" if other else ""
    if found.differing == 0:
        return f"{path} made again: the same bits in all of {found.cells} values{made}"
    return (
        f"{path} made again: {found.differing} of {found.cells} values differ, by {found.largest:.3g} at most"
        f"{made or '; the versions are the same: did an input file change?'}"
    )


def _compared(one, other):
    """How many values of two files differ, of how many, and by how much at most; block by block."""
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
