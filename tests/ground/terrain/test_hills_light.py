"""Light on the hills without labels has the bits of the labelled way."""

import numpy as np
import pytest

import fifesim
from fifesim.base.geometry import Geometry
from fifesim.grids import grid as grids
from fifesim.grids.grid import as_carried
from fifesim.ground.terrain import labels as terrain_labels
from fifesim.ground.terrain.elevation_labels import flint_hills
from fifesim.ground.terrain.labels import light_on_slopes
from fifesim.ground.terrain.sky_labels import horizon
from fifesim.ground.terrain.source_labels import beside_altitude

SUN = Geometry(60.0, 110.0, 25.0, 280.0)


def grids_of(cell, coarse, reach):
    """Cells of a scene, and those of the land around it."""
    grid = grids.grid_at("EPSG:26914", 708001.3, 4331002.9, 61 * cell, 47 * cell, cell)
    box = grid.boundingbox
    west, north = np.floor((box.left - reach) / coarse) * coarse, np.ceil((box.top + reach) / coarse) * coarse
    width, height = box.right + reach - west + coarse, north - box.bottom + reach + coarse
    return grid, grids.grid_at("EPSG:26914", west, north, width, height, coarse)


@pytest.mark.parametrize(("cell", "coarse", "reach"), [(10 / 3, 30.0, 600.0), (3.7, 29.6, 400.0), (20.0, 40.0, 900.0)])
def test_light_is_that_of_the_labelled_hills(cell, coarse, reach):
    grid, around = grids_of(cell, coarse, reach)
    dem = flint_hills(grid.pad(1), 4)
    above = horizon(flint_hills(around, 4, chunks=50), reach=reach, beside=dem).compute()
    expected = light_on_slopes(dem, as_carried(grid), SUN, above)
    found = terrain_labels.light_on_hills(grid, around, 4, reach, SUN, 0.4)
    data, sky, size, sun = found
    np.testing.assert_array_equal(data, expected[0])
    for one, other in zip(sky, expected[1], strict=True):
        np.testing.assert_array_equal(one, other)
    assert (size, sun) == expected[2:]
    assert np.ptp(sky.layers[3]) > 0


def test_steepest_is_the_largest_slope():
    _, around = grids_of(10 / 3, 30.0, 600.0)
    assert terrain_labels.steepest(around, 4) == float(terrain_labels.slope(flint_hills(around, 4)).max())


def test_an_altitude_far_from_the_hills_is_told():
    grid, around = grids_of(10 / 3, 30.0, 300.0)
    with pytest.warns(UserWarning, match="beside an altitude of the atmosphere of 3 km"):
        terrain_labels.light_on_hills(grid, around, 4, 300.0, SUN, 3.0)
    with pytest.warns(UserWarning, match="beside an altitude of the atmosphere of 3 km"):
        beside_altitude(fifesim.flint_hills(grid, seed=4), 3.0)
