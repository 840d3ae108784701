"""Coupling of surface and atmosphere: reflectance at the surface to apparent reflectance in space, and back."""

import numba
import numpy as np


def apparent_reflectance(
    surface_reflectance,
    path_reflectance,
    transmittance_down,
    transmittance_up,
    spherical_albedo,
    gas_transmittance=1.0,
):
    r"""
    Apparent reflectance at the top of the atmosphere over a uniform surface.

    .. math::

        \rho^* = T_g \left[ \rho_a + T(\theta_s) \, \frac{\rho}{1 - \rho S} \, T(\theta_v) \right]

    Parameters
    ----------
    surface_reflectance : array, shape (..., band, y, x)
        Reflectance factor of the surface, :math:`\rho`. [1]
    path_reflectance : array, broadcastable
        Reflectance of the atmosphere alone, :math:`\rho_a`. [1]
    transmittance_down, transmittance_up : array, broadcastable
        Total transmittance from the sun, :math:`T(\theta_s)`, and to the sensor, :math:`T(\theta_v)`. [1]
    spherical_albedo : array, broadcastable
        Of the atmosphere seen from below, :math:`S`. [1]
    gas_transmittance : array, broadcastable, optional
        Of the absorbing gases, down and up, :math:`T_g`. [1]

    Returns
    -------
    toa_reflectance : array, shape of the broadcast inputs
        Apparent reflectance :math:`\rho^*`, with the cosine of the solar zenith divided out. [1]

    Raises
    ------
    ValueError
        If :math:`\rho S \ge 1`, where the multiple reflections do not converge.

    Notes
    -----
    The surface is uniform and Lambertian; `adjacency.inhomogeneous_reflectance` is for any other.

    References
    ----------
    [Tanre1990]_

    Examples
    --------
    A perfectly clear atmosphere changes nothing:

    >>> float(apparent_reflectance(0.25, 0.0, 1.0, 1.0, 0.0))
    0.25
    """
    factors = path_reflectance, transmittance_down, transmittance_up, spherical_albedo, gas_transmittance
    toa = _apparent(surface_reflectance, *factors)
    # The kernel marks what does not converge.
    if np.any(np.isinf(toa)):
        trapped = surface_reflectance * np.asarray(spherical_albedo, float)
        raise ValueError(
            f"surface_reflectance times spherical_albedo must be below 1, got {np.nanmax(trapped):g}: "
            "reflectance is a fraction, not a percentage"
        )
    return toa


def surface_reflectance(
    toa_reflectance,
    path_reflectance,
    transmittance_down,
    transmittance_up,
    spherical_albedo,
    gas_transmittance=1.0,
):
    r"""
    Reflectance of a uniform surface from its apparent reflectance.

    .. math::

        \rho = \frac{y}{1 + S y}, \qquad y = \frac{\rho^* / T_g - \rho_a}{T(\theta_s) \, T(\theta_v)}

    Parameters
    ----------
    toa_reflectance : array, shape (..., band, y, x)
        Apparent reflectance, :math:`\rho^*`. [1]
    path_reflectance, transmittance_down, transmittance_up, spherical_albedo, gas_transmittance : array
        As in `apparent_reflectance`. [1]

    Returns
    -------
    surface_reflectance : array, shape of the broadcast inputs
        Negative where the scene is darker than the atmosphere alone. [1]

    Notes
    -----
    The exact inverse of `apparent_reflectance`.

    References
    ----------
    [Tanre1990]_

    Examples
    --------
    >>> round(float(surface_reflectance(apparent_reflectance(0.25, 0.1, 0.8, 0.9, 0.2), 0.1, 0.8, 0.9, 0.2)), 12)
    0.25
    """
    factors = path_reflectance, transmittance_down, transmittance_up, spherical_albedo, gas_transmittance
    return _surface(toa_reflectance, *factors)


# Not cached: processes that fill numba's cache of universal functions side by side can crash.
@numba.vectorize(["float64(float64, float64, float64, float64, float64, float64)"])
def _apparent(rho, path, down, up, albedo, gas):
    trapped = rho * albedo
    if trapped >= 1:
        return np.inf
    return gas * (path + down * rho / (1 - trapped) * up)


@numba.vectorize(["float64(float64, float64, float64, float64, float64, float64)"])
def _surface(toa, path, down, up, albedo, gas):
    ground = (toa / gas - path) / (down * up)
    return ground / (1 + albedo * ground)
