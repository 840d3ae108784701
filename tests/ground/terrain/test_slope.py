"""Tests of slope, aspect and normals against planes and vectors, of terraces, and of units of elevation."""

import numpy as np
import pytest
from oracles_terrain import hills, plane
from scipy.interpolate import RegularGridInterpolator

from fifesim.ground.terrain import slope as terrain
from fifesim.ground.terrain.slope import bilinear


@pytest.mark.parametrize("aspect", [0, 37.0, 90, 135, 201.5, 270, 359])
@pytest.mark.parametrize("slope", [0.5, 12.0, 45.0, 75.0])
def test_slope_and_aspect_of_a_plane_are_exact_on_cells_that_are_not_square(slope, aspect):
    found = terrain.slope_aspect(plane((7, 9), 20.0, 30.0, slope, aspect), 20.0, 30.0)
    np.testing.assert_allclose(found[0], slope, rtol=1e-10)
    # Rounding of elevations near 1000 m is 1e-13 m, which is 1e-12 radian of aspect for the smallest slope.
    np.testing.assert_allclose((found[1] - aspect + 180) % 360 - 180, 0, atol=1e-9)


@pytest.mark.parametrize("edge", [["north"], ["west"], ["north", "south"], ["north", "east"]])
def test_plane_is_exact_where_neighbours_are_missing(edge):
    dem = plane((6, 8), 10.0, 10.0, 20.0, 60.0)
    for side in edge:
        dem[{"north": np.s_[0], "south": np.s_[-1], "west": np.s_[:, 0], "east": np.s_[:, -1]}[side]] = np.nan
    slope, aspect = terrain.slope_aspect(dem, 10.0, 10.0)
    np.testing.assert_allclose(slope, 20.0, rtol=1e-10)
    np.testing.assert_allclose(aspect, 60.0, rtol=1e-10)


def test_level_ground_has_aspect_0_and_nan_stays_in_its_cell():
    dem = np.full((5, 5), -3.0)
    dem[2, 2] = np.nan
    slope, aspect = terrain.slope_aspect(dem, 1.0, 1.0)
    assert np.isnan(slope[1, 1]) and np.isnan(aspect[1, 1])
    assert np.nansum(np.abs(slope)) == np.nansum(np.abs(aspect)) == 0


def test_steepness_equals_the_slope_of_slope_aspect():
    dem = hills((20, 30), seed=3)
    dem[4, 7] = dem[0] = np.nan
    found = terrain.steepness(dem, 12.0, 7.0)
    assert np.isnan(found).sum() == 1
    assert found.tobytes() == terrain.slope_aspect(dem, 12.0, 7.0)[0].tobytes()


def test_gradient_agrees_with_numpy():
    """Also for selected rows and columns."""
    dem = hills((20, 30), seed=3)
    north, east = np.gradient(dem, -12.0, 7.0)
    found = terrain.gradient(dem, 12.0, 7.0)
    np.testing.assert_allclose(found, [east[1:-1, 1:-1], north[1:-1, 1:-1]], rtol=1e-12)
    rows, columns = np.array([3, 4, 11]), np.array([1, 20])
    some = terrain.gradient(dem, 12.0, 7.0, rows, columns)
    np.testing.assert_array_equal(some, np.array(found)[:, rows[:, None] - 1, columns - 1])


def test_bilinear_agrees_with_scipy():
    rng = np.random.default_rng(1)
    layer = rng.standard_normal((6, 9))
    rows, columns = np.sort(rng.uniform(0, 5, 40)), np.sort(rng.uniform(0, 8, 30))
    found = bilinear(layer, *((at.astype(int), at - at.astype(int)) for at in (rows, columns)))
    known = RegularGridInterpolator((np.arange(6), np.arange(9)), layer)
    expected = known(np.stack(np.meshgrid(rows, columns, indexing="ij"), axis=-1))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13)


def test_bilinear_extends_the_last_value_and_is_nan_next_to_nan():
    found = bilinear(np.array([[1.0, 2.0], [3.0, 5.0]]), *2 * [(np.array([1]), np.array([0.5]))])
    assert found.item() == 5.0
    at = np.array([0, 0, 2]), np.array([0.0, 0.5, 0.5])
    found = bilinear(np.array([[1.0, np.nan, 2.0, 2.0]]), (np.array([0]), np.array([0.0])), at)
    assert np.isnan(found)[0].tolist() == [True, True, False]


def test_kt_is_the_ratio_of_light_on_the_slope_and_on_level_ground():
    """Sum of direct light, skylight and light from terrain."""
    rng = np.random.default_rng(2)
    sky, land, rho, local, level, direct = rng.uniform(0.1, 0.9, (6, 40))
    total = direct + rng.uniform(0.01, 0.1, 40)
    light = direct * local / level + (total - direct) * sky + total * rho * land
    found = terrain.topographic_factor(sky, land, rho, local, level, direct, total)
    np.testing.assert_allclose(found, light / total, rtol=1e-12)


def test_slope_facing_away_from_the_sensor_has_upwelling_factor_0():
    assert terrain.upwelling_factor(np.array([0.3, 0.6, -0.2]), 0.6).tolist() == [0.5, 1.0, 0.0]


def test_terrace_step_is_found():
    rows, columns = np.mgrid[:80, :90]
    tilted = 400.0 + 3.0 * columns - 2.0 * rows
    gentle = tilted / 20
    assert terrain.terrace_step(np.rint(gentle)) == 1
    assert terrain.terrace_step(np.rint(gentle / 5) * 5) == 5
    assert terrain.terrace_step(gentle) is None
    assert terrain.terrace_step(np.full((9, 9), 400.0)) is None
    assert terrain.terrace_step(np.rint(tilted)) is None
    assert terrain.terrace_step(np.full((9, 9), np.nan)) is None


def test_units_have_several_names_and_unknown_units_are_refused():
    known = {"m": 1, "metre": 1, "Foot": 0.3048, "ft": 0.3048, "US survey foot": 1200 / 3937}
    assert {name: terrain.metres_per_unit(name) for name in known} == known
    with pytest.raises(ValueError, match="vertical units must be one of m, ft, us-ft"):
        terrain.metres_per_unit("furlong")
