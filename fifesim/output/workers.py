"""Workers of a run: threads or a cluster, the schedule of blocks on them, and the memory that a run needs."""

import errno
import math
import os
import shutil
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import dask
import dask.threaded
import psutil
from dask.core import get_deps, quote
from dask.highlevelgraph import HighLevelGraph, MaterializedLayer
from dask.order import order
from dask.utils import format_bytes

from fifesim.ground.landscape.autoregression import FIELD_TILE

# Memory of the dask tasks of a chunk of cells on terrain: twice the measured size. [byte]
_GRAPH = 120_000

# Memory of a cell of a field with its transform. [byte]
_CELL = 48

# Memory of a cell of a scene from field to image: 1.5 times the measured size. [byte]
_CELL_IN_MEMORY = 400

# Disk space of the truth of a pixel. [byte]
_TRUTH = 16

# Disk space relative to the blocks: blocks, GeoTIFF, and its copy with overviews. [1]
_COPIES = 3.4


def disk_space(scenario, scene=False):
    """Disk space of a run [byte]: for blocks alone, and including files and scene products."""
    bands = len(scenario.sensor.bands)
    blocks = _pixels(scenario) * (bands * math.ceil(scenario.sensor.description.bits / 8) + _TRUTH)
    return blocks, _COPIES * blocks + (2 * _cells(scenario) * 8 * (bands + 2) if scene else 0)


def check_size(scenario, folder):
    """Raise ValueError if a run cannot fit."""
    grid, cells = scenario.grid, _cells(scenario)
    at_once = cells if scenario.ground.method == "periodic" else min(cells, FIELD_TILE**2)
    memory = cells / FIELD_TILE**2 * _GRAPH + at_once * _CELL, psutil.virtual_memory().available / 2
    folder = Path(folder).absolute()
    place = next(parent for parent in (folder, *folder.parents) if parent.exists())
    disk = disk_space(scenario)[0], shutil.disk_usage(place).free
    if not disk[1]:
        raise OSError(f"{os.strerror(errno.ENOSPC)} in {place}: name another output folder with -o")
    for kind, problem, (needed, free) in (
        (ValueError, "too large for the memory", memory),
        (OSError, os.strerror(errno.ENOSPC), disk),
    ):
        if needed > free:
            fits = math.sqrt(grid.width * grid.height * free / needed)
            raise kind(
                f"{problem}: {cells:.3g} cells and {_pixels(scenario):.3g} pixels need {format_bytes(int(needed))}, "
                f"of which {format_bytes(int(free))} may be taken here; grid.width = grid.height = {fits:.2g} fits, "
                "or larger cells and pixels"
            )


def check_memory_of_cells(cells):
    """Raise ValueError if scenes computed in memory cannot fit."""
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


# HTTP pages of distributed, which disclose addresses.
_PAGES = ("distributed.scheduler.http.routes", "distributed.worker.http.routes")

# Time to wait for an answer of a scheduler. [s]
_TIMEOUT = 20

RETRIES = 3
"""Number of times that a task is repeated after its worker died; a task that ends more workers is the cause."""


def usable_cores():
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def cluster(workers=None, scheduler=None):
    """Context manager of a client on new local workers, which use TLS, or on a running scheduler; None for neither."""
    if workers is not None and scheduler is not None:
        raise ValueError("--workers starts a cluster and --scheduler uses one that runs: give one of them")
    if workers is not None and workers < 1:
        raise ValueError(f"workers must be at least 1, got {workers}")
    if workers is None and scheduler is None:
        # With a name or None, dask would import distributed.
        with dask.config.set(scheduler=dask.config.get("scheduler", dask.threaded.get)):
            yield None
        return
    from distributed import Client, LocalCluster

    if scheduler is not None:
        try:
            client = Client(scheduler, timeout=_TIMEOUT, set_as_default=False)
        except (OSError, ValueError) as error:
            raise OSError(f"no scheduler answers at {scheduler}: {error}") from None
        with client:
            yield client
        return
    from distributed.security import Security

    # Anybody who reaches a scheduler or a worker can run code as this user, so the temporary certificate is required.
    guarded = {"protocol": "tls://", "host": "127.0.0.1", "security": Security.temporary(), "dashboard_address": None}
    with (
        dask.config.set({"distributed.worker.daemon": True} | {key: [] for key in _PAGES}),
        LocalCluster(n_workers=workers, threads_per_worker=1, silence_logs="ERROR", **guarded) as local,
        Client(local, set_as_default=False) as client,
    ):
        local.scheduler.http_server.stop()
        client.run(lambda dask_worker: dask_worker.http_server.stop())
        yield client


# Number of outputs whose tasks are ordered together.
_PIECE = 600


def tasks_of(arrays, wanted):
    """Tasks of blocks, with shared tasks once, and the names and indices of the outputs by key."""
    outputs = {(arrays[name].name, *index): (name, index) for name, index in wanted}
    whole = HighLevelGraph.merge(*(array.dask for array in arrays.values()))
    return dict(whole.cull(set(outputs))), outputs


def run_on_threads(graph, outputs, deliver, threads):
    """Run tasks on threads of this process, and deliver each output in order."""
    pool, kept = ThreadPoolExecutor(threads), {}
    try:
        for tasks, last, waiting in _in_pieces(graph, outputs, deliver):
            _, *values = dask.threaded.get(tasks | kept, [last, *waiting], pool=pool)
            kept = {key: quote(value) for key, value in zip(waiting, values, strict=True)}
    finally:
        pool.shutdown(cancel_futures=True)


def run_on_client(graph, outputs, deliver, client):
    """Run tasks on a cluster, and deliver outputs as they finish; a task that dies with its worker is repeated."""
    from distributed import KilledWorker, as_completed  # there already, where a client is

    ranks = {}
    for tasks, _, _ in _in_pieces(graph, outputs, deliver):
        ranks |= {key: len(ranks) + rank for key, rank in order(tasks).items()}
    layer = MaterializedLayer(graph, annotations={"priority": lambda key: -ranks[key], "retries": RETRIES})
    whole = HighLevelGraph({"blocks": layer}, {"blocks": set()})
    futures = dict(zip(client.get(whole, list(outputs), sync=False, optimize_graph=False), outputs, strict=True))
    try:
        for future, result in as_completed(list(futures), loop=client.loop, with_results=True):
            deliver(*outputs[futures.pop(future)], result)
            future.release()
    except KilledWorker as error:
        raise RuntimeError(f"{error}: a worker may lack memory. Finished blocks are kept, use --resume") from None
    finally:
        # Cancel all tasks after an error.
        client.cancel(list(futures), force=True)


def _in_pieces(graph, outputs, deliver):
    """Split tasks into pieces by outputs: tasks, the last of them, and the results that still wait."""
    # dask goes depth first into what is requested first. Each delivery depends on the one before, so that outputs are
    # made in turn and no chunk waits long. In pieces, because the memory for ordering such a chain grows with its
    # square.
    dependencies, dependents = get_deps(graph)
    made, waiting, wanted = set(), set(), list(outputs)
    for first in range(0, len(wanted), _PIECE):
        tasks, last = {}, None
        for key in wanted[first : first + _PIECE]:
            needed = _needed(key, dependencies, made)
            tasks |= {each: graph[each] for each in needed}
            made |= needed
            tasks["delivered", key] = (partial(_deliver, deliver, *outputs[key]), key, last)
            last = ("delivered", key)
        later = set(wanted[first + _PIECE :])
        waiting = [each for each in {*waiting, *tasks} & made if each in later or not dependents[each] <= made]
        yield tasks, last, waiting


def _needed(key, dependencies, made):
    """A task and all of its dependencies that are not computed yet."""
    needed, pending = set(), [key]
    while pending:
        each = pending.pop()
        if each not in made and each not in needed:
            needed.add(each)
            pending += dependencies[each]
    return needed


def _deliver(deliver, name, index, block, before):
    deliver(name, index, block)
