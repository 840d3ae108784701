"""Processes make what one makes."""

import os
import signal

import numpy as np
import pytest

from fifesim.output.chips import makers as processes
from fifesim.output.chips.arrays import chip_arrays, layout_of
from fifesim.output.chips.makers import Job, jobs_of, makers_of
from fifesim.output.chips.store import Shards
from fifesim.scenario.chips import chips_of
from fifesim.scenario.scenario import parse_scenario
from fifesim.scenario.studies import Study

SMALL = {"grid": {"width": 180.0, "height": 180.0}, "terrain": {"dem": "flat"}}
DRAWS = {"visibility": {"uniform": [10, 60]}}


def chips_on(dem="flat", count=30, landscapes=6):
    return chips_of(Study(parse_scenario(SMALL | {"terrain": {"dem": dem}}), DRAWS, landscapes=landscapes), count)


def shards_of(length, count=30):
    shards = Shards(count, 1, length)
    shards.length = length
    return shards


@pytest.mark.parametrize("dem", ["flat", "flint-hills"])
@pytest.mark.parametrize("wanted", [range(5), [1, 4]])
def test_each_chip_that_is_wanted_is_in_one_job(dem, wanted):
    chips, shards = chips_on(dem), shards_of(6)
    jobs = jobs_of(chips, shards, wanted, 2)
    found = np.concatenate([job.chips for job in jobs])
    expected = np.concatenate([np.arange(*shards.range_of(shard)) for shard in wanted])
    np.testing.assert_array_equal(np.sort(found), expected)


def test_flat_ground_is_made_shard_by_shard_so_that_each_is_soon_whole():
    jobs = jobs_of(chips_on(), shards_of(6), range(5), 2)
    shards = np.concatenate([job.chips for job in jobs]) // 6
    assert (np.diff(shards) >= 0).all()
    assert all(len(set(job.chips // 6)) == 1 for job in jobs)


def test_hills_of_a_landscape_are_made_once_for_several_shards():
    chips = chips_on("flint-hills")
    jobs = jobs_of(chips, shards_of(6), range(5), 2)
    for job in jobs:
        assert len(set(chips.landscape[job.chips])) == 1
    assert [len(job.chips) for job in jobs] == [4] * 6 + [1] * 6


@pytest.fixture
def jobs():
    return [Job(np.array(numbers), group) for group, numbers in enumerate(([3, 0], [1], [2, 5, 4]))]


def test_processes_make_the_same_bits_and_end(jobs, monkeypatch):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    chips = chips_on(count=6)
    layout, found = layout_of(chips), []
    with makers_of(chips.study, 6, 2) as makers:
        for job, arrays in makers.made(jobs, layout):
            found.append(job.group)
            for name, values in chip_arrays(chips, job.chips, layout).items():
                np.testing.assert_array_equal(arrays[name], values)
        begun = processes.multiprocessing.active_children()
        assert len(begun) == 2
    assert sorted(found) == [0, 1, 2]
    assert not any(process.is_alive() for process in begun)
    assert "OMP_NUM_THREADS" not in os.environ


def test_a_process_says_what_it_could_not_make(jobs):
    chips = chips_on(count=6)
    layout = layout_of(chips)._replace(truth=())
    with (
        pytest.raises(ValueError, match=r"chip \d: has a truth that others have not, fpar, lai"),
        makers_of(chips.study, 6, 1) as makers,
    ):
        list(makers.made(jobs, layout))


def test_a_process_that_is_killed_is_told(jobs):
    chips = chips_on(count=6)
    with (
        pytest.raises(RuntimeError, match=r"ended by itself \(exit code -9\): is there too little memory"),
        makers_of(chips.study, 6, 1) as makers,
    ):
        for _ in makers.made(jobs, layout_of(chips)):
            (process,) = processes.multiprocessing.active_children()
            os.kill(process.pid, signal.SIGKILL)


def test_who_is_done_takes_the_last_of_what_others_have_left():
    class Pipe(list):
        send = list.append

    first, second = (processes._Maker(None, Pipe(), processes.deque(), processes.deque()) for _ in range(2))
    first.queue.extend(Job(np.array([number]), 0) for number in range(5))
    processes._give(second, [first, second])
    assert [each.tolist() for each in second.pipe] == [[4], [3]]
    processes._give(first, [first, second])
    assert [each.tolist() for each in first.pipe] == [[0], [1]]
    assert [job.chips.tolist() for job in first.queue] == [[2]]
