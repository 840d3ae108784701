"""Tables over leaf area and its dead share: exact functions on nodes, cubic splines between them."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numba.extending import register_jitable
from scipy.interpolate import CubicSpline

from fifesim.ground.canopy.background import over_background
from fifesim.ground.canopy.crowns import crown_shares, crowns_over_background

LIMIT = 50.0
"""Largest leaf area index in a table [m2 m-2]; canopies beyond are evaluated one by one."""

TOLERANCE = 4e-7
"""Of each of two axes; together within 1e-6 [1]."""

_COARSEST = 33, 33
_FINEST = 2**20  # nodes in all

TERMS = 8
"""Columns of `FoliageTable` for each band where crowns differ from cell to cell."""


class FoliageTable(NamedTuple):
    """
    Tensor product of uniform cubic B-splines.

    The axes are 1 - 1 / sqrt(1 + rate L); and q / (1 + q) with q^2 = fB / (1 - fB), on which a thin layer above or
    below a thick one has no steep side. Where the dead share is one number, its axis has one node.
    """

    rate: float
    steps: np.ndarray
    """Intervals per unit of each axis."""
    coefficients: np.ndarray
    """Shape (L, fB, column)."""


def tabulate_foliage(function, rate, by_brown=True, combine=None, tolerance=TOLERANCE):
    """
    Table of smooth functions of leaf area and dead share, as fine as it must be.

    Each axis is refined until the spline meets the function halfway between its nodes.

    Parameters
    ----------
    function : callable
        Of LAI and dead share, each of shape (n,), to values, shape (column, n).
    rate : float
        Largest decay rate of the functions. [1]
    by_brown : bool, optional
        Whether the table has an axis of the dead share.
    combine : callable, optional
        Of the values, shape (column, n), to that which must meet the tolerance; the values by default.
    tolerance : float, optional

    Returns
    -------
    table : FoliageTable

    Raises
    ------
    ValueError
        If no table fine enough is found.

    Examples
    --------
    >>> table = tabulate_foliage(lambda lai, brown: np.exp(-lai)[None], 1.0, by_brown=False)
    >>> table.coefficients.shape[1:]
    (1, 1)
    """
    combine = combine or (lambda values: values)
    # Fewest nodes, for the slow decay of dense canopies too, which is of the order of 1.
    rate = 0.3 * float(np.sqrt(rate))
    axes = [np.linspace(0, 1, _COARSEST[0]), np.linspace(0, 1, _COARSEST[1]) if by_brown else np.zeros(1)]

    def on(nodes):
        position, odds = (each.ravel() for each in np.meshgrid(*nodes, indexing="ij"))
        values = function(_lai(position, rate), odds**2 / (odds**2 + (1 - odds) ** 2))
        return np.moveaxis(values.reshape(-1, *map(len, nodes)), 0, -1)

    def columns(values):
        return combine(values.reshape(-1, values.shape[-1]).T)

    values, waiting = on(axes), [axis for axis, nodes in enumerate(axes) if len(nodes) > 1]
    while waiting and values.size // values.shape[-1] <= _FINEST:
        axis = waiting.pop(0)
        between = (axes[axis][1:] + axes[axis][:-1]) / 2
        exact = on([between if number == axis else nodes for number, nodes in enumerate(axes)])
        found = CubicSpline(axes[axis], values, axis=axis)(between)
        if np.abs(columns(found) - columns(exact)).max() >= tolerance:
            values = np.insert(values, np.arange(1, len(axes[axis])), exact, axis=axis)
            axes[axis] = np.linspace(0, 1, values.shape[axis])
            waiting.append(axis)
    if waiting:
        raise ValueError(f"no table of {_FINEST} nodes reaches {tolerance:g}: use exact=True")
    for axis in range(2):
        values = _uniform_splines(values, axis)
    steps = np.array([(len(axes[0]) - 1) / _length(rate), len(axes[1]) - 1])
    return FoliageTable(rate, steps, np.ascontiguousarray(values))


def _lai(position, rate):
    # Rounding must not lead past the last node.
    return np.minimum((1 / (1 - position * _length(rate)) ** 2 - 1) / rate, LIMIT)


def _length(rate):
    return 1 - 1 / np.sqrt(1 + rate * LIMIT)


def _uniform_splines(values, axis):
    """
    Coefficients of uniform B-splines, two more than there are nodes, times 6: the weights are without that divisor.

    With unit steps a spline is s = (c_-1 + 4 c_0 + c_1) / 6 and s'' = c_-1 - 2 c_0 + c_1 at its nodes.
    """
    if values.shape[axis] == 1:
        return values
    values = np.moveaxis(values, axis, 0)
    nodes = np.arange(len(values))
    curvature = CubicSpline(nodes, values, axis=0)(nodes, 2)
    inner = values - curvature / 6
    first = curvature[0] + 2 * inner[0] - inner[1]
    last = curvature[-1] + 2 * inner[-1] - inner[-2]
    return np.moveaxis(np.concatenate([first[None], inner, last[None]]), 0, axis) / 6


def crown_table(crown_shape, sza, vza, raa):
    """
    Table of `crown_shares` over the crown cover: of sun, view, apart and lit.

    The axis is the fourth root of the gaps, on which no power of them has a corner.

    Parameters
    ----------
    crown_shape, sza, vza, raa : float
        [1], [degree]

    Returns
    -------
    coefficients : array, shape (n, 4)
        Of uniform B-splines.

    Raises
    ------
    ValueError
        If no table fine enough is found.
    """

    def shares(root):
        found = crown_shares(1 - root**4, crown_shape, sza, vza, raa)
        return np.stack([found.sun, found.view, found.apart, found.lit], axis=-1)

    root = np.linspace(0, 1, 65)
    while len(root) < _FINEST:
        between, values = (root[1:] + root[:-1]) / 2, shares(root)
        if np.abs(CubicSpline(root, values)(between) - shares(between)).max() < TOLERANCE / 30:
            return np.ascontiguousarray(_uniform_splines(values, 0))
        root = np.linspace(0, 1, 2 * len(root) - 1)
    raise ValueError(f"no table of {_FINEST} crown covers is fine enough: use exact=True")


def interpolate_foliage(table, lai, brown, background):
    """
    Reflectance of canopies of two kinds of leaf over backgrounds.

    Parameters
    ----------
    table : FoliageTable
        Four columns for each band, the terms of `over_background`.
    lai, brown : array, shape (n,)
        Leaf area within crowns, and its dead share; NaN gives NaN. [m2 m-2], [1]
    background : array, shape (band, n) or (band, 1)
        [1]

    Returns
    -------
    reflectance : array, shape (band, n)
        Infinite where the leaf area within crowns is above `LIMIT`. [1]
    """
    values = np.empty((table.coefficients.shape[-1] // 4, lai.size))
    _foliage(*(np.ascontiguousarray(each) for each in (lai, brown, background)), table, values)
    return values


def interpolate_crowned(table, crowns, lai, brown, crown_cover, background):
    """
    Reflectance of crowns of two kinds of leaf, and of the gaps between them.

    Parameters
    ----------
    table : FoliageTable
        `TERMS` columns for each band, those of `crowns_over_background`.
    crowns : array, shape (n, 4)
        From `crown_table`.
    lai : array, shape (n,)
        Of the ground; NaN gives NaN. [m2 m-2]
    brown : array, shape (n,) or (1,)
        [1]
    crown_cover : array, shape (n,)
        [1]
    background : array, shape (band, n) or (band, 1)
        [1]

    Returns
    -------
    reflectance : array, shape (band, n)
        Infinite where the leaf area within crowns is above `LIMIT`. [1]
    """
    values = np.empty((table.coefficients.shape[-1] // TERMS, lai.size))
    cells = (np.ascontiguousarray(each) for each in (lai, brown, crown_cover, background))
    _crowned(*cells, table, crowns, values)
    return values


@register_jitable
def _weights(share):
    """Six times the weights of four neighbouring B-splines."""
    rest = 1 - share
    square, other = share * share, rest * rest
    return rest * other, 4 + square * (3 * share - 6), 4 + other * (3 * rest - 6), share * square


@register_jitable
def _place(position, nodes):
    """Interval of a position and the share of it; ``nodes`` counts coefficients, two more than nodes."""
    interval = min(int(position), nodes - 4)
    return interval, position - interval


@register_jitable
def _place_leaves(table, lai):
    return _place((1 - 1 / np.sqrt(1 + table.rate * lai)) * table.steps[0], table.coefficients.shape[0])


@register_jitable
def _place_brown(table, brown):
    dead = np.sqrt(brown)
    return _place(dead / (dead + np.sqrt(1 - brown)) * table.steps[1], table.coefficients.shape[1])


@register_jitable
def _blend(flat, start, length, leaves, browns, wide, out):
    """
    Values of all columns at one cell; ``wide`` is for them at four neighbours in the dead share.

    These lie in a row, so that most of the work is one long loop, which the compiler makes short.
    """
    a0, a1, a2, a3 = leaves
    b0, b1, b2, b3 = browns
    width, columns = wide.size, out.size
    r0, r1 = flat[start : start + width], flat[start + length : start + length + width]
    start += 2 * length
    r2, r3 = flat[start : start + width], flat[start + length : start + length + width]
    for c in range(width):
        wide[c] = a0 * r0[c] + a1 * r1[c] + a2 * r2[c] + a3 * r3[c]
    for c in range(columns):
        out[c] = b0 * wide[c] + b1 * wide[c + columns] + b2 * wide[c + 2 * columns] + b3 * wide[c + 3 * columns]


@njit(nogil=True, cache=True, error_model="numpy")
def _foliage(lai, brown, background, table, values):
    _, browns, columns = table.coefficients.shape
    flat, wide, terms = table.coefficients.reshape(-1), np.zeros(4 * columns), np.zeros(columns)
    of_ground = int(background.shape[1] > 1)
    for i in range(lai.size):
        if not (0 <= lai[i] <= LIMIT and 0 <= brown[i] <= 1):
            for band in range(values.shape[0]):
                values[band, i] = np.inf if lai[i] > LIMIT else np.nan
            continue
        row, share = _place_leaves(table, lai[i])
        at, dead = _place_brown(table, brown[i])
        _blend(flat, (row * browns + at) * columns, browns * columns, _weights(share), _weights(dead), wide, terms)
        for band in range(values.shape[0]):
            alone, hot, through, rdd = terms[4 * band], terms[4 * band + 1], terms[4 * band + 2], terms[4 * band + 3]
            ground = background[band, i * of_ground]
            values[band, i] = over_background(alone, hot, through, rdd, ground)


@njit(nogil=True, cache=True, error_model="numpy")
def _crowned(lai, brown, cover, background, table, crowns, values):
    _, browns, columns = table.coefficients.shape
    flat, rooms = table.coefficients.reshape(-1), crowns.reshape(-1)
    wide, terms, parts = np.zeros(4 * columns), np.zeros(columns), np.zeros(4)
    of_brown, of_ground = int(brown.size > 1), int(background.shape[1] > 1)
    for i in range(lai.size):
        dead = brown[i * of_brown]
        inside = lai[i] / cover[i] if cover[i] > 0 else 0 * lai[i]
        if not (0 <= inside <= LIMIT and 0 <= dead <= 1 and 0 <= cover[i] <= 1):
            for band in range(values.shape[0]):
                values[band, i] = np.inf if inside > LIMIT else np.nan
            continue
        row, share = _place_leaves(table, inside)
        leaves = _weights(share)
        if browns > 1:
            at, share = _place_brown(table, dead)
            _blend(flat, (row * browns + at) * columns, browns * columns, leaves, _weights(share), wide, terms)
        else:
            _line(flat, row * columns, leaves, terms)
        at, share = _place(np.sqrt(np.sqrt(1 - cover[i])) * (len(crowns) - 3), len(crowns))
        _line(rooms, 4 * at, _weights(share), parts)
        shares = cover[i], parts[0], parts[1], parts[2], parts[3]
        for band in range(values.shape[0]):
            t = terms[TERMS * band : TERMS * (band + 1)]
            of_band = t[0], t[1], t[2], t[3], t[4], t[5], t[6], t[7]
            values[band, i] = crowns_over_background(of_band, shares, background[band, i * of_ground])


@register_jitable
def _line(flat, start, weights, out):
    """Values of all columns from splines of one variable."""
    w0, w1, w2, w3 = weights
    columns = out.size
    rows = flat[start : start + 4 * columns]
    for c in range(columns):
        out[c] = w0 * rows[c] + w1 * rows[c + columns] + w2 * rows[c + 2 * columns] + w3 * rows[c + 3 * columns]
