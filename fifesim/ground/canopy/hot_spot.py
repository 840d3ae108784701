"""The hot spot: sun and observer see the same leaves and the same ground, the closer their directions are."""

import numpy as np


def apart(sza, vza, raa):
    """
    Distance of two directions on a horizontal plane one unit below.

    Parameters
    ----------
    sza, vza, raa : array
        [degree]

    Returns
    -------
    distance : array
        0 in the hot spot. [1]

    Examples
    --------
    >>> float(apart(30.0, 30.0, 0.0))
    0.0
    """
    tan_s, tan_v = np.tan(np.radians(sza)), np.tan(np.radians(vza))
    # Without cancellation near the hot spot.
    chord = 4 * tan_s * tan_v * np.sin(np.radians(raa) / 2) ** 2
    return np.sqrt((tan_s - tan_v) ** 2 + chord)


def hotspot_decay(sza, vza, raa, extinction, hotspot):
    """
    Decay of the correlation between the gaps of sun and observer over the canopy's relative depth.

    Parameters
    ----------
    sza, vza, raa : array
        [degree]
    extinction : array
        Of sunbeam and view together, ks + ko. [1]
    hotspot : array
        Ratio of leaf size to canopy height. [1]

    Returns
    -------
    alpha : array
        Infinite without a hot spot. The factor 2 / (ks + ko) is Breon's, as in Verhoef et al. (2007). [1]

    References
    ----------
    [Kuusk1991]_; [Verhoef2007]_
    """
    distance = apart(sza, vza, raa)
    has = hotspot > 0
    return np.where(has, 2 * distance / (extinction * np.where(has, hotspot, 1)), np.inf)


def bidirectional_gap(lai, ks, ko, alpha):
    r"""
    Chance that both beams reach the background, and leaf area that both reach.

    Parameters
    ----------
    lai : array
        Leaf area above. [m2 m-2]
    ks, ko : array
        Extinction of both beams. [1]
    alpha : array
        From `hotspot_decay`; of the upper share x of a canopy, x times that. [1]

    Returns
    -------
    tsstoo, sunlit_and_seen : array
        [1], [m2 m-2]

    Notes
    -----
    The gap fraction to relative depth x is

    .. math:: P(x) = \exp\left[-K L x + \kappa L \, (1 - e^{-\alpha x}) / \alpha \right]

    with :math:`K = k_s + k_o` and :math:`\kappa = \sqrt{k_s k_o}`. Its integral to infinite depth is, by parts again
    and again,

    .. math:: \sum_n (\kappa L)^n \Big/ \prod_{j=0}^n (K L + j \alpha)

    and what lies below :math:`x = 1` is :math:`P(1)` times the same with :math:`\kappa e^{-\alpha}`. As
    :math:`\kappa \le K / 2` each term is at most half of the one before: 56 terms reach rounding, for any hot spot.

    References
    ----------
    [Kuusk1991]_
    """
    extinction, kappa = ks + ko, np.sqrt(ks * ko)
    finite = np.where((alpha > 0) & (alpha < np.inf), alpha, 1)
    overlap = np.where(alpha > 0, np.where(alpha < np.inf, -np.expm1(-finite) / finite, 0), 1)
    tsstoo = np.exp(-(extinction - kappa * overlap) * lai)
    shade = np.exp(-alpha)
    term, below = np.broadcast_arrays(1.0, tsstoo)
    total = term - below
    for n in range(1, 57):
        # At zero depth in the exact hot spot 0 / 0 stands for a term that does not count.
        rate = extinction * lai + n * alpha
        ratio = kappa * lai / np.where(rate > 0, rate, 1)
        term, below = term * ratio, below * ratio * shade
        total = total + (term - below)
    return tsstoo, total / extinction
