"""Slope and aspect of labelled elevation."""

import numpy as np
import pytest
from elevations import labelled
from lazy import check_raster_function
from oracles_terrain import plane

import fifesim
from fifesim.ground.terrain.rasters import slopes


@pytest.mark.parametrize("name", ["slope", "aspect"])
def test_slopes_keep_the_promises_of_rasters(dem, name):
    dem[20:23, 30] = np.nan
    found = check_raster_function(getattr(slopes, name), dem, quantity=name)
    np.testing.assert_array_equal(np.isnan(found), np.isnan(dem))


def test_plane_is_exact_up_to_its_edges_on_cells_that_are_not_square():
    grid = fifesim.grid_at("EPSG:26914", 700000, 4330000, 300, 240, (3, 5))
    tilted = labelled(grid, plane(tuple(grid.shape), 3.0, 5.0, 20.0, 250.0))
    np.testing.assert_allclose(fifesim.slope(tilted), 20.0, rtol=1e-9)
    np.testing.assert_allclose(fifesim.aspect(tilted), 250.0, rtol=1e-9)
