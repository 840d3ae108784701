"""Tests of slope, horizon, light on slopes and wetness of arrays against closed forms and slower algorithms."""

import heapq

import numpy as np
import pytest
from elevations import hills
from scipy.interpolate import RegularGridInterpolator

from fifesim.base.geometry import Geometry
from fifesim.ground.terrain import horizon as horizons
from fifesim.ground.terrain import lit_slopes as lights
from fifesim.ground.terrain import slope as terrain
from fifesim.ground.terrain.horizon import horizon_terrain_view, sky_factor, sky_vector
from fifesim.ground.terrain.slope import bilinear, gradient, topographic_factor
from fifesim.ground.terrain.wetness import LEAST_SLOPE, drained_area, fill_pits, wetness_index

AZIMUTHS = horizons.azimuths(32)


def test_level_ground_has_aspect_0_and_nan_stays_in_its_cell():
    dem = np.full((5, 5), -3.0)
    dem[2, 2] = np.nan
    slope, aspect = terrain.slope_aspect(dem, 1.0, 1.0)
    assert np.isnan(slope[1, 1]) and np.isnan(aspect[1, 1])
    assert np.nansum(np.abs(slope)) == np.nansum(np.abs(aspect)) == 0


def test_gradient_agrees_with_numpy_and_steepness_with_slope_aspect():
    """The gradient also for selected rows and columns."""
    dem = hills((20, 30), seed=3)
    north, east = np.gradient(dem, -12.0, 7.0)
    found = gradient(dem, 12.0, 7.0)
    np.testing.assert_allclose(found, [east[1:-1, 1:-1], north[1:-1, 1:-1]], rtol=1e-12)
    rows, columns = np.array([3, 4, 11]), np.array([1, 20])
    some = gradient(dem, 12.0, 7.0, rows, columns)
    np.testing.assert_array_equal(some, np.array(found)[:, rows[:, None] - 1, columns - 1])
    dem[4, 7] = dem[0] = np.nan
    steep = terrain.steepness(dem, 12.0, 7.0)
    assert np.isnan(steep).sum() == 1
    assert steep.tobytes() == terrain.slope_aspect(dem, 12.0, 7.0)[0].tobytes()


def test_bilinear_agrees_with_scipy():
    """The last value is extended; NaN spreads to its neighbours."""
    rng = np.random.default_rng(1)
    layer = rng.standard_normal((6, 9))
    rows, columns = np.sort(rng.uniform(0, 5, 40)), np.sort(rng.uniform(0, 8, 30))
    found = bilinear(layer, *((at.astype(int), at - at.astype(int)) for at in (rows, columns)))
    known = RegularGridInterpolator((np.arange(6), np.arange(9)), layer)
    expected = known(np.stack(np.meshgrid(rows, columns, indexing="ij"), axis=-1))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13)
    last = bilinear(np.array([[1.0, 2.0], [3.0, 5.0]]), *2 * [(np.array([1]), np.array([0.5]))])
    assert last.item() == 5.0
    at = np.array([0, 0, 2]), np.array([0.0, 0.5, 0.5])
    beside = bilinear(np.array([[1.0, np.nan, 2.0, 2.0]]), (np.array([0]), np.array([0.0])), at)
    assert np.isnan(beside)[0].tolist() == [True, True, False]


def test_terrace_step_is_found():
    rows, columns = np.mgrid[:80, :90]
    tilted = 400.0 + 3.0 * columns - 2.0 * rows
    gentle, level = tilted / 20, np.full((9, 9), 400.0)
    given = [np.rint(gentle), np.rint(gentle / 5) * 5, gentle, level, np.rint(tilted), level * np.nan]
    assert [terrain.terrace_step(values) for values in given] == [1, 5, None, None, None, None]


def test_units_have_several_names():
    known = {"m": 1, "metre": 1, "Foot": 0.3048, "ft": 0.3048, "US survey foot": 1200 / 3937}
    assert {name: terrain.metres_per_unit(name) for name in known} == known


def tangents_of(dem, cell_y, cell_x, azimuths, reach):
    m, n = horizons.horizon_margin(cell_y, cell_x, reach)
    padded = np.pad(dem, ((m, m), (n, n)), constant_values=np.nan)
    return horizons.horizon_tangent(padded, cell_y, cell_x, azimuths, reach)


def test_horizon_is_exact_along_axes_and_diagonals():
    """Also across a gap, which hides no sky."""
    dem, azimuths = hills((40, 40), seed=4), np.arange(8) * 45.0
    dem[[24, 14], [17, 24]] = np.nan
    found = tangents_of(dem, 10.0, 10.0, azimuths, 200.0)
    for direction, (down, right) in enumerate([(-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1)]):
        expected, row, column = 0.0, 21, 17
        for k in range(1, 21):
            i, j, distance = row + k * down, column + k * right, 10.0 * k * np.hypot(down, right)
            if 0 <= i < 40 and 0 <= j < 40 and distance <= 200 + 1e-9 and np.isfinite(dem[i, j]):
                expected = max(expected, (dem[i, j] - dem[row, column]) / distance)
        assert found[direction, row, column] == pytest.approx(expected, abs=1e-14)


def test_horizon_has_the_same_bits_in_every_window():
    dem, azimuths, reach = hills((90, 80), seed=7), horizons.azimuths(16), 150.0
    m, n = horizons.horizon_margin(10.0, 10.0, reach)
    whole = horizons.horizon_tangent(dem, 10.0, 10.0, azimuths, reach)
    part = horizons.horizon_tangent(dem[7 : 7 + 2 * m + 5, 3 : 3 + 2 * n + 2], 10.0, 10.0, azimuths, reach)
    np.testing.assert_array_equal(part, whole[:, 7:12, 3:5])


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


def test_sky_factor_is_clipped():
    """Sky vector of level open ground on a steep slope, a vector too long, and one behind the slope; no horizon."""
    east, north = -np.tan(np.radians(60.0)) * np.array([0.5, np.sqrt(0.75)])
    open_sky = terrain.Vector(*sky_vector(np.zeros(16), np.arange(16) * 22.5, 0.0, 0.0))
    assert sky_factor(open_sky, east, north) == pytest.approx(0.5, abs=1e-12)
    assert sky_factor(terrain.Vector(0.0, 0.0, 2.0), east, north) == pytest.approx(0.75, abs=1e-12)
    assert sky_factor(terrain.Vector(east, north, 0.1), east, north) == 0
    assert horizons.tangent([95.0, np.nan, 45.0]) == pytest.approx([0.0, 0.0, 1.0], abs=1e-12)


def sky_of(dem, cell, reach, saa):
    """Elevation and sky of `slope_light` at every cell of a raster, with the horizon at the same resolution."""
    tangents = tangents_of(dem, cell, cell, AZIMUTHS, reach)
    edged = np.pad(dem, 1, constant_values=np.nan)
    vector = sky_vector(tangents, AZIMUTHS, *gradient(edged, cell, cell))
    layers = np.concatenate([vector, horizons.horizon_toward(tangents, AZIMUTHS, saa)[None]])
    row, column = (np.arange(size) for size in dem.shape)
    return edged, lights.Sky(layers, row, np.zeros(row.size), column, np.zeros(column.size))


def light_of(dem, cell, geometry, reach=500.0):
    return lights.slope_light(*sky_of(dem, cell, reach, geometry.saa), (cell, cell), geometry)


def kt_of(light, rho, geometry, direct=0.7, total=0.9):
    ct = horizon_terrain_view(light.sky_view, light.cosine)
    return topographic_factor(light.sky_view, ct, rho, light.mu_s_local, geometry.mu_s, direct, total)


@pytest.mark.parametrize("turn", [0, 1, 2, 3])
@pytest.mark.parametrize(("elevation", "oblique"), [(12.0, 0.0), (12.0, 17.3), (45.0, 17.3)])
def test_length_of_the_shadow_of_a_plateau(elevation, oblique, turn):
    """20 m / tan(elevation) along the azimuth of the sun, also 17.3 degrees off the normal of the edge."""
    dem = np.zeros((120, 120))
    dem[:, 60:] = 20.0
    light = light_of(np.rot90(dem, -turn), 2.0, Geometry(90 - elevation, (90 * (turn + 1) - oblique) % 360))
    line = np.rot90(light.mu_s_local == 0, turn)[60]
    length = 20 / np.tan(np.radians(elevation)) * np.cos(np.radians(oblique))
    assert line[:60].sum() * 2.0 == pytest.approx(length, abs=2.0 + 1e-9)
    # Cell 60 is on the slope of the edge, which faces away from the sun.
    assert not line[61:].any()
    assert np.diff(line.astype(int)).clip(0).sum() == 1  # one run


def test_light_that_enters_a_pit_is_conserved():
    """For rho = 0, Kt times the area of the walls sums to the light that passes the opening of a part of a sphere."""
    radius, depth, size = 100.0, 0.4, 121
    rim = radius * np.sqrt(depth * (2 - depth))
    cell = 2.4 * rim / size
    distance = np.hypot(*(np.mgrid[:size, :size] - size // 2)) * cell
    dem = np.where(distance < rim, radius * (1 - depth) - np.sqrt(np.maximum(radius**2 - distance**2, 0)), 0.0)
    opening = np.pi * rim**2
    for geometry in (Geometry(20.0, 30.0), Geometry(50.0, 200.0), Geometry(70.0, 310.0)):
        light = light_of(dem, cell, geometry)
        # Cells approximate the rim: 2 % of the opening is within half a cell of it.
        for direct in (0.0, 0.5, 0.9):
            flux = kt_of(light, 0.0, geometry, direct) * cell**2 / light.cosine
            assert flux[distance < rim].sum() == pytest.approx(opening, rel=0.02)


@pytest.mark.parametrize("upwelling", [True, False])
def test_fused_factor_has_the_same_bits_with_and_without_reflectance(upwelling, monkeypatch):
    """Bits of the formulas over hills with a hole; also in strips of two rows, and for bands in another order."""
    dem, geometry = hills((30, 35), seed=5, relief=60.0), Geometry(55.0, 100.0, 30.0, 20.0)
    dem[3, 4] = np.nan
    rho, air = np.random.default_rng(4).uniform(0, 0.6, (2, *dem.shape)), np.array([[0.6, 0.8], [0.85, 0.95]])
    arguments = *sky_of(dem, 10.0, 300.0, geometry.saa), (10.0, 10.0), geometry, *air
    kt = kt_of(light_of(dem, 10.0, geometry, 300.0), rho, geometry, *air[:, :, None, None])
    assert np.isnan(kt).sum() == 2
    monkeypatch.setattr(lights, "_STRIP", 70)
    turned = np.moveaxis(np.ascontiguousarray(np.moveaxis(rho, 0, -1)), -1, 0)
    assert lights.slope_factor(turned, *arguments).tobytes() == kt.tobytes()
    factor, reflectance = lights.slope_factor_and_reflectance(rho, *arguments, upwelling)
    assert factor.tobytes() == kt.tobytes()
    assert reflectance.tobytes() == lights.slope_reflectance(rho, *arguments, upwelling).tobytes()


FALL = 1e-4


def flooded(elevation):
    """Ground filled from its border inward, lowest cell first (priority flood)."""
    filled = np.full(elevation.shape, np.inf)
    edge = [
        (elevation[place], place)
        for place in np.ndindex(elevation.shape)
        if 0 in place or place[0] == elevation.shape[0] - 1 or place[1] == elevation.shape[1] - 1
    ]
    for height, place in edge:
        filled[place] = height
    heapq.heapify(edge)
    while edge:
        height, (y, x) = heapq.heappop(edge)
        for place in [(y + a, x + b) for a in (-1, 0, 1) for b in (-1, 0, 1)]:
            inside = 0 <= place[0] < filled.shape[0] and 0 <= place[1] < filled.shape[1]
            if inside and np.isinf(filled[place]):
                filled[place] = max(elevation[place], height + FALL)
                heapq.heappush(edge, (filled[place], place))
    return filled


@pytest.fixture(scope="module")
def rough():
    """Hills with many pits."""
    return hills((37, 52), seed=3) + np.random.default_rng(1).normal(0, 4, (37, 52))


def test_filled_pits_agree_with_a_priority_flood(rough):
    filled = fill_pits(rough)
    np.testing.assert_allclose(filled, flooded(rough), rtol=0, atol=1e-9)
    assert (filled > rough).any() and (filled >= rough).all()


def test_border_cells_drain_the_whole_area(rough):
    """Only cells on the border have no lower neighbour, and together they drain the whole area."""
    filled = fill_pits(rough)
    area = drained_area(filled, 10.0, 20.0)
    around = np.pad(filled, 1, constant_values=np.inf)
    windows = np.lib.stride_tricks.sliding_window_view(around, (3, 3))
    ends = windows.min(axis=(2, 3)) == filled
    assert not ends[1:-1, 1:-1].any()
    assert area[ends].sum() == pytest.approx(rough.size * 200.0, rel=1e-12)
    assert area.min() >= 200.0


def test_wetness_of_a_plane():
    """Away from the sides, where water leaves: ln(distance from the top / slope)."""
    rows = np.arange(40.0)[:, None]
    plane = np.repeat(200.0 - 0.08 * 10.0 * rows, 81, axis=1)
    found = wetness_index(plane, 10.0, 10.0)[:, 40]
    np.testing.assert_allclose(found[:30], np.log((rows[:30, 0] + 1) * 10.0 / 0.08), rtol=0, atol=2e-3)


def test_wetness_of_mirrored_ground_is_mirrored(rough):
    found = wetness_index(rough, 10.0, 20.0)
    np.testing.assert_allclose(wetness_index(rough[::-1], 10.0, 20.0)[::-1], found, rtol=0, atol=1e-9)
    np.testing.assert_allclose(wetness_index(rough.T, 20.0, 10.0).T, found, rtol=0, atol=1e-9)


def test_wetness_of_level_ground_and_small_rasters_is_finite():
    assert np.isfinite(wetness_index(np.full((6, 7), 3.0), 5.0, 5.0)).all()
    assert wetness_index(np.full((1, 1), 3.0), 5.0, 5.0)[0, 0] == pytest.approx(np.log(5.0 / LEAST_SLOPE))
    assert wetness_index(np.array([[3.0, 2.0]]), 5.0, 5.0).shape == (1, 2)


def test_missing_cells_drain_their_neighbours(rough):
    gap = rough.copy()
    gap[15:18, 20:30] = np.nan
    np.testing.assert_array_equal(np.isnan(wetness_index(gap, 10.0, 10.0)), np.isnan(gap))
    assert np.isfinite(drained_area(fill_pits(gap), 10.0, 10.0)).all()


def test_drained_area_is_divided_by_a_power_of_the_slope():
    """Water of a top 1 m above its neighbours, on cells of 10 m by 20 m, is divided by slope to the power 1.1."""
    top = np.zeros((3, 3))
    top[1, 1] = 1.0
    distance = np.hypot(10.0 * np.array([-1, 0, 1])[:, None], 20.0 * np.array([-1, 0, 1]))
    share = np.where(distance > 0, (1 / np.where(distance > 0, distance, 1)) ** 1.1, 0.0)
    expected = 200.0 * (1 + share / share.sum())
    np.testing.assert_allclose(drained_area(top, 10.0, 20.0), expected, rtol=1e-12)
