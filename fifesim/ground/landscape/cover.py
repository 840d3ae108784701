"""
Patches and patterns of cover as functions of seed and place.

Each block of the lattice has separate random numbers, so that any place can be computed alone.

All patterns depend only on seed, northing and easting, so a window equals a slice of the whole for any chunks, and
cells of another size show the same patches.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import exp
from typing import Literal

import numpy as np
from scipy.stats import norm

from fifesim.base.arguments import NUMBER, described
from fifesim.base.arrays import compiled, jitable
from fifesim.base.caches import cached
from fifesim.base.lattice import assemble, generator

# Streams of a seed.
_VORONOI, _SMOOTH, _PASTURES = 8, 9, 10

# Side of the squares in which random numbers are drawn. [block]
_SQUARE = 64

# Weights of the smooth field are cut off at this many knots, where they are 1.5e-8 of the maximum.
_REACH = 6

# Uniform numbers are multiples of 2**-53, and 0 has no normal deviate.
_LEAST = 2.0**-54

# Pastures along a side of a block.
_ALONG = 3


def voronoi(seed, down, across, class_of=None):
    """Number of the Voronoi cell of each place, uniform in [0, 1), or its class, shape (y, x)."""
    # Each square of the unit lattice has one uniform random point, so that the mean area of the cells is 1.
    # The nearest point is within sqrt(2), so at most two squares away.
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
    Standard normal field with Gaussian correlation, 1/e at distance 1.

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
    Knots as far apart as the standard deviation of their weights are not visible: the correlation equals a
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
    """Number of the pasture of each place, uniform in [0, 1), or its class, shape (y, x)."""
    # Blocks of 3 x 3 units are divided into nine pastures: always the largest so far, across its longer side at 3/8,
    # 1/2 or 5/8 of it. The mean area of the pastures is 1.
    down, across = np.asarray(down, float) / _ALONG, np.asarray(across, float) / _ALONG
    out = np.empty((down.size, across.size), float if class_of is None else np.int16)
    for row in np.unique(np.floor(down)).astype(int).tolist():
        rows = np.flatnonzero(np.floor(down) == row)
        for column in np.unique(np.floor(across)).astype(int).tolist():
            columns = np.flatnonzero(np.floor(across) == column)
            for (top, left, bottom, right), number in _fenced(seed, row, column):
                within = rows[(down[rows] - row >= top) & (down[rows] - row < bottom)]
                beside = columns[(across[columns] - column >= left) & (across[columns] - column < right)]
                if within.size and beside.size:
                    # Places are in order, so that a pasture is a rectangle of cells.
                    rectangle = slice(within[0], within[-1] + 1), slice(beside[0], beside[-1] + 1)
                    out[rectangle] = number if class_of is None else class_of(number)
    return out


@cached(1024, "pastures of a block")
def _fenced(seed, row, column):
    """Pastures of a block: edges (top, left, bottom, right) in units of the block, and a number for each."""
    drawn = generator(seed, _PASTURES, (0, 0, row, column)).random((2, _ALONG**2))
    parts = [(0.0, 0.0, 1.0, 1.0)]
    for number in drawn[0, 1:].tolist():
        areas = [(bottom - top) * (right - left) for top, left, bottom, right in parts]
        top, left, bottom, right = parts.pop(areas.index(max(areas)))
        share = (3 + int(3 * number)) / 8
        if bottom - top >= right - left:
            fence = top + share * (bottom - top)
            parts += [(top, left, fence, right), (fence, left, bottom, right)]
        else:
            fence = left + share * (right - left)
            parts += [(top, left, bottom, fence), (top, fence, bottom, right)]
    return tuple(zip(parts, drawn[1].tolist(), strict=True))


def _blocks(places, around):
    """First unit square of the places along an axis with a margin, and the number of squares."""
    first = int(np.floor(np.min(places))) - around
    return first, int(np.floor(np.max(places))) + around + 1 - first


def _drawn(seed, stream, top, left, shape, numbers):
    """Uniform numbers of a window of unit squares, shape (numbers, rows, columns)."""
    out = np.empty((numbers, *shape))
    for index in range(numbers):
        out[index] = assemble(partial(_square, seed, stream, index), _SQUARE, top, left, shape)
    return out


@cached(64, "random numbers of patches")
def _square(seed, stream, index, row, column):
    """Uniform numbers of a block of unit squares."""
    return generator(seed, stream, (0, index, row, column)).random((_SQUARE, _SQUARE))


@compiled
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


@jitable
def _knot_weights(place, first, weights):
    """Index of the first knot for a place along an axis, and the weights of the knots, whose squares sum to 1."""
    knot = int(np.floor(place)) - _REACH + 1
    total = 0.0
    for k in range(2 * _REACH):
        away = place - (knot + k)
        weights[k] = exp(-0.5 * away * away)
        total += weights[k] * weights[k]
    for k in range(2 * _REACH):
        weights[k] /= np.sqrt(total)
    return knot - first


@compiled
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


PATTERNS = ("voronoi", "levels", "pastures")

# Tolerance for the sum of fractions. [1]
_WHOLE = 1e-6


@dataclass(frozen=True)
class Patches:
    """
    Layout of the classes of a random landscape.

    Parameters
    ----------
    pattern : {"voronoi", "levels", "pastures"}
        ``voronoi``: Voronoi cells of random points, similar to stands or watersheds. ``levels``: zones between contours
        of a smooth field, in the order of the classes. ``pastures``: rectangles.
    size : float
        Square root of the mean patch area; for ``levels``, the distance at which the correlation of the field is 1/e.
        [m]
    shares : sequence or mapping of str to float, optional
        Area fraction of each class, in order or by name; equal by default. [1]

    Raises
    ------
    ValueError
        If the pattern is unknown, the size is not positive, or fractions are negative or do not sum to 1.
    TypeError
        If a value has the wrong type.

    Examples
    --------
    >>> from fifesim.ground import Patches
    >>> Patches("voronoi", 300, shares={"grass": 0.7, "wood": 0.3}).size
    300.0
    """

    pattern: Literal["voronoi", "levels", "pastures"]
    size: float
    shares: Sequence[float] | Mapping[str, float] | None = None

    def __post_init__(self):
        if not isinstance(self.pattern, str) or self.pattern not in PATTERNS:
            raise ValueError(f"the pattern of patches is one of {', '.join(PATTERNS)}, got {described(self.pattern)}")
        size = self.size
        if not NUMBER.fits(size) or not 0 < float(size) < np.inf:
            raise ValueError(f"the size of patches is a number above 0, in metres, got {described(size)}")
        object.__setattr__(self, "size", float(size))
        if self.shares is not None:
            named = hasattr(self.shares, "items")
            values = list(self.shares.values() if named else self.shares)
            _check_shares(values)
            shares = dict(zip(self.shares, values, strict=True)) if named else tuple(map(float, values))
            object.__setattr__(self, "shares", shares)

    def shares_of(self, names: Sequence[str]) -> tuple[float, ...]:
        """
        Area fraction of each class.

        Parameters
        ----------
        names : sequence of str

        Returns
        -------
        shares : tuple of float

        Raises
        ------
        ValueError
            If the names do not match the classes.
        """
        if self.shares is None:
            return (1.0 / len(names),) * len(names)
        if isinstance(self.shares, dict):
            if set(self.shares) != set(names):
                raise ValueError(f"shares are of {', '.join(self.shares)}, the classes are {', '.join(names)}")
            return tuple(float(self.shares[name]) for name in names)
        if len(self.shares) != len(names):
            raise ValueError(f"{len(self.shares)} shares for {len(names)} classes: give one for each")
        return tuple(self.shares)


def patch_classes(patches, shares, seed, northing, easting, codes=None):
    """Class number, or code, of each cell, shape (y, x)."""
    if not np.size(northing) or not np.size(easting):
        return np.zeros((np.size(northing), np.size(easting)), np.int16)
    codes = np.arange(len(shares), dtype=np.int16) if codes is None else codes
    place = np.asarray(northing, float) / patches.size, np.asarray(easting, float) / patches.size
    if patches.pattern == "levels":
        limits = norm.ppf(np.minimum(np.cumsum(shares)[:-1], 1.0))
        return codes[np.searchsorted(limits, smooth_field(seed, *place), side="right")]
    draw = voronoi if patches.pattern == "voronoi" else pastures
    return draw(seed, *place, lambda numbers: codes[np.searchsorted(np.cumsum(shares)[:-1], numbers, side="right")])


def _check_shares(values):
    wrong = [value for value in values if isinstance(value, str) or np.ndim(value) or not 0 <= float(value) <= 1]
    if wrong:
        raise ValueError(f"the share of a class is in [0, 1], got {described(wrong[0])}")
    if not abs(sum(values) - 1) <= _WHOLE:
        given = ", ".join(f"{value:g}" for value in values[:8]) + (", ..." if values[8:] else "")
        raise ValueError(f"the shares of the classes must sum to 1, got {sum(values):g} of {given}")
