"""Processes of this machine that make chips: each those of landscapes of its own, whose ground it keeps."""

import multiprocessing
import os
import signal
from collections import deque
from collections.abc import Callable
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing import connection
from typing import NamedTuple

import numpy as np

from fifesim.output.chips.arrays import chip_arrays
from fifesim.output.process import interrupts_blocked
from fifesim.scenario.chips import chips_of

# Not on Windows.
_FORKS = "forkserver" in multiprocessing.get_all_start_methods()
if _FORKS:
    from multiprocessing import forkserver, resource_tracker

# Landscapes of a process in so many groups: when others are done they take over some of them.
_GROUPS = 4

# The hills around a landscape take longer to make than one chip after the other: of so many shards they are made once.
_SHARDS_ON_HILLS = 4

# So many jobs a process has at hand: it does not wait for an answer to what it sent. [1]
_AT_HAND = 2

# Chips are many and small: a thread for each of their products would wait for the others.
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class Job(NamedTuple):
    """Some chips, and the group of landscapes that they lie in."""

    chips: np.ndarray
    group: int


class _Maker(NamedTuple):
    """A process that makes chips, the pipe to it, the jobs meant for it, and those that it has."""

    process: multiprocessing.process.BaseProcess
    pipe: connection.Connection
    queue: deque
    at_hand: deque


def jobs_of(chips, shards, wanted, makers):
    """
    What is to be done, in the order of the shards.

    Parameters
    ----------
    chips : fifesim.scenario.chips.Chips
    shards : fifesim.output.chips.store.Shards
    wanted : sequence of int
        Shards that are to be made.
    makers : int
        Processes.

    Returns
    -------
    jobs : list of Job
        Each chip of the shards once.
    """
    on_hills = chips.study.scenario.terrain.dem != "flat"
    step, groups = (_SHARDS_ON_HILLS, chips.study.landscapes) if on_hills else (1, makers * _GROUPS)
    jobs = []
    for first in range(0, len(wanted), step):
        ranges = [np.arange(*shards.range_of(shard)) for shard in wanted[first : first + step]]
        numbers = np.concatenate(ranges)
        group = chips.landscape[numbers] % groups
        jobs += [Job(numbers[group == each], int(each)) for each in np.unique(group)]
    return jobs


class Makers(NamedTuple):
    """Processes that make chips, from `makers_of`."""

    number: int
    begin: Callable

    def made(self, jobs, layout):
        """
        Make chips.

        Parameters
        ----------
        jobs : sequence of Job
        layout : fifesim.output.chips.arrays.Layout

        Yields
        ------
        job : Job
            In the order in which they are done.
        arrays : dict of str to array
            Of its chips.

        Raises
        ------
        ValueError
            As of `fifesim.output.chips.arrays.chip_arrays`.
        RuntimeError
            If a process ends by itself.
        """
        makers = self.begin() if jobs else []
        for maker in makers:
            maker.pipe.send(layout)
        for job in jobs:
            makers[job.group % len(makers)].queue.append(job)
        for maker in makers:
            _give(maker, makers)
        while working := {maker.pipe: maker for maker in makers if maker.at_hand}:
            for pipe in connection.wait(list(working)):
                maker = working[pipe]
                arrays = _answer(maker)
                job = maker.at_hand.popleft()
                _give(maker, makers)
                yield job, arrays


@contextmanager
def makers_of(study, count, number):
    """
    Processes that make the chips of a study; a context manager, with which they end.

    Parameters
    ----------
    study : fifesim.scenario.studies.Study
    count : int
        Chips in all.
    number : int
        Processes.

    Yields
    ------
    makers : Makers
    """
    # A server that has imported all once makes the processes, where the system has one: they begin at once and share
    # its memory. It has no threads, unlike this process, and imports while this one looks at the study.
    context, makers = multiprocessing.get_context("forkserver" if _FORKS else "spawn"), []
    with _environment(dict.fromkeys(_THREADS, "1")):
        if _FORKS:
            context.set_forkserver_preload([__name__])
            # The tracker ignores Ctrl-C by itself, but lets it in again here.
            resource_tracker.ensure_running()
            with interrupts_blocked():
                forkserver.ensure_running()
        try:
            yield Makers(number, partial(_begun, context, study, count, number, makers))
        finally:
            for maker in makers:
                maker.process.kill()
            for maker in makers:
                maker.process.join()
                maker.pipe.close()


def _begun(context, study, count, number, makers):
    """The processes, which are added to a list as they begin."""
    for _ in range(number):
        here, there = context.Pipe()
        process = context.Process(target=_work, args=(there, study, count), daemon=True)
        process.start()
        there.close()
        makers.append(_Maker(process, here, deque(), deque()))
    return makers


def _answer(maker):
    """The arrays that a process sends."""
    try:
        arrays, error = maker.pipe.recv()
    except (EOFError, ConnectionError):
        maker.process.join()
        raise RuntimeError(
            f"a process that made chips ended by itself (exit code {maker.process.exitcode}): is there too little "
            "memory? What is finished is kept, use --resume"
        ) from None
    if error is not None:
        raise error
    return arrays


def _give(maker, makers):
    """Give a process more to do: what is meant for it, else the last of what others have left."""
    while len(maker.at_hand) < _AT_HAND:
        longest = max(makers, key=lambda other: len(other.queue))
        if not (maker.queue or longest.queue):
            return
        job = maker.queue.popleft() if maker.queue else longest.queue.pop()
        # That it has ended is told where it is waited for.
        with suppress(BrokenPipeError):
            maker.pipe.send(job.chips)
        maker.at_hand.append(job)


def _work(pipe, study, count):
    """What a process does: chips that it is asked for, as long as somebody asks."""
    # Ctrl-C is for who started it, and ends it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    chips = chips_of(study, count)
    # Nobody is there any more.
    with suppress(EOFError, ConnectionError):
        layout = pipe.recv()
        while True:
            numbers = pipe.recv()
            try:
                answer = chip_arrays(chips, numbers, layout), None
            except (ValueError, OSError, MemoryError) as error:
                answer = None, error
            pipe.send(answer)


@contextmanager
def _environment(values):
    """Other variables of the environment for a while; those that are set stay."""
    added = {name: value for name, value in values.items() if name not in os.environ}
    os.environ.update(added)
    try:
        yield
    finally:
        for name in added:
            del os.environ[name]
