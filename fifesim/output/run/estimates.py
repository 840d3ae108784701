"""What a run will take on this machine, from a small piece of it."""

import json
import tempfile
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
from dask.utils import format_bytes, format_time

from fifesim.output.progress import memory
from fifesim.output.run.folder import simulate_to_folder
from fifesim.output.run.products import products_of, wanted_blocks
from fifesim.output.run.schedule import run_on_threads, tasks_of
from fifesim.output.run.size import check_size, disk_of
from fifesim.output.run.workers import usable_cores
from fifesim.rasters import grid as grids
from fifesim.scenario.simulation import simulate

# Side of the piece that is simulated to see how fast this machine is: a few chunks of the field. [cell]
_PIECE = 2016

# Beyond imports and task graph, memory holds chunks at work and chunks that wait for their neighbours. The piece has
# two chunks in a row; in a scene more of them wait. Peaks of scenes of n x n chunks relative to the piece, two threads:
# level ground 1.55 for n = 5 and 1.71 for n = 12, hills 1.28 to 1.63 for n = 5 and 1.57 to 1.99 for n = 9, three
# classes of cover on hills 1.47 for n = 5. So chunks wait up to the fifth column, and their rims beyond it. [1]
_COLUMNS, _WAITING_COLUMNS = 2, 5
_WAITING, _RIM = 0.25, 0.03

# Twice the difference between processes that do the same: 424 to 431 MiB in a run of 90 x 90 cells. [byte]
_SPREAD = 16 * 2**20

# Waiting for a thread to be free and writing files costs up to so much more than the computing alone. [1]
_SLACK = 1.1


def estimate(scenario, folder=".", *, threads=None, scene=False, start=0.0):
    """
    Cells, tasks, memory, disk and time of a run.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
    folder : path, optional
        Of its results.
    threads : int, optional
        Or workers; by default one for each core that this process may use.
    scene : bool, optional
        With the products of the scene.
    start : float, optional
        What a run needs before it begins, such as for imports. [s]

    Returns
    -------
    estimate : dict
        ``cells``, ``pixels``, ``tasks``, ``threads``, ``memory`` and ``disk`` [byte], ``seconds``.

    Raises
    ------
    ValueError
        If the scenario cannot be simulated, or does not fit on this machine.

    Notes
    -----
    A piece of up to 2016 x 2016 cells of the same ground is run whole once, with its report, and computed a second
    time. The first run gives the time that does not grow with the scene, the second one the time that does. Memory is
    the sum of imports, task graph, and what the piece takes above them, scaled to the rows of chunks of the scene.
    """
    complete = scenario.complete()
    check_size(complete, folder)
    threads = threads or usable_cores()
    tree = simulate(complete)
    found = products_of(tree)
    lai, image = tree["scene"]["lai"], found.arrays["image"]
    tasks = tasks_of(found.arrays, wanted_blocks(found, lai.chunks, grids.geobox(lai)))[0]
    before = memory()
    once, cells, rate, peak = _calibrate(complete, threads)
    return {
        "cells": lai.size,
        "pixels": image.shape[-2] * image.shape[-1],
        "tasks": len(tasks),
        "threads": threads,
        "memory": round(_SPREAD + before + (peak - before) * _growth(len(lai.chunks[-1]))),
        "disk": round(disk_of(complete, scene)[1]),
        "seconds": start + once + _SLACK * (lai.size - cells) / rate,
    }


def estimate_in_words(found, as_json=False):
    """
    An estimate in words.

    Parameters
    ----------
    found : dict
        From `estimate`.
    as_json : bool, optional

    Returns
    -------
    text : str
    """
    if as_json:
        return json.dumps({"event": "estimate"} | found)
    return "\n".join(
        [
            f"cells    {found['cells'] / 1e6:.1f} million, seen by {found['pixels'] / 1e6:.2f} million pixels",
            f"tasks    {found['tasks']}",
            f"memory   about {format_bytes(found['memory'])} with {found['threads']} threads or workers",
            f"disk     at most {format_bytes(found['disk'])} while it runs",
            f"time     about {format_time(found['seconds'])} on this machine as busy as it is now",
        ]
    )


def _growth(columns):
    """Memory that chunks of a scene take, at work and waiting, relative to the piece."""
    waiting = max(min(columns, _WAITING_COLUMNS) - _COLUMNS, 0)
    return 1 + _WAITING * waiting + _RIM * max(columns - _WAITING_COLUMNS, 0)


def _calibrate(scenario, threads):
    """Seconds of a whole run of a piece in the middle of the scene, its cells, cells per second, and peak memory."""
    piece = _piece(scenario)
    start = time.monotonic()
    # A piece without data has no files, where the scene may have some.
    with tempfile.TemporaryDirectory(prefix="fifesim-") as folder, suppress(ValueError):
        simulate_to_folder(piece, Path(folder) / "piece", threads=threads)
    once, used = time.monotonic() - start, [memory()]
    start = time.monotonic()
    tree = simulate(piece)
    found = products_of(tree)
    lai = tree["scene"]["lai"]
    tasks = tasks_of(found.arrays, wanted_blocks(found, lai.chunks, grids.geobox(lai)))
    run_on_threads(*tasks, lambda name, index, block: used.append(memory()), threads)
    return once, lai.size, lai.size / (time.monotonic() - start), max(used)


def _piece(scenario):
    """The same scenario on a smaller grid in its middle, of whole pixels."""
    grid, pixel = scenario.grid, scenario.sensor.pixel
    sizes = {}
    for name in ("width", "height"):
        size = getattr(grid, name)
        sizes[name] = min(size, max(np.floor(_PIECE * grid.cell / pixel), 2) * pixel)
    west = grid.west + np.floor((grid.width - sizes["width"]) / 2 / pixel) * pixel
    north = grid.north - np.floor((grid.height - sizes["height"]) / 2 / pixel) * pixel
    update = {name: float(value) for name, value in {**sizes, "west": west, "north": north}.items()}
    return scenario.model_copy(update={"grid": grid.model_copy(update=update)})
