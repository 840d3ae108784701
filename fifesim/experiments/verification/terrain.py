"""Checks of the terrain on surfaces whose slope, sky and light are known."""

from functools import partial
from itertools import product

import numpy as np

from fifesim.base.geometry import Geometry
from fifesim.experiments.verification import elevation
from fifesim.experiments.verification.deviations import Deviation, largest
from fifesim.ground.terrain import horizon
from fifesim.ground.terrain import lit_slopes as lights
from fifesim.ground.terrain import sky as skies
from fifesim.ground.terrain import slope as terrain

_deviation = partial(Deviation, "terrain")

_PLANES = tuple((slope, aspect) for slope in (0.5, 12.0, 45.0, 75.0) for aspect in (0.0, 37.0, 135.0, 201.5, 359.0))


def _plane(slope, aspect, shape=(7, 9)):
    """Elevations of a plane on cells of 20 x 30 m. [m]"""
    i, j = np.indices(shape)
    a = np.radians(aspect)
    return 1000 - np.tan(np.radians(slope)) * (30.0 * j * np.sin(a) - 20.0 * i * np.cos(a))


def _sky_view(slope, aspect, zenith):
    """Of a slope under a horizon that is known from north on."""
    steep, azimuth = np.tan(np.radians(slope)), np.radians(aspect)
    tangents, directions = horizon.tangent(zenith), horizon.azimuths(len(zenith))
    return skies.sky_view(tangents, directions, -steep * np.sin(azimuth), -steep * np.cos(azimuth))


def _vector(zenith, azimuth):
    zenith, azimuth = np.radians(zenith), np.radians(azimuth)
    return np.array([np.sin(zenith) * np.sin(azimuth), np.sin(zenith) * np.cos(azimuth), np.cos(zenith)])


def _slopes():
    """Elevations of 1000 m leave 1e-13 m, and the gentlest slope makes that 1e-10 degree. An edge may be unknown."""
    worst = np.zeros(2)
    for edge in (np.s_[9:], np.s_[0], np.s_[-1], np.s_[:, 0], np.s_[:, -1]):
        for slope, aspect in _PLANES:
            plane = _plane(slope, aspect)
            plane[edge] = np.nan
            tilt, azimuth = terrain.slope_aspect(plane, 20.0, 30.0)
            worst = np.maximum(worst, [largest(tilt, slope), largest((azimuth - aspect + 180) % 360, 180)])
    yield _deviation("slope of planes, central differences", worst[0], 1e-9, "degree", "plane")
    yield _deviation("aspect of planes, central differences", worst[1], 1e-9, "degree", "plane")
    ridge = _plane(30.0, 90.0)
    ridge[3, [3, 5]] = np.nan
    between = terrain.gradient(ridge, 20.0, 30.0)[0][2, 3]
    yield _deviation("slope between two unknown cells", abs(between), 0.0, "1", "none is known")


def _skies():
    """A horizon is known in 32 directions, and is a great circle between them: half a percent in a valley."""
    slopes = np.array([0.0, 5.0, 30.0, 60.0])
    wide = [_sky_view(slope, 100.0, np.full(32, 90.0)) for slope in slopes]
    analytic = (1 + np.cos(np.radians(slopes))) / 2
    yield _deviation("sky seen from a wide plane", largest(wide, analytic), 1e-12, "1", "(1 + cos slope) / 2")
    walls = np.array([5.0, 20.0, 45.0])
    across = np.abs(np.sin(np.radians(horizon.azimuths(32))))
    valleys = [horizon.zenith(np.tan(np.radians(wall)) * across) for wall in walls]
    floor = [_sky_view(0.0, 0.0, valley) for valley in valleys]
    worst = 100 * largest(floor, np.cos(np.radians(walls)), relative=True)
    yield _deviation("sky seen from the floor of a V valley", worst, 0.5, "%", "cos(wall)")
    foot = [_sky_view(wall, 90.0, valley) for wall, valley in zip(walls, valleys, strict=True)]
    worst = 100 * largest(foot, (1 + np.cos(np.radians(2 * walls))) / 2, relative=True)
    yield _deviation("sky seen from the foot of its wall", worst, 0.5, "%", "(1 + cos 2 wall) / 2")


def _valley_of_cells():
    """Walls of 20 degrees and 300 m that end at a level upland: the floor, and half way up."""
    wall, half, cell, reach = np.radians(20.0), 30, 10.0, 1000.0
    x = (np.arange(6 * half + 1) - 3 * half) * cell
    ground = np.broadcast_to(np.minimum(np.abs(x), half * cell) * np.tan(wall), (5, x.size))
    m, n = horizon.horizon_margin(cell, cell, reach)
    padded = np.pad(np.pad(ground, ((m, m), (0, 0)), mode="edge"), ((0, 0), (n, n)), constant_values=np.nan)
    directions = horizon.azimuths(32)
    slope, aspect = terrain.slope_aspect(np.pad(ground, 1, mode="edge"), cell, cell)
    zenith = horizon.horizon_zenith(padded, cell, cell, directions, reach)
    sky = _sky_view(slope, aspect, zenith)[2]
    rim = np.arctan(np.tan(wall) / 3)  # the far one, half a depth up and three quarters of a width away
    found, analytic = sky[[3 * half, 3 * half + half // 2]], [np.cos(wall), (1 + np.cos(rim + wall)) / 2]
    worst = 100 * largest(found, analytic, relative=True)
    yield _deviation("sky of a valley of cells, floor and wall", worst, 0.5, "%", "sines of its two limits")


def _any_sky():
    """Horizons of any shape, and slopes that rise above them; the midpoint rule meets kinks of the horizon."""
    rng = np.random.default_rng(5)
    phi, step = (np.arange(40_000) + 0.5) * 2 * np.pi / 40_000, 2 * np.pi / 24
    first, part = (phi // step).astype(int), phi % step
    worst = 0.0
    for slope, aspect in ((0.0, 0.0), (20.0, 75.0), (50.0, 200.0), (70.0, 330.0)):
        tangents = rng.uniform(0, 1.2, 24)
        land = (tangents[first] * np.sin(step - part) + tangents[(first + 1) % 24] * np.sin(part)) / np.sin(step)
        tilt, toward = np.radians(slope), phi - np.radians(aspect)
        h = np.arctan2(1.0, np.maximum(np.maximum(land, -np.tan(tilt) * np.cos(toward)), 0.0))
        integrand = np.cos(tilt) * np.sin(h) ** 2 + np.sin(tilt) * np.cos(toward) * (h - np.sin(h) * np.cos(h))
        found = _sky_view(slope, aspect, horizon.zenith(tangents))
        worst = np.maximum(worst, largest(found, np.mean(integrand)))
    yield _deviation("sky under a rugged horizon", worst, 1e-7, "1", "Dozier and Frew (1990), Eq. 7b, quadrature")


def _horizons():
    """A plane rises alike in all samples of a ray, as far as they reach; a ridge is straight between two directions."""
    worst = 0.0
    for slope, aspect in ((35.0, 210.0), (5.0, 17.0)):
        directions = 3.0 + horizon.azimuths(32)
        m, n = horizon.horizon_margin(20.0, 30.0, 1500.0)
        rise = -np.tan(np.radians(slope)) * np.cos(np.radians(directions - aspect))
        found = horizon.horizon_tangent(_plane(slope, aspect, (2 * m + 2, 2 * n + 2)), 20.0, 30.0, directions, 1500.0)
        worst = np.maximum(worst, largest(found, np.maximum(rise, 0.0)[:, None, None]))
        for azimuth in (0.0, 33.3, 351.0):
            toward = horizon.horizon_toward(rise, directions, azimuth)
            worst = np.maximum(
                worst, largest(toward, -np.tan(np.radians(slope)) * np.cos(np.radians(azimuth - aspect)))
            )
    yield _deviation("horizon of planes in all directions", worst, 1e-8, "1", "plane")


def _uneven_skies():
    """Sky and horizon toward the sun of 22 x 26 cells, and at places: such that rise evenly, and those of one place."""
    row, column = np.mgrid[:22, :26]
    at, along = row[:, 0], column[0]
    vector = np.array(
        [0.1 + 0.01 * row - 0.02 * column, 0.02 * row + 0.01 * column - 0.2, 0.01 * row + 0.05 * column - 0.1]
    )
    tangent = 0.2 + 0.031 * row + 0.017 * column
    before, beside = np.clip((at - 3) // 6, 0, 2), np.clip((along - 4) // 7, 0, 2)
    layers = np.concatenate([vector, tangent[None]])
    yield (
        vector,
        tangent,
        lights.Sky(layers[:, 3::6, 4::7], before, (at - 3) / 6 - before, beside, (along - 4) / 7 - beside),
    )
    vector, wall = np.full(vector.shape, 0.2), np.full(row.shape, np.inf)
    layers = np.concatenate([vector, wall[None]])
    yield vector, wall, lights.Sky(layers[:, :1, :1], 0 * at, np.zeros(22), 0 * along, np.zeros(26))


def _light():
    """Sun by the cosine of its angle, an uneven sky by its share, the land by what a slope sees; a cell is missing."""
    geometry, cell = Geometry(50.0, 110.0, 35.0, 300.0), (20.0, 30.0)
    sun, sensor = _vector(50.0, 110.0), _vector(35.0, 300.0)
    direct, total = np.array([0.55, 0.3])[:, None, None], np.array([0.8, 0.7])[:, None, None]
    rho = np.random.default_rng(3).uniform(0, 0.6, (2, 22, 26))
    known = np.ones(rho.shape[1:], bool)
    known[9, 12] = False
    worst = np.zeros(2)
    for plane, (vector, tangent, sky) in product(_PLANES, _uneven_skies()):
        normal, dem = _vector(*plane), _plane(*plane, (24, 28))
        dem[10, 13] = np.nan
        open_sky = (1 + normal[2]) / 2
        sky_view = np.clip(np.tensordot(normal, vector, 1), 0, open_sky)
        mu_s = np.where(tangent <= 1 / np.tan(np.radians(50.0)), max(normal @ sun, 0.0), 0.0)
        view = np.full(known.shape, max(normal @ sensor, 0.0) / sensor[2])
        found = np.stack(lights.slope_light(dem, sky, cell, geometry))
        expected = np.stack([np.full(known.shape, normal[2]), sky_view, mu_s, view])
        kept = np.isnan(found[:, ~known]).all()
        worst[0] = np.maximum(worst[0], largest(found[:, known], expected[:, known]) if kept else np.nan)
        flux = direct * mu_s / sun[2] + (total - direct) * sky_view + total * rho * (open_sky - sky_view)
        for factor, upwelling in ((view, True), (1.0, False)):
            seen = lights.slope_reflectance(rho, dem, sky, cell, geometry, direct.ravel(), total.ravel(), upwelling)
            worst[1] = np.maximum(worst[1], largest(seen[:, known], (rho * flux / total * factor)[:, known]))
    yield _deviation("sun, sky and view of planes", worst[0], 1e-9, "1", "vectors, cosine law")
    yield _deviation("reflectance of planes", worst[1], 1e-9, "1", "Eqs. 4 and 5 as sums of light")


def _shadow():
    """The edge of a shadow is known to a cell; the cliff is seen from as far as the reach."""
    cliff = np.where(np.arange(120) < 60, 0.0, 20.0) * np.ones((3, 1))
    m, n = horizon.horizon_margin(2.0, 2.0, 120.0)
    padded = np.pad(cliff, ((m, m), (n, n)), mode="edge")
    tangents = horizon.horizon_tangent(padded, 2.0, 2.0, np.array([90.0]), 120.0)[0, 1, :60]
    worst = largest(tangents, 20.0 / (120.0 - 2.0 * np.arange(60)))
    yield _deviation("horizon of a cliff of 20 m", worst, 1e-12, "1", "20 m / distance")
    sun = np.radians([12.0, 20.0, 45.0])
    lengths = 2.0 * np.sum(tangents > np.tan(sun)[:, None], axis=1)
    worst = largest(lengths, 20.0 / np.tan(sun))
    yield _deviation("length of its shadow", worst, 2.0, "m", "20 m / tan(elevation)")


CHECKS = (_slopes, _skies, _any_sky, _valley_of_cells, _horizons, _light, _shadow, *elevation.CHECKS)
