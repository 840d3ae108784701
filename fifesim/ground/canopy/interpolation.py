"""Interpolation of canopy reflectance between exact nodes of leaf area and its dead share, by cubic splines."""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from fifesim.base.arrays import compiled, jitable, read_only
from fifesim.ground.canopy.crowns import crown_shares, crowns_over_background
from fifesim.ground.canopy.leaf_area import LARGEST_LAI
from fifesim.ground.canopy.sail_model import over_background

LARGEST_TABLE_LAI = LARGEST_LAI  # largest leaf area index in a table

RUN = 1024  # cells whose places in a table are found together: they stay in the nearest cache

_COARSEST = 32
_FINEST = 2**16


class LaiTable(NamedTuple):
    """Cubic splines of functions of leaf area index, on nodes that are equidistant in rate LAI / (1 + rate LAI)."""

    rate: float
    step: float  # intervals per unit of rate LAI / (1 + rate LAI)
    coefficients: np.ndarray  # of polynomials over the unit interval, constant term first, shape (interval, column, 4)


def tabulate(function, rate, combine=None, tolerance=1e-6):
    """Table of smooth functions of leaf area index, with nodes doubled to the tolerance."""
    # Nodes for the slow decay of dense canopies too, which is of the order of 1.
    rate = float(np.sqrt(rate))
    length = rate * LARGEST_TABLE_LAI / (1 + rate * LARGEST_TABLE_LAI)
    values = refined(lambda position: function(_lai(position, rate, length)), _COARSEST, _FINEST, tolerance, 1, combine)
    spline = CubicSpline(np.arange(values.shape[1]), values, axis=1)
    coefficients = np.ascontiguousarray(spline.c[::-1].transpose(1, 2, 0))
    return LaiTable(rate, len(coefficients) / length, coefficients)


def refined(function, intervals, most, tolerance, axis, combine=None, nodes="nodes"):
    """Values of a function at even nodes along an axis, from 0 to 1, with nodes doubled to the tolerance."""
    # The spline through every second node must meet the others. The error falls with the fourth power of the step, so
    # that the error of the table is some 16 times smaller.
    combine = combine or (lambda values: values)
    values = function(np.linspace(0, 1, intervals + 1))
    while values.shape[axis] <= most:
        position = np.linspace(0, 1, values.shape[axis])
        between = (position[1:] + position[:-1]) / 2
        coarse, exact = CubicSpline(position, values, axis=axis)(between), function(between)
        values = np.insert(values, np.arange(1, values.shape[axis]), exact, axis=axis)
        if np.abs(combine(coarse) - combine(exact)).max() < tolerance:
            return values
    raise ValueError(f"no table of {most} {nodes} reaches {tolerance:g}: use exact=True")


def _lai(position, rate, length):
    # Rounding must not lead past the last node.
    return np.minimum(position * length / (1 - position * length) / rate, LARGEST_TABLE_LAI)


def interpolate(table, lai):
    """Values of a table, shape (column,) + lai.shape, NaN for leaf area outside 0 to `LARGEST_TABLE_LAI`."""
    lai = np.asarray(lai, float)
    values = np.empty((table.coefficients.shape[1], lai.size))
    _interpolate(np.ascontiguousarray(lai).ravel(), table, values)
    return values.reshape(-1, *lai.shape)


def interpolate_over(table, lai, background):
    """Reflectance of a canopy over a background that varies from cell to cell, shape (band,) + lai.shape. [1]"""
    lai = np.asarray(lai, float)
    bands = table.coefficients.shape[1] // 4
    background = np.broadcast_to(np.asarray(background, float), (bands, *lai.shape)).reshape(bands, -1)
    values = np.empty((bands, lai.size))
    _interpolate_over(np.ascontiguousarray(lai).ravel(), background, table, values)
    return values.reshape(-1, *lai.shape)


@jitable
def table_places(lai, table, interval, share):
    """Fill in the intervals of leaf area indices in a table and the places in these, NaN outside of the table."""
    last = table.coefficients.shape[0] - 1
    # Without branches, so that the loop is done for several cells at once.
    for k in range(lai.size):
        inside = (lai[k] >= 0) & (lai[k] <= LARGEST_TABLE_LAI)
        x = lai[k] if inside else 0.0
        position = table.rate * x / (1 + table.rate * x) * table.step
        at = min(int(position), last)
        interval[k] = at
        share[k] = position - at if inside else np.nan


@jitable
def value_at(table, interval, column, share):
    """Value of a table at a place in an interval."""
    c = table.coefficients[interval, column]
    return c[0] + share * (c[1] + share * (c[2] + share * c[3]))


# No divisor is 0; without this check the loop is vectorized.
@compiled
def _interpolate(lai, table, values):
    interval, share = np.empty(RUN, np.int64), np.empty(RUN)
    for first in range(0, lai.size, RUN):
        cells = lai[first : first + RUN]
        table_places(cells, table, interval, share)
        for column in range(values.shape[0]):
            out = values[column, first : first + RUN]
            for k in range(cells.size):
                out[k] = value_at(table, interval[k], column, share[k])


@compiled
def _interpolate_over(lai, background, table, values):
    interval, share = np.empty(RUN, np.int64), np.empty(RUN)
    for first in range(0, lai.size, RUN):
        cells = lai[first : first + RUN]
        table_places(cells, table, interval, share)
        for band in range(values.shape[0]):
            out, below = values[band, first : first + RUN], background[band, first : first + RUN]
            for k in range(cells.size):
                at, s, c = interval[k], share[k], 4 * band
                alone, hot = value_at(table, at, c, s), value_at(table, at, c + 1, s)
                through, rdd = value_at(table, at, c + 2, s), value_at(table, at, c + 3, s)
                out[k] = over_background(alone, hot, through, rdd, below[k])


LARGEST_FOLIAGE_LAI = 50.0  # largest leaf area index in a table [m2 m-2]; canopies beyond are evaluated one by one

FOLIAGE_TOLERANCE = 4e-7  # of each of two axes; together, and with the rounding of single precision, within 1e-6 [1]

_COARSEST_FOLIAGE = 33, 33
_FINEST_FOLIAGE = 2**20  # nodes in all

_LINE = 64  # of a processor's cache [byte]

TERMS = 8  # columns of `FoliageTable` for each band where crowns differ from cell to cell


class FoliageTable(NamedTuple):
    r"""
    Tensor product of uniform cubic B-splines.

    The axes are :math:`1 - 1 / \sqrt{1 + a L}` with the rate a; and :math:`q / (1 + q)` with
    :math:`q^2 = f_B / (1 - f_B)`, on which a thin layer above or below a thick one has no steep side. Where the dead
    share is one number, its axis has one node.
    """

    rate: float
    steps: np.ndarray  # intervals per unit of each axis
    coefficients: np.ndarray  # shape (L, fB, column), in single precision


def tabulate_foliage(function, rate, by_brown=True, combine=None):
    """Table of smooth functions of leaf area and dead share, with each axis refined to the tolerance."""
    # Tested halfway between the nodes.
    combine = combine or (lambda values: values)
    # Fewest nodes, for the slow decay of dense canopies too, which is of the order of 1.
    rate = 0.3 * float(np.sqrt(rate))
    axes = [
        np.linspace(0, 1, _COARSEST_FOLIAGE[0]),
        np.linspace(0, 1, _COARSEST_FOLIAGE[1]) if by_brown else np.zeros(1),
    ]

    def on(nodes):
        position, odds = (each.ravel() for each in np.meshgrid(*nodes, indexing="ij"))
        values = function(_foliage_lai(position, rate), odds**2 / (odds**2 + (1 - odds) ** 2))
        return np.moveaxis(values.reshape(-1, *map(len, nodes)), 0, -1)

    def columns(values):
        return combine(values.reshape(-1, values.shape[-1]).T)

    values, waiting = on(axes), [axis for axis, nodes in enumerate(axes) if len(nodes) > 1]
    while waiting and values.size // values.shape[-1] <= _FINEST_FOLIAGE:
        axis = waiting.pop(0)
        between = (axes[axis][1:] + axes[axis][:-1]) / 2
        exact = on([between if number == axis else nodes for number, nodes in enumerate(axes)])
        found = CubicSpline(axes[axis], values, axis=axis)(between)
        if np.abs(columns(found) - columns(exact)).max() >= FOLIAGE_TOLERANCE:
            values = np.insert(values, np.arange(1, len(axes[axis])), exact, axis=axis)
            axes[axis] = np.linspace(0, 1, values.shape[axis])
            waiting.append(axis)
    if waiting:
        raise ValueError(f"no table of {_FINEST_FOLIAGE} nodes reaches {FOLIAGE_TOLERANCE:g}: use exact=True")
    for axis in range(2):
        values = _uniform_splines(values, axis)
    steps = np.array([(len(axes[0]) - 1) / _length(rate), len(axes[1]) - 1])
    return FoliageTable(rate, steps, _aligned(values))


def _aligned(values):
    """Copy in single precision that starts at a cache line, so that no vector load crosses two."""
    size = 4 * values.size
    memory = np.empty(size + _LINE, np.uint8)
    start = -memory.ctypes.data % _LINE
    out = memory[start : start + size].view(np.float32).reshape(values.shape)
    out[...] = values
    return out


def _foliage_lai(position, rate):
    # Rounding must not lead past the last node.
    return np.minimum((1 / (1 - position * _length(rate)) ** 2 - 1) / rate, LARGEST_FOLIAGE_LAI)


def _length(rate):
    return 1 - 1 / np.sqrt(1 + rate * LARGEST_FOLIAGE_LAI)


def _uniform_splines(values, axis):
    """Coefficients of uniform B-splines, two more than nodes, times 6: the weights omit this divisor."""
    # With unit steps a spline is s = (c_-1 + 4 c_0 + c_1) / 6 and s'' = c_-1 - 2 c_0 + c_1 at its nodes.
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
    """Table of sun, view, apart and lit of `crown_shares` over crown cover, B-spline coefficients of shape (n, 4)."""
    # The axis is the fourth root of the gap fraction, in which none of its powers has a kink.

    def shares(root):
        found = crown_shares(1 - root**4, crown_shape, sza, vza, raa)
        return np.stack([found.sun, found.view, found.apart, found.lit], axis=-1)

    root = np.linspace(0, 1, 65)
    while len(root) < _FINEST_FOLIAGE:
        between, values = (root[1:] + root[:-1]) / 2, shares(root)
        if np.abs(CubicSpline(root, values)(between) - shares(between)).max() < FOLIAGE_TOLERANCE / 30:
            return np.ascontiguousarray(_uniform_splines(values, 0))
        root = np.linspace(0, 1, 2 * len(root) - 1)
    raise ValueError(f"no table of {_FINEST_FOLIAGE} crown covers is fine enough: use exact=True")


# Cells whose places in a table are found together: with their terms, in single precision as the table is, they stay in
# the nearest cache.
_RUN = 256


def interpolate_foliage(table, lai, brown, background):
    """Reflectance of green and dead leaves over backgrounds, shape (band, n) [1], and number of invalid cells."""
    # Infinite where the leaf area within crowns is above LIMIT.
    values = np.empty((table.coefficients.shape[-1] // 4, lai.size))
    given = read_only(lai), _for_runs(brown), read_only(background)
    wrong = _foliage(*given, table, table.coefficients.reshape(-1), _memory(table), values)
    return values, wrong


def interpolate_crowned(table, crowns, lai, brown, cover, background):
    """Reflectance of crowns of green and dead leaves and gaps, shape (band, n) [1], and number of invalid cells."""
    # Infinite where the leaf area within crowns is above LIMIT.
    values = np.empty((table.coefficients.shape[-1] // TERMS, lai.size))
    given = read_only(lai), _for_runs(brown), read_only(cover), read_only(background)
    wrong = _crowned(*given, table, table.coefficients.reshape(-1), crowns, _memory(table), values)
    return values, wrong


def _memory(table):
    """Memory for a run: all columns at four dead shares, and at the place of each cell; starts, leaves and dead."""
    columns, places = table.coefficients.shape[2], np.zeros((2, _RUN))
    wide, terms = np.empty(4 * columns, np.float32), np.zeros(_RUN * columns, np.float32)
    return wide, terms, np.empty(_RUN, np.int64), *places


def _for_runs(brown):
    """Dead share of each cell, or the same for all cells of a run."""
    return read_only(brown if brown.size > 1 else np.full(_RUN, brown[0]))


@jitable
def _weights(share):
    """Weights of four neighbouring cubic B-splines, times 6."""
    rest = 1 - share
    square, other = share * share, rest * rest
    return rest * other, 4 + square * (3 * share - 6), 4 + other * (3 * rest - 6), share * square


@jitable
def _place(position, nodes):
    """Interval of a position and the place in it; ``nodes`` counts coefficients, two more than nodes."""
    interval = min(int(position), nodes - 4)
    return interval, position - interval


# The next three are loops without branches, which are vectorized. Invalid values are counted separately, divisions,
# which take as long without.
@jitable
def _places(table, lai, brown, starts, leaves, dead):
    """Fill in first coefficients of cells, -1 outside of the table, and places; count the invalid cells."""
    browns, wrong = table.coefficients.shape[1], 0
    for i in range(lai.size):
        known = (lai[i] >= 0) & (lai[i] <= LARGEST_FOLIAGE_LAI) & (brown[i] >= 0) & (brown[i] <= 1)
        wrong += (lai[i] < 0) | (lai[i] > LARGEST_LAI) | (brown[i] < 0) | (brown[i] > 1)
        area, share, at = lai[i] if known else 0.0, brown[i] if known else 0.0, 0
        row, leaves[i] = _place((1 - 1 / np.sqrt(1 + table.rate * area)) * table.steps[0], table.coefficients.shape[0])
        if browns > 1:
            root = np.sqrt(share)
            at, dead[i] = _place(root / (root + np.sqrt(1 - share)) * table.steps[1], browns)
        starts[i] = row * browns + at if known else -1
    return wrong


@jitable
def _within(lai, cover, inside):
    """Fill in leaf area within crowns, NaN where the cover is invalid; return the number of invalid cells."""
    wrong = 0
    for i in range(lai.size):
        wrong += (lai[i] < 0) | (lai[i] > LARGEST_LAI) | (cover[i] < 0) | (cover[i] > 1)
        crowned = lai[i] / cover[i] if cover[i] > 0 else 0 * lai[i]
        inside[i] = crowned if (cover[i] >= 0) & (cover[i] <= 1) else np.nan
    return wrong


@jitable
def _rooms(crowns, cover, at, share):
    """Fill in the intervals of crown covers in a table of crowns, and the places in these."""
    for i in range(cover.size):
        known = cover[i] if (cover[i] >= 0) & (cover[i] <= 1) else 0.0
        at[i], share[i] = _place(np.sqrt(np.sqrt(1 - known)) * (len(crowns) - 3), len(crowns))


# Columns are found by places that have no sign, here in flat arrays and below: views of rows, and places that may count
# from the end, take longer than the work.
@jitable
def _along(flat, columns, rows, shares, values):
    """Fill in the values of all columns of a table, one cell after the other, from splines of one variable."""
    columns = np.uint64(columns)
    for i in range(rows.size):
        if rows[i] >= 0:
            w0, w1, w2, w3 = _weights(shares[i])
            to, k0 = np.uint64(i) * columns, np.uint64(rows[i]) * columns
            k1, k2, k3 = k0 + columns, k0 + columns + columns, k0 + columns + columns + columns
            for c in range(columns):
                values[to + c] = w0 * flat[k0 + c] + w1 * flat[k1 + c] + w2 * flat[k2 + c] + w3 * flat[k3 + c]


@jitable
def _across(table, flat, starts, leaves, dead, wide, values):
    """Fill in the values of all columns of a table from splines of two variables; ``wide`` holds four dead shares."""
    # These are contiguous, so that most of the work is one long loop.
    columns = np.uint64(table.shape[2])
    length, n2 = np.uint64(table.shape[1]) * columns, columns + columns
    n3, width = n2 + columns, n2 + n2
    for i in range(starts.size):
        if starts[i] >= 0:
            a0, a1, a2, a3 = _single(_weights(leaves[i]))
            b0, b1, b2, b3 = _single(_weights(dead[i]))
            to, k0 = np.uint64(i) * columns, np.uint64(starts[i]) * columns
            k1, k2, k3 = k0 + length, k0 + length + length, k0 + length + length + length
            for c in range(width):
                wide[c] = a0 * flat[k0 + c] + a1 * flat[k1 + c] + a2 * flat[k2 + c] + a3 * flat[k3 + c]
            for c in range(columns):
                values[to + c] = b0 * wide[c] + b1 * wide[columns + c] + b2 * wide[n2 + c] + b3 * wide[n3 + c]


@jitable
def _single(weights):
    w0, w1, w2, w3 = weights
    return np.float32(w0), np.float32(w1), np.float32(w2), np.float32(w3)


# No divisor is 0; without this check the loop is vectorized.
@compiled
def _foliage(lai, brown, background, table, flat, memory, values):
    wide, terms, starts, leaves, dead = memory
    columns, of_ground, of_brown = np.uint64(table.coefficients.shape[2]), background.shape[1] > 1, brown.size > _RUN
    wrong, step = 0, int(of_ground)
    for first in range(0, lai.size, _RUN):
        cells, shares = lai[first : first + _RUN], brown[first : first + _RUN] if of_brown else brown
        wrong += _places(table, cells, shares, starts, leaves, dead)
        _across(table.coefficients, flat, starts[: cells.size], leaves, dead, wide, terms)
        for band in range(values.shape[0]):
            out = values[band, first : first + _RUN]
            below = background[band, first : first + _RUN] if of_ground else background[band]
            k = np.uint64(4 * band)
            for i in range(cells.size):
                t, ground = np.uint64(i) * columns + k, below[step * i]
                wrong += (ground < 0) | (ground > 1)
                seen = over_background(terms[t], terms[t + 1], terms[t + 2], terms[t + 3], ground)
                out[i] = seen if starts[i] >= 0 else np.inf if cells[i] > LARGEST_FOLIAGE_LAI else np.nan
    return wrong


@compiled
def _crowned(lai, brown, cover, background, table, flat, crowns, memory, values):
    wide, terms, starts, leaves, dead = memory
    inside, places, shares, parts = np.empty(_RUN), np.empty(_RUN, np.int64), np.empty(_RUN), np.empty(4 * _RUN)
    columns, of_ground, of_brown = np.uint64(table.coefficients.shape[2]), background.shape[1] > 1, brown.size > _RUN
    wrong, step = 0, int(of_ground)
    for first in range(0, lai.size, _RUN):
        cells, crowned = lai[first : first + _RUN], cover[first : first + _RUN]
        browns = brown[first : first + _RUN] if of_brown else brown
        wrong += _within(cells, crowned, inside)
        of_cells = inside[: cells.size]
        wrong += _places(table, of_cells, browns, starts, leaves, dead)
        if table.coefficients.shape[1] > 1:
            _across(table.coefficients, flat, starts[: cells.size], leaves, dead, wide, terms)
        else:
            _along(flat, columns, starts[: cells.size], leaves, terms)
        _rooms(crowns, crowned, places, shares)
        _along(crowns.reshape(-1), 4, places[: cells.size], shares, parts)
        for band in range(values.shape[0]):
            out = values[band, first : first + _RUN]
            below = background[band, first : first + _RUN] if of_ground else background[band]
            k = np.uint64(TERMS * band)
            for i in range(cells.size):
                t, p, ground = np.uint64(i) * columns + k, parts[4 * i : 4 * i + 4], below[step * i]
                wrong += (ground < 0) | (ground > 1)
                of_band = (
                    terms[t], terms[t + 1], terms[t + 2], terms[t + 3],
                    terms[t + 4], terms[t + 5], terms[t + 6], terms[t + 7],
                )  # fmt: skip
                seen = crowns_over_background(of_band, (crowned[i], p[0], p[1], p[2], p[3]), ground)
                out[i] = seen if starts[i] >= 0 else np.inf if of_cells[i] > LARGEST_FOLIAGE_LAI else np.nan
    return wrong
