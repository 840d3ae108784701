"""Checks of elevation: splines, gaps, and hills that streams have cut, beside surfaces and equations that are known."""

from functools import partial

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph, linalg

from fifesim.experiments.verification.deviations import Deviation, largest
from fifesim.ground.terrain import flint_hills, gaps, spline, spline_noise, streams

_deviation = partial(Deviation, "terrain")

_NEIGHBOURS = [(down, across) for down in (-1, 0, 1) for across in (-1, 0, 1) if down or across]


def _upsampling():
    """A quintic spline loses 2e-4 of waves of six cells, and less of longer ones."""
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
    """Holes as large as are filled: the second differences of a paraboloid balance everywhere. And all sides."""
    rows, columns = np.mgrid[:60, :70]
    plane = 400.0 + 3.0 * columns - 2.0 * rows
    bent = plane + 0.05 * columns**2 - 0.03 * rows**2 + 0.04 * rows * columns
    holed = bent.copy()
    holed[20:29, 30:39], holed[40, 50], holed[43:47, 47:53] = np.nan, np.nan, np.nan
    yield _deviation("paraboloid in its holes", largest(gaps.fill_gaps(holed, (4, 4)), bent), 1e-8, "m", "paraboloid")
    cut = np.full(plane.shape, np.nan)
    cut[15:45, 20:50] = plane[15:45, 20:50]
    carried = gaps.extend(cut, 12, rest=False)
    reached = np.isfinite(carried)
    worst = largest(carried[reached], plane[reached]) if reached[3:57, 8:62].all() else np.nan
    yield _deviation("plane past its edge", worst, 1e-8, "m", "plane")


def _drainage(ground, preference, node):
    """Steepest ways down: the nodes that drain, the nodes that they drain to, and the way between."""
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
    """One unit of time of erosion, with sparse systems of equations for areas and for implicit stream power."""
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
    yield _deviation("least ways to a river", largest(streams.least_ways(cost), least), 1e-12, "1", "Dijkstra (1959)")


def _erosion():
    """A small upland step by step; and with time enough all that rises is cut, before the last rise."""
    rng, size, node = np.random.default_rng(2), 21, 30.0
    start = 300 + 20 * rng.uniform(0.5, 3.0, (size, size))
    rock, liked = rng.uniform(0.02, 0.1, start.shape), rng.uniform(0.8, 1.2, (8, start.size))
    law = streams.StreamPower(steps=4, area_exponent=0.519, uplift=40.0, creep=900.0, node=node)
    found = streams.erode(start, rock, liked, law)
    yield _deviation(
        "hills step by step", largest(found, _eroded(start, rock, liked, law)), 1e-9, "m", "sparse systems"
    )
    start, rock = 300 + streams.least_ways(np.ones(start.shape)), 1e4 * rock
    steady = streams.erode(start, rock, np.ones_like(liked), law._replace(steps=20, creep=0.0))
    steady[1:-1, 1:-1] -= 40.0 / 20
    drained = here, there, way = _drainage(steady, np.ones_like(liked), node)
    fall = (steady.ravel()[here] - steady.ravel()[there]) / way
    cut = rock.ravel()[here] * _areas(steady, drained, node)[here] ** 0.519 * fall
    yield _deviation("steady valleys cut what rises", largest(cut / 40, 1), 1e-9, "1", "law of stream power")


def _hills():
    """Elevations at quantiles, from a survey; noise by its variance, four standard errors."""
    eroded = np.array([322.1, 398.9, 506.3, 751.0, 923.6, 1035.7, 1087.9, 1097.7, 1108.3])
    surveyed = np.array([334.0, 341.0, 352.0, 379.0, 400.0, 412.0, 434.0, 440.0, 443.5])
    beyond = flint_hills.hypsometry(np.array([312.1, 1118.3])) - [334.0, 443.5]
    worst = np.maximum(largest(flint_hills.hypsometry(eroded), surveyed), largest(beyond, [-2.0, 2.0]))
    yield _deviation("quantiles of elevation", worst, 1e-9, "m", "Kings Creek, USGS 3DEP; lines beyond")
    at = np.arange(900) * 2.5
    noise = spline_noise.smooth_noise(1, 5, 5.0, at, at)
    yield _deviation("variance of smooth noise", abs(np.mean(noise**2) - 1), 0.015, "1", "B-spline of degree 11")


CHECKS = (_upsampling, _unknown_cells, _ways, _erosion, _hills)
