"""Blocks of lazy arrays computed by dask, in an order that leaves little waiting in memory."""

from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from functools import partial

import dask.threaded
from dask.core import get_deps, quote
from dask.highlevelgraph import HighLevelGraph, MaterializedLayer
from dask.order import order

from fifesim.output.run.workers import RETRIES, results_of

# Outputs whose tasks are put in order together.
_PIECE = 600


def tasks_of(arrays, wanted):
    """
    Tasks of blocks.

    Parameters
    ----------
    arrays : mapping of str to dask.array.Array
    wanted : sequence of (str, tuple of int)
        Names and block indices, in the order in which they are wanted.

    Returns
    -------
    graph : dict
        Task of each key. What several arrays need is in it once, as it would not be if dask optimised each of them.
    outputs : dict of key to (str, tuple of int)
        In the order in which they are wanted.
    """
    outputs = {(arrays[name].name, *index): (name, index) for name, index in wanted}
    whole = HighLevelGraph.merge(*(array.dask for array in arrays.values()))
    return dict(whole.cull(set(outputs))), outputs


def run_on_threads(graph, outputs, deliver, threads):
    """
    Run tasks on threads of this process.

    Parameters
    ----------
    graph, outputs
        From `tasks_of`.
    deliver : callable
        ``deliver(name, index, block)`` takes each output as it is wanted, one after the other.
    threads : int

    Raises
    ------
    Exception
        Whatever a task or ``deliver`` raises; tasks that run are finished first.
    """
    pool, kept = ThreadPoolExecutor(threads), {}
    try:
        for tasks, last, waiting in _in_pieces(graph, outputs, deliver):
            _, *values = dask.threaded.get(tasks | kept, [last, *waiting], pool=pool)
            kept = {key: quote(value) for key, value in zip(waiting, values, strict=True)}
    finally:
        pool.shutdown(cancel_futures=True)


def run_on_client(graph, outputs, deliver, client):
    """
    Run tasks on the workers of a cluster; a task that dies with its worker is run again.

    Parameters
    ----------
    graph, outputs, deliver
        As in `run_on_threads`; outputs are delivered in this process, as they come.
    client : distributed.Client

    Raises
    ------
    RuntimeError
        If a task has killed its workers too often.
    Exception
        Whatever a task or ``deliver`` raises.
    """
    ranks = {}
    for tasks, _, _ in _in_pieces(graph, outputs, deliver):
        ranks |= {key: len(ranks) + rank for key, rank in order(tasks).items()}
    layer = MaterializedLayer(graph, annotations={"priority": _Priority(ranks), "retries": RETRIES})
    whole = HighLevelGraph({"blocks": layer}, {"blocks": set()})
    futures = dict(zip(client.get(whole, list(outputs), sync=False, optimize_graph=False), outputs, strict=True))
    # Closed even if a delivery fails, so that no task goes on.
    with closing(results_of(client, futures)) as found:
        for key, result in found:
            deliver(*outputs[key], result)


class _Priority:
    """Rank of a key in an order, the first the highest."""

    def __init__(self, ranks):
        self._ranks = ranks

    def __call__(self, key):
        return -self._ranks[key]


def _in_pieces(graph, outputs, deliver):
    """
    The tasks of some outputs after those of others: tasks, the last of them, and those whose results still wait then.

    dask goes into the depth of what is asked first. A delivery waits for the one before it, so that outputs are made
    one after the other, and no chunk waits for an output that is far off. In pieces, as the memory that dask needs to
    order such a chain grows with its square.
    """
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
    """A task and all that it needs and that is not made."""
    needed, asked = set(), [key]
    while asked:
        each = asked.pop()
        if each not in made and each not in needed:
            needed.add(each)
            asked += dependencies[each]
    return needed


def _deliver(deliver, name, index, block, before):
    deliver(name, index, block)
