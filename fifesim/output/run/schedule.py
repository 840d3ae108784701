"""Compute blocks of lazy arrays one after the other, in an order that leaves little waiting in memory."""

import heapq
from collections import defaultdict
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait

import dask
from dask.core import get_dependencies
from dask.highlevelgraph import HighLevelGraph, MaterializedLayer
from distributed import KilledWorker, as_completed

from fifesim.rasters.windows import is_cut

# A worker that dies takes a task with it; one that kills its workers this often is at fault itself.
_RETRIES = 3


def ordered_blocks(arrays, wanted):
    """
    Tasks of blocks, and the order to run them in.

    Parameters
    ----------
    arrays : mapping of str to dask.array.Array
    wanted : sequence of (str, tuple of int)
        Names and block indices, in the order in which they are wanted.

    Returns
    -------
    graph : dict
        Task of each key.
    outputs : dict of key to (str, tuple of int)
    order : dict of key to int
        Depth first, so that what a block needs is made just before it; parts cut off a chunk are next after it.
    """
    graph = {}
    names = list(arrays)
    optimized = dict(zip(names, dask.optimize(*arrays.values()), strict=True))
    for array in optimized.values():
        graph.update(array.__dask_graph__())
    outputs = {(optimized[name].name, *index): (name, index) for name, index in wanted}
    needs = {}
    stack = list(outputs)
    while stack:
        key = stack.pop()
        if key not in needs:
            needs[key] = get_dependencies(graph, key)
            stack.extend(needs[key])
    return {key: graph[key] for key in needs}, outputs, _depth_first(outputs, needs)


def run_on_threads(graph, outputs, order, deliver, threads):
    """
    Run tasks on threads of this process, each as soon as it can in the order given.

    Parameters
    ----------
    graph, outputs, order
        From `ordered_blocks`.
    deliver : callable
        ``deliver(name, index, block)`` takes each output, in this thread.
    threads : int

    Raises
    ------
    Exception
        Whatever a task or ``deliver`` raises; tasks that run are finished first.
    """
    needs = {key: get_dependencies(graph, key) for key in graph}
    users = _reversed(needs)
    missing = {key: len(found) for key, found in needs.items()}
    left = {key: len(users[key]) for key in graph}
    ready = [(order[key], key) for key, count in missing.items() if not count]
    heapq.heapify(ready)
    results, running = {}, {}
    pool = ThreadPoolExecutor(threads)
    try:
        while ready or running:
            # One more than there are threads, so that none waits for this loop.
            while ready and len(running) <= threads:
                key = heapq.heappop(ready)[1]
                small = {need: results[need] for need in needs[key]} | {key: graph[key]}
                running[pool.submit(dask.get, small, key)] = key
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                key = running.pop(future)
                result = future.result()
                if key in outputs:
                    deliver(*outputs[key], result)
                for need in needs[key]:
                    left[need] -= 1
                    if not left[need]:
                        del results[need]
                if left[key]:
                    results[key] = result
                for user in users[key]:
                    missing[user] -= 1
                    if not missing[user]:
                        heapq.heappush(ready, (order[user], user))
                del result
    finally:
        pool.shutdown(cancel_futures=True)


def run_on_client(graph, outputs, order, deliver, client):
    """
    Run tasks on the workers of a cluster; a task that dies with its worker is run again.

    Parameters
    ----------
    graph, outputs, order, deliver
        As in `run_on_threads`; outputs are delivered in this process.
    client : distributed.Client

    Raises
    ------
    RuntimeError
        If a task has killed its workers too often.
    Exception
        Whatever a task or ``deliver`` raises.
    """
    layer = MaterializedLayer(graph, annotations={"priority": _Priority(order), "retries": _RETRIES})
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

    def __init__(self, order):
        self._order = order

    def __call__(self, key):
        return -self._order[key]


def _depth_first(outputs, needs):
    """Number of each task when what it needs is numbered before it, and its cuts right after it."""
    cuts = defaultdict(list)
    for key, found in needs.items():
        if is_cut(key):
            for need in found:
                cuts[need].append(key)
    order = {}
    for output in outputs:
        stack = [output]
        while stack:
            key = stack[-1]
            missing = [need for need in needs[key] if need not in order]
            if key in order or not missing:
                stack.pop()
                for each in (key, *sorted(cuts[key], key=str)):
                    order.setdefault(each, len(order))
            else:
                stack.extend(sorted(missing, key=str, reverse=True))
    return order


def _reversed(needs):
    users = defaultdict(list)
    for key, found in needs.items():
        for need in found:
            users[need].append(key)
    return users
