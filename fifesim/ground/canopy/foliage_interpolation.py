"""Reflectance of cells from tables over leaf area and its dead share."""

import numpy as np
from numba import njit
from numba.extending import register_jitable

from fifesim.ground.canopy.background import over_background
from fifesim.ground.canopy.crowns import crowns_over_background
from fifesim.ground.canopy.foliage_table import LIMIT, TERMS
from fifesim.ground.canopy.leaf_area import LARGEST_LAI

# Cells whose places in a table are found together: with their terms, in single precision as the table is, they stay in
# the nearest cache.
_RUN = 256


def interpolate_foliage(table, lai, brown, background):
    """
    Reflectance of canopies of two kinds of leaf over backgrounds.

    Parameters
    ----------
    table : FoliageTable
        Four columns for each band, the terms of `over_background`.
    lai : array, shape (n,)
        Leaf area within crowns; NaN gives NaN. [m2 m-2]
    brown : array, shape (n,) or (1,)
        Its dead share. [1]
    background : array, shape (band, n) or (band, 1)
        [1]

    Returns
    -------
    reflectance : array, shape (band, n)
        Infinite where the leaf area within crowns is above `LIMIT`. [1]
    wrong : int
        Above 0 where a cell has what no canopy has: a leaf area outside 0 to `LARGEST_LAI`, others outside 0 to 1.
    """
    values = np.empty((table.coefficients.shape[-1] // 4, lai.size))
    wrong = _foliage(*(np.ascontiguousarray(each) for each in (lai, brown, background)), table, values)
    return values, wrong


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
    wrong : int
        As of `interpolate_foliage`; leaf area within crowns counts too.
    """
    values = np.empty((table.coefficients.shape[-1] // TERMS, lai.size))
    cells = (np.ascontiguousarray(each) for each in (lai, brown, crown_cover, background))
    wrong = _crowned(*cells, table, crowns, values)
    return values, wrong


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


# The three below are loops without branches, so that cells are done several at once. What is wrong is counted beside
# divisions, which take as long without.
@register_jitable
def _places(table, lai, brown, starts, leaves, dead):
    """
    First coefficients of cells in rows of columns, -1 where the table has none, and shares of intervals.

    How many cells have what no canopy has.
    """
    browns, wrong = table.coefficients.shape[1], 0
    for i in range(lai.size):
        known = (lai[i] >= 0) & (lai[i] <= LIMIT) & (brown[i] >= 0) & (brown[i] <= 1)
        wrong += (lai[i] < 0) | (lai[i] > LARGEST_LAI) | (brown[i] < 0) | (brown[i] > 1)
        row, leaves[i] = _place_leaves(table, lai[i] if known else 0.0)
        at = 0
        if browns > 1:
            at, dead[i] = _place_brown(table, brown[i] if known else 0.0)
        starts[i] = row * browns + at if known else -1
    return wrong


@register_jitable
def _within(lai, cover, inside):
    """Leaf area within crowns, NaN where the cover is no share; and how many cells have what no canopy has."""
    wrong = 0
    for i in range(lai.size):
        wrong += (lai[i] < 0) | (lai[i] > LARGEST_LAI) | (cover[i] < 0) | (cover[i] > 1)
        crowned = lai[i] / cover[i] if cover[i] > 0 else 0 * lai[i]
        inside[i] = crowned if (cover[i] >= 0) & (cover[i] <= 1) else np.nan
    return wrong


@register_jitable
def _rooms(crowns, cover, at, share):
    """Intervals of covers in a table of crowns, and shares of these."""
    for i in range(cover.size):
        known = cover[i] if (cover[i] >= 0) & (cover[i] <= 1) else 0.0
        at[i], share[i] = _place(np.sqrt(np.sqrt(1 - known)) * (len(crowns) - 3), len(crowns))


# Columns are found by places that have no sign, here in flat arrays and below: views of rows, and places that may count
# from the end, take longer than the work.
@register_jitable
def _along(table, rows, shares, out):
    """Values of all columns of a table, shape (n, column), from splines of one variable."""
    flat, values, columns = table.reshape(-1), out.reshape(-1), np.uint64(out.shape[1])
    for i in range(rows.size):
        if rows[i] >= 0:
            w0, w1, w2, w3 = _weights(shares[i])
            to, k0 = np.uint64(i) * columns, np.uint64(rows[i]) * columns
            k1, k2, k3 = k0 + columns, k0 + columns + columns, k0 + columns + columns + columns
            for c in range(columns):
                values[to + c] = w0 * flat[k0 + c] + w1 * flat[k1 + c] + w2 * flat[k2 + c] + w3 * flat[k3 + c]


@register_jitable
def _across(table, starts, leaves, dead, wide, out):
    """
    Values of all columns of a table from splines of two variables; ``wide`` is for those at four dead shares.

    These lie in a row, so that most of the work is one long loop.
    """
    flat, values, columns = table.reshape(-1), out.reshape(-1), np.uint64(table.shape[2])
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


@register_jitable
def _single(weights):
    w0, w1, w2, w3 = weights
    return np.float32(w0), np.float32(w1), np.float32(w2), np.float32(w3)


# No divisor is 0: without that being asked, cells are done several at once.
@njit(nogil=True, cache=True, error_model="numpy")
def _foliage(lai, brown, background, table, values):
    columns = table.coefficients.shape[2]
    wide, terms = np.zeros(4 * columns, np.float32), np.zeros((_RUN, columns), np.float32)
    starts, leaves, dead = np.zeros(_RUN, np.int64), np.zeros(_RUN), np.zeros(_RUN)
    of_ground, of_brown, alike = background.shape[1] > 1, brown.size > 1, np.full(_RUN, brown[0])
    wrong, step = 0, int(of_ground)
    for first in range(0, lai.size, _RUN):
        cells, shares = lai[first : first + _RUN], brown[first : first + _RUN] if of_brown else alike
        wrong += _places(table, cells, shares, starts, leaves, dead)
        _across(table.coefficients, starts[: cells.size], leaves, dead, wide, terms)
        for band in range(values.shape[0]):
            out = values[band, first : first + _RUN]
            below = background[band, first : first + _RUN] if of_ground else background[band]
            k = np.uint64(4 * band)
            for i in range(cells.size):
                t, ground = terms[i], below[step * i]
                wrong += (ground < 0) | (ground > 1)
                seen = over_background(t[k], t[k + 1], t[k + 2], t[k + 3], ground)
                out[i] = seen if starts[i] >= 0 else np.inf if cells[i] > LIMIT else np.nan
    return wrong


@njit(nogil=True, cache=True, error_model="numpy")
def _crowned(lai, brown, cover, background, table, crowns, values):
    columns = table.coefficients.shape[2]
    wide, terms = np.zeros(4 * columns, np.float32), np.zeros((_RUN, columns), np.float32)
    starts, leaves, dead, inside = np.zeros(_RUN, np.int64), np.zeros(_RUN), np.zeros(_RUN), np.zeros(_RUN)
    places, shares, parts = np.zeros(_RUN, np.int64), np.zeros(_RUN), np.zeros((_RUN, 4))
    of_ground, of_brown, alike = background.shape[1] > 1, brown.size > 1, np.full(_RUN, brown[0])
    wrong, step = 0, int(of_ground)
    for first in range(0, lai.size, _RUN):
        cells, crowned = lai[first : first + _RUN], cover[first : first + _RUN]
        browns = brown[first : first + _RUN] if of_brown else alike
        wrong += _within(cells, crowned, inside)
        of_cells = inside[: cells.size]
        wrong += _places(table, of_cells, browns, starts, leaves, dead)
        if table.coefficients.shape[1] > 1:
            _across(table.coefficients, starts[: cells.size], leaves, dead, wide, terms)
        else:
            _along(table.coefficients, starts[: cells.size], leaves, terms)
        _rooms(crowns, crowned, places, shares)
        _along(crowns, places[: cells.size], shares, parts)
        for band in range(values.shape[0]):
            out = values[band, first : first + _RUN]
            below = background[band, first : first + _RUN] if of_ground else background[band]
            k = np.uint64(TERMS * band)
            for i in range(cells.size):
                t, p, ground = terms[i], parts[i], below[step * i]
                wrong += (ground < 0) | (ground > 1)
                of_band = t[k], t[k + 1], t[k + 2], t[k + 3], t[k + 4], t[k + 5], t[k + 6], t[k + 7]
                seen = crowns_over_background(of_band, (crowned[i], p[0], p[1], p[2], p[3]), ground)
                out[i] = seen if starts[i] >= 0 else np.inf if of_cells[i] > LIMIT else np.nan
    return wrong
