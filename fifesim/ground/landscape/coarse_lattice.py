"""
Fields of the autoregressive process on a coarser lattice, between whose cells those of the ground lie.

A cell of the lattice is a square of whole cells of the ground, counted from the origin of the reference system. Splines
lead from its centres to those of the ground's cells. Their weights are divided, for each place within a cell of the
lattice, by the standard deviation of what they make of the process: it is normal with variance 1 everywhere.
"""

from functools import lru_cache
from numbers import Integral

import numpy as np
from numba import njit
from numba.extending import register_jitable

from fifesim.base.kinds import described
from fifesim.ground.landscape.dispersion import pair_correlations
from fifesim.ground.landscape.field import mixed_field, streaming_field

# Edge of a tile. [cell of the lattice]
TILE = 252

LARGEST = 100
"""Cells of the ground along a side of a cell of the lattice."""

_TAPS = 4  # of a cubic spline


def coarse_field(seed, arp, coarser, row, column, shape):
    r"""
    Standard normal field that varies over several cells of the ground, as a function of place.

    .. math:: z(p) = \frac{\sum_k w_k(p) \, x_k}{\sqrt{\sum_{kl} w_k(p) \, w_l(p) \, \rho_{kl}}}

    with x the process on the coarser lattice, :math:`\rho` its correlations and w the weights of the 4 x 4 nearest of
    its cells in a uniform cubic B-spline.

    Parameters
    ----------
    seed : int
        In [0, 2**63).
    arp : float
        Between cells of the coarser lattice, in [0, 0.2498]. [1]
    coarser : int
        Cells of the ground along a side of a cell of the coarser lattice; 1 is the field of the ground's own.
    row, column : int
        Lattice position of the first cell of the ground; rows count southward.
    shape : (int, int)
        Rows and columns.

    Returns
    -------
    field : array, shape (rows, columns)
        Zero mean and unit variance over the ensemble, in every cell. [1]

    Raises
    ------
    ValueError
        If arp, coarser or seed is out of range.
    TypeError
        If the seed or coarser is no whole number.

    Notes
    -----
    The splines are smooth to the second derivative, and no structure is finer than the lattice. A correlation over
    cells of the ground is that of the process, further by about 0.6 cells of the lattice.

    Examples
    --------
    A window is a slice of the whole:

    >>> whole = coarse_field(7, 0.15, 4, -9, 0, (40, 50))
    >>> bool((coarse_field(7, 0.15, 4, 1, 20, (5, 6)) == whole[10:15, 20:26]).all())
    True
    """
    if check_coarser(coarser) == 1:
        return streaming_field(seed, arp, row, column, shape)
    rows, columns = (_knots(first, size, coarser) for first, size in zip((row, column), shape, strict=True))
    size = tuple(int(knots[-1]) + _TAPS - int(knots[0]) if knots.size else 0 for knots in (rows, columns))
    start = tuple(int(knots[0]) if knots.size else 0 for knots in (rows, columns))
    lattice = mixed_field({seed: 1.0}, arp, *start, size, tile=TILE)
    out = np.empty(shape)
    phases = tuple((first + np.arange(length)) % coarser for first, length in zip((row, column), shape, strict=True))
    _interpolate(lattice, rows - start[0], columns - start[1], *phases, *spline_weights(arp, coarser), out)
    return out


def check_coarser(coarser):
    """
    Refuse what is no size of a cell of a coarser lattice.

    Parameters
    ----------
    coarser : int
        Cells of the ground along a side.

    Returns
    -------
    coarser : int

    Raises
    ------
    ValueError
        If it is below 1 or above 100.
    TypeError
        If it is no whole number.

    Examples
    --------
    >>> check_coarser(4)
    4
    """
    if isinstance(coarser, bool) or not isinstance(coarser, Integral):
        raise TypeError(f"coarser must be a whole number of ground cells, got {described(coarser)}: type coarser=4")
    if not 1 <= coarser <= LARGEST:
        raise ValueError(
            f"coarser must be in 1 to {LARGEST}, got {coarser}: it counts ground cells along a side of one of the field"
        )
    return int(coarser)


@lru_cache(maxsize=32)
def spline_weights(arp, coarser):
    """
    Weights of the cells of the lattice by where in one of them a cell of the ground lies.

    Parameters
    ----------
    arp : float
        [1]
    coarser : int

    Returns
    -------
    along : array, shape (coarser, 4)
        Along an axis. [1]
    factor : array, shape (coarser, coarser)
        What the sum over both axes is multiplied with, so that its variance is 1. [1]

    Examples
    --------
    Of white noise the squares sum to 1:

    >>> along, factor = spline_weights(0.0, 3)
    >>> squares = np.sum(along**2, axis=1)
    >>> bool(np.allclose(squares[:, None] * squares * factor**2, 1.0))
    True
    """
    share = ((2 * np.arange(coarser) + 1 + coarser) % (2 * coarser)) / (2 * coarser)
    rest = 1.0 - share
    along = np.stack(
        [rest**3, 4.0 + share**2 * (3.0 * share - 6.0), 4.0 + rest**2 * (3.0 * rest - 6.0), share**3], axis=1
    )
    along /= 6.0
    lags = np.abs(np.subtract.outer(np.arange(_TAPS), np.arange(_TAPS)))
    correlation = pair_correlations(arp, (_TAPS, _TAPS))[0]
    between = correlation[lags[:, :, None, None], lags]
    variance = np.einsum("pa,pb,qc,qd,abcd->pq", along, along, along, along, between)
    return along, 1.0 / np.sqrt(variance)


def _knots(first, size, coarser):
    """First of the cells of the lattice that each cell of the ground is made from, along an axis."""
    # A centre lies at (2 i + 1 - coarser) / (2 coarser) centres of the lattice; one more lies before it.
    return (2 * (first + np.arange(size)) + 1 - coarser) // (2 * coarser) - 1


@njit(nogil=True, cache=True)
def _interpolate(lattice, rows, columns, down, across, along, factor, out):
    """Along rows of the lattice first, of which there are few; then cells of the ground are done several at once."""
    lines, scaled = np.empty((_TAPS, columns.size)), np.empty((factor.shape[0], columns.size))
    for p in range(factor.shape[0]):
        for j in range(columns.size):
            scaled[p, j] = factor[p, across[j]]
    made = rows[0] if rows.size else 0
    for i in range(rows.size):
        r, p = rows[i], down[i]
        while made < r + _TAPS:
            _expand(lattice[made], columns, across, along, lines[made % _TAPS])
            made += 1
        w0, w1, w2, w3 = along[p, 0], along[p, 1], along[p, 2], along[p, 3]
        l0, l1, l2, l3 = lines[r % _TAPS], lines[(r + 1) % _TAPS], lines[(r + 2) % _TAPS], lines[(r + 3) % _TAPS]
        scale, cells = scaled[p], out[i]
        for j in range(columns.size):
            cells[j] = scale[j] * (w0 * l0[j] + w1 * l1[j] + w2 * l2[j] + w3 * l3[j])


@register_jitable
def _expand(line, columns, across, along, out):
    """A row of the lattice at the columns of the ground."""
    for j in range(columns.size):
        c, q = columns[j], across[j]
        value = along[q, 0] * line[c] + along[q, 1] * line[c + 1]
        out[j] = value + along[q, 2] * line[c + 2] + along[q, 3] * line[c + 3]
