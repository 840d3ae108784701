"""Lazy arrays whose blocks know their location and read windows of other arrays."""

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
from fifesim.grids.windows import _ORIGINS, array_by_place, array_from_windows, gather, held, origin_of, with_origin

CELLS = np.arange(11.0 * 13).reshape(11, 13)


def mean_of_three(array, chunks):
    """Mean of each cell and its western and eastern neighbours; NaN if a neighbour lies outside."""

    def ask(rows, columns):
        return (), [(rows, slice(columns.start - 1, columns.stop + 1))]

    def kernel(window):
        return (window[:, :-2] + window[:, 1:-1] + window[:, 2:]) / 3

    return array_from_windows(kernel, [array], chunks, ask, token="mean-of-three")


@pytest.mark.parametrize("read", [-1, (3, 4), (11, 1)])
@pytest.mark.parametrize("made", [((11,), (13,)), ((2, 9), (5, 5, 3))])
def test_windows_are_assembled_from_any_chunks(read, made):
    found = mean_of_three(da.from_array(CELLS, chunks=read), made)
    assert found.chunks == made
    np.testing.assert_array_equal(found.compute()[:, 1:-1], CELLS[:, 1:-1])
    assert np.isnan(found.compute()[:, [0, -1]]).all()


def test_block_reads_only_its_window():
    read = []

    def cells(block_info=None):
        read.append(block_info[None]["chunk-location"])
        return np.zeros((2, 2))

    source = da.map_blocks(cells, chunks=((2, 2, 2), (2, 2, 2)), dtype=float, meta=np.empty((0, 0)))
    found = array_from_windows(lambda window: window, [source], ((2, 4), (2, 4)), lambda *at: ((), [at]), token="own")
    found.blocks[0, 0].compute(scheduler="synchronous")
    assert read == [(0, 0)]


@pytest.mark.parametrize(("columns", "cut"), [(4, True), (6, False)])
def test_small_part_of_a_chunk_is_cut_out_first(columns, cut):
    """The rest of the chunk is then released; a cut of most of it would only be a second copy."""
    source = da.ones((10, 10), chunks=10)
    found = array_from_windows(
        lambda window: window, [source], ((10,), (columns,)), lambda *at: ((), [at]), token="little"
    )
    assert any(str(key[0]).startswith("cut-") for key in found.dask if isinstance(key, tuple)) is cut
    assert found.compute().sum() == 10 * columns


def test_margins_of_chunks_by_location_are_computed_with_the_block():
    """dask might postpone a separate task for the margin, and the chunk would wait in memory."""
    cells = array_by_place(
        lambda row, column, shape: CELLS[row:, column:][: shape[0], : shape[1]], ((11,), (7, 6)), token="c"
    )
    found = mean_of_three(cells, cells.chunks)
    np.testing.assert_array_equal(found.compute()[:, 1:-1], CELLS[:, 1:-1])
    tasks = dict(found.dask)
    for column in (0, 1):
        needed = get_dependencies(tasks, (found.name, 0, column))
        assert {key for key in needed if isinstance(key, tuple)} == {(cells.name, 0, column)}


def test_gathered_window_is_missing_beyond_the_array():
    found = gather(CELLS, (slice(-1, 2), slice(11, 15)))
    np.testing.assert_array_equal(found[1:, :2], CELLS[:2, 11:])
    assert np.isnan(found[0]).all() and np.isnan(found[:, 2:]).all()


def test_block_split_at_seams_is_identical():
    """A block split at seams reads only its margins from other chunks."""
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


def test_dataset_of_an_array_and_its_derivative_is_computed():
    """Without `held`, dask fuses the two arrays and no longer finds the first."""
    image = held(da.from_array(CELLS, chunks=5) + 1.0)
    dataset = xr.Dataset({"image": (("y", "x"), image), "index": (("y", "x"), image * 2)})
    found = dask.compute(dataset)[0]
    np.testing.assert_array_equal(found["image"], CELLS + 1)
    np.testing.assert_array_equal(found["index"], 2 * CELLS + 2)
    assert held(CELLS) is CELLS


GRID = fifesim.fife_site(30 / 9, window=((0, 36), (5, 50)))


def position_cells(row, column, shape):
    """Kernel whose cell values encode their location."""
    return 1000.0 * (row + np.arange(shape[0]))[:, None] + column + np.arange(shape[1])


@pytest.mark.parametrize("pieces", [None, "auto", 17, {"y": 5, "x": 8}, {"y": 5}, {"x": -1}, {"y": (30, 6), "x": 45}])
def test_tiles_depend_on_their_location(pieces):
    with no_compute():
        out = windows.tiles(position_cells, GRID, pieces, tile=8)
    assert (out.chunks is None) == (pieces is None)
    np.testing.assert_array_equal(out, position_cells(0, 0, tuple(GRID.shape)))
    with pytest.raises(ValueError, match="chunks name the dimensions y and x, got band"):
        windows.tiles(position_cells, GRID, {"band": 1}, tile=8)


def test_automatic_chunks_end_at_tile_boundaries():
    """Each chunk holds two tiles of 8 cells; the lattice starts at the origin of the CRS."""
    out = windows.tiles(position_cells, GRID, "auto", tile=8)
    for first, sizes in zip(grids.lattice_position(GRID), out.chunks, strict=True):
        ends = first + np.cumsum(sizes)[:-1]
        assert (ends % 16 == 0).all() and len(ends) > 1


@pytest.mark.parametrize("tile", [8, 1008])
def test_parts_cover_the_grid_and_none_crosses_chunks(monkeypatch, tile):
    monkeypatch.setattr(windows, "_ROWS", 3)
    other, asked = np.random.default_rng(1).random(tuple(GRID.shape)), []

    def kernel(row, column, shape, block):
        asked.append((row, column, shape))
        return position_cells(row, column, shape) + block

    out = windows.part_by_part(kernel, GRID, other, tile=tile)
    np.testing.assert_array_equal(out, position_cells(0, 0, tuple(GRID.shape)) + other)
    grids.check_grid(grids.geobox(out))
    step, lattice = 16 if tile == 8 else tile, grids.lattice_position(GRID)
    for row, column, (rows, columns) in asked:
        assert rows <= 3
        for first, size, start in zip((row, column), (rows, columns), lattice, strict=True):
            assert (start + first) // step == (start + first + size - 1) // step


@pytest.mark.parametrize("tile", [None, 8])
def test_kernel_gets_the_location_of_its_block(monkeypatch, tile):
    monkeypatch.setattr(windows, "_ROWS", 3)
    array = windows.tiles(position_cells, GRID, tile=8)

    def kernel(block, starts):
        return block - position_cells(*starts, block.shape)

    assert (windows.located(kernel, array, tile=tile) == 0).all()
    assert (windows.located(kernel, array.chunk({"y": 5, "x": 8}), tile=tile) == 0).all()


def test_origin_is_kept_with_unchanged_values_and_released_with_its_raster():
    made = with_origin(xr.DataArray(da.zeros((4, 6), chunks=2), dims=("y", "x")), "leaves")
    assert origin_of(made) == "leaves" and origin_of(made.compute()) is None
    assert origin_of(made.assign_coords(sza=30.0).rename("other")) == "leaves"
    assert origin_of(made + 1) is None and origin_of(made[1:]) is None and origin_of(made.persist()) is None
    key = id(made.data.dask), made.data.name
    assert key in _ORIGINS
    del made
    gc.collect()
    assert key not in _ORIGINS
