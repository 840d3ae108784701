"""Tests of horizons and sky factors against ray marching, and against closed forms for walls, planes and pits."""

import numpy as np
import pytest
from oracles_terrain import dozier, hills, march, plane, plane_gradient

from fifesim.ground.terrain import horizon as horizons
from fifesim.ground.terrain.horizon import horizon_sky_view, horizon_terrain_view, sky_factor, sky_vector
from fifesim.ground.terrain.slope import Vector, slope_aspect


def tangents_of(dem, cell_y, cell_x, azimuths, reach):
    m, n = horizons.horizon_margin(cell_y, cell_x, reach)
    padded = np.pad(dem, ((m, m), (n, n)), constant_values=np.nan)
    return horizons.horizon_tangent(padded, cell_y, cell_x, azimuths, reach)


@pytest.mark.parametrize("cells", [(10.0, 10.0), (10.0, 25.0), (30.0, 12.0)])
def test_horizon_agrees_with_ray_marching(cells):
    """Away from the edge, where only one of the methods counts the last half cell."""
    dem, azimuths = hills((70, 75), length=12.0), horizons.azimuths(16) + 5.0
    found = tangents_of(dem, *cells, azimuths, 250.0)
    rng = np.random.default_rng(2)
    for row, column in zip(rng.integers(26, 44, 25), rng.integers(26, 49, 25), strict=True):
        expected = [march(dem, row, column, *cells, azimuth, 250.0) for azimuth in azimuths]
        # One method interpolates along one axis and the other along both, which differs by the curvature of the waves.
        np.testing.assert_allclose(found[:, row, column], expected, rtol=0, atol=0.02)
        assert np.abs(found[:, row, column] - expected).mean() < 0.004


def test_horizon_is_exact_along_axes_and_diagonals():
    dem, azimuths = hills((40, 40), seed=4), np.arange(8) * 45.0
    found = tangents_of(dem, 10.0, 10.0, azimuths, 200.0)
    for direction, (down, right) in enumerate([(-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1)]):
        expected, row, column = 0.0, 21, 17
        for k in range(1, 21):
            i, j, distance = row + k * down, column + k * right, 10.0 * k * np.hypot(down, right)
            if 0 <= i < 40 and 0 <= j < 40 and distance <= 200 + 1e-9:
                expected = max(expected, (dem[i, j] - dem[row, column]) / distance)
        assert found[direction, row, column] == pytest.approx(expected, abs=1e-14)


@pytest.mark.parametrize("count", [16, 20, 36])
def test_horizon_of_a_plane_is_exact_in_every_direction(count):
    azimuths = horizons.azimuths(count)
    found = tangents_of(plane((40, 60), 15.0, 10.0, 35.0, 210.0), 15.0, 10.0, azimuths, 100.0)[:, 20, 30]
    rise = -np.tan(np.radians(35.0)) * np.cos(np.radians(azimuths - 210.0))
    np.testing.assert_allclose(found, np.maximum(rise, 0), rtol=0, atol=1e-9)  # weights are rounded to 1e-9


def test_wall_is_visible_up_to_the_reach():
    dem = np.zeros((3, 200))
    dem[:, 150:] = 10.0
    found = tangents_of(dem, 3.0, 3.0, [90.0, 270.0], 150.0)
    distance = (150 - np.arange(200)) * 3.0
    seen = (distance > 0) & (distance <= 150)
    # Distant samples are up to 1/32 of the distance apart.
    np.testing.assert_allclose(found[0, 1][seen], 10.0 / distance[seen], rtol=1 / 31)
    near = seen & (distance <= 31 * 3)
    np.testing.assert_allclose(found[0, 1][near], 10.0 / distance[near], rtol=1e-12)
    assert (found[0, 1][~seen] == 0).all() and (found[1] == 0).all()


def test_missing_cells_and_the_edge_hide_no_sky():
    dem = np.zeros((9, 9))
    dem[:, 7] = np.nan
    dem[:, 8] = 100.0
    dem[4, 2] = np.nan
    found = tangents_of(dem, 10.0, 10.0, horizons.azimuths(16), 60.0)
    assert np.isfinite(found).all()
    assert found[:, 4, 2].max() == 0 and found[0].max() == 0
    assert found[4, 4, 4] == pytest.approx(100 / 40)  # across the gap


def test_horizon_has_the_same_bits_in_every_window():
    dem, azimuths, reach = hills((90, 80), seed=7), horizons.azimuths(16), 150.0
    m, n = horizons.horizon_margin(10.0, 10.0, reach)
    whole = horizons.horizon_tangent(dem, 10.0, 10.0, azimuths, reach)
    part = horizons.horizon_tangent(dem[7 : 7 + 2 * m + 5, 3 : 3 + 2 * n + 2], 10.0, 10.0, azimuths, reach)
    np.testing.assert_array_equal(part, whole[:, 7:12, 3:5])


def sky_of(slope, aspect, horizon):
    """Sky factor of slopes below a horizon given as zenith angles [degree]."""
    directions = np.arange(len(horizon)) * (360 / len(horizon))
    return horizon_sky_view(horizons.tangent(horizon), directions, *plane_gradient(slope, aspect))


@pytest.mark.parametrize("count", [16, 17, 32])
@pytest.mark.parametrize("slope", [0, 5, 30, 45, 60])
def test_sky_factor_of_a_plane(slope, count):
    """Vd = (1 + cos S) / 2."""
    for aspect in (0.0, 3.0, 11.25, 100.0):
        found = sky_of(slope, aspect, np.full(count, 90.0))
        np.testing.assert_allclose(found, (1 + np.cos(np.radians(slope))) / 2, rtol=0, atol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_sky_factor_agrees_with_the_integral_of_dozier(seed):
    rng = np.random.default_rng(seed)
    count = 24
    horizon = rng.uniform(50, 90, count)
    slope, aspect = rng.uniform(0, 60), rng.uniform(0, 360)
    tangents, step = horizons.tangent(horizon), 2 * np.pi / count

    def great_circles(phi):
        first = (phi // step).astype(int)
        part = phi - first * step
        return (tangents[first] * np.sin(step - part) + tangents[(first + 1) % count] * np.sin(part)) / np.sin(step)

    # Kinks of the horizon limit the accuracy of the midpoint rule to 1e-9 with this number of steps.
    expected = dozier(slope, aspect, great_circles)
    np.testing.assert_allclose(sky_of(slope, aspect, horizon), expected, rtol=0, atol=1e-8)


@pytest.mark.parametrize("steepest", [30.0, 75.0, 89.0])
def test_sky_vector_agrees_with_lamberts_formula(steepest):
    """Sum of angles times normals of arcs, which are up to a right angle long since the horizon is discontinuous."""
    rng, count = np.random.default_rng(3), 16
    tangents = np.tan(np.radians(rng.uniform(0, steepest, (count, 50))))
    tangents[:, 0] = np.where(np.arange(count) % 2, np.tan(np.radians(steepest)), 0.0)
    directions = np.arange(count) * (360 / count)
    expected = np.zeros((3, 50))
    for cell in range(50):
        edge = [(*np.sin(np.radians((a, 90 - a))), t) for a, t in zip(directions, tangents[:, cell], strict=True)]
        for a, b in zip(edge, edge[1:] + edge[:1], strict=True):
            normal = np.cross(b, a)
            sine = np.linalg.norm(normal)
            expected[:, cell] += np.arctan2(sine, np.dot(a, b)) * normal / sine / (2 * np.pi)
    found = sky_vector(tangents, directions, np.zeros(50), np.zeros(50))
    np.testing.assert_allclose(found, expected, rtol=0, atol=3e-14)


@pytest.mark.parametrize("wall", [5.0, 20.0, 45.0])
def test_sky_factor_of_a_v_shaped_valley(wall):
    """In a long valley Vd is half the sum of the sines of the angles from the normal to both limits of the sky."""
    azimuth = np.radians(np.arange(32) * 11.25)
    horizon = horizons.zenith(np.tan(np.radians(wall)) * np.abs(np.sin(azimuth)))
    np.testing.assert_allclose(sky_of(0.0, 0.0, horizon), np.cos(np.radians(wall)), rtol=5e-3)
    # The foot of the west wall faces east; its sky is limited by its plane to the west and the other wall to the east.
    found = sky_of(wall, 90.0, horizon)
    np.testing.assert_allclose(found, (1 + np.cos(np.radians(2 * wall))) / 2, rtol=5e-3)


def test_horizon_below_the_horizontal_or_unknown_hides_no_sky():
    assert sky_of(0.0, 0.0, np.full(16, 95.0)) == pytest.approx(1, abs=1e-12)
    assert sky_of(0.0, 0.0, np.full(16, np.nan)) == pytest.approx(1, abs=1e-12)


def cells_of(dem, cell, reach, count=32):
    """Slope, aspect and sky factor on a raster surrounded by NaN."""
    m, n = horizons.horizon_margin(cell, cell, reach)
    padded = np.pad(dem, ((m, m), (n, n)), constant_values=np.nan)
    slope, aspect = slope_aspect(np.pad(dem, 1, constant_values=np.nan), cell, cell)
    horizon = horizons.horizon_zenith(padded, cell, cell, horizons.azimuths(count), reach)
    return slope, aspect, sky_of(slope, aspect, horizon)


@pytest.mark.parametrize("depth", [0.2, 0.5, 0.8])
def test_sky_factor_and_terrain_view_in_a_spherical_pit(depth):
    """In a pit of a sphere of radius R, Vd = 1 - depth / 2R everywhere, since entering light is spread evenly."""
    radius, size = 100.0, 281
    rim = radius * np.sqrt(depth * (2 - depth))
    cell = 2.1 * rim / size
    y, x = (np.mgrid[:size, :size] - size // 2) * cell
    wall = radius * (1 - depth) - np.sqrt(np.maximum(radius**2 - x**2 - y**2, 0))
    dem = np.where(np.hypot(x, y) < rim, wall, 0.0)
    slope, _, found = cells_of(dem, cell, 210.0)
    inside = np.hypot(x, y) < 0.7 * rim
    np.testing.assert_allclose(found[inside].mean(), 1 - depth / 2, rtol=5e-3)
    # Cells approximate the rim, which matters for single directions.
    np.testing.assert_allclose(found[inside], 1 - depth / 2, rtol=0.012)
    # Ct of Eq. 4 equals the part of the sky above the plane of the slope that terrain hides.
    view = horizon_terrain_view(found, np.cos(np.radians(slope)))
    np.testing.assert_allclose(view[inside], ((1 + np.cos(np.radians(slope))) / 2)[inside] - 1 + depth / 2, atol=0.012)


def test_sky_factor_of_a_neighbouring_sky_vector_is_clipped():
    """Sky vector of level open ground on a steep slope, a vector too long, and one behind the slope."""
    east, north = plane_gradient(60.0, 30.0)
    open_sky = Vector(*sky_vector(np.zeros(16), np.arange(16) * 22.5, 0.0, 0.0))
    assert sky_factor(open_sky, east, north) == pytest.approx(0.5, abs=1e-12)
    assert sky_factor(Vector(0.0, 0.0, 2.0), east, north) == pytest.approx(0.75, abs=1e-12)
    assert sky_factor(Vector(east, north, 0.1), east, north) == 0
