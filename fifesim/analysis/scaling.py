"""Scale effects: averaging before and after an algorithm, variograms, kernel densities; shares of causes and inputs."""

from math import factorial
from typing import NamedTuple

import numpy as np
from scipy import fft

from fifesim.base.arguments import Range, check_number


def linearity_correlation(red, nir):
    r"""
    Correlation that must be 0 for NDVI to be linear in reflectance.

    .. math:: r = \mathrm{corr}\left[ \rho_\mathrm{nir} - \rho_\mathrm{vis},
        (\rho_\mathrm{nir} + \rho_\mathrm{vis})^{-1} \right]

    If it is 0, the mean of the ratio equals the product of the two means.

    Parameters
    ----------
    red, nir : array, one shape
        Reflectances; pairs with NaN are left out. [1]

    Returns
    -------
    r : float
        NaN where one of the two does not vary. [1]

    References
    ----------
    [Friedl1995]_, Eq. 2; [Hall1992]_
    """
    red, nir = np.asarray(red, float).ravel(), np.asarray(nir, float).ravel()
    valid = np.isfinite(red) & np.isfinite(nir)
    difference, inverse = (nir - red)[valid], 1.0 / (nir + red)[valid]
    difference, inverse = difference - difference.mean(), inverse - inverse.mean()
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.sum(difference * inverse) / np.sqrt(np.sum(difference**2) * np.sum(inverse**2)))


def second_order_bias(hessian, covariance):
    r"""
    Mean of an algorithm minus the algorithm of the mean, to second order in the variation within the region.

    .. math:: \overline{A(\psi)} - A(\overline{\psi}) \approx
        \tfrac12 \sum_{ij} \frac{\partial^2 A}{\partial \psi_i \partial \psi_j} \mathrm{cov}(\psi_i, \psi_j)

    Parameters
    ----------
    hessian : array, shape (n, n, ...)
        Second derivatives at the mean.
    covariance : array, shape (n, n, ...)
        Covariance of the inputs within the region.

    Returns
    -------
    bias : array, shape (...)

    References
    ----------
    [Friedl1995]_, Eq. 1; [Garrigues2006]_; [Hu1997]_
    """
    return 0.5 * np.sum(np.asarray(hessian) * np.asarray(covariance), axis=(0, 1))


def ndvi_hessian(red, nir):
    r"""
    Second derivatives of NDVI, in the order red, near infrared.

    With :math:`S = \rho_\mathrm{nir} + \rho_\mathrm{red}`:

    .. math:: \frac{\partial^2 N}{\partial \rho_\mathrm{red}^2} = \frac{4 \rho_\mathrm{nir}}{S^3}, \quad
        \frac{\partial^2 N}{\partial \rho_\mathrm{red} \partial \rho_\mathrm{nir}} =
        \frac{2 (\rho_\mathrm{nir} - \rho_\mathrm{red})}{S^3}, \quad
        \frac{\partial^2 N}{\partial \rho_\mathrm{nir}^2} = -\frac{4 \rho_\mathrm{red}}{S^3}

    Parameters
    ----------
    red, nir : array
        Reflectances. [1]

    Returns
    -------
    hessian : array, shape (2, 2, ...)
        [1]
    """
    red, nir = np.broadcast_arrays(np.asarray(red, float), np.asarray(nir, float))
    cubed = (nir + red) ** 3
    mixed = 2.0 * (nir - red) / cubed
    return np.array([[4.0 * nir / cubed, mixed], [mixed, -4.0 * red / cubed]])


def beer_bias(mean, variance, extinction, fpar_inf):
    r"""
    Mean FPAR minus the FPAR of the mean LAI, to second order. [1] FPAR of [Friedl1995]_, Eq. 6, has the curvature
    :math:`-\mathrm{FPAR}_\infty K^2 e^{-K\,\mathrm{LAI}}`.
    """
    curvature = -fpar_inf * extinction**2 * np.exp(-extinction * np.asarray(mean, float))
    return second_order_bias(curvature[None, None], np.asarray(variance)[None, None])


# Number of sums over pairs.
LAG_SUMS = 6


def lag_sums(cells, margin, reach, origin=0.0):
    """Sums by lag over pairs of cells, the first in the block and the second possibly in the margin, by FFT."""
    # Rows of the result: 1, first value, second value, product, squares of both. Sums over blocks add up to the sums
    # over the raster.
    values = np.asarray(cells, float) - origin
    valid = np.isfinite(values)
    values = np.where(valid, values, 0.0)
    inside = tuple(slice(before, size - after) for (before, after), size in zip(margin, values.shape, strict=True))
    first = np.zeros(valid.shape, bool)
    first[inside] = valid[inside]
    # A padding of twice the reach prevents wrap-around.
    shape = tuple(fft.next_fast_len(size + each, real=True) for size, each in zip(values.shape, reach, strict=True))
    factors = 1.0, values, values**2
    one, one_z, one_zz = (fft.rfft2(first * factor, shape) for factor in factors)
    two, two_z, two_zz = (fft.rfft2(valid * factor, shape) for factor in factors)
    pairs = (one, two), (one_z, two), (one, two_z), (one_z, two_z), (one_zz, two), (one, two_zz)
    rows, columns = np.arange(reach[0] + 1), np.arange(-reach[1], reach[1] + 1)
    sums = np.stack([fft.irfft2(np.conj(a) * b, shape)[np.ix_(rows, columns)] for a, b in pairs])
    # Counts are whole numbers.
    sums[0] = np.rint(sums[0])
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
    r"""Semivariance by lag from `lag_sums`, :math:`\sum (z_{i+h} - z_i)^2 / (2 N(h))` [Chiles2012]_, Section 2.2."""
    count, _, _, product, first_square, second_square = sums
    with np.errstate(divide="ignore", invalid="ignore"):
        squares = (first_square + second_square - 2.0 * product) / (2.0 * count)
    # Rounding of the transform may make a difference of zero negative.
    return np.where(count > 0, np.maximum(squares, 0.0), np.nan)


def crossing(lag, correlation, level=0.05):
    """Lag at which a correlation has fallen to a level, log-linear between lags; NaN if it does not. [m]"""
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
    """Mean autocorrelation of the weights of a footprint along one axis, for lags from -reach to reach. [1]"""
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
        Covariance of the cells, by lags from 0 down and from minus to plus across; the other half is symmetric.
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
    """
    half = len(down) // 2
    # Products of the footprint are even, so each downward lag also stands for the upward lag.
    rows = down[half:] * np.where(np.arange(half + 1) == 0, 1.0, 2.0)
    used = np.outer(rows, across)
    return float(np.sum(np.where(used != 0, used * covariance, 0.0)))


# Nodes along the axis over which memory is bounded: samples are taken in parts of this many.
_PART = 2**14


def silverman_bandwidth(deviation, interquartile_range, n):
    r"""
    Bandwidth of a Gaussian kernel by the rule of thumb.

    .. math:: h = 0.9 \min(\sigma, \mathrm{IQR} / 1.34) \, n^{-1/5}

    Parameters
    ----------
    deviation, interquartile_range : float
        Standard deviation and interquartile range of the samples.
    n : float
        Number of samples.

    Returns
    -------
    bandwidth : float

    References
    ----------
    [Silverman1986]_, Eq. 3.31
    """
    spread = min(deviation, interquartile_range / 1.34) if interquartile_range > 0 else deviation
    return 0.9 * spread * n**-0.2


def gaussian_density(samples, at, bandwidth, weights=None, *, reflect=False):
    r"""
    Gaussian kernel density.

    .. math:: \hat f(x) = \frac{1}{h \sum w} \sum_i w_i \, \varphi\left( \frac{x - x_i}{h} \right)

    For quantities that cannot be negative, the part of a kernel below zero is reflected:

    .. math:: \hat f^*(x) = \hat f(x) + \hat f(-x), \quad x \ge 0

    Parameters
    ----------
    samples : array, shape (n,)
        Values, or middles of bins.
    at : array, shape (m,)
        Places at which the density is computed.
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
    """
    check_number("bandwidth", bandwidth, Range("1", 0, np.inf, note="do the samples vary?", ends="()"))
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
    """Gaussian kernel density of samples, with the bandwidth of the rule of thumb, shape (m,)."""
    samples = np.asarray(samples, float)
    samples = samples[np.isfinite(samples)]
    if samples.size < 2:
        raise ValueError(f"a density needs at least 2 values, got {samples.size}")
    quartiles = np.subtract(*np.percentile(samples, (75, 25)))
    bandwidth = silverman_bandwidth(samples.std(ddof=1), quartiles, samples.size)
    return gaussian_density(samples, at, bandwidth, reflect=reflect)


def shapley(values, causes):
    r"""
    Shapley shares of an effect: mean contribution of each cause over all orders in which causes are added.

    .. math::

        \varphi_i = \sum_{S \not\ni i} \frac{|S|! \, (k - |S| - 1)!}{k!} \left[ v(S \cup i) - v(S) \right], \qquad
        \sum_i \varphi_i = v(\mathrm{all}) - v(\mathrm{none})

    Parameters
    ----------
    values : array, shape (2,) * causes + (...)
        Effect v of each set of causes: index 1 along the axis of a cause where it is at work, 0 where it is not.
    causes : int
        Their number k.

    Returns
    -------
    shares : array, shape (causes, ...)
        Exactly 0 for a cause that changes nothing.

    Raises
    ------
    ValueError
        If the values have no axis of two for each cause.

    References
    ----------
    [Shapley1953]_
    """
    values = _checked(values, causes)
    shares = []
    for cause in range(causes):
        added = np.diff(values, axis=cause).squeeze(axis=cause)
        # Number of other causes in each set.
        others = np.indices((2,) * (causes - 1)).sum(axis=0)
        weights = np.array([factorial(n) * factorial(causes - n - 1) / factorial(causes) for n in range(causes)])
        shares.append(np.tensordot(weights[others], added, axes=causes - 1))
    return np.array(shares).reshape(causes, *values.shape[causes:])


def taken_away(values, causes):
    r"""Reduction without one cause, :math:`v(\mathrm{all}) - v(\mathrm{all} \setminus i)`, as `shapley`."""
    return np.asarray(values, float)[(1,) * causes] - _one_apart(values, causes, 0)


def by_itself(values, causes):
    r"""Effect of one cause without any other, :math:`v(i) - v(\mathrm{none})`, as `shapley`."""
    return _one_apart(values, causes, 1) - np.asarray(values, float)[(0,) * causes]


def _one_apart(values, causes, state):
    """Effect with one cause at the state 1 or 0 and all others at the opposite state, shape (causes, ...)."""
    values = _checked(values, causes)
    sets = np.where(np.eye(causes, dtype=bool), state, 1 - state)
    return np.array([values[tuple(each)] for each in sets]).reshape(causes, *values.shape[causes:])


def _checked(values, causes):
    values = np.asarray(values, float)
    if values.shape[:causes] != (2,) * causes:
        raise ValueError(f"values must have {causes} axes of 2 first, one for each cause, got shape {values.shape}")
    return values


class SobolIndices(NamedTuple):
    """Indices by input, shape (k,), with their standard errors. [1]"""

    first: np.ndarray
    """Share of the variance by the input alone."""
    total: np.ndarray
    """Share by the input and its interactions."""
    first_error: np.ndarray
    total_error: np.ndarray


def sobol_points(points):
    r"""
    Points at which a function is evaluated for its Sobol indices [Saltelli2010]_, shape (k + 2, n, k): from points
    of the unit cube, shape (n, 2 k), the matrices A, B and :math:`A_B^i`, A with the column of input i from B.
    """
    one, other = np.split(np.asarray(points, float), 2, axis=1)
    inputs = one.shape[1]
    mixed = np.repeat(one[None], inputs, axis=0)
    for each in range(inputs):
        mixed[each, :, each] = other[:, each]
    return np.concatenate([one[None], other[None], mixed])


def sobol_indices(values):
    r"""
    First-order and total Sobol indices by the estimators of Saltelli et al. and Jansen.

    .. math::

        S_i = \frac{1}{V n} \sum_j f(B)_j \left[ f(A_B^i)_j - f(A)_j \right], \qquad
        T_i = \frac{1}{2 V n} \sum_j \left[ f(A)_j - f(A_B^i)_j \right]^2

    Parameters
    ----------
    values : array, shape (k + 2, n)
        Values of the function at `sobol_points`.

    Returns
    -------
    indices : SobolIndices
        Standard errors are of independent points, so that they are too large for points of a Sobol sequence.

    Raises
    ------
    ValueError
        If the function is constant, or a value is not finite.

    References
    ----------
    [Saltelli2010]_, Table 2, rows b and f
    """
    values = np.asarray(values, float)
    if not np.isfinite(values).all():
        raise ValueError("the function is not finite at all points: check the ranges of its inputs")
    variance = values[:2].var()
    if variance == 0:
        raise ValueError("the function is constant: no input has an index")
    # The mean does not matter, but the smaller the numbers, the smaller is the error.
    one, other, *mixed = values - values.mean()
    changes, count = np.array(mixed) - one, one.size
    terms = other * changes / variance, changes**2 / (2 * variance)
    first, total = (each.mean(axis=1) for each in terms)
    errors = (each.std(axis=1, ddof=1) / np.sqrt(count) for each in terms)
    return SobolIndices(first, total, *errors)
