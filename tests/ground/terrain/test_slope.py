"""Slope, aspect and normals against planes and vectors."""

import numpy as np
import pytest
from oracles_terrain import hills, plane, plane_gradient

from fifesim.ground.terrain import slope as terrain


@pytest.mark.parametrize("aspect", [0, 37.0, 90, 135, 201.5, 270, 359])
@pytest.mark.parametrize("slope", [0.5, 12.0, 45.0, 75.0])
def test_slope_and_aspect_of_a_plane_are_exact_on_cells_that_are_not_square(slope, aspect):
    found = terrain.slope_aspect(plane((7, 9), 20.0, 30.0, slope, aspect), 20.0, 30.0)
    np.testing.assert_allclose(found[0], slope, rtol=1e-10)
    # Elevations of 1000 m leave 1e-13 m, and the gentlest slope turns that into 1e-12 radian.
    np.testing.assert_allclose((found[1] - aspect + 180) % 360 - 180, 0, atol=1e-9)


@pytest.mark.parametrize("edge", [["north"], ["west"], ["north", "south"], ["north", "east"]])
def test_plane_stays_exact_where_neighbours_are_missing(edge):
    dem = plane((6, 8), 10.0, 10.0, 20.0, 60.0)
    for side in edge:
        dem[{"north": np.s_[0], "south": np.s_[-1], "west": np.s_[:, 0], "east": np.s_[:, -1]}[side]] = np.nan
    slope, aspect = terrain.slope_aspect(dem, 10.0, 10.0)
    np.testing.assert_allclose(slope, 20.0, rtol=1e-10)
    np.testing.assert_allclose(aspect, 60.0, rtol=1e-10)


def test_level_ground_faces_north_and_a_missing_cell_is_missing():
    dem = np.full((5, 5), -3.0)
    dem[2, 2] = np.nan
    slope, aspect = terrain.slope_aspect(dem, 1.0, 1.0)
    assert np.isnan(slope[1, 1]) and np.isnan(aspect[1, 1])
    assert np.nansum(np.abs(slope)) == np.nansum(np.abs(aspect)) == 0


def test_slope_alone_has_the_bits_of_slope_and_aspect():
    dem = hills((20, 30), seed=3)
    dem[4, 7] = dem[0] = np.nan
    found = terrain.steepness(dem, 12.0, 7.0)
    assert np.isnan(found).sum() == 1
    assert found.tobytes() == terrain.slope_aspect(dem, 12.0, 7.0)[0].tobytes()


def test_gradient_is_that_of_numpy_at_any_cells():
    dem = hills((20, 30), seed=3)
    north, east = np.gradient(dem, -12.0, 7.0)
    found = terrain.gradient(dem, 12.0, 7.0)
    np.testing.assert_allclose(found, [east[1:-1, 1:-1], north[1:-1, 1:-1]], rtol=1e-12)
    rows, columns = np.array([3, 4, 11]), np.array([1, 20])
    some = terrain.gradient(dem, 12.0, 7.0, rows, columns)
    np.testing.assert_array_equal(some, np.array(found)[:, rows[:, None] - 1, columns - 1])


def test_component_along_the_normal_is_that_of_vectors():
    rng = np.random.default_rng(1)
    slope, aspect, *vector = rng.uniform([[0], [0], [-1], [-1], [-1]], [[89], [360], [1], [1], [1]], (5, 50))
    tilt, azimuth = np.radians((slope, aspect))
    normal = np.stack([np.sin(tilt) * np.sin(azimuth), np.sin(tilt) * np.cos(azimuth), np.cos(tilt)])
    east, north = plane_gradient(slope, aspect)
    found = terrain.along_normal(terrain.Vector(*vector), east, north)
    np.testing.assert_allclose(found, (normal * vector).sum(0), rtol=0, atol=1e-13)
    np.testing.assert_allclose(terrain.slope_cosine(east, north), normal[2], rtol=0, atol=1e-14)


def test_angles_and_gradient_are_inverse():
    slope, aspect = np.array([0.5, 45.0, 80.0]), np.array([359.0, 180.0, 37.0])
    np.testing.assert_allclose(terrain.slope_angles(*plane_gradient(slope, aspect)), [slope, aspect], rtol=1e-12)
