"""Empirical corrections of reflectance for slopes, and normalisation of the view angle."""

import math

import numpy as np

from fifesim.analysis.regression import row_sums

# Slopes below this cosine are NaN, at 84.3 degrees of incidence. An error of the slope of 1 degree then changes the
# correction by 17 %, and on a clear day the light of the sky, which the cosine leaves out, is as strong as the sunbeam.
LEAST_COSINE = 0.1


def cosine_correction(reflectance, cos_i, sza):
    r"""
    Cosine correction.

    .. math:: \rho \, \frac{\cos \theta_s}{\cos i}

    Parameters
    ----------
    reflectance : array
        Reflectance relative to the irradiance of level ground. [1]
    cos_i : array
        Cosine of the angle between the sun and the normal of the slope. [1]
    sza : array
        [degree]

    Returns
    -------
    reflectance : array, shape of the broadcast inputs
        NaN where the cosine is below 0.1, and where the sun does not reach the slope. [1]

    References
    ----------
    [Teillet1982]_

    Examples
    --------
    >>> float(round(cosine_correction(0.2, 1.0, 60.0), 12))
    0.1
    """
    return reflectance * np.cos(np.radians(sza)) / _divisor(cos_i)


def c_correction(reflectance, cos_i, sza, c):
    r"""
    C correction: the cosine correction with a constant for diffuse light.

    .. math:: \rho \, \frac{\cos \theta_s + c}{\cos i + c}

    Parameters
    ----------
    reflectance, cos_i, sza
        As in `cosine_correction`.
    c : array
        Intercept over slope of the regression of reflectance on illumination, by `line_constant`. [1]

    Returns
    -------
    reflectance : array, shape of the broadcast inputs
        NaN where the cosine plus c is below 0.1, and where the sun does not reach the slope. [1]

    References
    ----------
    [Teillet1982]_

    Examples
    --------
    >>> float(round(c_correction(0.3, 1.0, 60.0, 0.5), 12))
    0.2
    """
    return reflectance * (np.cos(np.radians(sza)) + c) / _divisor(cos_i, c)


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
        NaN where the cosine is below 0.1, and where the sun does not reach the slope. [1]

    References
    ----------
    [Gu1998]_; [Soenen2005]_

    Examples
    --------
    >>> float(round(scs_correction(0.4, 1.0, 60.0, 60.0), 12))
    0.1
    """
    return reflectance * np.cos(np.radians(slope)) * np.cos(np.radians(sza)) / _divisor(cos_i)


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
        NaN where the cosine plus c is below 0.1, and where the sun does not reach the slope. [1]

    References
    ----------
    [Soenen2005]_

    Examples
    --------
    >>> float(round(scs_c_correction(0.6, 1.0, 60.0, 60.0, 0.5), 12))
    0.3
    """
    return reflectance * (np.cos(np.radians(slope)) * np.cos(np.radians(sza)) + c) / _divisor(cos_i, c)


def minnaert_correction(reflectance, cos_i, sza, k):
    r"""
    Minnaert correction.

    .. math:: \rho \left( \frac{\cos \theta_s}{\cos i} \right)^k

    Parameters
    ----------
    reflectance, cos_i, sza
        As in `cosine_correction`.
    k : array
        1 is the cosine correction, from `line_constant`. [1]

    Returns
    -------
    reflectance : array, shape of the broadcast inputs
        NaN where the cosine is below 0.1, and where the sun does not reach the slope. [1]

    References
    ----------
    [Minnaert1941]_

    Examples
    --------
    >>> float(round(minnaert_correction(0.2, 1.0, 60.0, 2.0), 12))
    0.05
    """
    return reflectance * (np.cos(np.radians(sza)) / _divisor(cos_i)) ** k


# Variance of illumination, or of its logarithm, that is rounding. [1]
_ROUNDING = 1e-14


def line_sums(reflectance, cos_i, logarithmic=False, level=1.0):
    """Sums over each row for least squares lines on illumination, about that of level ground, shape (6, ..., rows)."""
    x = _lit(cos_i)
    if logarithmic:
        reflectance, x, level = np.log(np.where(reflectance > 0, reflectance, np.nan)), np.log(x), np.log(level)
    bands = np.asarray(reflectance, float).reshape(-1, *x.shape)
    sums = np.stack([row_sums(np.ascontiguousarray(band), np.ascontiguousarray(x), 0.0, level) for band in bands])
    return np.moveaxis(sums, -1, 0).reshape(6, *np.shape(reflectance)[:-1])


def line_constant(sums, logarithmic=False, level=1.0):
    """Constant of the C correction, or the Minnaert exponent, from `line_sums`, the same for any blocks of rows."""
    n, x, y, xx, xy, _ = np.apply_along_axis(math.fsum, -1, sums)
    with np.errstate(invalid="ignore", divide="ignore"):
        squares = xx - x * x / n
        slope = np.where(squares > _ROUNDING * n, xy - x * y / n, np.nan) / squares
        return slope if logarithmic else (y / n - slope * (level + x / n)) / slope


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


def _divisor(cos_i, c=0.0):
    """Divisor of a correction, NaN below the limit and where the sun does not reach the slope."""
    divisor = _lit(cos_i) + c
    return np.where(divisor >= LEAST_COSINE, divisor, np.nan)
