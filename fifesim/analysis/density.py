"""Kernel densities of samples, or of the counts of many values."""

import numpy as np

# Nodes along the axis over which memory is bounded: samples are taken in parts of this many.
_PART = 2**14


def silverman_bandwidth(deviation, interquartile_range, n):
    r"""
    Bandwidth of a Gaussian kernel by the rule of thumb.

    .. math:: h = 0.9 \min(\sigma, \mathrm{IQR} / 1.34) \, n^{-1/5}

    Parameters
    ----------
    deviation, interquartile_range : float
        Of the samples.
    n : float
        How many.

    Returns
    -------
    bandwidth : float

    References
    ----------
    [Silverman1986]_, Eq. 3.31

    Examples
    --------
    >>> round(silverman_bandwidth(1.0, 2.0, 1.0), 12)
    0.9
    """
    spread = min(deviation, interquartile_range / 1.34) if interquartile_range > 0 else deviation
    return 0.9 * spread * n**-0.2


def gaussian_density(samples, at, bandwidth, weights=None, *, reflect=False):
    r"""
    Gaussian kernel density.

    .. math:: \hat f(x) = \frac{1}{h \sum w} \sum_i w_i \, \varphi\left( \frac{x - x_i}{h} \right)

    Of what cannot be negative, the part of a kernel that lies below zero is reflected:

    .. math:: \hat f^*(x) = \hat f(x) + \hat f(-x), \quad x \ge 0

    Parameters
    ----------
    samples : array, shape (n,)
        Values, or middles of bins.
    at : array, shape (m,)
        Where the density is wanted.
    bandwidth : float
        h, in units of the samples.
    weights : array, shape (n,), optional
        Such as counts of the bins; 1 by default.
    reflect : bool, optional
        Whether at zero, below which the density is then zero.

    Returns
    -------
    density : array, shape (m,)
        Per unit of the samples.

    Raises
    ------
    ValueError
        If the bandwidth is not positive, or a sample is negative that is to be reflected at zero.

    References
    ----------
    [Silverman1986]_, Sections 2.4 and 2.10

    Examples
    --------
    >>> at = np.linspace(-9, 9, 1001)
    >>> round(float(np.sum(gaussian_density(np.array([0.0]), at, 1.0)) * (at[1] - at[0])), 9)
    1.0
    """
    if not 0 < bandwidth < np.inf:
        raise ValueError(f"bandwidth must be positive, got {bandwidth:g}: do the samples vary?")
    samples, at = np.asarray(samples, float), np.asarray(at, float)
    if reflect:
        if np.min(samples, initial=0.0) < 0:
            raise ValueError(f"samples must be at least 0 to be reflected there, got {np.min(samples):g}")
        upper, mirrored = (gaussian_density(samples, each, bandwidth, weights) for each in (at, -at))
        return np.where(at >= 0, upper + mirrored, 0.0)
    weights = np.ones(samples.size) if weights is None else np.asarray(weights, float)
    density = np.zeros(at.size)
    for start in range(0, samples.size, _PART):
        part = slice(start, start + _PART)
        z = (at[:, None] - samples[None, part]) / bandwidth
        density += np.exp(-0.5 * z * z) @ weights[part]
    return density / (np.sqrt(2.0 * np.pi) * bandwidth * weights.sum())


def sample_density(samples, at, *, reflect=False):
    """
    Gaussian kernel density of samples in memory, with the bandwidth of the rule of thumb.

    Parameters
    ----------
    samples : array, any shape
        NaN is left out.
    at : array, shape (m,)
    reflect : bool, optional
        As in `gaussian_density`.

    Returns
    -------
    density : array, shape (m,)
        Per unit of the samples.

    Raises
    ------
    ValueError
        If fewer than two samples are left, they do not vary, or one is negative that is to be reflected.
    """
    samples = np.asarray(samples, float)
    samples = samples[np.isfinite(samples)]
    if samples.size < 2:
        raise ValueError(f"a density needs at least 2 values, got {samples.size}")
    quartiles = np.subtract(*np.percentile(samples, (75, 25)))
    bandwidth = silverman_bandwidth(samples.std(ddof=1), quartiles, samples.size)
    return gaussian_density(samples, at, bandwidth, reflect=reflect)
