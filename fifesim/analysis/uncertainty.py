"""Uncertainty of a variable that is inferred from a vegetation index: relative equivalent noise."""

import numba
import numpy as np

from fifesim.analysis.regression import totals

SUMS = 4


def equivalent_noise(deviation, slope, value):
    r"""
    Relative equivalent noise.

    .. math:: \mathrm{REN} = \frac{\sigma_\mathrm{LAI}}{\mathrm{LAI}}
        = \frac{\sigma_\mathrm{NDVI}}{\mathrm{LAI}} \left[ \frac{d\,\mathrm{NDVI}}{d\,\mathrm{LAI}} \right]^{-1}

    Parameters
    ----------
    deviation : array
        Standard deviation of NDVI where the variable has this value. [1]
    slope : array
        Of NDVI on the variable.
    value : array
        Of the variable.

    Returns
    -------
    ren : array, shape of the broadcast inputs
        [1]

    References
    ----------
    [Friedl1995]_, Eq. 7; [Baret1991]_

    Examples
    --------
    A scatter of 0.02 in NDVI, where NDVI rises by 0.4 per unit of LAI, is a twentieth of an LAI of 1:

    >>> round(equivalent_noise(0.02, 0.4, 1.0), 12)
    0.05
    """
    return deviation / (slope * value)


@numba.njit(nogil=True, cache=True)
def increment_sums(variable, ndvi, first, width, increments, ndvi_origin):
    """
    Sums of each row and increment of the variable.

    Parameters
    ----------
    variable, ndvi : array, shape (rows, columns)
        NaN where missing.
    first : int
        Number of the first increment, counted from zero in widths.
    width : float
        Of an increment.
    increments : int
        How many; pairs outside them are left out.
    ndvi_origin : float
        Value near the mean, subtracted first so that no digits cancel.

    Returns
    -------
    sums : array, shape (rows, 4 increments)
        Of 1, variable, ndvi and ndvi squared for each increment.
    """
    sums = np.zeros((variable.shape[0], 4 * increments))
    for i in range(variable.shape[0]):
        for j in range(variable.shape[1]):
            value, index = variable[i, j], ndvi[i, j] - ndvi_origin
            if not (np.isfinite(value) and np.isfinite(index)):
                continue
            k = int(np.floor(value / width)) - first
            if 0 <= k < increments:
                sums[i, 4 * k] += 1.0
                sums[i, 4 * k + 1] += value
                sums[i, 4 * k + 2] += index
                sums[i, 4 * k + 3] += index * index
    return sums


def increment_moments(sums):
    """
    What each increment holds.

    Parameters
    ----------
    sums : array, shape (rows, 4 increments)
        From `increment_sums`.

    Returns
    -------
    count : array of int, shape (increments,)
        Pairs.
    mean : array, shape (increments,)
        Of the variable; NaN where there is no pair.
    deviation : array, shape (increments,)
        Standard deviation of NDVI; NaN where there are fewer than two pairs.

    Examples
    --------
    >>> count, mean, deviation = increment_moments(increment_sums(
    ...     np.array([[0.1, 0.3, 1.2]]), np.array([[0.4, 0.6, 0.9]]), 0, 1.0, 2, 0.0))
    >>> count.tolist(), round(float(mean[0]), 12), round(float(deviation[0] ** 2), 12)
    ([2, 1], 0.2, 0.02)
    """
    count, value, index, square = np.reshape(totals(sums), (-1, SUMS)).T
    with np.errstate(divide="ignore", invalid="ignore"):
        variance = (square - index * index / count) / (count - 1)
        mean = np.where(count > 0, value / count, np.nan)
    return count.astype(int), mean, np.sqrt(np.where(count > 1, np.maximum(variance, 0.0), np.nan))


@numba.njit(nogil=True, cache=True)
def error_sums(truth, estimate, low, high):
    """
    Sums of each row over the pixels in which truth and estimate are there.

    Parameters
    ----------
    truth, estimate, low, high : array, shape (rows, columns)
        NaN where missing.

    Returns
    -------
    sums : array, shape (rows, 4)
        Of 1, the error, its square, and of pixels whose truth is between low and high.
    """
    sums = np.zeros((truth.shape[0], 4))
    for i in range(truth.shape[0]):
        for j in range(truth.shape[1]):
            error = estimate[i, j] - truth[i, j]
            if error == error:
                sums[i, 0] += 1.0
                sums[i, 1] += error
                sums[i, 2] += error * error
                if low[i, j] <= truth[i, j] <= high[i, j]:
                    sums[i, 3] += 1.0
    return sums
