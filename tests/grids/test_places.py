"""Arrays of kernels that are told where their cells lie."""

import numpy as np
import pytest
from lazy import no_compute

import fifesim
from fifesim.grids import grid as grids
from fifesim.grids import windows

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


def test_automatic_chunks_end_where_tiles_end():
    """Two tiles of 8 cells a chunk; the lattice counts from the origin of the CRS."""
    out = windows.tiles(cells_that_tell_their_place, GRID, "auto", tile=8)
    for first, sizes in zip(grids.lattice_position(GRID), out.chunks, strict=True):
        ends = first + np.cumsum(sizes)[:-1]
        assert (ends % 16 == 0).all() and len(ends) > 1


def test_unknown_dimension_of_chunks_is_named():
    with pytest.raises(ValueError, match="chunks name the dimensions y and x, got band"):
        windows.tiles(cells_that_tell_their_place, GRID, {"band": 1}, tile=8)


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
