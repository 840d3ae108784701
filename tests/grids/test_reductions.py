"""Sums over rasters: those of the whole array, in blocks and chunks of any size."""

import numpy as np
import pytest
import xarray as xr
from lazy import ODD_CHUNKS, in_chunks

from fifesim.grids.reductions import computed, extremes, sums_by_block, sums_by_row

VALUES = np.random.default_rng(9).integers(0, 100, (23, 31)).astype(float)
RASTER = xr.DataArray(VALUES, dims=("y", "x"))


def count_and_total(one, other, power):
    """Sums of rows: of 1, and of one less a power of the other."""
    return np.stack([np.full(len(one), one.shape[1]), (one - other**power).sum(axis=1)], axis=1)


@pytest.mark.parametrize("cells", [1, 31 * 5, 2**22])
@pytest.mark.parametrize("chunks", [{}, ODD_CHUNKS, {"y": 1}, {"x": 1}])
def test_each_row_is_summed_whole(monkeypatch, cells, chunks):
    """Whatever blocks of rows are read together; whole numbers are exact."""
    monkeypatch.setattr("fifesim.grids.reductions._CELLS", cells)
    found = sums_by_row(count_and_total, in_chunks(RASTER, chunks), RASTER + 1, count=2, power=2)
    np.testing.assert_array_equal(found, count_and_total(VALUES, VALUES + 1, 2))


def margins_and_pairs(cells, margin):
    """What there is of a margin, and the sum of products with the neighbour below of the cells inside it."""
    (above, below), (left, right) = margin
    padded = np.pad(cells, ((0, 1), (0, 0)))
    inside = slice(above, len(cells) - below), slice(left, cells.shape[1] - right)
    return np.array([above, below, left, right, np.sum((cells * padded[1:])[inside])])


@pytest.mark.parametrize("chunks", [{}, ODD_CHUNKS, {"y": 23, "x": 4}])
def test_blocks_with_their_margins_add_up(chunks):
    """Two rows of blocks below the first have a margin of 1 above, and so on: 4 blocks of columns, 3 of rows."""
    data = in_chunks(RASTER, chunks).data
    found = sums_by_block(margins_and_pairs, data, (5,), 8, margin=(1, 2))
    pairs = np.sum(VALUES[:-1] * VALUES[1:])
    np.testing.assert_array_equal(found, [2 * 4, 2 * 4, 3 * 3 * 2, 3 * 3 * 2, pairs])
    np.testing.assert_array_equal(sums_by_block(margins_and_pairs, data, (5,), 99, margin=(1, 2)), [0, 0, 0, 0, pairs])


def test_blocks_are_added_in_their_order():
    """1e16 swallows what is added to it one by one, and not what was added up before."""
    data = np.array([[1e16, *[1.0] * 62, -1e16]])
    assert sums_by_block(lambda cells, margin: cells[0], data, (1,), 1).tolist() == [0.0]
    assert data.sum() != 0


def test_limits_leave_out_what_is_missing():
    gap = RASTER.where(RASTER > 3)
    assert extremes(in_chunks(gap, ODD_CHUNKS)) == extremes(gap) == (VALUES[VALUES > 3].min(), VALUES.max())


def test_arrays_come_into_memory():
    lazy, plain = computed(in_chunks(RASTER, ODD_CHUNKS), VALUES)
    assert lazy.chunks is None and plain is VALUES
    np.testing.assert_array_equal(lazy, VALUES)
