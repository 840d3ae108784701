"""Shards are delivered complete, in any order of computation and with any workers."""

import multiprocessing
import os
import random
import signal
import subprocess
import sys
from concurrent.futures import Executor, Future
from contextlib import suppress

import numpy as np
import psutil
import pytest

from fifesim.output.chips.makers import Makers, jobs_of, made_shards, processes
from fifesim.output.chips.store import Shards, chip_arrays, layout_of


def list_shards(length, count=30):
    shards = Shards(count, 1, length)
    shards.length = length
    return shards


@pytest.mark.parametrize("dem", ["flat", "flint-hills"])
@pytest.mark.parametrize("wanted", [range(5), [1, 4]])
def test_each_requested_chip_is_in_one_job(chips_on, dem, wanted):
    chips, shards = chips_on(30, 6, terrain={"dem": dem}), list_shards(6)
    found = np.concatenate(jobs_of(chips, shards, wanted, 2))
    expected = np.concatenate([np.arange(*shards.range_of(shard)) for shard in wanted])
    np.testing.assert_array_equal(np.sort(found), expected)


def test_chips_on_flat_ground_are_computed_shard_by_shard(chips_on):
    jobs = jobs_of(chips_on(30, 6), list_shards(6), range(5), 2)
    shards = np.concatenate(jobs) // 6
    assert (np.diff(shards) >= 0).all()
    assert all(len(set(job // 6)) == 1 for job in jobs)


def test_hills_of_a_landscape_are_computed_once_for_several_shards(chips_on):
    chips = chips_on(30, 6, terrain={"dem": "flint-hills"})
    jobs = jobs_of(chips, list_shards(6), range(5), 2)
    for job in jobs:
        assert len(set(chips.landscape[job])) == 1
    assert [len(job) for job in jobs] == [4] * 6 + [1] * 6


@pytest.fixture(scope="module")
def chips(chips_on):
    return chips_on(7)


@pytest.fixture(scope="module")
def layout(chips):
    return layout_of(chips)


@pytest.fixture(scope="module")
def shards():
    return list_shards(3, 7)


class Shuffled(Executor):
    """Run each two tasks in a random order when the second is submitted, and a remaining task alone."""

    def __init__(self, seed, number):
        self.random, self.waiting, self.left = random.Random(seed), [], number

    def submit(self, function, *arguments):
        future = Future()
        self.waiting.append((future, function, arguments))
        self.left -= 1
        if len(self.waiting) == 2 or not self.left:
            self.random.shuffle(self.waiting)
            for each, call, given in self.waiting:
                each.set_result(call(*given))
            self.waiting.clear()
        return future


@pytest.mark.parametrize("seed", [None, 0, 1, 2])
def test_shards_equal_those_of_sequential_computation(seed, chips, layout, shards):
    number = len(jobs_of(chips, shards, [0, 1, 2], 1))
    told, makers = [], None if seed is None else Makers(Shuffled(seed, number), 1, ())
    found = dict(made_shards(chips, layout, shards, [0, 1, 2], told.append, makers))
    assert sum(told) == 7 and set(found) == {0, 1, 2}
    for shard, arrays in found.items():
        for name, values in chip_arrays(chips, range(*shards.range_of(shard)), layout).items():
            np.testing.assert_array_equal(arrays[name], values)


def test_killed_process_is_reported(chips, layout, shards):
    with pytest.raises(RuntimeError, match="ended unexpectedly, perhaps from lack of memory"), processes(1) as makers:
        for _ in made_shards(chips, layout, shards, [0, 1, 2], [].append, makers):
            (process,) = multiprocessing.active_children()
            os.kill(process.pid, signal.SIGKILL)


def test_processes_end_with_their_parent(tmp_path):
    code = (
        "import os, signal\n"
        "from fifesim.output.chips.makers import processes\n"
        "if __name__ == '__main__':\n"
        "    with processes(1) as makers:\n"
        "        print(makers.executor.submit(os.getpid).result(), flush=True)\n"
        "        os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    (tmp_path / "main.py").write_text(code)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, tmp_path / "main.py"]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=environment)
    with suppress(psutil.NoSuchProcess):
        psutil.Process(int(done.stdout)).wait(timeout=30)
    assert not psutil.pid_exists(int(done.stdout))
