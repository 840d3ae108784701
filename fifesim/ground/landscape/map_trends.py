"""How much of a map of means over pixels is a trend, beside what the autoregressive process makes of it."""

from functools import lru_cache

import numpy as np

from fifesim.ground.landscape.block_kriging import densities_of_means

# Over so many pixels second differences are taken; and the pixels along an axis whose frequencies they are summed over.
_LAGS, _PIXELS = (1, 2, 4, 8), 128

# Median of the square of a standard normal number.
_MEDIAN = 0.454936423119572

# Powers of two that are told apart: beyond these the process, or the trend, alone is left.
_LEAST, _MOST = -4, 6


def map_trend(levels, known, deviation, arp, ratio):
    r"""
    Strength of the trend of a map over that of the process, from its second differences.

    .. math:: \tau^2 = \frac{D^2 / s^2 - v_p}{v_t}

    with :math:`D^2` the variance of the second differences of pixels, the mean of those along rows and columns, s the
    deviation of the process, and :math:`v_p` and :math:`v_t` the variances that second differences of means over pixels
    have for a process and a trend of one. Of the differences over 1, 2, 4 and 8 pixels those count that show most of a
    trend: a gentle one is known by the wide ones.

    Parameters
    ----------
    levels : array, shape (rows, columns)
        Of the pixels.
    known : array of bool, shape (rows, columns)
        Where they are.
    deviation : float or array, shape (rows, columns)
        Standard deviation of the process, in units of levels.
    arp : float
        [1]
    ratio : (int, int)
        Cells in a pixel, down and across.

    Returns
    -------
    trend : float
        What `fifesim.ground.landscape.block_kriging.kriging_filter` takes, as a power of two; 0 where pixels vary no
        more than the process, infinite where there is none. [1]

    Notes
    -----
    The variance is that of normal numbers with the median of the squares, which fences and shores leave alone. A trend
    that is a factor of 1.4 off changes semivariances by less than 1 %.

    Examples
    --------
    What bends nowhere is left to the process:

    >>> map_trend(np.arange(64.0).reshape(8, 8), np.ones((8, 8), bool), 0.3, 0.15, (3, 3))
    0.0
    """
    variance = float(np.mean(np.square(np.broadcast_to(deviation, levels.shape)[known])))
    if not variance:
        return np.inf
    found = [0.0]
    for lag, axes in _second_differences(arp, ratio).items():
        squares = [_bends(levels, known, lag, axis) for axis in (0, 1)]
        if all(each.size for each in squares):
            excess = [
                (np.median(each) / _MEDIAN / variance - process) / slow
                for each, (process, slow) in zip(squares, axes, strict=True)
            ]
            found.append(float(np.mean(excess)))
    strength = max(found)
    if strength <= 4.0**_LEAST:
        return 0.0
    power = round(float(np.log2(strength)) / 2)
    return np.inf if power > _MOST else 2.0**power


def _bends(levels, known, lag, axis):
    """Squared second differences of three known pixels in a row or a column."""
    levels, known = np.moveaxis(levels, axis, 0), np.moveaxis(known, axis, 0)
    first, middle, last = slice(None, -2 * lag), slice(lag, -lag), slice(2 * lag, None)
    whole = known[first] & known[middle] & known[last]
    return (levels[first] - 2.0 * levels[middle] + levels[last])[whole] ** 2


@lru_cache(maxsize=8)
def _second_differences(arp, ratio):
    """By lag, variances of second differences of means over pixels along each axis: of a process and a trend of one."""
    process, slow = densities_of_means(arp, ratio, (_PIXELS, _PIXELS))
    frequency = 2.0 * np.pi * np.fft.fftfreq(_PIXELS)
    variances = {}
    for lag in _LAGS:
        bend = (2.0 - 2.0 * np.cos(lag * frequency)) ** 2
        axes = bend[:, None], bend
        variances[lag] = [(float(np.mean(process * each)), float(np.mean(slow * each))) for each in axes]
    return variances
