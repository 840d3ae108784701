"""Whether a run fits on this machine, by arithmetic, before anything is made."""

import errno
import math
import os
import shutil
from pathlib import Path

import psutil
from dask.utils import format_bytes

from fifesim.ground.landscape.field import TILE

# Tasks of a chunk of cells on terrain, as dask holds them; twice what they were measured to take. [byte]
_GRAPH = 120_000

# Of a cell of a field, with its transform. [byte]
_CELL = 48

# Of a cell of a scene from its field to its image, all in memory; measured, and half as much again. [byte]
_CELL_IN_MEMORY = 400

# Of a pixel of the truth, beside the bands. [byte]
_TRUTH = 16

# Blocks, the stream, its copy with overviews.
_COPIES = 3.4


def disk_of(scenario, scene=False):
    """
    Disk that a run needs while it computes.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
        Complete.
    scene : bool, optional
        With the products of the scene.

    Returns
    -------
    least, most : float
        The blocks alone, and with the files that are made of them, the products of the scene in full. [byte]
    """
    bands = len(scenario.sensor.bands)
    blocks = _pixels(scenario) * (bands * math.ceil(scenario.sensor.description.bits / 8) + _TRUTH)
    return blocks, _COPIES * blocks + (_cells(scenario) * 8 * (bands + 2) if scene else 0)


def check_size(scenario, folder):
    """
    Refuse a run that cannot fit.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
        Complete.
    folder : path
        Of its results.

    Raises
    ------
    ValueError
        If memory does not suffice; the message says what is needed, what is free, and what fits.
    OSError
        If the disk does not suffice; other programs may free some of it.
    """
    grid, cells = scenario.grid, _cells(scenario)
    at_once = cells if scenario.ground.method == "periodic" else min(cells, TILE**2)
    memory = cells / TILE**2 * _GRAPH + at_once * _CELL, psutil.virtual_memory().available / 2
    place = _existing(folder)
    disk = disk_of(scenario)[0], shutil.disk_usage(place).free
    if not disk[1]:
        raise OSError(f"{os.strerror(errno.ENOSPC)} in {place}: name another output folder with -o")
    for kind, said, (needed, free) in (
        (ValueError, "too large for the memory", memory),
        (OSError, os.strerror(errno.ENOSPC), disk),
    ):
        if needed > free:
            fits = math.sqrt(grid.width * grid.height * free / needed)
            raise kind(
                f"{said}: {cells:.3g} cells and {_pixels(scenario):.3g} pixels need {format_bytes(int(needed))}, "
                f"of which {format_bytes(int(free))} may be taken here; grid.width = grid.height = {fits:.2g} fits, "
                "or larger cells and pixels"
            )


def check_cells(cells):
    """
    Refuse scenes that are computed in memory and do not fit.

    Parameters
    ----------
    cells : int
        Along the edge.

    Raises
    ------
    ValueError
        If memory does not suffice, with what fits.
    """
    needed, free = cells**2 * _CELL_IN_MEMORY, psutil.virtual_memory().available / 2
    if needed > free:
        raise ValueError(
            f"cells = {cells}: a scene of so many along its edge needs {format_bytes(needed)} of memory, of which "
            f"{format_bytes(int(free))} may be taken here: cells = {int(math.sqrt(free / _CELL_IN_MEMORY)):.2g} fits"
        )


def _cells(scenario):
    return scenario.grid.width / scenario.grid.cell * (scenario.grid.height / scenario.grid.cell)


def _pixels(scenario):
    return scenario.grid.width / scenario.sensor.pixel * (scenario.grid.height / scenario.sensor.pixel)


def _existing(folder):
    """The folder, or the first above it that there is."""
    folder = Path(folder).absolute()
    return next(each for each in (folder, *folder.parents) if each.exists())
