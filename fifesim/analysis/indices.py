"""
Spectral vegetation indices, and the choice of a date for each cell of a composite.

Indices take reflectances in the near infrared N, the red R and the blue B, arrays that broadcast, and are NaN where a
denominator is zero.
"""

import numpy as np
from scipy.special import ndtr


def normalized_difference(nir, red):
    r"""
    Normalized difference vegetation index.

    .. math:: \mathrm{NDVI} = \frac{\rho_\mathrm{nir} - \rho_\mathrm{red}}{\rho_\mathrm{nir} + \rho_\mathrm{red}}

    Parameters
    ----------
    nir, red : array
        Reflectances in the near infrared and in the red. [1]

    Returns
    -------
    ndvi : array, shape of the broadcast inputs
        From -1 to 1; NaN where a reflectance is negative, or both are zero. [1]

    References
    ----------
    [Rouse1974]_; the criterion of [Friedl1995]_, Eq. 2, is `fifesim.analysis.scaling.linearity_correlation`
    """
    nir, red = np.asarray(nir, float), np.asarray(red, float)
    return np.where(np.minimum(nir, red) < 0, np.nan, linear_normalized_difference(nir, red))


def linear_normalized_difference(nir, red):
    """`normalized_difference` also of negative values, as of a linear model beyond possible reflectance."""
    return _ratio(nir - red, nir + red)


def normalized_difference_std(nir, red, nir_std, red_std):
    r"""
    Standard deviation of NDVI from the independent errors of its bands, to first order.

    .. math::

        s^2 = \left( \frac{2 \rho_\mathrm{red}}{\Sigma^2} s_\mathrm{nir} \right)^2 +
            \left( \frac{2 \rho_\mathrm{nir}}{\Sigma^2} s_\mathrm{red} \right)^2, \qquad
        \Sigma = \rho_\mathrm{nir} + \rho_\mathrm{red}

    Parameters
    ----------
    nir, red : array
        Reflectances in the near infrared and in the red. [1]
    nir_std, red_std : array
        Their standard deviations. [1]

    Returns
    -------
    std : array, shape of the broadcast inputs
        NaN where NDVI is NaN. [1]

    References
    ----------
    [JCGM2008]_, 5.1.2
    """
    nir, red = np.asarray(nir, float), np.asarray(red, float)
    std = _ratio(2 * np.hypot(red * nir_std, nir * red_std), (nir + red) ** 2)
    return np.where(np.minimum(nir, red) < 0, np.nan, std)


def enhanced(nir, red, blue):
    r"""Enhanced vegetation index (EVI), :math:`2.5 (N - R) / (N + 6 R - 7.5 B + 1)` [Huete2002]_. [1]"""
    nir, red, blue = (np.asarray(each, float) for each in (nir, red, blue))
    return _ratio(2.5 * (nir - red), nir + 6 * red - 7.5 * blue + 1)


def enhanced_of_two_bands(nir, red):
    r"""Enhanced vegetation index without the blue (EVI2), :math:`2.5 (N - R) / (N + 2.4 R + 1)` [Jiang2008]_. [1]"""
    nir, red = np.asarray(nir, float), np.asarray(red, float)
    return _ratio(2.5 * (nir - red), nir + 2.4 * red + 1)


def soil_adjusted(nir, red, soil=0.5):
    r"""Soil-adjusted vegetation index (SAVI), :math:`(1 + L) (N - R) / (N + R + L)`, L is `soil` [Huete1988]_. [1]"""
    nir, red = np.asarray(nir, float), np.asarray(red, float)
    return _ratio((1 + soil) * (nir - red), nir + red + soil)


def modified_soil_adjusted(nir, red):
    r"""
    Modified soil-adjusted index (MSAVI), :math:`[2 N + 1 - \sqrt{(2 N + 1)^2 - 8 (N - R)}] / 2`, NaN where noise makes
    the root imaginary [Qi1994]_, the second of them. [1]
    """
    nir, red = np.asarray(nir, float), np.asarray(red, float)
    square = (2 * nir + 1) ** 2 - 8 * (nir - red)
    return (2 * nir + 1 - np.sqrt(np.where(square >= 0, square, np.nan))) / 2


def near_infrared_of_vegetation(nir, red):
    """Near infrared reflectance of vegetation (NIRv), NDVI times the reflectance [Badgley2017]_. [1]"""
    return normalized_difference(nir, red) * np.asarray(nir, float)


def _ratio(above, below):
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = above / below
    return np.where(below == 0, np.nan, ratio)


def date_of_maximum(index):
    """
    Date with the largest value of an index.

    Parameters
    ----------
    index : array, shape (..., date)
        Such as NDVI; NaN where a date has no data.

    Returns
    -------
    chosen : array of int, shape (...)
        The first of equal ones; -1 where no date has data.

    Notes
    -----
    The maximum of n values with independent normal errors of standard deviation s exceeds their mean by 0.56 s for 2
    dates and 1.16 s for 5. The bias of a maximum NDVI composite therefore increases with the number of dates.

    References
    ----------
    [Holben1986]_
    """
    index = np.asarray(index, float)
    known = ~np.isnan(index)
    largest = np.argmax(np.where(known, index, -np.inf), axis=-1)
    # A cell whose values are all minus infinity has data as well.
    first = np.argmax(known, axis=-1)
    found = np.take_along_axis(known, largest[..., None], axis=-1)[..., 0]
    return np.where(known.any(axis=-1), np.where(found, largest, first), -1)


def date_of_median(index):
    """Date with the median value of an index, the lower of two middle ones, shape (...); -1 for no data."""
    index = np.asarray(index, float)
    count = (~np.isnan(index)).sum(axis=-1)
    # Missing values are sorted to the end.
    middle = np.maximum((count - 1) // 2, 0)[..., None]
    chosen = np.take_along_axis(np.argsort(index, axis=-1, kind="stable"), middle, axis=-1)[..., 0]
    return np.where(count > 0, chosen, -1)


def maximum_of_normals(dates):
    r"""
    Mean and standard deviation of the largest of independent standard normal numbers: the bias of a maximum composite.

    .. math:: E = \int_{-\infty}^{\infty} z \, n \, \varphi(z) \, \Phi(z)^{n - 1} \, \mathrm{d}z

    Parameters
    ----------
    dates : int
        Number of dates :math:`n`, at least 1.

    Returns
    -------
    mean, sd : float
        In standard deviations of the errors of one date. [1]

    References
    ----------
    [David2003]_, order statistics
    """
    # The trapezoidal rule converges exponentially for a smooth integrand that vanishes at both ends.
    z = np.linspace(-12.0, 12.0, 4001)
    density = dates * np.exp(-0.5 * z * z) / np.sqrt(2 * np.pi) * ndtr(z) ** (dates - 1)
    mean = float(np.trapezoid(z * density, z))
    return mean, float(np.sqrt(np.trapezoid((z - mean) ** 2 * density, z)))


def values_of_date(values, chosen, missing):
    """Values of the chosen date in each cell, of dates or of dates by cell, shape (...)."""
    places = np.maximum(chosen, 0)
    if values.ndim == 1:
        kept = values[places]
    else:
        places = np.broadcast_to(places, values.shape[:-1])[..., None]
        kept = np.take_along_axis(values, places, axis=-1)[..., 0]
    return np.where(chosen < 0, np.asarray(missing, values.dtype), kept)
