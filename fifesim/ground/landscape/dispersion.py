"""Variance of cells within pixels, and how much of it the means over pixels keep."""

import numpy as np
from scipy import fft

from fifesim.ground.landscape.autoregression import check_arp, margin, response
from fifesim.ground.landscape.field import periodic_field

# Of the logarithm of cells.
LARGEST_DEVIATION = 2.0

_NODES = 41

# Cells along a side of the sample, and pixels at least.
_SAMPLE, _FEWEST = 504, 8


def pair_correlations(arp, ratio):
    """
    Correlations of all pairs of cells in a pixel, and how many there are of each.

    Parameters
    ----------
    arp : float
        [1]
    ratio : (int, int)
        Cells in a pixel, down and across.

    Returns
    -------
    correlation, weight : array, shape (ratio[0], ratio[1])
        By the lag down and across; the weights sum to 1. [1]
    """
    check_arp(arp)
    size = fft.next_fast_len(2 * (max(ratio) + margin(arp)), real=True)
    u = 2.0 * np.pi * fft.fftfreq(size)
    covariance = fft.irfft2(response(arp, u[:, None], np.abs(u[: size // 2 + 1])) ** 2, s=(size, size))
    down, across = (
        np.where(np.arange(number) > 0, 2.0, 1.0) * (number - np.arange(number)) / number**2 for number in ratio
    )
    return covariance[: ratio[0], : ratio[1]] / covariance[0, 0], down[:, None] * across


def kept_variance(arp, ratio):
    r"""
    Share of the variance of cells that means over pixels keep.

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
    """
    Cells of some pixels of the process.

    Parameters
    ----------
    arp, ratio
        As in `kept_variance`.

    Returns
    -------
    fields : array, shape (pixels, cells)
        Standard normal, some 250 000 cells of a fixed draw; each pixel's mean is scaled so that their variances are
        those of the process. [1]
    """
    size = [max(_SAMPLE // number, _FEWEST) for number in ratio]
    field = periodic_field(0, arp, tuple(count * number for count, number in zip(size, ratio, strict=True)))
    cells = field.reshape(size[0], ratio[0], size[1], ratio[1]).transpose(0, 2, 1, 3).reshape(size[0] * size[1], -1)
    means = cells.mean(axis=1, keepdims=True)
    kept = kept_variance(arp, ratio)
    inside = (cells - means) * np.sqrt((1.0 - kept) / np.mean((cells - means) ** 2)) if cells.shape[1] > 1 else 0.0
    means = means - np.mean(means)
    return means * np.sqrt(kept / np.mean(means**2)) + inside


def deviation_table(arp, ratio):
    r"""
    Standard deviation of the logarithm of cells, by the coefficient of variation that they have within pixels.

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
    Deviations of a process whose means over pixels vary as the levels that the means of leaf area have.

    .. math:: s_l^2 = \mathrm{var}\,g(\bar l) / v

    with g the level of a mean and v the share of `kept_variance`. They are above those of the cells where leaf area is
    a bent function: what cells do in a pixel moves its mean.

    Parameters
    ----------
    transform : object
        Gives leaf area ``cells(field)`` and the ``level(mean)`` of pixels.
    deviations : array, shape (n,)
        Of the field of cells.
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
