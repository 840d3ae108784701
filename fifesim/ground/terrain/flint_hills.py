"""
Synthetic elevation model of the dissected Flint Hills of Kansas, with its uplands and streams.

Rivers in a deformed net enclose uplands. In each upland, streams cut into rising ground (stream power and hillslope
creep). This makes a tree of valleys that drain to the rivers, and leaves level land where streams have not arrived yet.
As the elevation of the rivers is given, each upland is independent of the others and of the requested window. The
result is deformed by smooth noise, mapped to the elevations of a real watershed, cut by benches of limestone, and given
the roughness of a real model.
"""

import threading
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator

from fifesim.base.arrays import compiled
from fifesim.base.caches import cached
from fifesim.base.lattice import assemble, centres, generator
from fifesim.ground.terrain.spline import (
    SPLINE_REACH,
    noise_square,
    smooth_noise,
    spline_coefficients,
    spline_grid,
    spline_of_tiles,
    spline_points,
)


class StreamPower(NamedTuple):
    r"""
    Stream power law of erosion over one unit of time.

    .. math:: \frac{\partial z}{\partial t} = U - K A^m S + D \nabla^2 z

    with the uplift U, the erodibility K, the drained area A [m2] and its exponent m, the slope S and the creep D.
    """

    steps: int
    area_exponent: float
    uplift: float
    creep: float
    node: float  # distance of nodes [m]


def erode(start, erodibility, preference, law):
    """
    Ground after one unit of time of uplift, stream power and creep, with a fixed border.

    Parameters
    ----------
    start : array, shape (n, n)
        Ground before. [m]
    erodibility : array, shape (n, n)
        For drained areas in m2.
    preference : array, shape (8, n * n)
        Factors on the slopes to the neighbours, by which ways down are chosen. [1]
    law : StreamPower

    Returns
    -------
    ground : array, shape (n, n)
        Stream power is implicit, creep explicit in parts of a step. [m]

    References
    ----------
    [Braun2013]_
    """
    size, step = start.shape[0], 1.0 / law.steps
    ground, new = np.array(start, float), np.array(start, float)
    receiver, order, drained, above = (np.empty(size * size, np.int32) for _ in range(4))
    # Powers of areas, which are whole numbers of nodes; 0 where none has been asked for.
    distance, powers, factor = np.ones(size * size), np.zeros(size * size + 1), np.empty(size * size)
    # The explicit scheme is stable below a quarter.
    parts = int(law.creep * step / law.node**2 / 0.2) + 1
    share = law.creep * step / law.node**2 / parts
    for _ in range(law.steps):
        _receivers(ground.reshape(-1), preference, size, law.node, receiver, distance)
        _drain(receiver, above, order, drained)
        area = law.node**2, law.area_exponent, powers
        _factors(step, erodibility.reshape(-1), *area, drained, distance, receiver, factor)
        _cut(order, receiver, factor, ground.reshape(-1))
        for _ in range(parts):
            _creep(ground, share, law.uplift * step / parts, new)
            ground, new = new, ground
    return ground


def least_ways(cost):
    """Least cost of a path from each node to the border, by sweeps until convergence, shape (n, n). [node]"""
    way = np.full(cost.shape, np.inf)
    way[0] = way[-1] = way[:, 0] = way[:, -1] = 0.0
    _shorten(cost, way)
    return way


@compiled
def _shorten(cost, way):
    size = cost.shape[0]
    diagonal = np.sqrt(2.0)
    changed = True
    while changed:
        changed = False
        for sweep in range(4):
            for i in range(1, size - 1):
                y = i if sweep < 2 else size - 1 - i
                for j in range(1, size - 1):
                    x = j if sweep % 2 == 0 else size - 1 - j
                    for a in range(-1, 2):
                        for b in range(-1, 2):
                            length = diagonal if a * b != 0 else 1.0
                            through = way[y + a, x + b] + length * 0.5 * (cost[y, x] + cost[y + a, x + b])
                            if through < way[y, x]:
                                way[y, x] = through
                                changed = True


@compiled
def _receivers(ground, preference, size, node, receiver, distance):
    """Fill in the receiver of each node: its neighbour down the steepest weighted slope, itself on the border."""
    for i in range(size * size):
        receiver[i] = i
    steepest = np.empty(size - 2)
    for y in range(1, size - 1):
        first = y * size + 1
        here, to = ground[first : first + size - 2], receiver[first : first + size - 2]
        far = distance[first : first + size - 2]
        for x in range(size - 2):
            steepest[x] = 0.0
        k = 0
        # The loop over neighbours is outermost, so that inner loops over nodes have no branches.
        for a in range(-1, 2):
            for b in range(-1, 2):
                if a == 0 and b == 0:
                    continue
                j = first + a * size + b
                there, liked = ground[j : j + size - 2], preference[k, first : first + size - 2]
                length = node * (np.sqrt(2.0) if a * b != 0 else 1.0)
                for x in range(size - 2):
                    slope = (here[x] - there[x]) / length * liked[x]
                    steeper = slope > steepest[x]
                    steepest[x] = slope if steeper else steepest[x]
                    to[x] = np.int32(j + x) if steeper else to[x]
                    far[x] = length if steeper else far[x]
                k += 1


@compiled
def _drain(receiver, above, order, drained):
    """Fill in an order of nodes in which each precedes its receiver, and how many nodes drain through each."""
    for i in range(receiver.size):
        above[i], drained[i] = 0, 1
    for i in range(receiver.size):
        above[receiver[i]] += receiver[i] != i
    # Sources, then whatever all water has come to that flows into it. An entry stays if the count goes on past it:
    # a branch would be guessed wrongly at every other node.
    filled = 0
    for i in range(receiver.size):
        order[filled] = i
        filled += above[i] == 0
    for done in range(receiver.size):
        i = order[done]
        into = receiver[i]
        drained[into] += drained[i] if into != i else 0
        above[into] -= 1
        if filled < receiver.size:
            order[filled] = into
            filled += above[into] == 0


@compiled
def _factors(step, erodibility, own, exponent, powers, drained, distance, receiver, factor):
    """Fill in the weight of the receiver of each node in the implicit step, 0 on the fixed border."""
    for i in range(factor.size):
        if powers[drained[i]] == 0.0:
            powers[drained[i]] = (drained[i] * own) ** exponent
        cut = step * erodibility[i] * powers[drained[i]] / distance[i]
        factor[i] = cut if receiver[i] != i else 0.0


@compiled
def _cut(order, receiver, factor, ground):
    """Apply one implicit step of stream power to the ground, from the border upstream."""
    for k in range(order.size - 1, -1, -1):
        i = order[k]
        ground[i] = (ground[i] + factor[i] * ground[receiver[i]]) / (1.0 + factor[i])


@compiled
def _creep(ground, share, uplift, new):
    """Fill in the ground after a part of a step of creep and uplift; its border stays."""
    for y in range(1, ground.shape[0] - 1):
        north, row, south, out = ground[y - 1], ground[y], ground[y + 1], new[y]
        for x in range(1, row.size - 1):
            around = row[x - 1] + row[x + 1] + north[x] + south[x]
            out[x] = row[x] + share * (around - 4.0 * row[x]) + uplift


# An upland is a square of nodes between rivers. [m]
NODES = 181
NODE = 45.0
UPLAND = (NODES - 1) * NODE

STREAM_POWER = StreamPower(steps=40, area_exponent=0.519, uplift=751.0, creep=5000.0, node=NODE)
ERODIBILITY = 4.68  # mean, for areas in m2

# Standard deviations of the logarithms, and lattice steps [m], of the noise in erodibility and in the cost of a way to
# a river, which lays out the first streams, and in the preference for one of eight neighbours.
ERODIBILITY_NOISE = ((0.077, 2400.0), (0.09, 208.0))
WAY_NOISE = ((0.286, 1050.0), (0.622, 150.0))
PREFERENCE_NOISE = 0.104

# Before uplift: elevation and its rise with the cost of the way to a river. Rivers lie at the base, and in the valleys
# that join two of them the saddle is higher. [m], [1], [m], [m]
START = 345.0
TILT = 0.00077
BASE = 335.0
SADDLE = 63.0

# Stream of random numbers, different from the streams of the hills.
_STREAM = 80

_lock = threading.Lock()


def upland(seed, line, column):
    """Spline coefficients of eroded ground between four rivers, mirrored there so that both sides meet. [m]"""
    # Threads that want the same upland wait for the one that makes it.
    with _lock:
        return _upland(seed, line, column)


# Those within reach of three landscapes of chips, in 20 MB.
@cached(64, "uplands of hills")
def _upland(seed, line, column):
    drawn = generator(seed, _STREAM, (0, 0, line, column))
    erodibility, cost = (
        np.exp(sum(size * noise_square(drawn, NODE / step, NODES) for size, step in noise))
        for noise in (ERODIBILITY_NOISE, WAY_NOISE)
    )
    preference = np.exp(PREFERENCE_NOISE * drawn.standard_normal((8, NODES * NODES)))
    ground = START + TILT * NODE * least_ways(cost)
    valley = BASE + SADDLE * (1 - np.abs(np.linspace(-1, 1, NODES))) ** 0.6
    ground[0] = ground[-1] = BASE
    ground[:, 0] = ground[:, -1] = valley
    ground = erode(ground, ERODIBILITY * erodibility, preference, STREAM_POWER)
    coefficients = spline_coefficients(np.pad(ground, 2 * SPLINE_REACH, mode="reflect", reflect_type="odd"))
    return np.ascontiguousarray(coefficients[SPLINE_REACH:-SPLINE_REACH, SPLINE_REACH:-SPLINE_REACH])


# The surface is a quintic spline whose coefficients lie on a lattice of this step, a half of that on which uplands are
# bent. Both are made in fixed tiles. [m], [lattice node]
HILLS_STEP = 10.0
BENT_STEP = 20.0
HILLS_TILE = 252

# Coarse cells per tile: larger tiles extend far beyond the requested grid.
_COARSE_TILE = 28

# Noise that bends the axes, in base level, and of the roughness: standard deviation and lattice step. [m]
BENDING = ((450.0, 3000.0), (130.0, 700.0), (28.0, 200.0))
BASE_NOISE = (5.0, 7000.0)
ROUGHNESS = ((1.05, 160.0), (0.48, 80.0), (0.3, 40.0), (0.8, 20.0))

# First streams of random numbers: of the bends along and across, the base level, the roughness, the benches and the
# origin of the net.
_ALONG, _ACROSS, _LEVEL, _ROUGH, _BENCH, _ORIGIN = 16, 24, 32, 40, 48, 81

# Benches: height from one to the next [m], and the share of the slope that changes over them where they are clearest.
BENCHES = ((11.3, 0.65), (17.9, 0.3), (7.1, 0.6))
BENCH_NOISE = 900.0

# Axes of the net of rivers, and shifts of the valleys between one river and the next, as shares of an upland.
AXES_ANGLE = 23.0
SHIFTS = np.array([0.0, 0.37, 0.71, 0.18, 0.55])

# Elevations at quantiles 0, 0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99 and 1, of the eroded ground (900 km2, 36 seeds) and
# of a watershed (Kings Creek, Konza Prairie; USGS 3DEP, 10 m). [m]
_ERODED = np.array([322.1, 398.9, 506.3, 751.0, 923.6, 1035.7, 1087.9, 1097.7, 1108.3])
_WATERSHED = np.array([334.0, 341.0, 352.0, 379.0, 400.0, 412.0, 434.0, 440.0, 443.5])
_CUBICS = PchipInterpolator(_ERODED, _WATERSHED).c


def hills_elevation(seed, northing, easting):
    """
    Elevation of the synthetic hills on the cells of a grid.

    Parameters
    ----------
    seed : int
        In [0, 2**63).
    northing, easting : array, shape (y,), (x,)
        Coordinates of rows and columns; northing decreases, easting increases. [m]

    Returns
    -------
    elevation : array, shape (y, x)
        [m]

    Notes
    -----
    The drainage results from steady rain on nearly uniform rock: there are no floodplains, incised creeks, ponds or
    roads. Rivers keep one level, in a net without a mouth, with saddles where a divide would be. Roughness leaves 1 %
    of 30 m cells without a lower neighbour.

    References
    ----------
    [Braun2013]_ for the implicit solution of the stream power equation
    """
    # Places in steps of 2**-30 of a node, 1e-8 m, from which whole nodes are taken off without rounding.
    rows, columns = (
        np.rint(axis / HILLS_STEP * 2**30) / 2**30 for axis in (-np.asarray(northing), np.asarray(easting))
    )
    return spline_of_tiles(partial(_tile, int(seed)), HILLS_TILE, rows, columns)


def elevation_around(seed, cell, row, column, shape):
    """Elevation of the synthetic hills on a window of coarse cells, from cached tiles, shape (rows, columns). [m]"""
    return assemble(partial(_coarse_tile, int(seed), *cell), _COARSE_TILE, row, column, shape)


# This number takes 120 MB, the surroundings of thirty landscapes of chips.
@cached(18432, "coarse tiles of synthetic hills")
def _coarse_tile(seed, down, across, tile_row, tile_column):
    rows, columns = (tile * _COARSE_TILE + np.arange(_COARSE_TILE) for tile in (tile_row, tile_column))
    return hills_elevation(seed, centres(0.0, -down, rows), centres(0.0, across, columns))


# The tiles of 29 km x 29 km, in 65 MB.
@cached(128, "tiles of synthetic hills")
def _tile(seed, tile_row, tile_column):
    """Coefficients of the surface on one tile of its lattice."""
    per_bent = round(BENT_STEP / HILLS_STEP)
    nodes = HILLS_TILE // per_bent + 2 * SPLINE_REACH
    rows, columns = (
        tile * (HILLS_TILE // per_bent) - SPLINE_REACH + np.arange(nodes) for tile in (tile_row, tile_column)
    )
    eroded = _bent_uplands(seed, rows * BENT_STEP, columns * BENT_STEP)
    inside = SPLINE_REACH + np.arange(HILLS_TILE) / per_bent
    south, east = ((tile * HILLS_TILE + np.arange(HILLS_TILE)) * HILLS_STEP for tile in (tile_row, tile_column))
    return _detail(seed, south, east, hypsometry(spline_grid(eroded, inside, inside)))


def _bent_uplands(seed, south, east):
    """Eroded ground at nodes, in the deformed net of rivers."""
    bent = []
    for stream, axis in ((_ALONG, east[None, :]), (_ACROSS, south[:, None])):
        shift = sum(size * smooth_noise(seed, stream + k, step, south, east) for k, (size, step) in enumerate(BENDING))
        bent.append(axis + shift)
    (x, y), turn, origin = bent, np.radians(AXES_ANGLE), generator(seed, _ORIGIN).random(2)
    along = (np.cos(turn) * x + np.sin(turn) * y) / UPLAND + origin[0]
    across = (np.cos(turn) * y - np.sin(turn) * x) / UPLAND + origin[1] * SHIFTS.size
    line = np.floor(across).astype(int)
    along = along - SHIFTS[line % SHIFTS.size]
    place = np.floor(along).astype(int)
    out = np.empty(along.shape)
    for number in range(line.min(), line.max() + 1):
        between = line == number
        for column in range(place.min(), place.max() + 1):
            here = np.nonzero(between & (place == column))
            if here[0].size:
                rows = (across[here] - number) * (NODES - 1) + SPLINE_REACH
                columns = (along[here] - column) * (NODES - 1) + SPLINE_REACH
                out[here] = spline_points(upland(seed, number, column), rows[None], columns[None])[0]
    return out + BASE_NOISE[0] * smooth_noise(seed, _LEVEL, BASE_NOISE[1], south, east)


def _detail(seed, south, east, ground):
    """Ground with roughness and benches."""
    for k, (size, step) in enumerate(ROUGHNESS):
        ground = ground + size * smooth_noise(seed, _ROUGH + k, step, south, east)
    for k, (height, share) in enumerate(BENCHES):
        clear = np.clip(0.5 + 0.5 * smooth_noise(seed, _BENCH + k, BENCH_NOISE, south, east), 0, 1)
        _add_bench(ground.reshape(-1), clear.reshape(-1), height, share)
    return ground


@compiled
def _add_bench(ground, clear, height, share):
    """Add to the ground a sine of its elevation that changes its slope by a share, where `clear` is above 0."""
    for i in range(ground.size):
        turns = ground[i] / height
        turns -= np.rint(turns)
        # The same sine, nearer to 0.
        turns = turns if abs(turns) <= 0.25 else np.copysign(0.5, turns) - turns
        angle, series = 2 * np.pi * turns, 1.0
        # Its series as a product, to the last digit at a right angle.
        for k in range(20, 0, -2):
            series = 1 - angle * angle * (1 / (k * (k + 1))) * series
        ground[i] += share * (height / (2 * np.pi)) * clear[i] * angle * series


def hypsometry(eroded):
    """Elevation of the watershed at the same quantile, an increasing function, so that valleys keep draining. [m]"""
    # Beyond the table it is linear, with a fifth of the slope at the end.
    out = np.empty(eroded.shape)
    _survey(np.ascontiguousarray(eroded, float).ravel(), _ERODED, _CUBICS, out.ravel())
    return out


@compiled
def _survey(eroded, knots, cubics, out):
    """Cubics between knots and lines beyond them, in one pass that is five times as fast as scipy."""
    first, last = knots[0], knots[-1]
    for i in range(out.size):
        inside = min(max(eroded[i], first), last)
        k = 0
        for n in range(1, knots.size - 1):
            k += inside >= knots[n]
        s = inside - knots[k]
        height = cubics[3, k] + cubics[2, k] * s + cubics[1, k] * (s * s) + cubics[0, k] * (s * s * s)
        out[i] = height + 0.2 * ((min(eroded[i], first) - first) + (max(eroded[i], last) - last))
