"""Slope and aspect of labelled elevation."""

import numpy as np
import pytest
from elevations import labelled
from lazy import check_raster_function
from oracles_terrain import plane
from pyproj import Transformer

import fifesim
from fifesim.grids import grid as grids
from fifesim.grids import projection
from fifesim.ground.terrain import labels as terrain_labels


@pytest.mark.parametrize("name", ["slope", "aspect"])
def test_slopes_keep_the_promises_of_rasters(dem, name):
    dem[20:23, 30] = np.nan
    found = check_raster_function(getattr(terrain_labels, name), dem, quantity=name)
    np.testing.assert_array_equal(np.isnan(found), np.isnan(dem))


def test_plane_is_exact_up_to_its_edges_on_cells_that_are_not_square():
    grid = fifesim.grid_at("EPSG:26914", 700000, 4330000, 300, 240, (3, 5))
    tilted = labelled(grid, plane(tuple(grid.shape), 3.0, 5.0, 20.0, 250.0))
    np.testing.assert_allclose(fifesim.slope(tilted), 20.0, rtol=1e-9)
    # Grid north lies 1.48 degrees east of true north, and turns by 0.002 degrees over the scene.
    np.testing.assert_allclose(fifesim.aspect(tilted), 250.0 + projection.convergence(grid), atol=0.002)


@pytest.mark.parametrize(
    ("epsg", "longitude", "latitude"),
    [(3413, -120, 80), (3413, 135, 85), (5070, -75, 40), (3035, 30, 55), (32614, -96, 39), (3031, 10, -75)],
)
def test_aspect_counts_from_true_north(epsg, longitude, latitude):
    """Ground that descends to the true south, and one to the true east; EPSG:3035 distorts angles by 0.16."""
    to_map = Transformer.from_crs(4326, epsg, always_xy=True)
    west, north = to_map.transform(longitude, latitude)
    grid = fifesim.grid_at(f"EPSG:{epsg}", round(west, -1), round(north, -1), 3000, 3000, 10)
    x, y = (grids.coordinates(grid)[axis].values for axis in "xy")
    east_of, north_of = to_map.transform(*np.meshgrid(x, y), direction="INVERSE")
    for sides, expected in ((north_of, 180.0), (-east_of, 90.0)):
        aspect = fifesim.aspect(labelled(grid, 500 + 500 * (sides - sides.mean()) / np.ptp(sides)))
        np.testing.assert_allclose(aspect, expected, atol=0.2)


def test_aspect_of_a_window_has_the_bits_of_the_whole():
    grid = fifesim.grid_at("EPSG:3413", -1200000, -700000, 4000, 4000, 40)
    dem = labelled(grid, plane(tuple(grid.shape), 40.0, 40.0, 20.0, 250.0) ** 1.5 / 20)
    whole = fifesim.aspect(dem)
    np.testing.assert_array_equal(fifesim.aspect(dem[20:70, 33:90])[1:-1, 1:-1], whole[21:69, 34:89])
    level = labelled(grid, np.full(tuple(grid.shape), 300.0))
    assert (fifesim.aspect(level) == 0).all()


def test_one_convergence_for_a_wide_scene_is_warned_of():
    """400 km at 85 degrees north: grid north turns by 23 degrees from the middle to a corner."""
    wide = fifesim.grid_at("EPSG:3413", -600000, -200000, 400000, 400000, 10000)
    dem = labelled(wide, 1000 + plane(tuple(wide.shape), 10000.0, 10000.0, 5.0, 70.0) / 40)
    with pytest.warns(UserWarning, match=r"grid north rotates by up to \d+\.\d degrees"):
        fifesim.illumination(dem, fifesim.Geometry(60.0, 120.0))
