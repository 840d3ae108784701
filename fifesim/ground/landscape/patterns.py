"""
Patterns on the unit lattice as a function of seed and place: Voronoi cells, a smooth field, rectangles.

Blocks of the lattice draw numbers of their own, so that any place can be made alone.
"""

from functools import lru_cache, partial
from math import exp

import numpy as np
from numba import njit
from scipy.stats import norm

from fifesim.base.lattice import assemble
from fifesim.base.seeds import generator

# Streams of a seed.
_VORONOI, _SMOOTH, _PASTURES = 8, 9, 10

# Numbers of blocks are drawn in squares of so many.
_SQUARE = 64

# Weights of the smooth field end this many knots away, where they are 1.5e-8 of the largest.
_REACH = 6

# Uniform numbers are multiples of 2**-53, and 0 has no normal deviate.
_LEAST = 2.0**-54

# Pastures along a side of a block that is fenced as a whole.
_ALONG = 3


def voronoi(seed, down, across, class_of=None):
    """
    Number of the Voronoi cell that each place lies in.

    Each square of the unit lattice has one point, uniformly within it, so that the mean area of the cells is 1.

    Parameters
    ----------
    seed : int
    down, across : array, shape (y,), (x,)
        Places, in units of a patch.
    class_of : callable, optional
        ``class_of(numbers)`` gives the class of each number.

    Returns
    -------
    number : array, shape (y, x)
        Uniform in [0, 1), of each cell its own; with ``class_of`` its class, an int16. [1]
    """
    # The nearest point lies within sqrt(2), so at most two squares away.
    (top, rows), (left, columns) = (_blocks(each, 2) for each in (down, across))
    points = _drawn(seed, _VORONOI, top, left, (rows, columns), 3)
    points[0] += np.arange(top, top + rows)[:, None]
    points[1] += np.arange(left, left + columns)
    out = np.empty((down.size, across.size), float if class_of is None else np.int16)
    # Patches are fewer than places.
    points[2] = points[2] if class_of is None else class_of(points[2])
    _nearest(down, across, top, left, points, out)
    return out


def smooth_field(seed, down, across):
    r"""
    Standard normal field whose correlation is Gaussian, 1/e at distance 1.

    .. math:: z = \sum_k w_k \, n_k / \sqrt{\textstyle\sum_k w_k^2}, \quad w_k = \exp(-2 d_k^2)

    over white noise at knots half a unit apart, each at a distance d from the place.

    Parameters
    ----------
    seed : int
    down, across : array, shape (y,), (x,)
        Places, in units of the length.

    Returns
    -------
    field : array, shape (y, x)
        [1]

    Notes
    -----
    Knots as far apart as the standard deviation of their weights leave no trace: the correlation is that of a
    continuous sum within 1e-8.
    """
    # In units of the knots.
    down, across = 2.0 * np.asarray(down, float), 2.0 * np.asarray(across, float)
    (top, rows), (left, columns) = (_blocks(each, _REACH) for each in (down, across))
    drawn = _drawn(seed, _SMOOTH, top, left, (rows, columns), 1)[0]
    knots = norm.ppf(np.maximum(drawn, _LEAST))
    out = np.empty((down.size, across.size))
    _weighted(down, across, top, left, knots, out)
    return out


def pastures(seed, down, across, class_of=None):
    """
    Number of the pasture that each place lies in.

    Blocks of 3 x 3 units are fenced as wholes. Each is parted into nine pastures, always the largest so far, across
    its longer side at 3/8, 1/2 or 5/8 of it: the mean area of the pastures is 1.

    Parameters
    ----------
    seed : int
    down, across : array, shape (y,), (x,)
        Places, in units of a pasture.
    class_of : callable, optional
        As in `voronoi`.

    Returns
    -------
    number : array, shape (y, x)
        Uniform in [0, 1), of each pasture its own; with ``class_of`` its class, an int16. [1]
    """
    down, across = np.asarray(down, float) / _ALONG, np.asarray(across, float) / _ALONG
    out = np.empty((down.size, across.size), float if class_of is None else np.int16)
    for row in np.unique(np.floor(down)).astype(int).tolist():
        rows = np.flatnonzero(np.floor(down) == row)
        for column in np.unique(np.floor(across)).astype(int).tolist():
            columns = np.flatnonzero(np.floor(across) == column)
            for (top, left, bottom, right), number in _fenced(seed, row, column):
                within = (down[rows] - row >= top) & (down[rows] - row < bottom)
                beside = (across[columns] - column >= left) & (across[columns] - column < right)
                _paint(rows[within], columns[beside], number if class_of is None else class_of(number), out)
    return out


@njit(nogil=True, cache=True)
def _paint(rows, columns, value, out):
    """The same value in all crossings of rows and columns; numpy takes several times as long over them."""
    for i in rows:
        for j in columns:
            out[i, j] = value


@lru_cache(maxsize=1024)
def _fenced(seed, row, column):
    """Pastures of a block: edges (top, left, bottom, right) in units of the block, and a number."""
    drawn = generator(seed, _PASTURES, (0, 0, row, column)).random((2, _ALONG**2))
    parts = [(0.0, 0.0, 1.0, 1.0)]
    for number in drawn[0, 1:].tolist():
        top, left, bottom, right = parts.pop(max(range(len(parts)), key=lambda index: _area(parts[index])))
        share = (3 + int(3 * number)) / 8
        if bottom - top >= right - left:
            fence = top + share * (bottom - top)
            parts += [(top, left, fence, right), (fence, left, bottom, right)]
        else:
            fence = left + share * (right - left)
            parts += [(top, left, bottom, fence), (top, fence, bottom, right)]
    return tuple(zip(parts, drawn[1].tolist(), strict=True))


def _area(part):
    top, left, bottom, right = part
    return (bottom - top) * (right - left)


def _blocks(places, around):
    """First of the unit squares that some places along an axis lie in, with a margin, and how many."""
    first = int(np.floor(np.min(places))) - around
    return first, int(np.floor(np.max(places))) + around + 1 - first


def _drawn(seed, stream, top, left, shape, numbers):
    """Uniform numbers of a window of unit squares, shape (numbers, rows, columns)."""
    out = np.empty((numbers, *shape))
    for index in range(numbers):
        out[index] = assemble(partial(_square, seed, stream, index), _SQUARE, top, left, shape)
    return out


@lru_cache(maxsize=64)
def _square(seed, stream, index, row, column):
    """Uniform numbers of a square of unit squares."""
    return generator(seed, stream, (0, index, row, column)).random((_SQUARE, _SQUARE))


@njit(nogil=True, cache=True)
def _nearest(down, across, top, left, points, out):
    for i in range(down.size):
        row = int(np.floor(down[i])) - top
        below = down[i] - np.floor(down[i])
        for j in range(across.size):
            column = int(np.floor(across[j])) - left
            beside = across[j] - np.floor(across[j])
            least = np.inf
            for k in range(row - 1, row + 2):
                for m in range(column - 1, column + 2):
                    away = (points[0, k, m] - down[i]) ** 2 + (points[1, k, m] - across[j]) ** 2
                    if away < least:
                        least = away
                        out[i, j] = points[2, k, m]
            # Squares further out are at least so far away.
            if least <= (1.0 + min(min(below, 1.0 - below), min(beside, 1.0 - beside))) ** 2:
                continue
            for k in range(row - 2, row + 3):
                for m in range(column - 2, column + 3):
                    away = (points[0, k, m] - down[i]) ** 2 + (points[1, k, m] - across[j]) ** 2
                    if away < least:
                        least = away
                        out[i, j] = points[2, k, m]


@njit(nogil=True, cache=True)
def _knot_weights(place, first, weights):
    """Index of the first knot that a place along an axis is made from; its weights, whose squares sum to 1."""
    knot = int(np.floor(place)) - _REACH + 1
    total = 0.0
    for k in range(2 * _REACH):
        away = place - (knot + k)
        weights[k] = exp(-0.5 * away * away)
        total += weights[k] * weights[k]
    for k in range(2 * _REACH):
        weights[k] /= np.sqrt(total)
    return knot - first


@njit(nogil=True, cache=True)
def _weighted(down, across, top, left, knots, out):
    weights, line = np.empty(2 * _REACH), np.empty(knots.shape[1])
    starts, sides = np.empty(across.size, np.int64), np.empty((across.size, 2 * _REACH))
    for j in range(across.size):
        starts[j] = _knot_weights(across[j], left, sides[j])
    for i in range(down.size):
        first = _knot_weights(down[i], top, weights)
        line[:] = 0.0
        for k in range(2 * _REACH):
            for m in range(line.size):
                line[m] += weights[k] * knots[first + k, m]
        for j in range(across.size):
            total = 0.0
            for k in range(2 * _REACH):
                total += sides[j, k] * line[starts[j] + k]
            out[i, j] = total
