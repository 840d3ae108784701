"""Lazy arrays whose blocks know their place and read windows of others."""

import gc

import dask
import dask.array as da
import numpy as np
import pytest
import xarray as xr
from dask.core import get_dependencies
from lazy import no_compute

import fifesim
from fifesim.grids import grid as grids
from fifesim.grids import windows
from fifesim.grids.windows import _ORIGINS, array_by_place, array_from_windows, gather, held, made_of, origin_of

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


GRID = fifesim.fife_site(30 / 9, window=((0, 36), (5, 50)))


def cells_that_tell_their_place(row, column, shape):
    """Kernel whose cells tell their place."""
    return 1000.0 * (row + np.arange(shape[0]))[:, None] + column + np.arange(shape[1])


@pytest.mark.parametrize("pieces", [None, "auto", 17, {"y": 5, "x": 8}, {"y": 5}, {"x": -1}, {"y": (30, 6), "x": 45}])
def test_tiles_are_made_by_their_place(pieces):
    with no_compute():
        out = windows.tiles(cells_that_tell_their_place, GRID, pieces, tile=8)
    assert (out.chunks is None) == (pieces is None)
    np.testing.assert_array_equal(out, cells_that_tell_their_place(0, 0, tuple(GRID.shape)))
    with pytest.raises(ValueError, match="chunks name the dimensions y and x, got band"):
        windows.tiles(cells_that_tell_their_place, GRID, {"band": 1}, tile=8)


def test_automatic_chunks_end_where_tiles_end():
    """Two tiles of 8 cells a chunk; the lattice counts from the origin of the CRS."""
    out = windows.tiles(cells_that_tell_their_place, GRID, "auto", tile=8)
    for first, sizes in zip(grids.lattice_position(GRID), out.chunks, strict=True):
        ends = first + np.cumsum(sizes)[:-1]
        assert (ends % 16 == 0).all() and len(ends) > 1


@pytest.mark.parametrize("tile", [8, 1008])
def test_parts_make_the_whole_and_none_lies_in_two_chunks(monkeypatch, tile):
    monkeypatch.setattr(windows, "_ROWS", 3)
    other, asked = np.random.default_rng(1).random(tuple(GRID.shape)), []

    def kernel(row, column, shape, block):
        asked.append((row, column, shape))
        return cells_that_tell_their_place(row, column, shape) + block

    out = windows.part_by_part(kernel, GRID, other, tile=tile)
    np.testing.assert_array_equal(out, cells_that_tell_their_place(0, 0, tuple(GRID.shape)) + other)
    grids.check_grid(grids.geobox(out))
    step, lattice = 16 if tile == 8 else tile, grids.lattice_position(GRID)
    for row, column, (rows, columns) in asked:
        assert rows <= 3
        for first, size, start in zip((row, column), (rows, columns), lattice, strict=True):
            assert (start + first) // step == (start + first + size - 1) // step


@pytest.mark.parametrize("tile", [None, 8])
def test_kernel_is_told_where_its_block_lies(monkeypatch, tile):
    monkeypatch.setattr(windows, "_ROWS", 3)
    array = windows.tiles(cells_that_tell_their_place, GRID, tile=8)

    def kernel(block, starts):
        return block - cells_that_tell_their_place(*starts, block.shape)

    assert (windows.located(kernel, array, tile=tile) == 0).all()
    assert (windows.located(kernel, array.chunk({"y": 5, "x": 8}), tile=tile) == 0).all()


def raster(chunks):
    return xr.DataArray(da.zeros((4, 6), chunks=chunks), dims=("y", "x"))


def test_an_origin_stays_with_the_values():
    made = made_of(raster(2), "leaves")
    assert origin_of(made) == "leaves" and origin_of(made.compute()) is None
    assert origin_of(made.assign_coords(sza=30.0).rename("other")) == "leaves"
    assert origin_of(made + 1) is None and origin_of(made[1:]) is None and origin_of(made.persist()) is None


def test_an_origin_is_forgotten_with_its_raster():
    made = made_of(raster(2), "leaves")
    key = id(made.data.dask), made.data.name
    assert key in _ORIGINS
    del made
    gc.collect()
    assert key not in _ORIGINS
