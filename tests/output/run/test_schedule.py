"""Blocks in order: the numbers of dask without it, and little that waits."""

import weakref

import dask.array as da
import numpy as np
import pytest
import xarray as xr

from fifesim import fife_site
from fifesim.base.footprints import axis_operator
from fifesim.base.line_spread import Boxcar
from fifesim.grids import grid as grids
from fifesim.grids.chunks import neighbourhood
from fifesim.grids.reductions import resample
from fifesim.grids.windows import array_from_windows, tiles
from fifesim.output.run import workers
from fifesim.output.run.workers import run_on_threads, tasks_of


def places(row, column, shape):
    return np.arange(row, row + shape[0])[:, None] * 1000.0 + np.arange(column, column + shape[1])


def means(side, chunk):
    """Smoothed places, averaged over pixels of 3.1 cells."""
    grid = fife_site(30 / 9, window=((0, side), (0, side)))
    array = neighbourhood(lambda block: block[1:-1, 1:-1] + block[:-2, 2:], tiles(places, grid, chunk, tile=8), 1)
    array = grids.place(array, grid)
    cell = 30 / 9
    axis = axis_operator(
        Boxcar(3.3 * cell), cell_origin=0, cell_size=cell, n_cells=side, pixel_origin=0, pixel_size=3.1 * cell,
        n_pixels=side // 4,
    )  # fmt: skip
    return resample(axis, axis, array, grids.aligned_grid(grid, 4 * cell)).data


def wanted(array, name="means"):
    return [(name, index) for index in np.ndindex(array.numblocks)]


@pytest.mark.parametrize("threads", [1, 3])
def test_blocks_are_those_of_dask(threads):
    array, found = means(96, 17), {}
    run_on_threads(
        *tasks_of({"means": array}, wanted(array)),
        lambda name, index, block: found.update({index: block}),
        threads,
    )
    for index, block in found.items():
        np.testing.assert_array_equal(block, array.blocks[index].compute(scheduler="sync"))
    assert len(found) == array.npartitions


@pytest.mark.parametrize("piece", [1, 5])
def test_what_waits_for_later_pieces_is_made_once(monkeypatch, piece):
    monkeypatch.setattr(workers, "_PIECE", piece)
    made, found = [], {}

    def source(row, column, shape):
        made.append((row, column))
        return places(row, column, shape)

    grid = fife_site(30 / 9, window=((0, 60), (0, 40)))
    cells = tiles(source, grid, 10, tile=10)
    around = neighbourhood(lambda block: block[1:-1, 1:-1] + block[:-2, 2:], cells * 2, 1)
    arrays = {"cells": cells.data, "around": around.data}
    run_on_threads(
        *tasks_of(arrays, [(name, index) for index in np.ndindex(6, 4) for name in arrays]),
        lambda name, index, block: found.update({(name, *index): block}),
        2,
    )
    assert len(made) == len(set(made)) == 24
    for (name, *index), block in found.items():
        np.testing.assert_array_equal(block, arrays[name].blocks[tuple(index)].compute(scheduler="sync"))
    assert len(found) == 48


def test_only_what_is_wanted_is_computed():
    array = means(96, 17)
    all_of_it = tasks_of({"means": array}, wanted(array))[0]
    one = tasks_of({"means": array}, [("means", (2, 3))])[0]
    assert len(one) < len(all_of_it) / 6


class Watch:
    """Makes chunks, and sees how many of them are in memory together at most."""

    def __init__(self):
        self.alive, self.most = set(), 0

    def __call__(self, block):
        made = block + 1
        self.alive.add(id(made))
        weakref.finalize(made, self.alive.discard, id(made))
        self.most = max(self.most, len(self.alive))
        return made


def chunks_at_once(rows, columns):
    """Most chunks in memory together when pixels are made of so many of them, by one thread."""
    watched, shape = Watch(), (rows * 10, columns * 10)
    options = {"dtype": float, "meta": np.empty((0, 0))}
    truth = da.ones(shape, chunks=10).map_blocks(watched, **options)
    image = truth.map_blocks(np.sqrt).map_blocks(watched, **options)
    grid = fife_site(30 / 9, window=((0, rows * 10), (0, columns * 10)))
    pixels = grids.aligned_grid(grid, 10.0)
    axes = [
        axis_operator(
            Boxcar(3.5), cell_origin=0, cell_size=1, n_cells=size, pixel_origin=0, pixel_size=3, n_pixels=size // 3
        )
        for size in shape
    ]
    arrays = {
        name: resample(*axes, grids.place(xr.DataArray(data, dims=("y", "x")), grid), pixels).data
        for name, data in (("image", image), ("truth", truth))
    }
    places = [(name, index) for index in np.ndindex(arrays["image"].numblocks) for name in arrays]
    run_on_threads(*tasks_of(arrays, places), lambda *block: None, 1)
    return watched.most


@pytest.mark.parametrize("piece", [7, 600])
def test_no_chunk_waits_for_those_that_need_its_rims_only(monkeypatch, piece):
    """Blocks that read a row and a column before them too: the row of blocks above waits as rims."""
    monkeypatch.setattr(workers, "_PIECE", piece)

    def ask(*place):
        return (), [tuple(slice(part.start - 1, part.stop) for part in place)]

    watched, sizes = Watch(), ((10,) * 4, (10,) * 20)
    cells = da.ones((40, 200), chunks=10).map_blocks(watched, dtype=float, meta=np.empty((0, 0)))
    blocks = array_from_windows(lambda window: window[1:, 1:] + window[:-1, :-1], [cells], sizes, ask, token="before")
    run_on_threads(*tasks_of({"blocks": blocks}, wanted(blocks, "blocks")), lambda *block: None, 1)
    assert watched.most <= 3


def test_what_waits_grows_neither_with_rows_nor_with_columns():
    """A few of the chunk that is being used and of its neighbours, never a row of them."""
    assert chunks_at_once(40, 20) == chunks_at_once(10, 20) == chunks_at_once(10, 5) <= 3


def test_blocks_are_delivered_as_they_are_wanted():
    array, found = means(96, 17), []
    backwards = wanted(array)[::-1]
    run_on_threads(*tasks_of({"means": array}, backwards), lambda name, index, block: found.append((name, index)), 2)
    assert found == backwards


def test_what_two_arrays_need_is_made_once():
    made = []

    def source(block):
        made.append(block.shape)
        return block + 1

    common = da.ones((20, 20), chunks=10).map_blocks(source, dtype=float, meta=np.empty((0, 0)))
    arrays = {"more": common + 1, "less": common - 1}
    places = [(name, index) for index in np.ndindex(common.numblocks) for name in arrays]
    run_on_threads(*tasks_of(arrays, places), lambda *block: None, 2)
    assert len(made) == common.npartitions


def test_nothing_wanted_is_nothing_done():
    run_on_threads(*tasks_of({"means": means(96, 17)}, []), lambda *block: pytest.fail("not wanted"), 2)


def test_an_error_of_a_task_is_raised_as_it_is():
    def broken(block):
        raise OSError("no such cells")

    array = da.ones((4, 4), chunks=2).map_blocks(broken, dtype=float, meta=np.empty((0, 0)))
    with pytest.raises(OSError, match="no such cells"):
        run_on_threads(*tasks_of({"a": array}, wanted(array, "a")), lambda *block: None, 2)
