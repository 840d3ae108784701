"""
A synthetic elevation model of the dissected Flint Hills of Kansas, as a function of place.

Rivers in a bent net enclose uplands. In each, streams cut into rising ground (stream power and hillslope creep), which
makes a tree of valleys that falls to the rivers everywhere, and leaves level land where streams have not arrived yet.
As the elevation of the rivers is given, each upland is made by itself: nothing depends on the window that asks for it.
The result is bent by smooth noise, mapped to the elevations of a real watershed, cut by benches of limestone, and given
the roughness of a real model.
"""

import threading
from functools import lru_cache, partial

import numba
import numpy as np
from scipy import interpolate

from fifesim.base.lattice import assemble
from fifesim.base.seeds import generator
from fifesim.ground.terrain.spline import spline_coefficients, spline_grid, spline_points

# An upland is a square of nodes between rivers, seen along axes that smooth noise bends. [m]
NODES = 181
NODE = 45.0
UPLAND = (NODES - 1) * NODE

# The surface is a quintic spline whose coefficients lie on a lattice of this step, a half of that on which uplands are
# bent. Both are made in fixed tiles. [m], [lattice node]
STEP = 10.0
BENT_STEP = 20.0
TILE = 252
_REACH = 8

# Streams, over one unit of time: dz/dt = UPLIFT - erodibility area**AREA_EXPONENT slope + CREEP laplacian(z). [m, m2]
STEPS = 40
AREA_EXPONENT = 0.519
ERODIBILITY = 4.68
UPLIFT = 751.0
CREEP = 5000.0

# Standard deviations of the logarithms, and lattice steps [m], of the noise in erodibility and in the cost of a way to
# a river, which lays out the first streams; and that of the preference for one of eight neighbours.
ERODIBILITY_NOISE = ((0.077, 2400.0), (0.09, 208.0))
WAY_NOISE = ((0.286, 1050.0), (0.622, 150.0))
PREFERENCE_NOISE = 0.104

# Before uplift: elevation and its rise with the cost of the way to a river. Rivers lie at the base, and in the valleys
# that join two of them the saddle is higher. [m], [1], [m], [m]
START = 345.0
TILT = 0.00077
BASE = 335.0
SADDLE = 63.0

# Noise that bends the axes, in base level, and of the roughness: standard deviation and lattice step. [m]
BENDING = ((450.0, 3000.0), (130.0, 700.0), (28.0, 200.0))
BASE_NOISE = (5.0, 7000.0)
ROUGHNESS = ((1.05, 160.0), (0.48, 80.0), (0.3, 40.0), (0.8, 20.0))

# Benches: height from one to the next [m], and the share of the slope that changes over them where they are clearest.
BENCHES = ((11.3, 0.65), (17.9, 0.3), (7.1, 0.6))
BENCH_NOISE = 900.0

# Axes of the net of rivers, and shifts of the valleys between one river and the next, as shares of an upland.
AXES_ANGLE = 23.0
SHIFTS = np.array([0.0, 0.37, 0.71, 0.18, 0.55])

# Elevations at quantiles 0, .01, .05, .25, .5, .75, .95, .99 and 1, of the eroded ground (900 km2, 36 seeds) and of a
# watershed (Kings Creek, Konza Prairie; USGS 3DEP, 10 m). [m]
_ERODED = np.array([322.1, 398.9, 506.3, 751.0, 923.6, 1035.7, 1087.9, 1097.7, 1108.3])
_WATERSHED = np.array([334.0, 341.0, 352.0, 379.0, 400.0, 412.0, 434.0, 440.0, 443.5])

# Standard deviation of a quintic spline of white noise, the value at 0 of the B-spline of degree 11.
_SPLINE_DEVIATION = 0.3939255651755652

# Noise is drawn in blocks of this size. [lattice node]
_BLOCK = 64

# The first of the hills' streams of random numbers.
_FIRST_STREAM = 16

_lock = threading.Lock()


def elevation(seed, northing, easting):
    """
    Elevation of the synthetic hills on the cells of a grid.

    Parameters
    ----------
    seed : int
        In [0, 2**63).
    northing, easting : array, shape (y,), (x,)
        Of rows and columns; northing falls, easting rises. [m]

    Returns
    -------
    elevation : array, shape (y, x)
        [m]

    Notes
    -----
    The drainage is that of steady rain on nearly uniform rock: there are no floodplains, incised creeks, ponds or
    roads. Rivers keep one level, in a net without a mouth, with saddles where a divide would be. Roughness leaves 1 %
    of 30 m cells without a lower neighbour.

    References
    ----------
    [Braun2013]_ for the implicit solution of the stream power equation

    Examples
    --------
    A window is a slice of the whole, to the bit:

    >>> north, east = 4.3e6 - 3.0 * np.arange(9), 7e5 + 3.0 * np.arange(8)
    >>> bool((elevation(7, north[4:], east[2:5]) == elevation(7, north, east)[4:, 2:5]).all())
    True
    """
    # Places in steps of 2**-30 of a node, 1e-8 m, from which whole nodes are taken off without rounding.
    rows, columns = (np.rint(axis / STEP * 2**30) / 2**30 for axis in (-np.asarray(northing), np.asarray(easting)))
    first = [int(np.floor(axis[0])) - _REACH for axis in (rows, columns)]
    shape = tuple(int(np.floor(axis[-1])) + _REACH - start for axis, start in zip((rows, columns), first, strict=True))
    coefficients = assemble(partial(_tile, int(seed)), TILE, *first, shape)
    return spline_grid(coefficients, rows - first[0], columns - first[1])


# The tiles of 29 km x 29 km, in 65 MB.
@lru_cache(maxsize=128)
def _tile(seed, tile_row, tile_column):
    """Coefficients of the surface on one tile of its lattice."""
    per_bent = round(BENT_STEP / STEP)
    nodes = TILE // per_bent + 2 * _REACH
    rows, columns = (tile * (TILE // per_bent) - _REACH + np.arange(nodes) for tile in (tile_row, tile_column))
    eroded = _bent_uplands(seed, rows * BENT_STEP, columns * BENT_STEP)
    inside = _REACH + np.arange(TILE) / per_bent
    south, east = ((tile * TILE + np.arange(TILE)) * STEP for tile in (tile_row, tile_column))
    return _detail(seed, south, east, hypsometry(spline_grid(eroded, inside, inside)))


def _bent_uplands(seed, south, east):
    """Eroded ground at nodes, in the bent net of rivers."""
    bent = []
    for stream, axis in ((0, east[None, :]), (8, south[:, None])):
        shift = sum(size * smooth_noise(seed, stream + k, step, south, east) for k, (size, step) in enumerate(BENDING))
        bent.append(axis + shift)
    turn = np.radians(AXES_ANGLE)
    along = (np.cos(turn) * bent[0] + np.sin(turn) * bent[1]) / UPLAND
    across = (np.cos(turn) * bent[1] - np.sin(turn) * bent[0]) / UPLAND
    origin = generator(seed, _FIRST_STREAM + 65).random(2)
    along, across = along + origin[0], across + origin[1] * SHIFTS.size
    line = np.floor(across).astype(int)
    along = along - SHIFTS[line % SHIFTS.size]
    place = np.floor(along).astype(int)
    out = np.empty(along.shape)
    for number in np.unique(line):
        for column in np.unique(place[line == number]):
            here = (line == number) & (place == column)
            coefficients = upland(seed, int(number), int(column))
            positions = (
                (axis[here] - start) * (NODES - 1) + _REACH for axis, start in ((across, number), (along, column))
            )
            out[here] = spline_points(coefficients, *(position[None] for position in positions))[0]
    return out + BASE_NOISE[0] * smooth_noise(seed, 16, BASE_NOISE[1], south, east)


def _detail(seed, south, east, ground):
    """Ground with roughness and benches."""
    for k, (size, step) in enumerate(ROUGHNESS):
        ground = ground + size * smooth_noise(seed, 24 + k, step, south, east)
    for k, (height, share) in enumerate(BENCHES):
        clear = np.clip(0.5 + 0.5 * smooth_noise(seed, 32 + k, BENCH_NOISE, south, east), 0, 1)
        turn = 2 * np.pi / height
        ground = ground + share / turn * clear * np.sin(turn * ground)
    return ground


def hypsometry(eroded):
    """
    Elevation of the watershed at the same quantile.

    Parameters
    ----------
    eroded : array, any shape
        [m]

    Returns
    -------
    elevation : array, shape of the input
        A rising function: valleys keep falling. Beyond the table it goes on in a line of a fifth of the slope there.
    """
    low, high = eroded.clip(max=_ERODED[0]) - _ERODED[0], eroded.clip(min=_ERODED[-1]) - _ERODED[-1]
    return _hypsometry()(eroded.clip(_ERODED[0], _ERODED[-1])) + 0.2 * (low + high)


@lru_cache
def _hypsometry():
    return interpolate.PchipInterpolator(_ERODED, _WATERSHED)


def smooth_noise(seed, stream, step, south, east):
    """
    Gaussian noise of unit variance without wavelengths much below twice a lattice step, as a function of place.

    Parameters
    ----------
    seed, stream : int
        Streams of a seed are independent.
    step : float
        [m]
    south, east : array, shape (y,), (x,)
        Rising. [m]

    Returns
    -------
    noise : array, shape (y, x)
        [1]
    """
    rows, columns = south / step, east / step
    first = [int(np.floor(axis[0])) - _REACH for axis in (rows, columns)]
    shape = tuple(int(np.floor(axis[-1])) + _REACH - start for axis, start in zip((rows, columns), first, strict=True))
    white = assemble(partial(_noise_block, seed, stream), _BLOCK, *first, shape)
    return spline_grid(white, rows - first[0], columns - first[1]) / _SPLINE_DEVIATION


@lru_cache(maxsize=256)
def _noise_block(seed, stream, block_row, block_column):
    """White noise of one lattice block: its place is the upper half of the Philox counter."""
    return generator(seed, _FIRST_STREAM + stream, (0, 0, block_row, block_column)).standard_normal((_BLOCK, _BLOCK))


def upland(seed, line, column):
    """
    Spline coefficients of the eroded ground between four rivers.

    Parameters
    ----------
    seed : int
    line, column : int
        Place in the net of rivers.

    Returns
    -------
    coefficients : array, shape (NODES + 8, NODES + 8)
        Mirrored at points of the rivers, so that both sides meet there. [m]
    """
    # Threads that want the same upland wait for the one that makes it.
    with _lock:
        return _upland(seed, line, column)


@lru_cache(maxsize=128)
def _upland(seed, line, column):
    drawn = generator(seed, _FIRST_STREAM + 64, (0, 0, line, column))
    erodibility, cost = (
        np.exp(sum(size * _noise_square(drawn, step) for size, step in noise))
        for noise in (ERODIBILITY_NOISE, WAY_NOISE)
    )
    preference = np.exp(PREFERENCE_NOISE * drawn.standard_normal((8, NODES * NODES)))
    ground = START + TILT * NODE * _ways(cost)
    valley = BASE + SADDLE * (1 - np.abs(np.linspace(-1, 1, NODES))) ** 0.6
    ground[0] = ground[-1] = BASE
    ground[:, 0] = ground[:, -1] = valley
    ground = _erode(ground, ERODIBILITY * erodibility, preference, STEPS, AREA_EXPONENT, UPLIFT, CREEP)
    coefficients = spline_coefficients(np.pad(ground, 2 * _REACH, mode="reflect", reflect_type="odd"))
    return coefficients[_REACH:-_REACH, _REACH:-_REACH]


def _noise_square(drawn, step):
    """Smooth noise on the nodes of an upland."""
    positions = 3 + np.arange(NODES) * (NODE / step)
    size = int(positions[-1]) + 5
    return spline_grid(drawn.standard_normal((size, size)), positions, positions) / _SPLINE_DEVIATION


@numba.njit(nogil=True, cache=True)
def _ways(cost):
    """Least cost of a way from each node to the border, over eight neighbours: sweeps until nothing changes. [node]"""
    size = cost.shape[0]
    way = np.full((size, size), np.inf)
    way[0] = way[-1] = way[:, 0] = way[:, -1] = 0.0
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
    return way


@numba.njit(nogil=True, cache=True)
def _receivers(ground, preference, size, receiver, distance):
    """Where each node drains to: the neighbour down the steepest way, some being preferred; itself on the border."""
    for i in range(size * size):
        receiver[i] = i
    for y in range(1, size - 1):
        for x in range(1, size - 1):
            i = y * size + x
            steepest, k = 0.0, 0
            for a in range(-1, 2):
                for b in range(-1, 2):
                    if a == 0 and b == 0:
                        continue
                    j = i + a * size + b
                    length = NODE * (np.sqrt(2.0) if a * b != 0 else 1.0)
                    slope = (ground[i] - ground[j]) / length * preference[k, i]
                    k += 1
                    if slope > steepest:
                        steepest = slope
                        receiver[i], distance[i] = j, length


@numba.njit(nogil=True, cache=True)
def _downstream_first(receiver, order, child, sibling):
    """Order of nodes in which each comes after the one that it drains to."""
    child[:] = -1
    for i in range(receiver.size):
        if receiver[i] != i:
            sibling[i] = child[receiver[i]]
            child[receiver[i]] = i
    filled = 0
    for i in range(receiver.size):
        if receiver[i] == i:
            done = filled
            order[filled] = i
            filled += 1
            while done < filled:
                other = child[order[done]]
                while other >= 0:
                    order[filled] = other
                    filled += 1
                    other = sibling[other]
                done += 1


@numba.njit(nogil=True, cache=True)
def _erode(start, erodibility, preference, steps, exponent, uplift, creep):
    """Ground after one unit of time of uplift, stream power (implicit, [Braun2013]_) and creep (explicit)."""
    size = start.shape[0]
    ground, new, area = start.copy().ravel(), np.empty(size * size), np.empty(size * size)
    rock, distance = erodibility.ravel(), np.ones(size * size)
    receiver, order, child, sibling = (
        np.empty(size * size, np.int32),
        np.empty(size * size, np.int32),
        np.empty(size * size, np.int32),
        np.empty(size * size, np.int32),
    )
    step = 1.0 / steps
    # The explicit scheme is stable below a quarter.
    parts = int(creep * step / NODE**2 / 0.2) + 1
    share = creep * step / NODE**2 / parts
    for _ in range(steps):
        _receivers(ground, preference, size, receiver, distance)
        _downstream_first(receiver, order, child, sibling)
        area[:] = NODE**2
        for k in range(size * size - 1, -1, -1):
            i = order[k]
            if receiver[i] != i:
                area[receiver[i]] += area[i]
        for k in range(size * size):
            i = order[k]
            if receiver[i] != i:
                factor = step * rock[i] * area[i] ** exponent / distance[i]
                ground[i] = (ground[i] + factor * ground[receiver[i]]) / (1.0 + factor)
        for _ in range(parts):
            new[:] = ground
            for y in range(1, size - 1):
                for x in range(1, size - 1):
                    i = y * size + x
                    around = ground[i - 1] + ground[i + 1] + ground[i - size] + ground[i + size]
                    new[i] = ground[i] + share * (around - 4.0 * ground[i]) + uplift * step / parts
            ground, new = new, ground
    return ground.reshape(size, size)
