"""Green and dead leaves in one canopy: two SAIL layers of which each is a mixture of both."""

from typing import NamedTuple

import numpy as np

from fifesim.base.geometry import relative_azimuth
from fifesim.ground.canopy.hot_spot import bidirectional_gap, hotspot_decay
from fifesim.ground.canopy.leaf_angles import leaf_angle_classes
from fifesim.ground.canopy.sail_model import Canopy, scattered_again, scattering


class Layers(NamedTuple):
    """How leaves of two kinds lie above each other; fields broadcast against each other."""

    lai: np.ndarray
    """Leaf area of the upper layer. [m2 m-2]"""
    lai_below: np.ndarray
    """And of the lower one. [m2 m-2]"""
    brown: np.ndarray
    """Dead share of the leaf area in the upper layer. [1]"""
    brown_below: np.ndarray
    """And in the lower one. [1]"""


def layers_of(lai, brown, dissociation):
    r"""
    Leaf areas of two layers, and their shares of dead leaves.

    .. math::

        L_1 &= (1 - f_B) \, L, \quad & b_1 &= (1 - D) \, f_B \\
        L_2 &= f_B \, L, & b_2 &= 1 - (1 - D) (1 - f_B)

    Parameters
    ----------
    lai : array
        Of the canopy, :math:`L`. [m2 m-2]
    brown : array
        Dead share of it, :math:`f_B`. [1]
    dissociation : array
        :math:`D`: 0 where all leaves are mixed, 1 where the dead ones lie below. [1]

    Returns
    -------
    layers : Layers

    References
    ----------
    [VerhoefBach2007]_

    Examples
    --------
    What is dead above and below is what is dead in all:

    >>> layers = layers_of(3.0, 0.4, 0.5)
    >>> round(float(layers.lai * layers.brown + layers.lai_below * layers.brown_below), 12)
    1.2
    """
    lai, brown, mixed = np.asarray(lai, float), np.asarray(brown, float), 1 - np.asarray(dissociation, float)
    return Layers((1 - brown) * lai, brown * lai, mixed * brown, 1 - mixed * (1 - brown))


def two_layers(
    lai,
    leaf_reflectance,
    leaf_transmittance,
    brown_reflectance,
    brown_transmittance,
    *,
    brown,
    dissociation=0.0,
    sza,
    vza=0.0,
    raa=0.0,
    leaf_angles="spherical",
    hotspot=0.0,
):
    r"""
    Reflectances and transmittances of a canopy of green and dead leaves, after 4SAIL2.

    Parameters
    ----------
    lai : array
        Leaf area index of both kinds together. NaN gives NaN. [m2 m-2]
    leaf_reflectance, leaf_transmittance, brown_reflectance, brown_transmittance : array
        Of green leaves, and of dead ones. [1]
    brown, dissociation : array
        As in `layers_of`. [1]
    sza, vza, raa, leaf_angles, hotspot
        As in `sail`, the same in both layers; the hot spot is one over the depth of both.

    Returns
    -------
    canopy : Canopy
        Fields of the broadcast shape of all arguments, or broadcastable to it. [1]

    Notes
    -----
    Each layer has the mean optics of its leaves, and the two are added. What the observer gets by one scattering is
    :math:`w_1 A_1 + w_2 A_2` with the leaf areas :math:`A` that sun and observer both reach in each, from Kuusk's
    gap over both; its integral is the series of `bidirectional_gap`, for which the authors' program takes 20 steps.

    References
    ----------
    [VerhoefBach2007]_; [Kuusk1991]_

    Examples
    --------
    Leaves that are alike are one canopy, wherever they lie:

    >>> from fifesim.ground.canopy.sail_model import sail
    >>> both = two_layers(3.0, 0.45, 0.42, 0.45, 0.42, brown=0.4, dissociation=0.7, sza=30, hotspot=0.1)
    >>> bool(abs(both.rso - sail(3.0, 0.45, 0.42, sza=30, hotspot=0.1).rso) < 1e-14)
    True
    """
    raa = relative_azimuth(raa, 0.0)
    green, dead = (leaf_reflectance, leaf_transmittance), (brown_reflectance, brown_transmittance)
    layers = layers_of(lai, brown, dissociation)
    angles = sza, vza, raa, leaf_angle_classes(leaf_angles)
    upper = scattering(*mixed(green, dead, layers.brown), *angles)
    lower = scattering(*mixed(green, dead, layers.brown_below), *angles)
    alpha = hotspot_decay(sza, vza, raa, upper.ks + upper.ko, np.asarray(hotspot, float))
    # Without a hot spot the decay is infinite, which no share of the depth makes less.
    none = np.isinf(alpha)
    alpha_above = np.where(none, np.inf, np.where(none, 0, alpha) * (1 - np.asarray(brown, float)))
    lai = np.asarray(lai, float)
    tsstoo, seen = bidirectional_gap(lai, upper.ks, upper.ko, alpha)
    _, seen_above = bidirectional_gap(layers.lai, upper.ks, upper.ko, alpha_above)
    both = added(scattered_again(layers.lai, upper), scattered_again(layers.lai_below, lower))
    once = upper.w * seen_above + lower.w * (seen - seen_above)
    return both._replace(rso=once + both.rso, tsstoo=tsstoo)


def mixed(green, dead, brown):
    """
    Mean optics of leaves of two kinds.

    Parameters
    ----------
    green, dead : (array, array)
        Reflectance and transmittance. [1]
    brown : array
        Share of the dead ones. [1]

    Returns
    -------
    reflectance, transmittance : array
        [1]

    Examples
    --------
    >>> [float(each) for each in mixed((0.5, 0.25), (0.25, 0.25), 0.5)]
    [0.375, 0.25]
    """
    pairs = ((np.asarray(one, float), np.asarray(other, float)) for one, other in zip(green, dead, strict=True))
    return tuple(one + brown * (other - one) for one, other in pairs)


def added(top, bottom):
    r"""
    One layer over another, by adding.

    .. math::

        r_{so} = r_{so}^1 + \left( \tau_{ss}^1 r_{so}^2 + D \, r_{do}^2 \right) \tau_{oo}^1 + U \, \tau_{do}^1, \quad
        U = \frac{\tau_{ss}^1 r_{sd}^2 + \tau_{sd}^1 r_{dd}^2}{1 - r_{dd}^1 r_{dd}^2}, \quad
        D = \tau_{sd}^1 + r_{dd}^1 U

    with the diffuse light :math:`D` down and :math:`U` up between them, and likewise for the others.

    Parameters
    ----------
    top, bottom : Canopy

    Returns
    -------
    canopy : Canopy
        Its tsstoo without a hot spot. [1]

    References
    ----------
    [Verhoef1985]_

    Examples
    --------
    Half a canopy over the other half:

    >>> from fifesim.ground.canopy.sail_model import sail
    >>> half, whole = (sail(lai, 0.45, 0.42, sza=30) for lai in (1.0, 2.0))
    >>> bool(abs(added(half, half).rso - whole.rso) < 1e-14)
    True
    """
    back_and_forth = 1 / (1 - top.rdd_below * bottom.rdd)
    up = (top.tss * bottom.rsd + top.tsd * bottom.rdd) * back_and_forth
    down = top.tsd + top.rdd_below * up
    # Diffuse light that the observer gets of what comes up between the layers, and of what goes down there.
    seen_up = (top.tdo + top.rdd_below * bottom.rdo * top.too) * back_and_forth
    sky_up = top.tdd * bottom.rdd * back_and_forth
    sky_down = top.tdd * back_and_forth
    return Canopy(
        rso=top.rso + (top.tss * bottom.rso + down * bottom.rdo) * top.too + up * top.tdo,
        rdo=top.rdo + sky_down * bottom.rdo * top.too + sky_up * top.tdo,
        rsd=top.rsd + up * top.tdd,
        rdd=top.rdd + sky_up * top.tdd,
        tss=top.tss * bottom.tss,
        too=top.too * bottom.too,
        tsd=top.tss * bottom.tsd + down * bottom.tdd,
        tdo=bottom.tdo * top.too + bottom.tdd * seen_up,
        tdd=sky_down * bottom.tdd,
        tsstoo=top.tsstoo * bottom.tsstoo,
        rdd_below=bottom.rdd_below + bottom.tdd * top.rdd_below * bottom.tdd * back_and_forth,
    )
