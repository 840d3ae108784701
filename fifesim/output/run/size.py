"""Whether a run fits on this machine, by arithmetic, before anything is made."""

import math
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

# Of a pixel of one band while its chunk is made, and of the truth beside the bands. [byte]
_PIXEL, _TRUTH = 32, 16

# Blocks, the stream, its copy with overviews.
_COPIES = 3.4


def disk_of(scenario, scene=False):
    """
    Disk that a run needs while it computes, at most.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
        Complete.
    scene : bool, optional
        With the products of the scene.

    Returns
    -------
    disk : float
        [byte]
    """
    bands = len(scenario.sensor.bands)
    kept = _pixels(scenario) * (bands * math.ceil(scenario.sensor.description.bits / 8) + _TRUTH)
    return _COPIES * kept + (_cells(scenario) * 8 * (bands + 2) if scene else 0)


def check_size(scenario, folder, scene=False):
    """
    Refuse a run that cannot fit.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
        Complete.
    folder : path
        Of its results.
    scene : bool, optional
        With the products of the scene.

    Raises
    ------
    ValueError
        If memory or disk does not suffice; the message says what is needed, what is free, and what fits.
    """
    grid, own = scenario.grid, scenario.sensor
    cells, pixels = _cells(scenario), _pixels(scenario)
    memory, disk = psutil.virtual_memory().available / 2, shutil.disk_usage(_existing(folder)).free
    at_once = cells if scenario.ground.method == "periodic" else TILE**2
    in_chunk = min(TILE**2, cells) * (grid.cell / own.pixel) ** 2
    edge = math.sqrt(grid.width * grid.height)
    for what, needed, free, key, value, power in (
        ("memory", cells / TILE**2 * _GRAPH + min(at_once, cells) * _CELL, memory, "grid.width = grid.height", edge, 1),
        ("memory", in_chunk * len(own.bands) * _PIXEL, memory, "sensor.pixel", own.pixel, -1),
        ("disk", disk_of(scenario, scene), disk, "grid.width = grid.height", edge, 1),
    ):
        if needed > free:
            fits = value * math.sqrt(free / needed) ** power
            raise ValueError(
                f"{cells:.3g} cells and {pixels:.3g} pixels need {_bytes(needed)} of {what}, of which {_bytes(free)} "
                f"may be taken here: {key} = {fits:.2g} fits"
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
            f"cells = {cells}: a scene of so many along its edge needs {_bytes(needed)} of memory, of which "
            f"{_bytes(free)} may be taken here: cells = {int(math.sqrt(free / _CELL_IN_MEMORY)):.2g} fits"
        )


def _cells(scenario):
    return scenario.grid.width / scenario.grid.cell * (scenario.grid.height / scenario.grid.cell)


def _pixels(scenario):
    return scenario.grid.width / scenario.sensor.pixel * (scenario.grid.height / scenario.sensor.pixel)


def _existing(folder):
    """The folder, or the first above it that there is."""
    folder = Path(folder).absolute()
    return next(each for each in (folder, *folder.parents) if each.exists())


def _bytes(number):
    return format_bytes(int(number)) if number < 1e18 else f"{number:.1g} bytes"
