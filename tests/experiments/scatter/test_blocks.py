import numpy as np
import xarray as xr

from fifesim.experiments.scatter.blocks import middle_cells, spread_out_means
from fifesim.rasters import grid as grids
from fifesim.rasters.sites import fife_site

GRID = fife_site(10.0, ((0, 7), (0, 6)))
BLOCKS = grids.aligned(GRID, 30.0)


def raster(values, grid):
    return grids.place(xr.DataArray(values, dims=("y", "x")), grid)


def test_means_lie_on_the_cells_of_their_block():
    cells = raster(np.arange(42.0).reshape(7, 6), GRID)
    cells[0, 0] = np.nan
    spread = spread_out_means(raster([[1.0, 2.0], [3.0, np.nan]], BLOCKS), cells).values
    assert np.isnan(spread[0, 0]) and spread[2, 2] == 1.0 and spread[0, 3] == 2.0 and spread[5, 0] == 3.0
    # No block, or one without data: the cell's own.
    np.testing.assert_array_equal(spread[6], cells[6])
    np.testing.assert_array_equal(spread[3:6, 3:], cells[3:6, 3:])


def test_the_cell_in_the_middle_stands_for_its_block():
    codes = raster(np.arange(42).reshape(7, 6), GRID)
    codes[0, 0] = -1
    spread = middle_cells(codes, BLOCKS).values
    assert spread[0, 0] == -1 and (spread[3:6, :3] == 4 * 6 + 1).all() and (spread[:3, 3:] == 6 + 4).all()
    np.testing.assert_array_equal(spread[6], codes[6])
