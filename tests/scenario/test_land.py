"""Elevation of a scenario, and how far the land around it is known."""

import numpy as np
import pytest
import xarray as xr

import fifesim
from fifesim.grids import grid as grids
from fifesim.ground.terrain import labels as slopes_light
from fifesim.scenario.ground import elevation, in_memory, scenario_light_on_hills
from fifesim.scenario.scenario import Scenario, parse_scenario

GRID = {"west": 707970.0, "north": 4331220.0, "width": 300.0, "height": 240.0}


def test_level_ground_has_no_elevation():
    flat = parse_scenario({"grid": GRID, "terrain": {"dem": "flat"}})
    assert elevation(flat, flat.geobox()) == (None, None, {})


def test_hills_reach_a_cell_past_the_grid_and_their_horizon_as_far_as_asked():
    hills = parse_scenario({"grid": GRID, "terrain": {"seed": 3, "horizon_reach": 600}})
    grid = hills.geobox()
    dem, horizon, reach = elevation(hills, grid)
    assert grids.same_grid(grids.geobox(dem), grid.pad(1))
    np.testing.assert_array_equal(dem, fifesim.flint_hills(grid.pad(1), seed=3))
    assert reach == dict.fromkeys(("north", "east", "south", "west"), 600.0)
    around, box = grids.geobox(horizon).boundingbox, grid.boundingbox
    assert around.left <= box.left - 600 + 30 and around.right >= box.right + 600 - 30
    assert around.bottom <= box.bottom - 600 + 30 and around.top >= box.top + 600 - 30


def test_horizon_is_found_on_multiples_of_its_cells_from_the_origin_of_the_crs():
    """So that windows of a scene share its places."""
    hills = parse_scenario({"grid": GRID, "terrain": {"horizon_reach": 300}})
    affine = grids.geobox(elevation(hills, hills.geobox())[1]).affine
    for origin, cell in ((affine.c, affine.a), (affine.f, affine.e)):
        # Places are middles of cells of the land around, which lie on whole multiples.
        assert abs(((origin + cell / 2) / (cell / 2)) - round((origin + cell / 2) / (cell / 2))) < 1e-6


def test_in_memory_is_the_horizon_that_lies_above_the_elevation():
    one = Scenario(grid={"west": 708000.0, "north": 4331000.0, "width": 300.0, "height": 300.0})
    dem, horizon, _ = elevation(one, one.geobox())
    whole, (dem, above) = horizon.compute(), in_memory(dem, horizon)
    assert dem.chunks is None and above.chunks is None and above.size < whole.size / 100
    xr.testing.assert_equal(above, whole.sel(y=above.y, x=above.x))
    light = [slopes_light.illumination(dem, one.sun_and_view(), each) for each in (above, whole)]
    np.testing.assert_array_equal(*light)
    assert in_memory(None, None) == (None, None)


@pytest.mark.parametrize(("sza", "alone"), [(70.0, True), (73.0, False)])
def test_where_slopes_may_hide_the_sun_all_of_the_land_is_asked(sza, alone):
    """The steepest of these hills has 18.8 degrees."""
    hills = parse_scenario({"grid": GRID, "terrain": {"seed": 7}, "geometry": {"sza": sza, "saa": 95.0}})
    light = scenario_light_on_hills(hills, hills.geobox(), hills.sun_and_view())
    assert (light is not None) is alone


def test_only_synthetic_hills_are_lit_without_labels():
    flat = parse_scenario({"grid": GRID, "terrain": {"dem": "flat"}})
    assert scenario_light_on_hills(flat, flat.geobox(), flat.sun_and_view()) is None
