"""The light that falls on a slope, and what of the light that it sends up is seen (Equations 4 and 5)."""

import numpy as np
from numba.extending import register_jitable

from fifesim.ground.terrain.slope import Vector


def direction_vector(zenith, azimuth):
    """
    Unit vector toward the sun or the sensor.

    Parameters
    ----------
    zenith, azimuth : float
        Clockwise from north. [degree]

    Returns
    -------
    vector : fifesim.ground.terrain.slope.Vector
        [1]

    Examples
    --------
    >>> direction_vector(0.0, 120.0).z.item()
    1.0
    """
    zenith, azimuth = np.radians(zenith), np.radians(azimuth)
    return Vector(np.sin(zenith) * np.sin(azimuth), np.sin(zenith) * np.cos(azimuth), np.cos(zenith))


@register_jitable
def topographic_factor(sky_view, terrain_view, reflectance, mu_s_local, mu_s, direct_transmittance, transmittance_down):
    r"""
    Topographic correction factor: irradiance on a slope over that on level ground.

    .. math::

        K_t = V_d + C_t \, \rho
            + \frac{e^{-\tau / \mu_0}}{T(\theta_s)} \left[ \frac{\mu_s}{\mu_0} - V_d \right]

    Parameters
    ----------
    sky_view, terrain_view : array
        :math:`V_d` and :math:`C_t`. [1]
    reflectance : array
        Of the land around, :math:`\rho`, as it is on level ground. [1]
    mu_s_local : array
        Cosine of the sun's zenith angle on the slope, :math:`\mu_s`; 0 in shadow. [1]
    mu_s : float
        The same on level ground, :math:`\mu_0`. [1]
    direct_transmittance : array
        Of the sunbeam, :math:`e^{-\tau / \mu_0}`. [1]
    transmittance_down : array
        Total, direct and diffuse, :math:`T(\theta_s)`. [1]

    Returns
    -------
    kt : array
        1 on level and open ground. [1]

    Notes
    -----
    The sky is uniform, the land around a slope is as bright as the slope's own cell, and its light comes once.

    References
    ----------
    [Friedl1995]_, Eq. 4; [Dubayah1992]_

    Examples
    --------
    >>> float(topographic_factor(1.0, 0.0, 0.3, 0.8, 0.8, 0.6, 0.9))
    1.0
    """
    direct = direct_transmittance / transmittance_down
    return sky_view + terrain_view * reflectance + direct * (mu_s_local / mu_s - sky_view)


@register_jitable
def upwelling_factor(mu_v_local, mu_v):
    r"""
    Cosine correction of the light that leaves a slope toward the sensor.

    .. math:: \max(\mu_v, 0) / \cos \theta_v

    The paper has no divisor; with it level ground has 1 in any view.

    Parameters
    ----------
    mu_v_local : array
        Cosine of the sensor's zenith angle on the slope, :math:`\mu_v`. [1]
    mu_v : float
        The same on level ground, :math:`\cos \theta_v`. [1]

    Returns
    -------
    factor : array
        1 on level ground, 0 where the slope faces away. [1]

    References
    ----------
    [Friedl1995]_, Eq. 5

    Examples
    --------
    >>> upwelling_factor(np.array([0.5, 1.0, -0.1]), 0.5).tolist()
    [1.0, 2.0, 0.0]
    """
    return np.maximum(mu_v_local, 0.0) / mu_v
