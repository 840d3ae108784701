"""Checks of terrain and elevation on surfaces and equations with known solutions."""

from functools import partial
from itertools import product

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph, linalg

from fifesim.base.geometry import Geometry
from fifesim.ground.terrain import flint_hills, horizon, spline
from fifesim.ground.terrain import lit_slopes as lights
from fifesim.ground.terrain import slope as terrain
from verification.deviations import Deviation, largest

_deviation = partial(Deviation, "terrain")

_NEIGHBOURS = [(down, across) for down in (-1, 0, 1) for across in (-1, 0, 1) if down or across]


def _upsampling():
    """Check spline upsampling, which loses 2e-4 of waves of six cells, and less of longer waves."""
    rows, columns = np.mgrid[:100, :90]
    y, x = 40 + np.arange(90) / 9, 38 + np.arange(80) / 9
    worst = 0.0
    for turn in (0.0, 30.0, 45.0):
        u, v = 2 * np.pi / 6 * np.cos(np.radians(turn)), 2 * np.pi / 6 * np.sin(np.radians(turn))
        wave, coefficients = np.sin(u * x + v * y[:, None]), spline.spline_coefficients(np.sin(u * columns + v * rows))
        found = [
            spline.spline_grid(coefficients, y, x),
            spline.spline_points(coefficients, *np.meshgrid(y, x, indexing="ij")),
            spline.spline_of_tiles(lambda i, j, of=coefficients: of[10 * i :, 10 * j :][:10, :10], 10, y, x),
        ]
        worst = np.maximum(worst, largest(found, wave))
    yield _deviation("wave of six cells, nine times finer", worst, 2e-4, "1", "the wave itself")


def _unknown_cells():
    """Check filled gaps up to the largest size; the second differences of a paraboloid balance everywhere."""
    rows, columns = np.mgrid[:60, :70]
    plane = 400.0 + 3.0 * columns - 2.0 * rows
    bent = plane + 0.05 * columns**2 - 0.03 * rows**2 + 0.04 * rows * columns
    holed = bent.copy()
    holed[20:29, 30:39], holed[40, 50], holed[43:47, 47:53] = np.nan, np.nan, np.nan
    yield _deviation("paraboloid in its holes", largest(spline.fill_gaps(holed, (4, 4)), bent), 1e-8, "m", "paraboloid")
    cut = np.full(plane.shape, np.nan)
    cut[15:45, 20:50] = plane[15:45, 20:50]
    carried = spline.extend(cut, 12, rest=False)
    reached = np.isfinite(carried)
    worst = largest(carried[reached], plane[reached]) if reached[3:57, 8:62].all() else np.nan
    yield _deviation("plane past its edge", worst, 1e-8, "m", "plane")


def _drainage(ground, preference, node):
    """Steepest descent: the nodes that drain, the nodes to which they drain, and the distances."""
    index, middle = np.arange(ground.size).reshape(ground.shape), (slice(1, -1),) * 2
    lengths = np.array([node * np.hypot(*step) for step in _NEIGHBOURS])
    falls, others = [], []
    for (down, across), length, liked in zip(_NEIGHBOURS, lengths, preference, strict=True):
        there = np.roll(ground, (-down, -across), (0, 1))[middle], np.roll(index, (-down, -across), (0, 1))[middle]
        falls.append((ground[middle] - there[0]) / length * liked.reshape(ground.shape)[middle])
        others.append(there[1])
    steepest = np.argmax(falls, axis=0)[None]
    falls, others = (np.take_along_axis(np.array(each), steepest, 0)[0] for each in (falls, others))
    drains = falls > 0
    return index[middle][drains], others[drains], lengths[steepest[0]][drains]


def _areas(ground, drained, node):
    """Area that drains through each node, by a system of linear equations."""
    here, there, _ = drained
    given = sparse.csc_array((np.ones(there.size), (there, here)), shape=(ground.size, ground.size))
    return linalg.spsolve((sparse.eye_array(ground.size) - given).tocsc(), np.full(ground.size, node**2))


def _eroded(ground, erodibility, preference, law):
    """One unit of time of erosion, with sparse systems for areas and for implicit stream power."""
    ground, step = ground.copy(), 1 / law.steps
    parts = int(law.creep * step / law.node**2 / 0.2) + 1
    for _ in range(law.steps):
        drained = here, there, way = _drainage(ground, preference, law.node)
        rate = step * erodibility.ravel()[here] * _areas(ground, drained, law.node)[here] ** law.area_exponent / way
        places = np.tile(here, 2), np.concatenate([here, there])
        cut = sparse.csc_array((np.concatenate([rate, -rate]), places), shape=(ground.size, ground.size))
        ground = linalg.spsolve((sparse.eye_array(ground.size) + cut).tocsc(), ground.ravel()).reshape(ground.shape)
        for _ in range(parts):
            bent = sum(np.roll(ground, shift, axis) for shift in (-1, 1) for axis in (0, 1)) - 4 * ground
            risen = ground + law.creep * step / parts * bent / law.node**2 + law.uplift * step / parts
            ground[1:-1, 1:-1] = risen[1:-1, 1:-1]
    return ground


def _ways():
    rng, size = np.random.default_rng(2), 21
    cost, index = rng.uniform(0.5, 3.0, (size, size)), np.arange(size**2).reshape(size, size)
    links = []
    for down, across in ((0, 1), (1, 0), (1, 1), (1, -1)):
        here = index[: size - down, max(-across, 0) : size - max(across, 0)].ravel()
        there = here + down * size + across
        links.append((here, there, np.hypot(down, across) * (cost.ravel()[here] + cost.ravel()[there]) / 2))
    here, there, length = np.concatenate(links, axis=1)
    graph = sparse.csr_array((length, (here.astype(int), there.astype(int))), shape=(size**2, size**2))
    border = np.setdiff1d(index, index[1:-1, 1:-1])
    least = csgraph.dijkstra(graph, directed=False, indices=border, min_only=True).reshape(size, size)
    worst = largest(flint_hills.least_ways(cost), least)
    yield _deviation("least ways to a river", worst, 1e-12, "1", "Dijkstra (1959)")


def _erosion():
    """Check erosion of a small upland step by step, and that everything above base level is cut in the long run."""
    rng, size, node = np.random.default_rng(2), 21, 30.0
    start = 300 + 20 * rng.uniform(0.5, 3.0, (size, size))
    rock, liked = rng.uniform(0.02, 0.1, start.shape), rng.uniform(0.8, 1.2, (8, start.size))
    law = flint_hills.StreamPower(steps=4, area_exponent=0.519, uplift=40.0, creep=900.0, node=node)
    found = flint_hills.erode(start, rock, liked, law)
    worst = largest(found, _eroded(start, rock, liked, law))
    yield _deviation("hills step by step", worst, 1e-9, "m", "sparse systems")
    start, rock = 300 + flint_hills.least_ways(np.ones(start.shape)), 1e4 * rock
    steady = flint_hills.erode(start, rock, np.ones_like(liked), law._replace(steps=20, creep=0.0))
    steady[1:-1, 1:-1] -= 40.0 / 20
    drained = here, there, way = _drainage(steady, np.ones_like(liked), node)
    fall = (steady.ravel()[here] - steady.ravel()[there]) / way
    cut = rock.ravel()[here] * _areas(steady, drained, node)[here] ** 0.519 * fall
    yield _deviation("steady valleys cut what rises", largest(cut / 40, 1), 1e-9, "1", "law of stream power")


def _hills():
    """Check elevations at quantiles against a survey, and the variance of noise within four standard errors."""
    eroded = np.array([322.1, 398.9, 506.3, 751.0, 923.6, 1035.7, 1087.9, 1097.7, 1108.3])
    surveyed = np.array([334.0, 341.0, 352.0, 379.0, 400.0, 412.0, 434.0, 440.0, 443.5])
    beyond = flint_hills.hypsometry(np.array([312.1, 1118.3])) - [334.0, 443.5]
    worst = np.maximum(largest(flint_hills.hypsometry(eroded), surveyed), largest(beyond, [-2.0, 2.0]))
    yield _deviation("quantiles of elevation", worst, 1e-9, "m", "Kings Creek, USGS 3DEP; lines beyond")
    at = np.arange(900) * 2.5
    noise = spline.smooth_noise(1, 5, 5.0, at, at)
    yield _deviation("variance of smooth noise", abs(np.mean(noise**2) - 1), 0.015, "1", "B-spline of degree 11")


ELEVATION_CHECKS = (_upsampling, _unknown_cells, _ways, _erosion, _hills)


_PLANES = tuple((slope, aspect) for slope in (0.5, 12.0, 45.0, 75.0) for aspect in (0.0, 37.0, 135.0, 201.5, 359.0))


def _plane(slope, aspect, shape=(7, 9)):
    """Elevations of a plane on cells of 20 x 30 m. [m]"""
    i, j = np.indices(shape)
    a = np.radians(aspect)
    return 1000 - np.tan(np.radians(slope)) * (30.0 * j * np.sin(a) - 20.0 * i * np.cos(a))


def _sky_view(slope, aspect, zenith):
    """Sky view of a slope below a horizon given from north on. [1]"""
    steep, azimuth = np.tan(np.radians(slope)), np.radians(aspect)
    tangents, directions = horizon.tangent(zenith), horizon.azimuths(len(zenith))
    east, north = -steep * np.sin(azimuth), -steep * np.cos(azimuth)
    return horizon.sky_factor(terrain.Vector(*horizon.sky_vector(tangents, directions, east, north)), east, north)


def _vector(zenith, azimuth):
    zenith, azimuth = np.radians(zenith), np.radians(azimuth)
    return np.array([np.sin(zenith) * np.sin(azimuth), np.sin(zenith) * np.cos(azimuth), np.cos(zenith)])


def _slopes():
    """Check slopes and aspects of planes; an edge may be unknown."""
    # Elevations of 1000 m have errors of 1e-13 m, which are 1e-10 degrees on the gentlest slope.
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
    """Check sky views."""
    # A horizon is known in 32 directions and is a great circle between them: half a percent in a valley.
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
    """Check a valley with walls of 20 degrees and 300 m below a level upland, on the floor and half way up."""
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
    """Check sky views for horizons of any shape and slopes above them, by the midpoint rule, which meets kinks."""
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
    """Check horizons on a plane, for any sample of a ray, and on a ridge, which is straight between directions."""
    worst = 0.0
    for slope, aspect in ((35.0, 210.0), (5.0, 17.0)):
        directions = 3.0 + horizon.azimuths(32)
        m, n = horizon.horizon_margin(20.0, 30.0, 1500.0)
        rise = -np.tan(np.radians(slope)) * np.cos(np.radians(directions - aspect))
        found = horizon.horizon_tangent(_plane(slope, aspect, (2 * m + 2, 2 * n + 2)), 20.0, 30.0, directions, 1500.0)
        worst = np.maximum(worst, largest(found, np.maximum(rise, 0.0)[:, None, None]))
        for azimuth in (0.0, 33.3, 351.0):
            expected = -np.tan(np.radians(slope)) * np.cos(np.radians(azimuth - aspect))
            worst = np.maximum(worst, largest(horizon.horizon_toward(rise, directions, azimuth), expected))
    yield _deviation("horizon of planes in all directions", worst, 1e-8, "1", "plane")


def _uneven_skies():
    """Check sky and horizon toward the sun on 22 x 26 cells and at places, with linear and with uniform fields."""
    row, column = np.mgrid[:22, :26]
    at, along = row[:, 0], column[0]
    vector = np.array(
        [0.1 + 0.01 * row - 0.02 * column, 0.02 * row + 0.01 * column - 0.2, 0.01 * row + 0.05 * column - 0.1]
    )
    tangent = 0.2 + 0.031 * row + 0.017 * column
    before, beside = np.clip((at - 3) // 6, 0, 2), np.clip((along - 4) // 7, 0, 2)
    layers = np.concatenate([vector, tangent[None]])
    sky = lights.Sky(layers[:, 3::6, 4::7], before, (at - 3) / 6 - before, beside, (along - 4) / 7 - beside)
    yield vector, tangent, sky
    vector, wall = np.full(vector.shape, 0.2), np.full(row.shape, np.inf)
    layers = np.concatenate([vector, wall[None]])
    yield vector, wall, lights.Sky(layers[:, :1, :1], 0 * at, np.zeros(22), 0 * along, np.zeros(26))


def _light():
    """Check light on slopes: sun by its cosine, sky by its vector, land by the visible share; one cell is missing."""
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
    """Check the edge of a shadow to one cell, and that a cliff is seen up to the reach."""
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


CHECKS = (_slopes, _skies, _any_sky, _valley_of_cells, _horizons, _light, _shadow, *ELEVATION_CHECKS)
