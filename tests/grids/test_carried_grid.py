"""A grid by its numbers alone is the one that a raster tells."""

import numpy as np
import pytest
import xarray as xr

from fifesim.grids import grid as grids
from fifesim.grids.grid import as_carried, centres_of


@pytest.mark.parametrize("seed", range(20))
def test_a_grid_is_carried_as_a_raster_tells_it(seed):
    """Origins that are no multiples of cells, and cells that no binary number is."""
    draw = np.random.default_rng(seed)
    cell = draw.choice([10 / 3, 30.0, 0.7, draw.uniform(0.5, 50)], 2)
    west, north = 708000 + cell[1] * draw.integers(0, 900), 4331000 - draw.uniform(0, 5000)
    rows, columns = draw.integers(1, 300, 2)
    grid = grids.grid_at("EPSG:26914", west, north, columns * cell[1] + 1e-6, rows * cell[0] + 1e-6, tuple(cell))
    for each in (grid, grid.pad(1)):
        raster = grids.place(xr.DataArray(np.zeros(each.shape), dims=("y", "x")), each)
        found, expected = as_carried(each), grids.geobox(raster)
        assert found.shape == expected.shape and found.crs == expected.crs
        assert tuple(found.affine) == tuple(expected.affine)


def test_centres_are_the_coordinates():
    grid = grids.grid_at("EPSG:26914", 708000.1, 4331000.7, 300, 200, 10 / 3)
    for axis, values in zip(("y", "x"), centres_of(grid), strict=True):
        np.testing.assert_array_equal(values, grids.coordinates(grid)[axis])
