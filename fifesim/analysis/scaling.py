"""Scale invariance: what averaging before an algorithm does to its result, simulated and to second order."""

import numpy as np


def ndvi_linearity(red, nir):
    r"""
    Correlation that must be zero for NDVI to be linear in reflectance.

    .. math:: r = \mathrm{corr}\left[ \rho_\mathrm{nir} - \rho_\mathrm{vis},
        (\rho_\mathrm{nir} + \rho_\mathrm{vis})^{-1} \right]

    Then the mean of the ratio is the product of the two means.

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

    Examples
    --------
    Brightness alone changes the difference and the sum together:

    >>> light = np.array([1.0, 2.0, 4.0])
    >>> bool(ndvi_linearity(0.1 * light, 0.3 * light) < 0)
    True
    """
    red, nir = np.asarray(red, float).ravel(), np.asarray(nir, float).ravel()
    valid = np.isfinite(red) & np.isfinite(nir)
    difference, inverse = (nir - red)[valid], 1.0 / (nir + red)[valid]
    difference, inverse = difference - difference.mean(), inverse - inverse.mean()
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.sum(difference * inverse) / np.sqrt(np.sum(difference**2) * np.sum(inverse**2)))


def second_order_bias(hessian, covariance):
    r"""
    Mean of an algorithm less the algorithm of the mean, to second order in what varies within.

    .. math:: \overline{A(\psi)} - A(\overline{\psi}) \approx
        \tfrac12 \sum_{ij} \frac{\partial^2 A}{\partial \psi_i \partial \psi_j} \mathrm{cov}(\psi_i, \psi_j)

    Parameters
    ----------
    hessian : array, shape (n, n, ...)
        Second derivatives at the mean.
    covariance : array, shape (n, n, ...)
        Of the inputs within the region.

    Returns
    -------
    bias : array, shape (...)

    References
    ----------
    [Friedl1995]_, Eq. 1; [Garrigues2006]_; [Hu1997]_

    Examples
    --------
    It is exact for a square:

    >>> x = np.array([1.0, 2.0, 6.0])
    >>> float(round(second_order_bias(np.array([[2.0]]), np.array([[x.var()]])) - (np.mean(x**2) - x.mean() ** 2), 12))
    0.0
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

    Examples
    --------
    NDVI does not depend on brightness, so along it there is no curvature:

    >>> hessian = ndvi_hessian(0.1, 0.3)
    >>> direction = np.array([0.1, 0.3])
    >>> bool(abs(direction @ hessian @ direction) < 1e-14)
    True
    """
    red, nir = np.broadcast_arrays(np.asarray(red, float), np.asarray(nir, float))
    cubed = (nir + red) ** 3
    mixed = 2.0 * (nir - red) / cubed
    return np.array([[4.0 * nir / cubed, mixed], [mixed, -4.0 * red / cubed]])


def fpar_curvature(lai, extinction, fpar_inf):
    r"""
    Second derivative of FPAR by Beer's law.

    .. math:: \frac{d^2 \mathrm{FPAR}}{d \mathrm{LAI}^2} = -\mathrm{FPAR}_\infty K^2 e^{-K\,\mathrm{LAI}}

    Parameters
    ----------
    lai : array
        [m2 m-2]
    extinction : float
        :math:`K`. [1]
    fpar_inf : float
        FPAR of an infinitely thick canopy. [1]

    Returns
    -------
    curvature : array, shape of lai

    References
    ----------
    [Friedl1995]_, Eq. 6

    Examples
    --------
    >>> fpar_curvature(0.0, 0.5, 1.0).item()
    -0.25
    """
    return -fpar_inf * extinction**2 * np.exp(-extinction * np.asarray(lai, float))


def beer_bias(mean, variance, extinction, fpar_inf):
    r"""
    Mean FPAR less FPAR of the mean LAI, to second order.

    Parameters
    ----------
    mean, variance : array
        Of LAI within the region.
    extinction, fpar_inf : float
        As in `fpar_curvature`. [1]

    Returns
    -------
    bias : array, shape of the broadcast inputs
        Never positive: FPAR saturates. [1]

    Examples
    --------
    >>> round(float(beer_bias(0.74, 0.53**2, 0.569, 0.94)), 3)
    -0.028
    """
    return second_order_bias(fpar_curvature(mean, extinction, fpar_inf)[None, None], np.asarray(variance)[None, None])


def share_kept(pixels, cells):
    """
    Share of the range and of the variance of cells that pixels keep.

    Parameters
    ----------
    pixels, cells : array, any shape
        Values at the two scales; NaN is left out.

    Returns
    -------
    of_range, of_variance : float
        [1]

    References
    ----------
    [Friedl1995]_, Fig. 6

    Examples
    --------
    >>> share_kept(np.array([1.0, 3.0]), np.array([0.0, 2.0, 4.0, 2.0]))
    (0.5, 0.5)
    """
    pixels, cells = np.asarray(pixels, float), np.asarray(cells, float)
    pixels, cells = pixels[np.isfinite(pixels)], cells[np.isfinite(cells)]
    return float(np.ptp(pixels) / np.ptp(cells)), float(pixels.var() / cells.var())
