"""Mapping of a Gaussian field to a frequency distribution (Fig. 2, step 5): by its quantiles, or by ranks."""

from functools import lru_cache

import numpy as np
from numba import njit
from numba.extending import register_jitable
from scipy import stats

# Quantiles are tabulated for normal deviates from -8.5 to 8.5, past which lie 2e-17 of all cells. The step leaves a
# linear interpolation error of step**2 / 8 = 1.3e-7 times the curvature of the quantile function.
_REACH = 8.5
NODES = 2**14 + 1

# Cells that are done together, so that they stay in the nearest cache.
_RUN = 1024

# Of so many the quantiles of ranks are kept, 2 MB.
_FEW = 2**18


# Some hundredths of a second each; treatments and the distributions of drawn shares are the same objects each time.
@lru_cache(maxsize=64)
def quantile_table(distribution):
    """
    Quantiles of a distribution at evenly spaced standard normal deviates.

    Parameters
    ----------
    distribution : frozen scipy distribution
        Whose table is kept.

    Returns
    -------
    table : array, shape (16385,)
        For deviates from -8.5 to 8.5; increasing, not negative. Kept for who asks again.
    """
    deviates = np.linspace(-_REACH, _REACH, NODES)
    lower = distribution.ppf(stats.norm.cdf(deviates[deviates <= 0]))
    # The upper half goes by survival functions, which keep their digits in the tail.
    upper = distribution.isf(stats.norm.sf(deviates[deviates > 0]))
    return np.maximum.accumulate(np.concatenate([[0.0], lower, upper]))[1:]


def quantile_map(field, table, out=None):
    """
    Map a standard normal field to the distribution of a quantile table.

    Parameters
    ----------
    field : array, shape (...)
        Standard normal deviates; NaN stays NaN.
    table : array, shape (16385,)
        From `quantile_table`.
    out : array of float, shape (...), optional
        Filled in and returned; it may be the field.

    Returns
    -------
    values : array, shape (...)

    References
    ----------
    [Friedl1995]_, Fig. 2, step 5, for a field without end: ranks are those of the ensemble
    """
    cells = np.ascontiguousarray(field, float)
    out = np.empty(cells.shape) if out is None else out
    _map(cells.reshape(-1), table, out.reshape(-1))
    return out


def quantile_map_of_classes(field, numbers, tables):
    """
    The same where each class of cells has a distribution of its own.

    Parameters
    ----------
    field : array, shape (y, x)
        As in `quantile_map`.
    numbers : array of int, shape (y, x)
        Which of the tables is a cell's.
    tables : array, shape (n, 16385)
        From `quantile_table`; the cells of one whose values are all the same have that value, NaN or not.

    Returns
    -------
    values : array, shape (y, x)

    Examples
    --------
    >>> tables = np.stack([quantile_table(stats.uniform()), np.full(16385, 3.0)])
    >>> quantile_map_of_classes(np.zeros((1, 3)), np.array([[1, 0, 1]], np.int16), tables).tolist()
    [[3.0, 0.5, 3.0]]
    """
    same, out = tables[:, 0] == tables[:, -1], np.empty(np.shape(field))
    _map_classes(np.ascontiguousarray(field, float).reshape(-1), numbers.reshape(-1), tables, same, out.reshape(-1))
    return out


@register_jitable
def _places(field, size, at, share):
    """Nodes of a table below deviates, and shares of the steps to the next."""
    per_deviate, last = (size - 1) / (2.0 * _REACH), np.uint32(size - 2)
    # Without branches, so that the loop is done for several cells at once.
    for i in range(field.size):
        position = (field[i] + _REACH) * per_deviate
        known = position == position
        inside = min(max(position, 0.0), last + 1.0) if known else 0.0
        at[i] = min(np.uint32(inside), last)
        share[i] = inside - at[i] if known else np.nan


@njit(nogil=True, cache=True)
def _map(field, table, out):
    at, share = np.empty(_RUN, np.uint32), np.empty(_RUN)
    for first in range(0, field.size, _RUN):
        cells, values = field[first : first + _RUN], out[first : first + _RUN]
        _places(cells, table.size, at, share)
        for i in range(cells.size):
            k = np.uint64(at[i])
            values[i] = table[k] * (1.0 - share[i]) + table[k + np.uint64(1)] * share[i]


@njit(nogil=True, cache=True)
def _map_classes(field, numbers, tables, same, out):
    at, share = np.empty(_RUN, np.uint32), np.empty(_RUN)
    flat, size = tables.reshape(-1), tables.shape[1]
    for first in range(0, field.size, _RUN):
        cells, of_cells = field[first : first + _RUN], numbers[first : first + _RUN]
        values = out[first : first + _RUN]
        _places(cells, size, at, share)
        for i in range(cells.size):
            number = np.uint32(of_cells[i])
            share[i] = 0.0 if same[number] else share[i]
            at[i] += number * np.uint32(size)
        for i in range(cells.size):
            k = np.uint64(at[i])
            values[i] = flat[k] * (1.0 - share[i]) + flat[k + np.uint64(1)] * share[i]


def rank_map(field, distribution):
    """
    Map a field to a distribution by its ranks, exactly.

    Parameters
    ----------
    field : array, any shape
        Values without NaN.
    distribution : frozen scipy distribution

    Returns
    -------
    values : array, shape of the field
        The quantiles (rank + 1/2) / n, each once.

    References
    ----------
    [Friedl1995]_, Fig. 2, step 5

    Examples
    --------
    >>> rank_map(np.array([3.0, -1.0]), stats.uniform()).tolist()
    [0.75, 0.25]
    """
    values = np.empty(field.size)
    values[np.argsort(field, axis=None, kind="stable")] = rank_quantiles(distribution, field.size)
    return values.reshape(field.shape)


def rank_quantiles(distribution, count):
    """
    Quantiles of a distribution that ranks stand for.

    Parameters
    ----------
    distribution : frozen scipy distribution
    count : int

    Returns
    -------
    quantiles : array, shape (count,)
        At (rank + 1/2) / count. Those of few are kept for who asks again.
    """
    return (_kept_quantiles if count <= _FEW else _kept_quantiles.__wrapped__)(distribution, count)


@lru_cache(maxsize=16)
def _kept_quantiles(distribution, count):
    return distribution.ppf((np.arange(count) + 0.5) / count)
