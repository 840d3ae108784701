"""
A synthetic elevation model of the dissected Flint Hills of Kansas, as a function of place.

Rivers in a bent net enclose uplands. In each, streams cut into rising ground (stream power and hillslope creep), which
makes a tree of valleys that falls to the rivers everywhere, and leaves level land where streams have not arrived yet.
As the elevation of the rivers is given, each upland is made by itself: nothing depends on the window that asks for it.
The result is bent by smooth noise, mapped to the elevations of a real watershed, cut by benches of limestone, and given
the roughness of a real model.
"""

from functools import lru_cache, partial

import numpy as np
from numba import njit
from scipy.interpolate import PchipInterpolator

from fifesim.base.lattice import assemble, centres
from fifesim.base.seeds import generator
from fifesim.ground.terrain.spline import REACH, spline_grid, spline_of_tiles, spline_points
from fifesim.ground.terrain.spline_noise import smooth_noise
from fifesim.ground.terrain.uplands import NODES, UPLAND, upland

# The surface is a quintic spline whose coefficients lie on a lattice of this step, a half of that on which uplands are
# bent. Both are made in fixed tiles. [m], [lattice node]
STEP = 10.0
BENT_STEP = 20.0
TILE = 252

# Coarse cells that are made together: larger tiles reach far beyond what is asked for.
_COARSE_TILE = 28

# Noise that bends the axes, in base level, and of the roughness: standard deviation and lattice step. [m]
BENDING = ((450.0, 3000.0), (130.0, 700.0), (28.0, 200.0))
BASE_NOISE = (5.0, 7000.0)
ROUGHNESS = ((1.05, 160.0), (0.48, 80.0), (0.3, 40.0), (0.8, 20.0))

# Streams of random numbers: the first of those that bend along and across, of the base level, roughness and benches,
# and that of the origin of the net.
_ALONG, _ACROSS, _LEVEL, _ROUGH, _BENCH, _ORIGIN = 16, 24, 32, 40, 48, 81

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
_CUBICS = PchipInterpolator(_ERODED, _WATERSHED).c


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
    return spline_of_tiles(partial(_tile, int(seed)), TILE, rows, columns)


def elevation_around(seed, cell, row, column, shape):
    """
    Elevation of the synthetic hills on a window of a lattice of coarse cells, which is kept for windows that share it.

    Parameters
    ----------
    seed : int
        In [0, 2**63).
    cell : (float, float)
        Down and across. [m]
    row, column : int
        Of the first cell, counted from the origin of the CRS; rows count southward.
    shape : (int, int)
        Rows and columns.

    Returns
    -------
    elevation : array, shape (rows, columns)
        The bits of `elevation`. [m]
    """
    return assemble(partial(_coarse_tile, int(seed), *cell), _COARSE_TILE, row, column, shape)


# So many are 120 MB: what thirty landscapes of chips see around them.
@lru_cache(maxsize=18432)
def _coarse_tile(seed, down, across, tile_row, tile_column):
    rows, columns = (tile * _COARSE_TILE + np.arange(_COARSE_TILE) for tile in (tile_row, tile_column))
    return elevation(seed, centres(0.0, -down, rows), centres(0.0, across, columns))


# The tiles of 29 km x 29 km, in 65 MB.
@lru_cache(maxsize=128)
def _tile(seed, tile_row, tile_column):
    """Coefficients of the surface on one tile of its lattice."""
    per_bent = round(BENT_STEP / STEP)
    nodes = TILE // per_bent + 2 * REACH
    rows, columns = (tile * (TILE // per_bent) - REACH + np.arange(nodes) for tile in (tile_row, tile_column))
    eroded = _bent_uplands(seed, rows * BENT_STEP, columns * BENT_STEP)
    inside = REACH + np.arange(TILE) / per_bent
    south, east = ((tile * TILE + np.arange(TILE)) * STEP for tile in (tile_row, tile_column))
    return _detail(seed, south, east, hypsometry(spline_grid(eroded, inside, inside)))


def _bent_uplands(seed, south, east):
    """Eroded ground at nodes, in the bent net of rivers."""
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
                rows = (across[here] - number) * (NODES - 1) + REACH
                columns = (along[here] - column) * (NODES - 1) + REACH
                out[here] = spline_points(upland(seed, number, column), rows[None], columns[None])[0]
    return out + BASE_NOISE[0] * smooth_noise(seed, _LEVEL, BASE_NOISE[1], south, east)


def _detail(seed, south, east, ground):
    """Ground with roughness and benches."""
    for k, (size, step) in enumerate(ROUGHNESS):
        ground = ground + size * smooth_noise(seed, _ROUGH + k, step, south, east)
    for k, (height, share) in enumerate(BENCHES):
        clear = np.clip(0.5 + 0.5 * smooth_noise(seed, _BENCH + k, BENCH_NOISE, south, east), 0, 1)
        _add_bench(ground, clear, height, share)
    return ground


@njit(nogil=True, cache=True, error_model="numpy")
def _add_bench(ground, clear, height, share):
    """Ground with a sine of itself that changes its slope by a share where it is clear."""
    ground, clear = ground.ravel(), clear.ravel()
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
    out = np.empty(eroded.shape)
    _survey(np.ascontiguousarray(eroded, float).ravel(), _ERODED, _CUBICS, out.ravel())
    return out


@njit(nogil=True, cache=True)
def _survey(eroded, knots, cubics, out):
    """Cubics between knots and lines beyond, in one pass: scipy's takes five times as long."""
    first, last = knots[0], knots[-1]
    for i in range(out.size):
        inside = min(max(eroded[i], first), last)
        k = 0
        for n in range(1, knots.size - 1):
            k += inside >= knots[n]
        s = inside - knots[k]
        height = cubics[3, k] + cubics[2, k] * s + cubics[1, k] * (s * s) + cubics[0, k] * (s * s * s)
        out[i] = height + 0.2 * ((min(eroded[i], first) - first) + (max(eroded[i], last) - last))
