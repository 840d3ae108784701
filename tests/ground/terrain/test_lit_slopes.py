"""Tests of light on slopes: cosines, shadows, Kt and conservation of energy."""

import numpy as np
import pytest
from oracles_terrain import hills, plane, plane_gradient

from fifesim.base.geometry import Geometry
from fifesim.ground.terrain import horizon as horizons
from fifesim.ground.terrain import lit_slopes as lights
from fifesim.ground.terrain.horizon import horizon_sky_view, horizon_terrain_view, sky_vector
from fifesim.ground.terrain.slope import gradient, topographic_factor

AZIMUTHS = horizons.azimuths(32)


def sky_of(dem, cell, reach, saa):
    """Elevation and sky of `slope_light` at every cell of a raster, with the horizon at the same resolution."""
    m, n = horizons.horizon_margin(cell, cell, reach)
    padded = np.pad(dem, ((m, m), (n, n)), constant_values=np.nan)
    tangents = horizons.horizon_tangent(padded, cell, cell, AZIMUTHS, reach)
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


def test_light_on_planes_agrees_with_formulas():
    """Cosines by spherical trigonometry."""
    geometry = Geometry(50.0, 110.0, 20.0, 300.0)

    def cosine(slope, aspect, zenith, azimuth):
        (s, z), across = np.radians([slope, zenith]), np.cos(np.radians(azimuth - aspect))
        return np.cos(s) * np.cos(z) + np.sin(s) * np.sin(z) * across

    for slope, aspect in ((0, 0), (15, 80), (40, 250), (60, 300)):
        light = light_of(plane((12, 14), 10.0, 10.0, slope, aspect), 10.0, geometry)
        mu_s, mu_v = (max(cosine(slope, aspect, *toward), 0.0) for toward in ((50.0, 110.0), (20.0, 300.0)))
        sky = horizon_sky_view(np.zeros(32), AZIMUTHS, *plane_gradient(slope, aspect))
        wanted = [np.cos(np.radians(slope)), sky, mu_s, mu_v / np.cos(np.radians(20.0))]
        for found, value, tolerance in zip(light, wanted, (1e-12, 2e-4, 1e-12, 1e-12), strict=True):
            np.testing.assert_allclose(found, value, rtol=0, atol=tolerance)


@pytest.mark.parametrize("turn", [0, 1, 2, 3])
@pytest.mark.parametrize("oblique", [0.0, 17.3])
@pytest.mark.parametrize("elevation", [12.0, 20.0, 45.0])
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


def pit(size=121, radius=100.0, depth=0.4):
    rim = radius * np.sqrt(depth * (2 - depth))
    cell = 2.4 * rim / size
    y, x = (np.mgrid[:size, :size] - size // 2) * cell
    z = radius * (1 - depth) - np.sqrt(np.maximum(radius**2 - x**2 - y**2, 0))
    return np.minimum(np.where(x**2 + y**2 < rim**2, z, 0.0), 0.0), cell, np.hypot(x, y) < rim, np.pi * rim**2


def test_light_that_enters_a_pit_is_conserved():
    """For rho = 0, Kt times the area of the walls sums to the light that passes the opening."""
    dem, cell, inside, opening = pit()
    for geometry in (Geometry(20.0, 30.0), Geometry(50.0, 200.0), Geometry(70.0, 310.0)):
        light = light_of(dem, cell, geometry)
        area = cell**2 / light.cosine
        # Cells approximate the rim: 2 % of the opening is within half a cell of it.
        for direct in (0.0, 0.5, 0.9):
            flux = (kt_of(light, 0.0, geometry, direct) * area)[inside].sum()
            assert flux == pytest.approx(opening, rel=0.02)


def test_rotating_terrain_and_directions_rotates_the_light():
    dem = hills((41, 41), seed=3, relief=60.0)
    before = light_of(dem, 10.0, Geometry(60.0, 35.0, 25.0, 290.0))
    # `rot90` rotates counterclockwise, from east to north: azimuths decrease by 90 degrees.
    after = light_of(np.rot90(dem), 10.0, Geometry(60.0, 305.0, 25.0, 200.0))
    np.testing.assert_allclose(np.rot90(before, axes=(1, 2)), after, rtol=0, atol=1e-9)
    assert before.sky_view.std() > 1e-3 and (before.mu_s_local == 0).any()


@pytest.fixture
def lit():
    """Arguments of fused passes over hills with a hole, and their light and Kt from the formulas."""
    dem, geometry = hills((30, 35), seed=5, relief=60.0), Geometry(55.0, 100.0, 30.0, 20.0)
    dem[3, 4] = np.nan
    rho = np.random.default_rng(4).uniform(0, 0.6, (2, *dem.shape))
    direct, total = np.array([0.6, 0.8]), np.array([0.85, 0.95])
    light = light_of(dem, 10.0, geometry, 300.0)
    kt = kt_of(light, rho, geometry, direct[:, None, None], total[:, None, None])
    return (rho, *sky_of(dem, 10.0, 300.0, geometry.saa), (10.0, 10.0), geometry, direct, total), light, kt


def test_fused_reflectance_is_rho_times_kt_times_the_upwelling_factor(lit):
    arguments, light, kt = lit
    expected = arguments[0] * kt
    np.testing.assert_allclose(lights.slope_reflectance(*arguments, upwelling=False), expected, rtol=1e-13)
    np.testing.assert_allclose(lights.slope_reflectance(*arguments), expected * light.upwelling, rtol=1e-13)
    assert np.isnan(expected).sum() == 2


@pytest.mark.parametrize("upwelling", [True, False])
def test_fused_factor_has_the_same_bits_with_and_without_reflectance(lit, upwelling, monkeypatch):
    """Also in strips of two rows."""
    arguments, _, kt = lit
    monkeypatch.setattr(lights, "_STRIP", 70)
    assert lights.slope_factor(*arguments).tobytes() == kt.tobytes()
    factor, reflectance = lights.slope_factor_and_reflectance(*arguments, upwelling)
    assert factor.tobytes() == kt.tobytes()
    assert reflectance.tobytes() == lights.slope_reflectance(*arguments, upwelling).tobytes()


@pytest.mark.parametrize("make", [lights.slope_factor, lights.slope_reflectance])
def test_memory_layout_of_bands_changes_no_bit(lit, make):
    rho, *others = lit[0]
    turned = np.moveaxis(np.ascontiguousarray(np.moveaxis(rho, 0, -1)), -1, 0)
    np.testing.assert_array_equal(make(turned, *others), make(rho, *others))


def test_sky_is_interpolated_between_its_cells():
    """A linear sky is exact between and beyond its cells; selected rows have the same bits."""
    rows, columns = np.arange(20.0), np.arange(24.0)
    value = 0.6 + 0.01 * rows[:, None] + 0.005 * columns
    layers = np.zeros((4, 5, 3))
    layers[2] = value[4:17:3, 5:18:6]
    row = np.clip((rows - 4).astype(int) // 3, 0, 3)
    column = np.clip((columns - 5).astype(int) // 6, 0, 1)
    sky = lights.Sky(layers, row, (rows - 4 - 3 * row) / 3, column, (columns - 5 - 6 * column) / 6)
    light = lights.slope_light(np.zeros((22, 26)), sky, (1.0, 1.0), Geometry(30.0, 0.0))
    np.testing.assert_allclose(light.sky_view, np.clip(value, 0, 1), rtol=1e-12)
    some = sky._replace(row=row[9:14], row_share=sky.row_share[9:14])
    part = lights.slope_light(np.zeros((7, 26)), some, (1.0, 1.0), Geometry(30.0, 0.0))
    np.testing.assert_array_equal(part.sky_view, light.sky_view[9:14])
