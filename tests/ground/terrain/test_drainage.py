"""The wetness index of labelled elevation."""

import numpy as np
import pytest
from elevations import labelled
from lazy import check_raster_function

import fifesim
from fifesim.ground.terrain.wetness import wetness_index


def test_wetness_keeps_the_promises_of_rasters(dem):
    dem[20:23, 30] = np.nan
    found = check_raster_function(fifesim.wetness, dem, quantity="wetness")
    np.testing.assert_array_equal(np.isnan(found), np.isnan(dem))


def test_at_its_places_it_is_that_of_the_coarse_elevation(around):
    """Every ninth cell, as of the horizon, has the index of the elevation there; cells between lie on a line."""
    found, places = fifesim.wetness(around, resolution=30.0), fifesim.horizon(around, resolution=30.0)
    cells = [np.abs(around[axis].values[:, None] - places[axis].values).argmin(axis=0).tolist() for axis in ("y", "x")]
    expected = wetness_index(around.values[np.ix_(*cells)], 30.0, 30.0)
    np.testing.assert_allclose(found.values[np.ix_(*cells)], expected, rtol=0, atol=1e-9)
    row, (start, stop) = cells[0][3], cells[1][4:6]
    between = found.values[row, start : stop + 1]
    np.testing.assert_allclose(between, np.linspace(between[0], between[-1], 10), rtol=0, atol=1e-9)


def test_finest_is_the_elevation_itself(dem):
    found = fifesim.wetness(dem, resolution=1.0)
    np.testing.assert_array_equal(found, wetness_index(dem.values, 30 / 9, 30 / 9))


def test_few_cells_and_coarse_ones_have_one_too():
    tiny = labelled(fifesim.grid_at("EPSG:26914", 700000, 4330000, 12, 9, 3), np.full((3, 4), 7.0))
    assert np.isfinite(fifesim.wetness(tiny)).all()


def test_elevation_of_nothing_is_nothing(dem):
    assert np.isnan(fifesim.wetness(dem * np.nan)).all()
    with pytest.raises(ValueError, match="resolution of an elevation's source must be positive"):
        fifesim.wetness(dem, resolution=0)
