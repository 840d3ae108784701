"""Processes that make shards of chips, on this machine or on a cluster."""

import multiprocessing
import os
import pickle
import signal
from concurrent.futures import FIRST_COMPLETED, Executor, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from itertools import islice
from threading import Thread
from typing import NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from fifesim.base.caches import cached
from fifesim.output.chips.store import chip_arrays, empty_arrays
from fifesim.output.terminal import interrupts_blocked
from fifesim.output.workers import RETRIES
from fifesim.scenario.chips import chips_of

# Not on Windows.
_FORKS = "forkserver" in multiprocessing.get_all_start_methods()
if _FORKS:
    from multiprocessing import forkserver, resource_tracker

# Groups of landscapes per process, whose chips are made together.
_GROUPS = 4

# Number of shards for which the hills around a landscape are made once, because they take longer than many chips.
_SHARDS_ON_HILLS = 4

# Jobs submitted for each process: none waits for work, and few results wait to be written. [1]
_AT_HAND = 2


class Makers(NamedTuple):
    """Processes that make chips, how many they are, and the errors that say that one of them ended."""

    executor: Executor
    number: int
    ended: tuple[type[Exception], ...]


@contextmanager
def processes(number):
    """Processes of this machine that make chips; a context manager, with which they end."""
    # A fork server, where available, imports the libraries once, while this process validates the study. Its processes
    # start at once and share its memory. Unlike this process, it has no threads.
    context = multiprocessing.get_context("forkserver" if _FORKS else "spawn")
    if _FORKS:
        context.set_forkserver_preload([__name__])
        # The tracker ignores Ctrl-C, but restores the handler here.
        resource_tracker.ensure_running()
        with interrupts_blocked():
            forkserver.ensure_running()
    wanted, held = context.Pipe(duplex=False)
    executor = ProcessPoolExecutor(number, context, _begin, (wanted,))
    try:
        yield Makers(executor, number, (BrokenProcessPool,))
    finally:
        held.close()
        executor.shutdown(cancel_futures=True)
        wanted.close()


def _begin(wanted):
    """Prepare a process: it ends at once when the other end of a pipe is closed, or who holds that end is killed."""
    # The parent process handles Ctrl-C.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Chips are many and small: BLAS threads would wait for each other.
    threadpool_limits(1)
    Thread(target=_end_with, args=(wanted,), daemon=True).start()


def _end_with(wanted):
    with suppress(EOFError, OSError):
        wanted.recv()
    os._exit(1)


@contextmanager
def workers_of(client):
    """Workers of a cluster that make chips; a context manager, with which what they do is cancelled."""
    from distributed import KilledWorker  # there already, where a client is

    executor = client.get_executor(pure=False, retries=RETRIES)
    try:
        yield Makers(executor, max(len(client.ncores()), 1), (KilledWorker,))
    finally:
        executor.shutdown(wait=False)


def jobs_of(chips, shards, wanted, makers):
    """Chips that are made together, in the order of the shards."""
    on_hills = chips.study.scenario.terrain.dem != "flat"
    step, groups = (_SHARDS_ON_HILLS, chips.study.landscapes) if on_hills else (1, makers * _GROUPS)
    jobs = []
    for first in range(0, len(wanted), step):
        numbers = np.concatenate([np.arange(*shards.range_of(shard)) for shard in wanted[first : first + step]])
        group = chips.landscape[numbers] % groups
        jobs += [numbers[group == each] for each in np.unique(group)]
    return jobs


def made_shards(chips, layout, shards, wanted, advance, makers=None):
    """Iterate over shards and their arrays as they are finished."""
    jobs, begun = jobs_of(chips, shards, wanted, 1 if makers is None else makers.number), {}
    here = ((job, chip_arrays(chips, job, layout)) for job in jobs)
    for job, arrays in here if makers is None else _finished_jobs(makers, chips, jobs, layout):
        of = shards.shard_of(job)
        for shard in np.unique(of).tolist():
            first, last = shards.range_of(shard)
            whole, left = begun.pop(shard, None) or (empty_arrays(last - first, layout), last - first)
            for name, values in arrays.items():
                whole[name][job[of == shard] - first] = values[of == shard]
            left -= np.count_nonzero(of == shard)
            if left:
                begun[shard] = whole, left
            else:
                yield shard, whole
        advance(len(job))


def _finished_jobs(makers, chips, jobs, layout):
    """Jobs and the arrays of their chips, in order of completion."""
    known, waiting, working = pickle.dumps((chips.study, len(chips))), iter(jobs), {}
    try:
        while True:
            for job in islice(waiting, _AT_HAND * makers.number - len(working)):
                working[makers.executor.submit(_chip_arrays, known, job, layout)] = job
            if not working:
                return
            for future in wait(working, return_when=FIRST_COMPLETED).done:
                yield working.pop(future), future.result()
    except makers.ended as error:
        raise RuntimeError(
            f"a worker process ended unexpectedly, perhaps from lack of memory. Finished chips are kept, use "
            f"--resume ({error})"
        ) from None


def _chip_arrays(known, numbers, layout):
    """Arrays of some chips, where a study and the number of its chips are known by their pickle."""
    return chip_arrays(_chips(known), numbers, layout)


@cached(1, "chips of a study")
def _chips(known):
    return chips_of(*pickle.loads(known))
