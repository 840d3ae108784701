"""
Fields of the autoregressive process on a coarser lattice, and the variance that coarser cells keep.

A cell of the lattice is a square of whole cells of the ground, counted from the origin of the reference system. Splines
interpolate from its centres to the centres of the ground cells. For each place within a cell of the lattice, their
weights are divided by the standard deviation of the interpolated process, so that it is normal with variance 1
everywhere.
"""

from numbers import Integral

import numpy as np
from scipy import fft

from fifesim.base.arguments import described
from fifesim.base.arrays import compiled, jitable
from fifesim.base.caches import cached
from fifesim.ground.landscape import autoregression

# Largest standard deviation of the logarithm of cells.
LARGEST_DEVIATION = 2.0

_NODES = 41

# Cells along a side of the sample, and pixels at least.
_SAMPLE, _FEWEST = 504, 8


def pair_correlations(arp, ratio):
    """Correlations of all pairs of cells in a pixel by lag, and weights that sum to 1, of shape `ratio`. [1]"""
    autoregression.check_arp(arp)
    size = fft.next_fast_len(2 * (max(ratio) + autoregression.margin(arp)), real=True)
    u = 2.0 * np.pi * fft.fftfreq(size)
    covariance = fft.irfft2(autoregression.response(arp, u[:, None], np.abs(u[: size // 2 + 1])) ** 2, s=(size, size))
    down, across = (
        np.where(np.arange(number) > 0, 2.0, 1.0) * (number - np.arange(number)) / number**2 for number in ratio
    )
    return covariance[: ratio[0], : ratio[1]] / covariance[0, 0], down[:, None] * across


def kept_variance(arp, ratio):
    r"""
    Share of the variance of cells that the means over pixels keep.

    .. math:: v = \frac{1}{n^2} \sum_{ij} \rho_{ij}

    Parameters
    ----------
    arp : float
        [1]
    ratio : (int, int)
        Cells in a pixel, down and across.

    Returns
    -------
    share : float
        [1]

    Examples
    --------
    >>> round(kept_variance(0.0, (2, 3)), 9)
    0.166666667
    """
    correlation, weight = pair_correlations(arp, ratio)
    return float(np.sum(weight * correlation))


def pixel_sample(arp, ratio):
    """Standard normal cells of some pixels of the process, a fixed draw of shape (pixels, cells)."""
    # The mean of each pixel is scaled so that their variance is exactly the one of the process.
    size = [max(_SAMPLE // number, _FEWEST) for number in ratio]
    field = autoregression.periodic_field(
        0, arp, tuple(count * number for count, number in zip(size, ratio, strict=True))
    )
    cells = field.reshape(size[0], ratio[0], size[1], ratio[1]).transpose(0, 2, 1, 3).reshape(size[0] * size[1], -1)
    means = cells.mean(axis=1, keepdims=True)
    kept = kept_variance(arp, ratio)
    inside = (cells - means) * np.sqrt((1.0 - kept) / np.mean((cells - means) ** 2)) if cells.shape[1] > 1 else 0.0
    means = means - np.mean(means)
    return means * np.sqrt(kept / np.mean(means**2)) + inside


def deviation_table(arp, ratio):
    r"""
    Standard deviation of the logarithm of cells, tabulated by their coefficient of variation within pixels.

    .. math:: c^2 = \left\langle \frac{\overline{l^2} - \bar l^2}{\bar l^2} \right\rangle, \quad l = e^{s z}

    Parameters
    ----------
    arp, ratio
        As in `kept_variance`.

    Returns
    -------
    variations, deviations : array, shape (41,)
        c and s, increasing from 0. Those of `pixel_sample`, good to 0.5 %. [1]
    """
    sample = pixel_sample(arp, ratio)
    sample = sample - sample.mean(axis=1, keepdims=True)
    deviations = np.linspace(0.0, LARGEST_DEVIATION, _NODES)
    squared = []
    for deviation in deviations:
        cells = np.exp(deviation * sample)
        squared.append(np.mean(np.mean(cells**2, axis=1) / np.mean(cells, axis=1) ** 2) - 1.0)
    return np.sqrt(np.maximum.accumulate(squared)), deviations


def level_deviations(transform, deviations, arp, ratio):
    r"""
    Deviations of a process whose means over pixels vary as the levels of the means of leaf area.

    .. math:: s_l^2 = \mathrm{var}\,g(\bar l) / v

    with g the level of a mean and v the share of `kept_variance`. They exceed those for cells where leaf area is
    a nonlinear function: variation within a pixel changes its mean.

    Parameters
    ----------
    transform : object
        Gives leaf area ``cells(field)`` and the ``level(mean)`` of pixels.
    deviations : array, shape (n,)
        Deviations of the field of cells.
    arp, ratio
        As in `kept_variance`.

    Returns
    -------
    deviations : array, shape (n,)
        Those of `pixel_sample`.
    """
    sample = pixel_sample(arp, ratio)
    found = [np.std(transform.level(transform.cells(each * sample).mean(axis=1))) for each in deviations]
    return np.array(found) / np.sqrt(kept_variance(arp, ratio))


# Edge of a tile. [cell of the lattice]
COARSE_TILE = 252

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
    cells of the ground is longer than in the process by about 0.6 cells of the lattice.

    Examples
    --------
    A window is a slice of the whole:

    >>> whole = coarse_field(7, 0.15, 4, -9, 0, (40, 50))
    >>> bool((coarse_field(7, 0.15, 4, 1, 20, (5, 6)) == whole[10:15, 20:26]).all())
    True
    """
    if check_coarser(coarser) == 1:
        return autoregression.streaming_field(seed, arp, row, column, shape)
    rows, columns = (_knots(first, size, coarser) for first, size in zip((row, column), shape, strict=True))
    size = tuple(int(knots[-1]) + _TAPS - int(knots[0]) if knots.size else 0 for knots in (rows, columns))
    start = tuple(int(knots[0]) if knots.size else 0 for knots in (rows, columns))
    lattice = autoregression.mixed_field({seed: 1.0}, arp, *start, size, tile=COARSE_TILE)
    out = np.empty(shape)
    phases = tuple((first + np.arange(length)) % coarser for first, length in zip((row, column), shape, strict=True))
    _interpolate(lattice, rows - start[0], columns - start[1], *phases, *spline_weights(arp, coarser), out)
    return out


def check_coarser(coarser):
    """Raise an error if the coarsening factor is invalid."""
    if isinstance(coarser, bool) or not isinstance(coarser, Integral):
        raise TypeError(f"coarser must be a whole number of ground cells, got {described(coarser)}: type coarser=4")
    if not 1 <= coarser <= LARGEST:
        raise ValueError(
            f"coarser must be in 1 to {LARGEST}, got {coarser}: it counts ground cells along a side of one of the field"
        )
    return int(coarser)


@cached(32, "spline weights of a coarse lattice")
def spline_weights(arp, coarser):
    """Spline weights by place, shape (coarser, 4), and factors for variance 1, shape (coarser, coarser). [1]"""
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
    """First of the four lattice cells from which each ground cell along an axis is interpolated."""
    # A centre lies at (2 i + 1 - coarser) / (2 coarser) centres of the lattice; one more lies before it.
    return (2 * (first + np.arange(size)) + 1 - coarser) // (2 * coarser) - 1


@compiled
def _interpolate(lattice, rows, columns, down, across, along, factor, out):
    """Interpolate the lattice to cells."""
    # First along rows of the lattice, which are few, then for several cells of the ground at once.
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


@jitable
def _expand(line, columns, across, along, out):
    """Interpolate a row of the lattice to the columns of the ground."""
    for j in range(columns.size):
        c, q = columns[j], across[j]
        value = along[q, 0] * line[c] + along[q, 1] * line[c + 1]
        out[j] = value + along[q, 2] * line[c + 2] + along[q, 3] * line[c + 3]
