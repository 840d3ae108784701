"""Scores of uncertain estimates against known values: CRPS, interval score and coverage."""

import numpy as np
from scipy.special import ndtr

_INVERSE_SQRT_PI = 1 / np.sqrt(np.pi)


def normal_crps(mean, sd, truth):
    r"""
    Continuous ranked probability score of a normal distribution.

    .. math::

        \mathrm{CRPS} = \sigma \left[ z (2 \Phi(z) - 1) + 2 \varphi(z) - \pi^{-1/2} \right],
        \quad z = (y - \mu) / \sigma

    Parameters
    ----------
    mean, sd : array
        Mean and standard deviation of the estimate. Without spread, the score is the absolute error.
    truth : array

    Returns
    -------
    crps : array, shape of the broadcast inputs
        In the unit of the estimate; 0 is best. NaN where an input is.

    References
    ----------
    [GneitingRaftery2007]_, Eq. 21
    """
    mean, sd, truth = (np.asarray(each, float) for each in (mean, sd, truth))
    with np.errstate(divide="ignore", invalid="ignore"):
        z = (truth - mean) / sd
        density = np.exp(-0.5 * z * z) / np.sqrt(2 * np.pi)
        found = sd * (z * (2 * ndtr(z) - 1) + 2 * density - _INVERSE_SQRT_PI)
    return np.where(sd == 0, np.abs(truth - mean), found)


def normal_pit(mean, sd, truth):
    """Probability of a value below the truth, by a normal distribution: uniform if it is calibrated. [1]"""
    with np.errstate(divide="ignore", invalid="ignore"):
        return ndtr((np.asarray(truth, float) - mean) / np.asarray(sd, float))


def ensemble_crps(members, truth, *, fair=False):
    r"""
    Continuous ranked probability score of an ensemble.

    .. math::

        \mathrm{CRPS} = \frac{1}{n} \sum_i |x_i - y| - \frac{1}{2 n^2} \sum_{i, j} |x_i - x_j|

    Parameters
    ----------
    members : array, shape (..., n)
        Values of the ensemble.
    truth : array, shape (...)
    fair : bool
        Divide the second sum by n (n - 1) instead of n^2, so that the expected score does not depend on n.

    Returns
    -------
    crps : array, shape (...)
        In the unit of the members; 0 is best. NaN where an input is.

    References
    ----------
    [GneitingRaftery2007]_, Eq. 20; Ferro (2014) for the fair score
    """
    members, truth = np.sort(np.asarray(members, float), axis=-1), np.asarray(truth, float)
    n = members.shape[-1]
    error = np.abs(members - truth[..., None]).mean(axis=-1)
    # Sum over all pairs from the sorted members.
    pairs = 2 * (members * (2 * np.arange(1, n + 1) - n - 1)).sum(axis=-1)
    return error - 0.5 * pairs / (n * (n - 1) if fair else n * n)


def mask_errors(mask, truth):
    r"""
    Omission and commission of a mask, with true shares of pixels.

    .. math:: o = \frac{\sum f (1 - m)}{\sum f}, \qquad c = \frac{\sum (1 - f) m}{\sum m}

    Parameters
    ----------
    mask : array, shape (...)
        Detected pixels, :math:`m`, 0 or 1. [1]
    truth : array, shape (...)
        True share of each pixel, :math:`f`, 0 to 1. [1]

    Returns
    -------
    omission, commission : float
        Share of the true area that the mask lacks, and share of the mask that is wrong; NaN for no area. Pixels with a
        NaN do not count. [1]

    References
    ----------
    [Congalton1991]_
    """
    mask, truth = np.broadcast_arrays(np.asarray(mask, float), np.asarray(truth, float))
    known = ~np.isnan(mask + truth)
    mask, truth = mask[known], truth[known]
    with np.errstate(invalid="ignore"):
        return np.sum(truth * (1 - mask)) / np.sum(truth), np.sum((1 - truth) * mask) / np.sum(mask)


def ensemble_pit(members, truth):
    """Rank of the truth in an ensemble as a share, shape (...); ties count half, NaN where an input is. [1]"""
    members, truth = np.asarray(members, float), np.asarray(truth, float)[..., None]
    below = (members < truth).sum(axis=-1) + 0.5 * (members == truth).sum(axis=-1)
    share = (below + 0.5) / (members.shape[-1] + 1)
    return np.where(np.isnan(members).any(axis=-1) | np.isnan(truth[..., 0]), np.nan, share)


def interval_score(low, high, truth, level):
    r"""
    Interval score of a central interval: its width, and a penalty for each truth outside.

    .. math::

        S = (u - l) + \frac{2}{\alpha} \left[ \max(l - y, 0) + \max(y - u, 0) \right], \quad \alpha = 1 - \mathrm{level}

    Parameters
    ----------
    low, high : array
        Ends of the interval, :math:`l` and :math:`u`.
    truth : array
    level : float
        Share of true values that the interval shall contain, 0 to 1. [1]

    Returns
    -------
    score : array, shape of the broadcast inputs
        In the unit of the estimate; small is good.

    References
    ----------
    [GneitingRaftery2007]_, Eq. 43
    """
    low, high, truth = (np.asarray(each, float) for each in (low, high, truth))
    return (high - low) + 2 / (1 - level) * (np.maximum(low - truth, 0) + np.maximum(truth - high, 0))


def grouped_sums(group, pit, *values, groups, bins):
    """Sums over the valid pixels of each row by group: count, error, its square, other values, and bins of the PIT."""
    rows = len(group)
    valid = np.isfinite(group) & np.logical_and.reduce([np.isfinite(each) for each in values])
    at = (np.arange(rows)[:, None] * groups + np.where(valid, group, 0).astype(int))[valid]

    def total(weights):
        return np.bincount(at, weights[valid], rows * groups)

    error = values[0]
    sums = [np.bincount(at, minlength=rows * groups), total(error), total(error**2)]
    sums += [total(each) for each in values[1:]]
    number = np.minimum((np.where(valid, np.nan_to_num(pit), 0) * bins).astype(int), bins - 1)
    known = valid & np.isfinite(pit)
    at = (np.arange(rows)[:, None] * groups + np.where(valid, group, 0).astype(int))[known]
    sums += [np.bincount(at, number[known] == each, rows * groups) for each in range(bins)]
    return np.stack(sums, axis=-1).reshape(rows, -1)


def sums_by_group_and_decile(*arrays, groups, bins, kept):
    """Sums by group, and sums of the error and of the kept values by each further kind of group, next to each other."""
    kinds, (pit, *values) = arrays[: len(groups)], arrays[len(groups) :]
    found = [grouped_sums(kinds[0], pit, *values, groups=groups[0], bins=bins)]
    valid = np.logical_and.reduce([np.isfinite(each) for each in values])
    for kind, count in zip(kinds[1:], groups[1:], strict=True):
        kind, own = np.where(valid, kind, np.nan), (values[at] for at in (0, *kept))
        found.append(grouped_sums(kind, pit, *own, groups=count, bins=0))
    return np.hstack(found)


def ratio_error(parts, counts):
    """
    Standard error of a ratio of sums over independent clusters of dependent pixels.

    Parameters
    ----------
    parts, counts : array, shape (clusters, ...)
        Sum of a value, and number of pixels, of each cluster.

    Returns
    -------
    error : array, shape (...)
        Linearized (Taylor) variance of the ratio estimator. NaN with fewer than two clusters that have pixels.

    References
    ----------
    [Cochran1977]_, Eq. 6.13
    """
    clusters = (counts > 0).sum(axis=0)
    total = counts.sum(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = parts.sum(axis=0) / total
        squares = ((parts - ratio * counts) ** 2).sum(axis=0)
        error = np.sqrt(clusters / (clusters - 1) * squares) / total
    return np.where(clusters > 1, error, np.nan)
