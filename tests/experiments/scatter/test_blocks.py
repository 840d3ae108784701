"""Ground that is uniform within the blocks of its pixels."""

import numpy as np
import pytest
import xarray as xr

import fifesim
from fifesim.experiments.scatter.stages import middle_cells, spread_out
from fifesim.grids import grid as grids

# Seven cells of 10 m along each axis: two blocks of 30 m, and a cell of none.
GRID = fifesim.grid_at("EPSG:26914", 707970.0, 4331220.0, 70.0, 70.0, 10.0)
BLOCKS = grids.aligned_grid(GRID, 30.0)


@pytest.fixture
def cells():
    lai = fifesim.lai_scene(GRID, "burned-grazed", arp=0.15, seed=7)
    return lai.copy(data=np.arange(49.0).reshape(7, 7))


def test_each_cell_of_a_block_has_its_mean(cells):
    found = spread_out(cells, BLOCKS, 0.98).values
    expected = [[8.0, 11.0], [29.0, 32.0]]
    np.testing.assert_array_equal(found[:6, :6], np.kron(expected, np.ones((3, 3))))
    np.testing.assert_array_equal(found[6], cells.values[6])
    np.testing.assert_array_equal(found[:, 6], cells.values[:, 6])


def test_a_cell_without_data_has_none_and_a_block_without_a_mean_keeps_its_cells(cells):
    cells[0, 0] = np.nan
    found = spread_out(cells, BLOCKS, 0.98).values
    np.testing.assert_array_equal(found[:3, :3], cells.values[:3, :3])
    found = spread_out(cells, BLOCKS, 0.5).values
    assert np.isnan(found[0, 0]) and found[1, 1] == pytest.approx((9 * 8 - 0) / 8)


def test_the_middle_cell_stands_for_its_block(cells):
    codes = xr.where(cells == 0, -1, cells, keep_attrs=True).astype(np.int16)
    found = middle_cells(cells.copy(data=codes.values), BLOCKS).values
    assert found[0, 0] == -1 and set(found[:3, :3].ravel()) == {-1, 8}
    np.testing.assert_array_equal(found[3:6, 3:6], 32)
    np.testing.assert_array_equal(found[6], cells.values[6])
