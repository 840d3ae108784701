"""Shards are whole when they come, whoever makes their chips and in whatever order."""

from types import SimpleNamespace

import numpy as np
import pytest

from fifesim.output.chips.arrays import chip_arrays, layout_of
from fifesim.output.chips.making import made_shards
from fifesim.output.chips.store import Shards
from fifesim.scenario.chips import chips_of
from fifesim.scenario.scenario import parse_scenario
from fifesim.scenario.studies import Study

SMALL = {"grid": {"width": 180.0, "height": 180.0}, "terrain": {"dem": "flat"}}


@pytest.fixture(scope="module")
def chips():
    return chips_of(Study(parse_scenario(SMALL), {"visibility": {"uniform": [10, 60]}}, landscapes=3), 7)


@pytest.fixture(scope="module")
def layout(chips):
    return layout_of(chips)


@pytest.fixture(scope="module")
def shards(layout):
    found = Shards(7, layout.size, 3)
    found.length = 3
    return found


def others(chips, seed):
    """Processes that answer in a drawn order."""

    def made(jobs, layout):
        for at in np.random.default_rng(seed).permutation(len(jobs)):
            yield jobs[at], chip_arrays(chips, jobs[at].chips, layout)

    return SimpleNamespace(number=2, made=made)


@pytest.mark.parametrize("seed", [None, 0, 1, 2])
def test_shards_are_those_of_the_chips_one_after_the_other(seed, chips, layout, shards):
    told = []
    makers = None if seed is None else others(chips, seed)
    found = dict(made_shards(chips, layout, shards, [0, 1, 2], told.append, makers=makers))
    assert sum(told) == 7 and set(found) == {0, 1, 2}
    for shard, arrays in found.items():
        for name, values in chip_arrays(chips, range(*shards.range_of(shard)), layout).items():
            np.testing.assert_array_equal(arrays[name], values)


def test_only_shards_that_are_wanted_are_made(chips, layout, shards):
    told = []
    found = dict(made_shards(chips, layout, shards, [2], told.append))
    assert set(found) == {2} and told and len(found[2]["dn"]) == 1
