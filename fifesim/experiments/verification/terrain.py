"""Checks of the terrain on surfaces whose slope, sky and light are known."""

from functools import partial

import numpy as np

from fifesim.experiments.verification.deviations import Deviation, largest
from fifesim.ground.terrain import horizon
from fifesim.ground.terrain import light as illumination
from fifesim.ground.terrain import sky as skies
from fifesim.ground.terrain import slope as terrain
from fifesim.ground.terrain import spline as dem

_deviation = partial(Deviation, "terrain")

_PLANES = tuple((slope, aspect) for slope in (0.5, 12.0, 45.0, 75.0) for aspect in (0.0, 37.0, 135.0, 201.5, 359.0))


def _plane(slope, aspect):
    """Elevations of a plane on cells of 20 x 30 m. [m]"""
    i, j = np.mgrid[:7, :9]
    a = np.radians(aspect)
    return 1000 - np.tan(np.radians(slope)) * (30.0 * j * np.sin(a) - 20.0 * i * np.cos(a))


def _vector(zenith, azimuth):
    zenith, azimuth = np.radians(zenith), np.radians(azimuth)
    return np.array([np.sin(zenith) * np.sin(azimuth), np.sin(zenith) * np.cos(azimuth), np.cos(zenith)])


def _slopes():
    """Elevations of 1000 m leave 1e-13 m, and the gentlest slope turns that into 1e-10 degree."""
    found = [terrain.slope_aspect(_plane(*plane), 20.0, 30.0) for plane in _PLANES]
    slope = np.max([largest(one[0], plane[0]) for one, plane in zip(found, _PLANES, strict=True)])
    turned = [(one[1] - plane[1] + 180) % 360 - 180 for one, plane in zip(found, _PLANES, strict=True)]
    yield _deviation("slope of planes (Horn)", slope, 1e-9, "degree", "plane")
    yield _deviation("aspect of planes (Horn)", largest(turned, 0), 1e-9, "degree", "plane")


def _skies():
    """A horizon is known in 32 directions, and is a great circle between them: half a percent in a valley."""
    slopes, open_sky = np.array([0.0, 5.0, 30.0, 60.0]), np.full((32, 1), 90.0)
    wide = [skies.sky_view(slope, 100.0, open_sky[:, 0]) for slope in slopes]
    analytic = (1 + np.cos(np.radians(slopes))) / 2
    yield _deviation("sky seen from a wide plane", largest(wide, analytic), 1e-12, "1", "(1 + cos slope) / 2")
    walls = np.array([5.0, 20.0, 45.0])
    across = np.abs(np.sin(np.radians(horizon.azimuths(32))))
    valleys = [horizon.zenith(np.tan(np.radians(wall)) * across) for wall in walls]
    floor = [skies.sky_view(0.0, 0.0, valley) for valley in valleys]
    worst = 100 * largest(floor, np.cos(np.radians(walls)), relative=True)
    yield _deviation("sky seen from the floor of a V valley", worst, 0.5, "%", "cos(wall)")
    foot = [skies.sky_view(wall, 90.0, valley) for wall, valley in zip(walls, valleys, strict=True)]
    worst = 100 * largest(foot, (1 + np.cos(np.radians(2 * walls))) / 2, relative=True)
    yield _deviation("sky seen from the foot of its wall", worst, 0.5, "%", "(1 + cos 2 wall) / 2")


def _valley_of_cells():
    """Walls of 20 degrees and 300 m that end at a level upland: the floor, and half way up."""
    wall, half, cell, reach = np.radians(20.0), 30, 10.0, 1000.0
    x = (np.arange(6 * half + 1) - 3 * half) * cell
    elevation = np.broadcast_to(np.minimum(np.abs(x), half * cell) * np.tan(wall), (5, x.size))
    m, n = horizon.horizon_margin(cell, cell, reach)
    padded = np.pad(np.pad(elevation, ((m, m), (0, 0)), mode="edge"), ((0, 0), (n, n)), constant_values=np.nan)
    directions = horizon.azimuths(32)
    slope, aspect = terrain.slope_aspect(np.pad(elevation, 1, mode="edge"), cell, cell)
    zenith = horizon.horizon_zenith(padded, cell, cell, directions, reach)
    sky = skies.sky_view(slope, aspect, zenith, directions)[2]
    rim = np.arctan(np.tan(wall) / 3)  # the far one, half a depth up and three quarters of a width away
    found, analytic = sky[[3 * half, 3 * half + half // 2]], [np.cos(wall), (1 + np.cos(rim + wall)) / 2]
    worst = 100 * largest(found, analytic, relative=True)
    yield _deviation("sky of a valley of cells, floor and wall", worst, 0.5, "%", "sines of its two limits")


def _light():
    """Sun by the cosine of its angle, and an even sky by the share that a plane sees."""
    sza, saa, direct, total = 50.0, 110.0, 0.55, 0.8
    mu_s = np.cos(np.radians(sza))
    worst = 0.0
    for plane in _PLANES:
        east, north = terrain.gradient(_plane(*plane), 20.0, 30.0)
        sky = skies.sky_view(*plane, np.full(32, 90.0))
        sun = np.maximum(terrain.along_normal(illumination.direction_vector(sza, saa), east, north), 0.0)
        ct = skies.terrain_view(sky, np.cos(np.radians(plane[0])))
        found = illumination.topographic_factor(sky, ct, 0.3, sun, mu_s, direct, total)
        beam = max(_vector(*plane) @ _vector(sza, saa), 0.0) / mu_s * direct
        expected = (beam + (1 + np.cos(np.radians(plane[0]))) / 2 * (total - direct)) / total
        worst = np.maximum(worst, largest(found, expected))
    yield _deviation("Kt of planes", worst, 1e-9, "1", "cosine law, Liu and Jordan (1960)")


def _shadow():
    """The edge of a shadow is known to a cell."""
    cliff = np.where(np.arange(120) < 60, 0.0, 20.0) * np.ones((3, 1))
    m, n = horizon.horizon_margin(2.0, 2.0, 140.0)
    padded = np.pad(cliff, ((m, m), (n, n)), mode="edge")
    tangents = horizon.horizon_tangent(padded, 2.0, 2.0, np.array([90.0]), 140.0)[0, 1]
    worst = 0.0
    for elevation in (12.0, 20.0, 45.0):
        dark = tangents[:60] > np.tan(np.radians(elevation))
        worst = np.maximum(worst, abs(2.0 * dark.sum() - 20.0 / np.tan(np.radians(elevation))))
    yield _deviation("length of the shadow of a cliff of 20 m", worst, 2.0, "m", "20 m / tan(elevation)")


def _upsampling():
    """A quintic spline loses 2e-4 of waves of six cells, and less of longer ones."""
    rows, columns = np.mgrid[:100, :90]
    y, x = 40 + np.arange(90) / 9, 38 + np.arange(80) / 9
    worst = 0.0
    for turn in (0.0, 30.0, 45.0):
        u, v = 2 * np.pi / 6 * np.cos(np.radians(turn)), 2 * np.pi / 6 * np.sin(np.radians(turn))
        found = dem.spline_grid(dem.spline_coefficients(np.sin(u * columns + v * rows)), y, x)
        worst = np.maximum(worst, largest(found, np.sin(u * x + v * y[:, None])))
    yield _deviation("wave of six cells, nine times finer", worst, 2e-4, "1", "the wave itself")


CHECKS = (_slopes, _skies, _valley_of_cells, _light, _shadow, _upsampling)
