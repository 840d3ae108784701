"""From the bands of one instrument to those of another: the best linear estimate over a library of spectra."""

from typing import NamedTuple

import numpy as np

# How real spectra differ from those of a library: by a smooth factor of this standard deviation [1] and
# correlation length [um]. Held out soils and canopies decided it: more costs what the library knows of water, less
# follows the library into bands far away.
DEVIATION = 0.005
CORRELATION = 0.05

# Share [1] and reflectance [1] of grey surfaces beside a library of land: roads, roofs and clouds stay about what they
# are. A tenth of it would leave a road of 0.2 at 0.196 in TM5.
GREY_SHARE = 0.01
GREY = 0.3


class Estimate(NamedTuple):
    """A linear estimate of the bands of one instrument from those of another."""

    weights: np.ndarray  # of the source's bands in each target band, shape (target, source) [1]
    error: np.ndarray  # standard error of each target band over the library, shape (target,) [1]


class Line(NamedTuple):
    """One band as a straight line of another."""

    slope: float
    offset: float
    error: float  # standard deviation about the line [1]
    difference: float  # root mean square of the bands' difference, without the line [1]


def band_moments(weights, wavelength, spectra):
    r"""
    Second moments of band means over a library of spectra, each of which may deviate by a smooth factor.

    .. math:: C = W \, (M \circ (1 + K)) \, W^T, \quad M = \frac{1}{N} \sum_n \rho_n \rho_n^T + g \rho_g^2, \quad
        K_{ij} = s^2 \exp\left(-\frac{(\lambda_i - \lambda_j)^2}{2 \ell^2}\right)

    with :math:`s = 0.005` and :math:`\ell = 0.05` um, and a share :math:`g = 0.01` of grey surfaces of
    :math:`\rho_g = 0.3`.

    Parameters
    ----------
    weights : array, shape (band, n)
        Of the wavelengths in each band. [1]
    wavelength : array, shape (n,)
        [um]
    spectra : array, shape (spectrum, n)
        [1]

    Returns
    -------
    moments : array, shape (band, band)
        [1]

    Examples
    --------
    >>> band_moments([[1.0, 0.0]], [0.5, 0.6], [[0.2, 0.4]]).round(6).tolist()
    [[0.040901]]
    """
    weights, spectra = np.asarray(weights, float), np.asarray(spectra, float)
    apart = np.subtract.outer(np.asarray(wavelength, float), np.asarray(wavelength, float))
    deviation = DEVIATION**2 * np.exp(-(apart**2) / (2 * CORRELATION**2))
    land = spectra.T @ spectra / len(spectra) + GREY_SHARE * GREY**2
    return weights @ (land * (1 + deviation)) @ weights.T


def best_linear(moments, sources, uncertainty):
    r"""
    Best linear estimate of bands from others, and its error.

    .. math:: B = C_{ts} \, (C_{ss} + u^2 I)^{-1}, \quad
        e_t^2 = (C_{tt} - B \, C_{st})_{tt}

    It has no offset: what reflects nothing does so in all bands, and half the light is half the reflectance.

    Parameters
    ----------
    moments : array, shape (band, band)
        Second moments :math:`C` of the source's bands, then the target's, from `band_moments`. [1]
    sources : int
        How many bands are the source's.
    uncertainty : float
        Standard error :math:`u` of the source's reflectance, independent from band to band. [1]

    Returns
    -------
    estimate : Estimate

    Examples
    --------
    A band that is another's double is found as such:

    >>> found = best_linear(np.array([[1.0, 2.0], [2.0, 4.0]]), 1, 0.0)
    >>> found.weights.tolist(), found.error.tolist()
    ([[2.0]], [0.0])
    """
    moments = np.asarray(moments, float)
    own, cross, target = moments[:sources, :sources], moments[:sources, sources:], moments[sources:, sources:]
    weights = np.linalg.solve(own + uncertainty**2 * np.eye(sources), cross).T
    # Rounding may leave less than nothing of a band that the source has itself.
    squared = np.diag(target) - np.sum(weights * cross.T, axis=1)
    return Estimate(weights, np.sqrt(np.maximum(squared, 0.0)))


def line_between(source, target):
    """
    Least squares line from one band to another over spectra.

    Parameters
    ----------
    source, target : array, shape (spectrum,)
        Band means. [1]

    Returns
    -------
    line : Line

    Examples
    --------
    >>> found = line_between([0.0, 0.1, 0.2], [0.01, 0.06, 0.11])
    >>> round(found.slope, 12), round(found.offset, 12), round(found.error, 12)
    (0.5, 0.01, 0.0)
    """
    source, target = np.asarray(source, float), np.asarray(target, float)
    from_mean = source - source.mean()
    slope = np.sum(from_mean * (target - target.mean())) / np.sum(from_mean**2)
    offset = target.mean() - slope * source.mean()
    error = np.sqrt(np.mean((target - offset - slope * source) ** 2))
    difference = np.sqrt(np.mean((target - source) ** 2))
    return Line(*map(float, (slope, offset, error, difference)))
