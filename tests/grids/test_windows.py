"""Blocks made from windows of lazy arrays are those that numpy would make of the whole."""

import dask
import dask.array as da
import numpy as np
import pytest
import xarray as xr
from dask.core import get_dependencies

from fifesim.grids.windows import array_by_place, array_from_windows, gather, held, slices

CELLS = np.arange(11.0 * 13).reshape(11, 13)


def mean_of_three(array, chunks):
    """Mean of the cell and its neighbours to the west and east, NaN where one lies beyond."""

    def ask(rows, columns):
        return (), [(rows, slice(columns.start - 1, columns.stop + 1))]

    def kernel(window):
        return (window[:, :-2] + window[:, 1:-1] + window[:, 2:]) / 3

    return array_from_windows(kernel, [array], chunks, ask, token="mean-of-three")


@pytest.mark.parametrize("read", [-1, (3, 4), (11, 1)])
@pytest.mark.parametrize("made", [((11,), (13,)), ((2, 9), (5, 5, 3))])
def test_windows_come_together_from_any_chunks(read, made):
    found = mean_of_three(da.from_array(CELLS, chunks=read), made)
    assert found.chunks == made
    np.testing.assert_array_equal(found.compute()[:, 1:-1], CELLS[:, 1:-1])
    assert np.isnan(found.compute()[:, [0, -1]]).all()


def test_a_block_reads_its_own_window_only():
    read = []

    def cells(block_info=None):
        read.append(block_info[None]["chunk-location"])
        return np.zeros((2, 2))

    source = da.map_blocks(cells, chunks=((2, 2, 2), (2, 2, 2)), dtype=float, meta=np.empty((0, 0)))
    found = array_from_windows(lambda window: window, [source], ((2, 4), (2, 4)), lambda *at: ((), [at]), token="own")
    found.blocks[0, 0].compute(scheduler="synchronous")
    assert read == [(0, 0)]


@pytest.mark.parametrize(("columns", "cut"), [(4, True), (6, False)])
def test_little_of_a_chunk_is_cut_out_of_it_first(columns, cut):
    """So that the chunk need not wait in memory for others; a copy of most of it would be a second one."""
    source = da.ones((10, 10), chunks=10)
    found = array_from_windows(
        lambda window: window, [source], ((10,), (columns,)), lambda *at: ((), [at]), token="little"
    )
    assert any(str(key[0]).startswith("cut-") for key in found.dask if isinstance(key, tuple)) is cut
    assert found.compute().sum() == 10 * columns


def test_the_kernel_is_told_its_place():
    found = array_from_windows(
        lambda row, column: np.full((2, 3), 10.0 * row + column),
        [],
        ((2, 2), (3, 3)),
        lambda rows, columns: ((rows.start, columns.start), []),
        token="place",
    )
    np.testing.assert_array_equal(found.compute()[::2, ::3], [[0, 3], [20, 23]])


def test_cells_by_place_are_those_of_one_call():
    def kernel(row, column, shape):
        return CELLS[row : row + shape[0], column : column + shape[1]]

    np.testing.assert_array_equal(array_by_place(kernel, ((4, 7), (6, 6, 1)), token="cells").compute(), CELLS)


def test_what_lies_beside_a_chunk_by_place_is_made_with_the_block():
    """As a task of its own, dask may put it off, and the chunk waits for it."""
    cells = array_by_place(
        lambda row, column, shape: CELLS[row:, column:][: shape[0], : shape[1]], ((11,), (7, 6)), token="c"
    )
    found = mean_of_three(cells, cells.chunks)
    np.testing.assert_array_equal(found.compute()[:, 1:-1], CELLS[:, 1:-1])
    tasks = dict(found.dask)
    for column in (0, 1):
        needed = get_dependencies(tasks, (found.name, 0, column))
        assert {key for key in needed if isinstance(key, tuple)} == {(cells.name, 0, column)}


def test_slices_follow_each_other():
    assert slices((2, 3)) == [slice(0, 2), slice(2, 5)]


def test_a_gathered_window_is_missing_beyond_the_array():
    found = gather(CELLS, (slice(-1, 2), slice(11, 15)))
    np.testing.assert_array_equal(found[1:, :2], CELLS[:2, 11:])
    assert np.isnan(found[0]).all() and np.isnan(found[:, 2:]).all()


def test_parts_of_a_block_are_to_the_bit_the_block():
    """Made at seams, a block reads its rim from other chunks and the rest where it is."""
    cells = np.random.default_rng(3).random((2, 30, 40))
    array = da.from_array(cells, chunks=(2, 10, 10))

    def kernel(window):
        return window[:, :-2, :-2] + window[:, 2:, 2:]

    def ask(rows, columns):
        return (), [tuple(slice(each.start, each.stop + 2) for each in (rows, columns))]

    made = ((8, 10, 10), (8, 10, 20))
    options = {"token": "parts", "leading": (2,), "seams": ([10, 20], [10, 20, 30])}
    found = array_from_windows(kernel, [array], made, ask, **options)
    np.testing.assert_array_equal(found.compute(scheduler="synchronous"), cells[:, :-2, :-2] + cells[:, 2:, 2:])


def test_a_dataset_of_an_array_and_what_is_made_of_it_is_computed():
    """dask fuses the two, and misses the first, where it is not held."""
    image = held(da.from_array(CELLS, chunks=5) + 1.0)
    dataset = xr.Dataset({"image": (("y", "x"), image), "index": (("y", "x"), image * 2)})
    found = dask.compute(dataset)[0]
    np.testing.assert_array_equal(found["image"], CELLS + 1)
    np.testing.assert_array_equal(found["index"], 2 * CELLS + 2)
    assert held(CELLS) is CELLS
