"""Lazy arrays that are computed by themselves."""

import threading

import dask
import dask.array as da
import numpy as np
import pytest
from distributed import Client, LocalCluster
from lazy import no_compute

from fifesim.grids import chunks
from fifesim.grids.chunks import all_apart, apart


def counted(calls):
    """A lazy array that notes each of its blocks when it is made."""

    def make(zeros, block_info):
        calls.append(tuple(block_info[None]["chunk-location"]))
        (top, bottom), (left, right) = block_info[None]["array-location"]
        return zeros + np.add.outer(1000.0 * np.arange(top, bottom), np.arange(left, right))

    return da.zeros((60, 80), chunks=(20, 30)).map_blocks(make, dtype=float, meta=np.empty((0, 0)))


def rechunked():
    """What dask's own copy of a graph loses tasks of: an array of another's chunks, sampled by slices and lists."""
    source = da.from_array(np.arange(4800.0).reshape(60, 80), chunks=(20, 30)) + 1
    return source.rechunk((7, 80))[::3, [5, 2, 2, 70]].rechunk((4, 3))


@pytest.mark.parametrize("scheduler", ["synchronous", "threads", "processes"])
def test_values_are_those_of_the_array(scheduler):
    array = rechunked()
    found = apart(array)
    assert (found.shape, found.dtype, found.numblocks) == (array.shape, array.dtype, (1, 1))
    workers = {"num_workers": 1} if scheduler == "processes" else {}
    np.testing.assert_array_equal(found.compute(scheduler=scheduler, **workers), array.compute())


def test_one_task_keeps_to_its_thread():
    """It waits for no other: a pool of one thread, and a cluster of one worker, come to an end."""
    threads = set()

    def note(block):
        threads.add(threading.get_ident())
        return block

    blocks = da.ones((60, 80), chunks=(5, 5)).map_blocks(note, dtype=float, meta=np.empty((0, 0)))
    with dask.config.set(scheduler="threads", num_workers=2):
        assert apart(blocks).sum().compute() == 4800
    assert len(threads) == 1
    options = {"n_workers": 1, "threads_per_worker": 1, "processes": False, "dashboard_address": None}
    with LocalCluster(**options) as cluster, Client(cluster) as client:
        assert client.compute(apart(blocks).sum()).result(timeout=20) == 4800


@pytest.mark.parametrize("dtype", [np.float32, np.int16, bool])
def test_kind_of_number_is_kept(dtype):
    array = da.ones((4, 6), chunks=3, dtype=dtype)
    assert apart(array).dtype == dtype and apart(array).compute().dtype == dtype


def test_nothing_is_computed_early():
    calls = []
    with no_compute():
        lazy = apart(counted(calls))[::2] + 1
    assert lazy.shape == (30, 80) and not calls


def test_blocks_are_made_for_the_sample_and_again_for_what_uses_them():
    """Else each would wait in memory for the last: the sample is of all, and what uses it has them one by one."""
    calls = []
    array = counted(calls)
    total = apart(array[::4, ::4]).sum()
    found = (array - total).sum(axis=1).compute(scheduler="synchronous")
    assert sorted(calls) == sorted(2 * [(row, column) for row in range(3) for column in range(3)])
    whole = np.add.outer(1000.0 * np.arange(60), np.arange(80))
    np.testing.assert_allclose(found, (whole - whole[::4, ::4].sum()).sum(axis=1), rtol=1e-12)


def test_no_task_is_shared_with_the_array():
    array = rechunked()
    assert not set(apart(array).__dask_graph__()) & set(array.__dask_graph__())


def test_the_same_array_has_the_same_key_and_is_computed_once():
    """Bits of a graph that are the same are one task, and other arrays are others."""
    calls = []
    array = counted(calls)
    one, other = apart(array), apart(array)
    assert one.name == other.name and one.name != apart(array + 1).name
    dask.compute(one, other, scheduler="synchronous")
    assert len(calls) == 9
    assert apart(rechunked()).name == apart(rechunked()).name


def test_what_fails_in_it_is_told():
    def refuse(block):
        raise ValueError("brightness must be in [-1, 1]")

    array = da.ones((4, 4), chunks=2).map_blocks(refuse, dtype=float, meta=np.empty((0, 0)))
    with pytest.raises(ValueError, match="brightness must be in"):
        apart(array).compute()


def test_what_several_need_is_made_once():
    calls = []
    array = counted(calls)
    found = dask.compute(*all_apart([array[::4, ::4], array.sum(axis=0)]), scheduler="synchronous")
    assert len(calls) == 9
    np.testing.assert_array_equal(found[0], array.compute()[::4, ::4])
    np.testing.assert_array_equal(found[1], array.compute().sum(axis=0))


def test_samples_of_samples_are_made_once_by_all_threads():
    """And each who asks has values of its own."""
    calls = []
    few = apart(counted(calls)[::3, ::3])
    many = [apart(few + number) for number in range(6)]
    with dask.config.set(scheduler="threads", num_workers=3):
        dask.compute(few, *many)
    assert len(calls) == 9
    first = few.compute(scheduler="synchronous")
    first += 1
    np.testing.assert_array_equal(few.compute(scheduler="synchronous"), first - 1)


def test_large_samples_are_not_kept(monkeypatch):
    monkeypatch.setattr(chunks, "_FEW", 100)
    calls = []
    few = apart(counted(calls)[::3, ::3])
    for times in (1, 2):
        few.compute(scheduler="synchronous")
        assert len(calls) == 9 * times
