"""Blocks of lazy arrays computed by dask, in an order that leaves little waiting in memory."""

from concurrent.futures import ThreadPoolExecutor
from functools import partial

import dask.threaded
from dask.highlevelgraph import HighLevelGraph, MaterializedLayer
from dask.order import order

# A worker that dies takes a task with it; one that kills its workers this often is at fault itself.
_RETRIES = 3


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
    pool = ThreadPoolExecutor(threads)
    try:
        dask.threaded.get(*_in_order(graph, outputs, deliver), pool=pool)
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
    from distributed import KilledWorker, as_completed  # there already, where a client is

    ranks = order(_in_order(graph, outputs, deliver)[0])
    layer = MaterializedLayer(graph, annotations={"priority": _Priority(ranks), "retries": _RETRIES})
    whole = HighLevelGraph({"blocks": layer}, {"blocks": set()})
    futures = dict(zip(client.get(whole, list(outputs), sync=False, optimize_graph=False), outputs, strict=True))
    try:
        for future, result in as_completed(list(futures), loop=client.loop, with_results=True):
            deliver(*outputs[futures.pop(future)], result)
            future.release()
    except KilledWorker as error:
        raise RuntimeError(f"{error}: has a worker too little memory? What is finished is kept, use --resume") from None
    finally:
        client.cancel(list(futures), force=True)


class _Priority:
    """Rank of a key in an order, the first the highest."""

    def __init__(self, ranks):
        self._ranks = ranks

    def __call__(self, key):
        return -self._ranks[key]


def _in_order(graph, outputs, deliver):
    """
    The graph with the delivery of each output, and the last of these, which is all that there is to ask for.

    dask goes into the depth of what is asked first. A delivery waits for the one before it, so that outputs are made
    one after the other, and no chunk waits for an output that is far off.
    """
    tasks, before = dict(graph), []
    for number, (key, place) in enumerate(outputs.items()):
        tasks[("delivered", number)] = (partial(_deliver, deliver, *place), key, before)
        before = [("delivered", number)]
    return tasks, before


def _deliver(deliver, name, index, block, before):
    deliver(name, index, block)
