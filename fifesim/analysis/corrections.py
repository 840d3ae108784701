"""Empirical corrections of reflectance for slopes, and normalisation of the view angle."""

import numpy as np


def illumination_cosine(sza, saa, slope, aspect):
    r"""
    Cosine of the angle between the sun and the normal of a slope.

    .. math:: \cos i = \cos \theta_s \cos S + \sin \theta_s \sin S \cos(\varphi_s - A)

    Parameters
    ----------
    sza, saa : array
        Solar zenith and azimuth angles. [degree]
    slope, aspect : array
        Slope, and azimuth down the slope. [degree]

    Returns
    -------
    cosine : array, shape of the broadcast inputs
        Negative where the slope faces away. [1]

    References
    ----------
    [Teillet1982]_

    Examples
    --------
    >>> float(round(illumination_cosine(30.0, 180.0, 30.0, 180.0), 12))
    1.0
    """
    sza, saa, slope, aspect = map(np.radians, (sza, saa, slope, aspect))
    return np.cos(sza) * np.cos(slope) + np.sin(sza) * np.sin(slope) * np.cos(saa - aspect)


def cosine_correction(reflectance, cos_i, sza):
    r"""
    Cosine correction.

    .. math:: \rho \, \frac{\cos \theta_s}{\cos i}

    Parameters
    ----------
    reflectance : array
        Reflectance relative to the irradiance of level ground. [1]
    cos_i : array
        From `illumination_cosine`. [1]
    sza : array
        [degree]

    Returns
    -------
    reflectance : array, shape of the broadcast inputs
        NaN where the sun does not reach the slope. [1]

    References
    ----------
    [Teillet1982]_

    Examples
    --------
    >>> float(round(cosine_correction(0.2, 1.0, 60.0), 12))
    0.1
    """
    return reflectance * np.cos(np.radians(sza)) / _lit(cos_i)


def c_correction(reflectance, cos_i, sza, c):
    r"""
    C correction: the cosine correction with a constant for diffuse light.

    .. math:: \rho \, \frac{\cos \theta_s + c}{\cos i + c}

    Parameters
    ----------
    reflectance, cos_i, sza
        As in `cosine_correction`.
    c : array
        From `regression_constant`. [1]

    Returns
    -------
    reflectance : array, shape of the broadcast inputs
        [1]

    References
    ----------
    [Teillet1982]_

    Examples
    --------
    >>> float(round(c_correction(0.3, 1.0, 60.0, 0.5), 12))
    0.2
    """
    return reflectance * (np.cos(np.radians(sza)) + c) / (_lit(cos_i) + c)


def scs_correction(reflectance, cos_i, sza, slope):
    r"""
    Sun-canopy-sensor correction, for plants that grow upright.

    .. math:: \rho \, \frac{\cos S \cos \theta_s}{\cos i}

    Parameters
    ----------
    reflectance, cos_i, sza
        As in `cosine_correction`.
    slope : array
        [degree]

    Returns
    -------
    reflectance : array, shape of the broadcast inputs
        [1]

    References
    ----------
    [Gu1998]_; [Soenen2005]_

    Examples
    --------
    >>> float(round(scs_correction(0.4, 1.0, 60.0, 60.0), 12))
    0.1
    """
    return reflectance * np.cos(np.radians(slope)) * np.cos(np.radians(sza)) / _lit(cos_i)


def scs_c_correction(reflectance, cos_i, sza, slope, c):
    r"""
    Sun-canopy-sensor correction with a constant for diffuse light.

    .. math:: \rho \, \frac{\cos S \cos \theta_s + c}{\cos i + c}

    Parameters
    ----------
    reflectance, cos_i, sza, slope
        As in `scs_correction`.
    c : array
        As in `c_correction`. [1]

    Returns
    -------
    reflectance : array, shape of the broadcast inputs
        [1]

    References
    ----------
    [Soenen2005]_

    Examples
    --------
    >>> float(round(scs_c_correction(0.6, 1.0, 60.0, 60.0, 0.5), 12))
    0.3
    """
    return reflectance * (np.cos(np.radians(slope)) * np.cos(np.radians(sza)) + c) / (_lit(cos_i) + c)


def minnaert_correction(reflectance, cos_i, sza, k):
    r"""
    Minnaert correction.

    .. math:: \rho \left( \frac{\cos \theta_s}{\cos i} \right)^k

    Parameters
    ----------
    reflectance, cos_i, sza
        As in `cosine_correction`.
    k : array
        1 is the cosine correction, from `minnaert_exponent`. [1]

    Returns
    -------
    reflectance : array, shape of the broadcast inputs
        [1]

    References
    ----------
    [Minnaert1941]_

    Examples
    --------
    >>> float(round(minnaert_correction(0.2, 1.0, 60.0, 2.0), 12))
    0.05
    """
    return reflectance * (np.cos(np.radians(sza)) / _lit(cos_i)) ** k


def regression_line(x, y):
    """Intercept and slope of the least squares line of y on x, from the pairs that are finite, shape (...)."""
    # The last two axes are cells.
    known = np.isfinite(x) & np.isfinite(y)
    count = known.sum(axis=(-2, -1))
    x, y = (np.where(known, each, 0.0) for each in (x, y))
    with np.errstate(invalid="ignore", divide="ignore"):
        mean_x, mean_y = x.sum(axis=(-2, -1)) / count, y.sum(axis=(-2, -1)) / count
        apart = np.where(known, x - mean_x[..., None, None], 0.0)
        slope = (apart * y).sum(axis=(-2, -1)) / (apart**2).sum(axis=(-2, -1))
    return mean_y - slope * mean_x, slope


def regression_constant(reflectance, cos_i):
    r"""
    Constant of the C correction of a scene: intercept over slope of its regression on illumination.

    .. math:: \rho = b + m \cos i, \qquad c = b / m

    Parameters
    ----------
    reflectance : array, shape (..., rows, columns)
        [1]
    cos_i : array, shape (rows, columns)
        [1]

    Returns
    -------
    c : array, shape (...)
        NaN where all cells have the same illumination. [1]

    References
    ----------
    [Teillet1982]_

    Examples
    --------
    >>> cos_i = np.array([[0.2, 0.4, 0.8]])
    >>> float(round(regression_constant(0.1 + 0.2 * cos_i, cos_i), 12))
    0.5
    """
    intercept, slope = regression_line(np.broadcast_to(_lit(cos_i), np.shape(reflectance)), reflectance)
    with np.errstate(invalid="ignore", divide="ignore"):
        return intercept / slope


def minnaert_exponent(reflectance, cos_i):
    r"""
    Exponent of the Minnaert correction of a scene: slope of its logarithmic regression on illumination.

    .. math:: \ln \rho = a + k \ln \cos i

    Parameters
    ----------
    reflectance : array, shape (..., rows, columns)
        Cells at or below 0 are left out. [1]
    cos_i : array, shape (rows, columns)
        [1]

    Returns
    -------
    k : array, shape (...)
        [1]

    References
    ----------
    [Minnaert1941]_

    Examples
    --------
    >>> cos_i = np.array([[0.2, 0.4, 0.8]])
    >>> float(round(minnaert_exponent(0.3 * cos_i**0.7, cos_i), 12))
    0.7
    """
    logs = np.log(np.where(reflectance > 0, reflectance, np.nan))
    return regression_line(np.broadcast_to(np.log(_lit(cos_i)), logs.shape), logs)[1]


def c_factor(at_view, at_target):
    r"""
    Factor that converts a reflectance from its view direction to a target direction.

    .. math:: c = R(\Omega_\mathrm{target}) / R(\Omega_\mathrm{view})

    Parameters
    ----------
    at_view, at_target : array
        Reflectance by a model of the surface, such as `fifesim.base.surface_kernels.ross_li`. [1]

    Returns
    -------
    factor : array, shape of the broadcast inputs
        [1]

    References
    ----------
    [Roy2016]_

    Examples
    --------
    >>> float(c_factor(0.25, 0.2))
    0.8
    """
    return np.divide(at_target, at_view)


def _lit(cos_i):
    """Illumination, NaN where the sun does not reach the slope."""
    return np.where(cos_i > 0, cos_i, np.nan)
