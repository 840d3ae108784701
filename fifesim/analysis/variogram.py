"""Covariance and semivariance by lag, and the variance that a footprint leaves."""

import numpy as np
from scipy import fft

# Sums over pairs, and their places.
SUMS = 6
_COUNT, _FIRST, _SECOND, _PRODUCT, _FIRST_SQUARE, _SECOND_SQUARE = range(SUMS)


def lag_sums(cells, margin, reach, origin=0.0):
    r"""
    Sums over pairs of cells of one block and its margin, by lag.

    The first cell of a pair is in the block, the second is ``(lag_y, lag_x)`` further, so that the sums of the blocks
    of a raster add up to those of the raster. They are correlations, done by Fourier transform.

    Parameters
    ----------
    cells : array, shape (rows, columns)
        The block with what there is of its margin; NaN where missing.
    margin : ((int, int), (int, int))
        Cells of margin that are there, before and after the block along each axis.
    reach : (int, int)
        Largest lags, downward and across; lags run from 0 down, and from minus to plus across. [cell]
    origin : float, optional
        Value near the mean, subtracted first so that no digits cancel.

    Returns
    -------
    sums : array, shape (6, reach[0] + 1, 2 reach[1] + 1)
        Over pairs in which both are there: of 1, the first, the second, their product, and the squares of both.
    """
    values = np.asarray(cells, float) - origin
    valid = np.isfinite(values)
    values = np.where(valid, values, 0.0)
    inside = tuple(slice(before, size - after) for (before, after), size in zip(margin, values.shape, strict=True))
    first = np.zeros(valid.shape, bool)
    first[inside] = valid[inside]
    # Twice the reach apart nothing wraps round.
    shape = tuple(fft.next_fast_len(size + each, real=True) for size, each in zip(values.shape, reach, strict=True))
    factors = 1.0, values, values**2
    one, one_z, one_zz = (fft.rfft2(first * factor, shape) for factor in factors)
    two, two_z, two_zz = (fft.rfft2(valid * factor, shape) for factor in factors)
    pairs = (one, two), (one_z, two), (one, two_z), (one_z, two_z), (one_zz, two), (one, two_zz)
    rows, columns = np.arange(reach[0] + 1), np.arange(-reach[1], reach[1] + 1)
    sums = np.stack([fft.irfft2(np.conj(a) * b, shape)[np.ix_(rows, columns)] for a, b in pairs])
    # Counts are whole.
    sums[_COUNT] = np.rint(sums[_COUNT])
    return sums


def covariance(sums):
    r"""
    Covariance by lag, about the mean of all cells.

    .. math:: C(h) = \frac{1}{N(h)} \sum (z_i - \bar z)(z_{i+h} - \bar z)

    Parameters
    ----------
    sums : array, shape (6, lags down, lags across)
        From `lag_sums`.

    Returns
    -------
    covariance : array, shape (lags down, lags across)
        NaN where there is no pair.

    References
    ----------
    [Chiles2012]_, Section 2.2
    """
    count, first, second, product = sums[:4]
    middle = sums.shape[2] // 2
    mean = first[0, middle] / count[0, middle]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(count > 0, (product - mean * (first + second)) / count + mean**2, np.nan)


def semivariance(sums):
    r"""
    Semivariance by lag.

    .. math:: \gamma(h) = \frac{1}{2 N(h)} \sum (z_{i+h} - z_i)^2

    Parameters
    ----------
    sums : array, shape (6, lags down, lags across)
        From `lag_sums`.

    Returns
    -------
    semivariance : array, shape (lags down, lags across)
        NaN where there is no pair.

    References
    ----------
    [Chiles2012]_, Section 2.2

    Examples
    --------
    A plane that rises by 2 a cell across:

    >>> plane = 2.0 * np.arange(5.0) * np.ones((4, 1))
    >>> semivariance(lag_sums(plane, ((0, 0), (0, 0)), (0, 2)))[0].round(9).tolist()
    [8.0, 2.0, 0.0, 2.0, 8.0]
    """
    count = sums[_COUNT]
    with np.errstate(divide="ignore", invalid="ignore"):
        squares = (sums[_FIRST_SQUARE] + sums[_SECOND_SQUARE] - 2.0 * sums[_PRODUCT]) / (2.0 * count)
    # Rounding of the transform may leave a difference of nothing below zero.
    return np.where(count > 0, np.maximum(squares, 0.0), np.nan)


def crossing(lag, correlation, level=0.05):
    """
    Lag at which a correlation has fallen to a level; log-linear between lags.

    Parameters
    ----------
    lag : array, shape (n,)
        Increasing, from 0. [m]
    correlation : array, shape (n,)
    level : float, optional
        0.05 is the practical range of geostatistics. [1]

    Returns
    -------
    lag : float
        NaN where it does not fall so far. [m]

    Examples
    --------
    >>> lag = np.arange(10.0)
    >>> bool(np.isclose(crossing(lag, np.exp(-lag / 2)), 2 * np.log(20)))
    True
    """
    below = np.flatnonzero(correlation <= level)
    if not below.size or below[0] == 0:
        return np.nan
    after = below[0]
    upper, lower = correlation[after - 1], correlation[after]
    if lower > 0:
        share = np.log(upper / level) / np.log(upper / lower)
    else:
        share = (upper - level) / (upper - lower)
    return float(lag[after - 1] + share * (lag[after] - lag[after - 1]))


def weight_correlation(operator, reach):
    """
    Products of the weights of a footprint along one axis, by lag, in the mean over its pixels.

    Parameters
    ----------
    operator : fifesim.base.footprints.AxisOperator
        Pixels that lie partly outside the scene are left out.
    reach : int
        Largest lag. [cell]

    Returns
    -------
    products : array, shape (2 reach + 1,)
        For lags from -reach to reach; they sum to 1 where the reach covers the footprint. [1]
    """
    whole = operator.weights[operator.share > 1 - 1e-9]
    size = whole.shape[1]
    full = np.mean([np.correlate(weights, weights, "full") for weights in whole], axis=0)
    products = np.zeros(2 * reach + 1)
    kept = min(reach, size - 1)
    products[reach - kept : reach + kept + 1] = full[size - 1 - kept : size + kept]
    return products


def footprint_variance(covariance, down, across):
    r"""
    Variance of means over a footprint.

    .. math:: \sigma^2 = \sum_{h_y} \sum_{h_x} a_y(h_y) \, a_x(h_x) \, C(h_y, h_x),
        \qquad a(h) = \sum_i w_i w_{i+h}

    Parameters
    ----------
    covariance : array, shape (reach_y + 1, 2 reach_x + 1)
        Of the cells, by lags from 0 down and from minus to plus across: the other half is its mirror image.
    down : array, shape (2 reach_y + 1,)
        a_y, from `weight_correlation`. [1]
    across : array, shape (2 reach_x + 1,)
        a_x. [1]

    Returns
    -------
    variance : float

    References
    ----------
    [Jupp1988]_; [Chiles2012]_, Section 2.4

    Examples
    --------
    Of white noise, means of two by two cells keep a quarter:

    >>> noise = np.zeros((2, 3))
    >>> noise[0, 1] = 1.0
    >>> float(footprint_variance(noise, np.array([0.25, 0.5, 0.25]), np.array([0.25, 0.5, 0.25])))
    0.25
    """
    half = len(down) // 2
    # The footprint's own products are even: each lag down stands for the one up, too.
    rows = down[half:] * np.where(np.arange(half + 1) == 0, 1.0, 2.0)
    used = np.outer(rows, across)
    return float(np.sum(np.where(used != 0, used * covariance, 0.0)))
