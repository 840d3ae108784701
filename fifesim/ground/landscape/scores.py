"""Standard normal scores: what ranks among a sample make of values."""

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy import stats

# Of a table; values between two nodes are interpolated.
_NODES = 2049

# Where searches begin; with so many they mostly end there, and the table stays in a processor's cache.
_STARTS = 32768

# Of the distance of two starts.
_ROUNDING = 1e-6

# Values that are done together, so that they stay in the nearest cache.
_RUN = 1024


class Scores(NamedTuple):
    """Standard normal scores of values: what ranks among all of a sample make of them."""

    values: np.ndarray
    scores: np.ndarray
    slopes: np.ndarray
    """Of the lines between them."""
    starts: np.ndarray
    """Which of the values is the last below each of evenly spaced ones, from which a search goes on."""
    steps: int
    """The most that a search goes on."""


def score_table(sample):
    """
    Standard normal scores of the values of a sample.

    Parameters
    ----------
    sample : array, shape (n,)
        Without NaN.

    Returns
    -------
    scores : Scores
        Of mean 0 and standard deviation 1 over the sample; equal values share the mean of their ranks.

    Raises
    ------
    ValueError
        If all values are the same.

    Examples
    --------
    >>> score_table(np.arange(9.0)).scores.round(2).tolist()
    [-1.71, -1.04, -0.63, -0.3, 0.0, 0.3, 0.63, 1.04, 1.71]
    """
    values, counts = np.unique(sample, return_counts=True)
    if values.size < 2:
        raise ValueError("is the same everywhere: nothing can follow it")
    scores = stats.norm.ppf((np.cumsum(counts) - counts / 2) / counts.sum())
    mean = np.average(scores, weights=counts)
    scores = (scores - mean) / np.sqrt(np.average((scores - mean) ** 2, weights=counts))
    kept = np.unique(np.linspace(0, values.size - 1, _NODES).round().astype(int))
    return _table(values[kept], scores[kept])


def _table(values, scores):
    even, rounding = np.linspace(values[0], values[-1], _STARTS, retstep=True)
    # A value that lies on one of the even ones may by rounding be taken for one beside.
    first, last = (
        np.clip(np.searchsorted(values, even + aside * rounding, side="right") - 1, 0, values.size - 2)
        for aside in (-_ROUNDING, 1 + _ROUNDING)
    )
    return Scores(values, scores, np.diff(scores) / np.diff(values), first.astype(np.int32), int(np.max(last - first)))


def normal_scores(values, scores):
    """
    Scores of values by a table; beyond it those of its ends.

    Parameters
    ----------
    values : array
        NaN gives NaN.
    scores : Scores

    Returns
    -------
    scores : array, shape of values
        [1]

    Examples
    --------
    >>> normal_scores(np.array([-5.0, 4.0]), score_table(np.arange(9.0))).round(2).tolist()
    [-1.71, 0.0]
    """
    out = np.zeros(np.size(values))
    add_scores(values, scores, 1.0, out)
    return out.reshape(np.shape(values))


def add_scores(values, scores, weight, out):
    """
    Add the weighted scores of values to an array.

    Parameters
    ----------
    values : array, shape (...)
        NaN gives NaN. [any]
    scores : Scores
    weight : float
        [1]
    out : array, shape (n,)
        Of as many, changed in place: it spares an array of all cells for each property. [1]
    """
    _lookup(np.ascontiguousarray(values, float).ravel(), *scores, float(weight), out)


@njit(nogil=True, cache=True)
def _lookup(values, nodes, scores, slopes, starts, steps, weight, out):
    """Add the weighted scores of values, linear between nodes."""
    lowest, highest, last = nodes[0], nodes[-1], np.uint32(nodes.size - 2)
    per_start = (starts.size - 1) / (highest - lowest)
    inside, at = np.empty(_RUN), np.empty(_RUN, np.uint32)
    for first in range(0, values.size, _RUN):
        cells, to = values[first : first + _RUN], out[first : first + _RUN]
        # Without branches, so that the loops are done for several values at once.
        for i in range(cells.size):
            inside[i] = min(max(cells[i], lowest), highest) if cells[i] == cells[i] else lowest
            at[i] = np.uint32((inside[i] - lowest) * per_start)
        for i in range(cells.size):
            at[i] = starts[at[i]]
        for _ in range(steps):
            for i in range(cells.size):
                up = np.uint32(at[i] + 1)
                at[i] = min(up, last) if inside[i] >= nodes[up] else at[i]
        for i in range(cells.size):
            k = at[i]
            score = scores[k] + (inside[i] - nodes[k]) * slopes[k]
            to[i] = to[i] + weight * score if cells[i] == cells[i] else np.nan
