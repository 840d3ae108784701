"""Elevation of a scenario, and how far the land around it is known."""

import numpy as np

import fifesim
from fifesim.rasters import grid as grids
from fifesim.scenario.land import elevation
from fifesim.scenario.scenario import parse_scenario

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
