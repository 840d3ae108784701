"""Tables over leaf area index: exact functions on nodes, cubic splines between them."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numba.extending import register_jitable
from scipy.interpolate import CubicSpline

from fifesim.ground.canopy.background import over_background
from fifesim.ground.canopy.leaf_area import LARGEST_LAI

LIMIT = LARGEST_LAI
"""Largest leaf area index in a table."""

RUN = 1024
"""Cells whose places in a table are found together: they stay in the nearest cache."""

_COARSEST = 32
_FINEST = 2**16


class LaiTable(NamedTuple):
    """Cubic splines of functions of leaf area index, on nodes that are equidistant in rate LAI / (1 + rate LAI)."""

    rate: float
    step: float
    """Intervals per unit of rate LAI / (1 + rate LAI)."""
    coefficients: np.ndarray
    """Of polynomials over the unit interval, constant term first, shape (interval, column, 4)."""


def tabulate(function, rate, combine=None, tolerance=1e-6):
    """
    Table of smooth functions of leaf area index, as fine as it must be.

    Nodes are doubled until the spline through every second one meets the others within the tolerance. A cubic
    spline's error falls with the fourth power of the step: that of the table is some sixteen times smaller.

    Parameters
    ----------
    function : callable
        Of LAI, shape (n,), to values, shape (column, n).
    rate : float
        Largest decay rate of the functions. [1]
    combine : callable, optional
        Of the values, shape (column, n), to that which must meet the tolerance; the values by default.
    tolerance : float, optional

    Returns
    -------
    table : LaiTable

    Raises
    ------
    ValueError
        If no table fine enough is found.

    Examples
    --------
    >>> table = tabulate(lambda lai: np.exp(-lai)[None], rate=1.0)
    >>> bool(abs(interpolate(table, np.array([0.7]))[0, 0] - np.exp(-0.7)) < 1e-7)
    True
    """
    combine = combine or (lambda values: values)
    # Nodes for the slow decay of dense canopies too, which is of the order of 1.
    rate = float(np.sqrt(rate))
    length = rate * LIMIT / (1 + rate * LIMIT)
    values = function(_lai(np.linspace(0, 1, _COARSEST + 1), rate, length))
    while values.shape[1] <= _FINEST:
        position = np.linspace(0, 1, values.shape[1])
        between = (position[1:] + position[:-1]) / 2
        exact = function(_lai(between, rate, length))
        coarse = CubicSpline(position, values, axis=1)(between)
        values = np.insert(values, np.arange(1, values.shape[1]), exact, axis=1)
        if np.abs(combine(coarse) - combine(exact)).max() < tolerance:
            spline = CubicSpline(np.arange(values.shape[1]), values, axis=1)
            coefficients = np.ascontiguousarray(spline.c[::-1].transpose(1, 2, 0))
            return LaiTable(rate, len(coefficients) / length, coefficients)
    raise ValueError(f"no table of {_FINEST} nodes reaches {tolerance:g}: use exact=True")


def _lai(position, rate, length):
    # Rounding must not lead past the last node.
    return np.minimum(position * length / (1 - position * length) / rate, LIMIT)


def interpolate(table, lai):
    """
    Values of a table.

    Parameters
    ----------
    table : LaiTable
    lai : array
        NaN, and all outside 0 to `LIMIT`, gives NaN. [m2 m-2]

    Returns
    -------
    values : array, shape (column,) + lai.shape
    """
    lai = np.asarray(lai, float)
    values = np.empty((table.coefficients.shape[1], lai.size))
    _interpolate(np.ascontiguousarray(lai).ravel(), table, values)
    return values.reshape(-1, *lai.shape)


def interpolate_over(table, lai, background):
    """
    Reflectance of a canopy over a background that varies from cell to cell, from a table of its layer.

    Parameters
    ----------
    table : LaiTable
        Four columns for each band, the terms of `over_background`.
    lai : array
        NaN, and all outside 0 to `LIMIT`, gives NaN. [m2 m-2]
    background : array, shape (band,) + lai.shape or broadcastable
        Reflectance of the background. [1]

    Returns
    -------
    reflectance : array, shape (band,) + lai.shape
        [1]
    """
    lai = np.asarray(lai, float)
    bands = table.coefficients.shape[1] // 4
    background = np.broadcast_to(np.asarray(background, float), (bands, *lai.shape)).reshape(bands, -1)
    values = np.empty((bands, lai.size))
    _interpolate_over(np.ascontiguousarray(lai).ravel(), background, table, values)
    return values.reshape(-1, *lai.shape)


@register_jitable
def places_of(lai, table, interval, share):
    """
    Intervals of leaf area indices in a table, and their places in these.

    Parameters
    ----------
    lai : array, shape (n,)
        [m2 m-2]
    table : LaiTable
    interval : array of int, shape (n,)
        Filled in.
    share : array, shape (n,)
        Filled in: from 0 to 1, NaN where the table has no such leaf area. [1]
    """
    last = table.coefficients.shape[0] - 1
    # Without branches, so that the loop is done for several cells at once.
    for k in range(lai.size):
        inside = (lai[k] >= 0) & (lai[k] <= LIMIT)
        x = lai[k] if inside else 0.0
        position = table.rate * x / (1 + table.rate * x) * table.step
        at = min(int(position), last)
        interval[k] = at
        share[k] = position - at if inside else np.nan


@register_jitable
def value_at(table, interval, column, share):
    """
    Value of a table.

    Parameters
    ----------
    table : LaiTable
    interval : int
    column : int
    share : float
        Place in the interval, from `places_of`. [1]

    Returns
    -------
    value : float
    """
    c = table.coefficients[interval, column]
    return c[0] + share * (c[1] + share * (c[2] + share * c[3]))


# No divisor is 0: without that being asked, cells are done several at once.
@njit(nogil=True, cache=True, error_model="numpy")
def _interpolate(lai, table, values):
    interval, share = np.empty(RUN, np.int64), np.empty(RUN)
    for first in range(0, lai.size, RUN):
        cells = lai[first : first + RUN]
        places_of(cells, table, interval, share)
        for column in range(values.shape[0]):
            out = values[column, first : first + RUN]
            for k in range(cells.size):
                out[k] = value_at(table, interval[k], column, share[k])


@njit(nogil=True, cache=True, error_model="numpy")
def _interpolate_over(lai, background, table, values):
    interval, share = np.empty(RUN, np.int64), np.empty(RUN)
    for first in range(0, lai.size, RUN):
        cells = lai[first : first + RUN]
        places_of(cells, table, interval, share)
        for band in range(values.shape[0]):
            out, below = values[band, first : first + RUN], background[band, first : first + RUN]
            for k in range(cells.size):
                at, s, c = interval[k], share[k], 4 * band
                alone, hot = value_at(table, at, c, s), value_at(table, at, c + 1, s)
                through, rdd = value_at(table, at, c + 2, s), value_at(table, at, c + 3, s)
                out[k] = over_background(alone, hot, through, rdd, below[k])
