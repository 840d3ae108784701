"""Absorbed photosynthetically active radiation."""

import numpy as np

from fifesim.ground.canopy.layers import layers_of
from fifesim.ground.canopy.leaf_angles import leaf_angle_classes, leaf_projection

FPAR_INF = 0.94
"""FPAR of an infinitely thick canopy [1]; Friedl et al. (1995), below Eq. 6."""


def extinction_coefficient(sza, leaf_angles="spherical"):
    r"""
    Extinction coefficient of the direct beam per leaf area.

    .. math:: K = G(\theta_s) / \mu_s

    Parameters
    ----------
    sza : array
        Below 90. [degree]
    leaf_angles : optional
        Whatever `leaf_angle_classes` accepts. Spherical leaves have exactly :math:`G = 1/2`; others are summed over
        their classes.

    Returns
    -------
    extinction : array, shape of sza
        :math:`K`. [1]

    References
    ----------
    [Monteith1990]_

    Examples
    --------
    Horizontal leaves hide their own area, wherever the sun stands:

    >>> float(round(extinction_coefficient(60.0, "0: 1"), 12))
    1.0
    """
    leaf_angles = leaf_angle_classes(leaf_angles)
    mu_s = np.cos(np.radians(np.asarray(sza, float)))
    if leaf_angles == leaf_angle_classes("spherical"):
        return 0.5 / mu_s
    projection = leaf_projection(np.asarray(leaf_angles.inclination), np.asarray(sza, float)[..., None])
    return projection @ np.asarray(leaf_angles.fraction) / mu_s


def fpar(lai, extinction, fpar_inf=FPAR_INF):
    r"""
    Fraction of photosynthetically active radiation that a canopy absorbs, by Beer's law.

    .. math:: \mathrm{FPAR} = \mathrm{FPAR}_\infty \left[ 1 - e^{-K \, \mathrm{LAI}} \right]

    Parameters
    ----------
    lai : array
        Leaf area index. NaN gives NaN. [m2 m-2]
    extinction : array
        Extinction coefficient :math:`K`; `extinction_coefficient` gives it. [1]
    fpar_inf : array, optional
        FPAR of an infinitely thick canopy. [1]

    Returns
    -------
    fpar : array, shape of the broadcast inputs
        [1]

    References
    ----------
    [Friedl1995]_, Eq. 6

    Examples
    --------
    Bare ground absorbs nothing:

    >>> float(fpar(0.0, 0.57))
    0.0
    """
    return -fpar_inf * np.expm1(-np.asarray(extinction, float) * np.asarray(lai, float))


def green_fpar(lai, extinction, brown, dissociation=0.0, fpar_inf=FPAR_INF):
    r"""
    Fraction of photosynthetically active radiation that the green leaves of a canopy absorb.

    .. math::

        \mathrm{FPAR}_g = \mathrm{FPAR}_\infty \, \big[ &(1 - b_1) \left( 1 - e^{-K L_1} \right) \\
            &+ (1 - b_2) \, e^{-K L_1} \left( 1 - e^{-K L_2} \right) \big]

    Parameters
    ----------
    lai : array
        Leaf area index of both kinds. NaN gives NaN. [m2 m-2]
    extinction, fpar_inf : array
        As in `fpar`. [1]
    brown, dissociation : array
        Dead share :math:`f_B`, and :math:`D`, as in `layers_of`, which gives the layers and their shares. [1]

    Returns
    -------
    fpar : array, shape of the broadcast inputs
        [1]

    Notes
    -----
    Where both kinds are mixed it is FPAR times the green share of the leaf area, as in Hall et al. (1992); green leaves
    above dead ones get the light first.

    References
    ----------
    [Friedl1995]_, Eq. 6; [Hall1992]_

    Examples
    --------
    >>> bool(np.isclose(green_fpar(2.0, 0.57, 0.25), 0.75 * fpar(2.0, 0.57)))
    True
    """
    if not np.ndim(dissociation) and dissociation == 0:
        return (1 - np.asarray(brown, float)) * fpar(lai, extinction, fpar_inf)
    layers, k = layers_of(lai, brown, dissociation), np.asarray(extinction, float)
    above, below = fpar(layers.lai, k, fpar_inf), np.exp(-k * layers.lai) * fpar(layers.lai_below, k, fpar_inf)
    return (1 - layers.brown) * above + (1 - layers.brown_below) * below
