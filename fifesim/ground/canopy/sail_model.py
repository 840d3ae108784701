"""SAIL: four-stream radiative transfer in a homogeneous leaf canopy over a background."""

from typing import NamedTuple

import numpy as np

from fifesim.base.geometry import relative_azimuth
from fifesim.ground.canopy.divided_differences import exponential_chain
from fifesim.ground.canopy.hot_spot import bidirectional_gap, hotspot_decay
from fifesim.ground.canopy.leaf_angles import azimuth_limit, leaf_angle_classes, leaf_projection


class Canopy(NamedTuple):
    """
    Reflectances and transmittances of a canopy layer alone; s is the sun, o the observer, d diffuse light [1].

    The first letter is the light that comes in, the second that which leaves. Fields broadcast against each other.
    """

    rso: np.ndarray
    rdo: np.ndarray
    rsd: np.ndarray
    rdd: np.ndarray
    tss: np.ndarray
    too: np.ndarray
    tsd: np.ndarray
    tdo: np.ndarray
    tdd: np.ndarray
    tsstoo: np.ndarray
    """Probability that sun and observer both see a point of the background."""
    rdd_below: np.ndarray
    """As rdd, of light from below; the same where all leaves are alike."""


class Scattering(NamedTuple):
    """Coefficients of the four-stream equations per leaf area, Verhoef's notation. [1]"""

    ks: np.ndarray  # extinction of the sunbeam
    ko: np.ndarray  # and toward the observer
    a: np.ndarray  # loss of the diffuse streams
    sigma: np.ndarray  # exchange between them, backward
    m: np.ndarray  # their eigenvalue, sqrt(a^2 - sigma^2)
    sf: np.ndarray  # sunbeam to diffuse, forward
    sb: np.ndarray  # and backward
    vf: np.ndarray  # upward diffuse to observer
    vb: np.ndarray  # downward diffuse to observer
    w: np.ndarray  # sunbeam to observer


def sail(lai, leaf_reflectance, leaf_transmittance, *, sza, vza=0.0, raa=0.0, leaf_angles="spherical", hotspot=0.0):
    r"""
    Reflectances and transmittances of a leaf canopy by the four-stream SAIL model with Kuusk's hot spot.

    With depth :math:`t` from the top in leaf area, sunlight :math:`E_s`, diffuse light down and up
    :math:`E^-, E^+` and light to the observer :math:`E_o`,

    .. math::

        \dot E_s &= -k_s E_s \\
        \dot E^- &= s_f E_s - a E^- + \sigma E^+ \\
        \dot E^+ &= -s_b E_s - \sigma E^- + a E^+ \\
        \dot E_o &= -w E_s - v_b E^- - v_f E^+ + k_o E_o

    Parameters
    ----------
    lai : array
        Leaf area index. NaN gives NaN. [m2 m-2]
    leaf_reflectance, leaf_transmittance : array
        Their sum must not exceed 1. [1]
    sza, vza, raa : array
        Zenith angles below 90, and relative azimuth with 0 in the hot spot. [degree]
    leaf_angles : optional
        Whatever `leaf_angle_classes` accepts.
    hotspot : array, optional
        Ratio of leaf size to canopy height; 0 for none. [1]

    Returns
    -------
    canopy : Canopy
        Fields of the broadcast shape of all arguments, or broadcastable to it. [1]

    Notes
    -----
    A slab's Green function turns the solution into sums of positive `exponential_chain` terms, which hold for
    conservative and black leaves, at grazing angles and where an extinction coefficient equals the
    eigenvalue. Leaves are Lambertian, with random azimuth and the same optics on both sides. Beside exact radiative
    transfer in a canopy of spherical leaves up to LAI 5, SAIL is within 3 % at nadir.

    References
    ----------
    [Verhoef1984]_; [Verhoef2007]_; [Kuusk1991]_

    Examples
    --------
    What leaves do not absorb is reflected or transmitted:

    >>> canopy = sail(2.0, 0.5, 0.5, sza=30)
    >>> float(round(canopy.rsd + canopy.tsd + canopy.tss, 12))
    1.0
    """
    lai = np.asarray(lai, float)
    rho, tau = np.asarray(leaf_reflectance, float), np.asarray(leaf_transmittance, float)
    raa = relative_azimuth(raa, 0.0)
    c = scattering(rho, tau, sza, vza, raa, leaf_angle_classes(leaf_angles))
    alpha = hotspot_decay(sza, vza, raa, c.ks + c.ko, np.asarray(hotspot, float))
    tsstoo, sunlit_and_seen = bidirectional_gap(lai, c.ks, c.ko, alpha)
    layer = scattered_again(lai, c)
    return layer._replace(rso=c.w * sunlit_and_seen + layer.rso, tsstoo=tsstoo)


def scattered_again(lai, c):
    """
    Reflectances and transmittances of a layer, without the light that the observer gets by one scattering.

    Parameters
    ----------
    lai : array
        [m2 m-2]
    c : Scattering

    Returns
    -------
    canopy : Canopy
        Its rso is of two scatterings or more, its tsstoo without a hot spot. [1]

    References
    ----------
    [Verhoef1984]_; [Verhoef2007]_
    """
    # sinh(m L) / m and A(L) of a slab, both times e^(-m L).
    sinh = exponential_chain(lai, 2 * c.m, 0.0)
    slab = np.exp(-2 * c.m * lai) + (c.a + c.m) * sinh
    tss, too, rdd = np.exp(-c.ks * lai), np.exp(-c.ko * lai), c.sigma * sinh / slab
    return Canopy(
        rso=_multiple_scattering(lai, c) / slab,
        rdo=_turned_back(lai, c, c.ko, c.vf, c.vb) / slab,
        rsd=_turned_back(lai, c, c.ks, c.sf, c.sb) / slab,
        rdd=rdd,
        tss=tss,
        too=too,
        tsd=_passed_on(lai, c, c.ks, c.sf, c.sb) / slab,
        tdo=_passed_on(lai, c, c.ko, c.vf, c.vb) / slab,
        tdd=np.exp(-c.m * lai) / slab,
        tsstoo=tss * too,
        rdd_below=rdd,
    )


def scattering(rho, tau, sza, vza, raa, leaf_angles):
    """
    Coefficients of the four-stream equations, summed over leaf angle classes.

    Parameters
    ----------
    rho, tau : array
        Reflectance and transmittance of the leaves. [1]
    sza, vza, raa : array
        [degree]
    leaf_angles : LeafAngles

    Returns
    -------
    coefficients : Scattering
        Per leaf area. [1]

    References
    ----------
    [Verhoef1984]_
    """
    inclination, fraction = np.asarray(leaf_angles.inclination), np.asarray(leaf_angles.fraction)
    sza, vza, raa = (np.asarray(angle, float)[..., None] for angle in (sza, vza, raa))
    mu_s, mu_v = np.cos(np.radians(sza)), np.cos(np.radians(vza))
    ks = _over_leaves(leaf_projection(inclination, sza) / mu_s, fraction)
    ko = _over_leaves(leaf_projection(inclination, vza) / mu_v, fraction)
    bf = np.cos(np.radians(inclination)) ** 2 @ fraction
    reflected, transmitted = volume_scattering(inclination, sza, vza, raa)
    scattered = [_over_leaves(phase / (mu_s * mu_v), fraction) for phase in (reflected, transmitted)]
    sigma = ((1 + bf) * rho + (1 - bf) * tau) / 2
    absorbed = 1 - rho - tau
    return Scattering(
        ks=ks,
        ko=ko,
        a=absorbed + sigma,
        sigma=sigma,
        # a^2 - sigma^2 in factors: exact for conservative leaves, where it vanishes.
        m=np.sqrt(np.maximum(absorbed, 0) * (absorbed + 2 * sigma)),
        sf=((ks - bf) * rho + (ks + bf) * tau) / 2,
        sb=((ks + bf) * rho + (ks - bf) * tau) / 2,
        vf=((ko - bf) * rho + (ko + bf) * tau) / 2,
        vb=((ko + bf) * rho + (ko - bf) * tau) / 2,
        w=np.pi * (scattered[0] * rho + scattered[1] * tau),
    )


def _over_leaves(values, fraction):
    """Sum over leaf angles; a matrix product's last bits would depend on how many cells there are."""
    return np.sum(values * fraction, axis=-1)


def volume_scattering(inclination, sza, vza, raa):
    """
    Bidirectional area scattering of leaves of one inclination and random azimuth.

    Parameters
    ----------
    inclination : array
        Leaf inclination. [degree]
    sza, vza, raa : array
        [degree]

    Returns
    -------
    reflected, transmitted : array, shape of the broadcast inputs
        Weights of leaf reflectance and transmittance. [sr-1]

    References
    ----------
    [Verhoef1984]_

    Examples
    --------
    A horizontal leaf transmits nothing to an observer above:

    >>> reflected, transmitted = volume_scattering(0.0, 0.0, 60.0, 0.0)
    >>> float(transmitted)
    0.0
    """
    beta_s, cos_s, sin_s = azimuth_limit(inclination, sza)
    beta_o, cos_o, sin_o = azimuth_limit(inclination, vza)
    psi = np.radians(raa)
    near, far = np.abs(beta_s - beta_o), np.pi - np.abs(beta_s + beta_o - np.pi)
    first, middle, last = np.minimum(psi, near), np.clip(psi, near, far), np.maximum(psi, far)
    product = 2 * np.maximum(cos_s, sin_s) * np.maximum(cos_o, sin_o)
    even = 2 * cos_s * cos_o + sin_s * sin_o * np.cos(psi)
    odd = np.sin(middle) * (product + sin_s * sin_o * np.cos(first) * np.cos(last))
    # Rounding takes either a hair below zero.
    reflected = np.maximum((np.pi - middle) * even + odd, 0) / (2 * np.pi**2)
    return reflected, np.maximum(odd - middle * even, 0) / (2 * np.pi**2)


# The diffuse streams of a slab, lit from one side over black ground, are with u the leaf area still ahead
#     toward the far side  A(u) = cosh(m u) + a sinh(m u) / m,   back  B(u) = sigma sinh(m u) / m,
# both over A(L). Writing A(u) = e^(-m u) + (a + m) sinh(m u) / m leaves positive terms only, and sinh(m u) / m is
# the chain of -m and m. All chains carry a factor e^(-m L) against overflow: each rate is m higher.


def _turned_back(lai, c, k, forward, backward):
    """Beam of extinction k that leaves as diffuse light where it came in, times A(L) e^(-m L)."""
    again = (c.a + c.m) * backward + c.sigma * forward
    beam = k + c.m
    return backward * exponential_chain(lai, beam, 2 * c.m) + again * exponential_chain(lai, beam, 2 * c.m, 0.0)


def _passed_on(lai, c, k, forward, backward):
    """Beam of extinction k that leaves as diffuse light on the far side, times A(L) e^(-m L)."""
    again = (c.a + c.m) * forward + c.sigma * backward
    beam = k + 2 * c.m
    return forward * exponential_chain(lai, beam, c.m) + again * exponential_chain(lai, beam, k, c.m)


def _multiple_scattering(lai, c):
    """Sunlight that reaches the observer after two scatterings or more, times A(L) e^(-m L)."""
    down = _between(lai, c, c.ko, (c.sf, c.sb), (c.vb, c.vf))
    return down + _between(lai, c, c.ks, (c.vf, c.vb), (c.sb, c.sf))


def _between(lai, c, k, upper, lower):
    """
    Paths with the scatterings of one beam above those of the other, whose extinction is k.

    Both beams cross the leaves above the upper scattering, the other beam alone those between. Above and below, the
    diffuse light is as in `_passed_on` and `_turned_back`.
    """
    (forward, backward), (turned, kept) = upper, lower
    forward_again = (c.a + c.m) * forward + c.sigma * backward
    turned_again = (c.a + c.m) * turned + c.sigma * kept
    both, one, m2 = c.ks + c.ko, k + c.m, 2 * c.m
    direct = exponential_chain(lai, both + m2, one, m2)
    from_above = exponential_chain(lai, both + m2, both, one, m2)
    from_below = exponential_chain(lai, both + m2, one, m2, 0.0)
    from_either = exponential_chain(lai, both + m2, both, one, m2, 0.0)
    return turned * (forward * direct + forward_again * from_above) + turned_again * (
        forward * from_below + forward_again * from_either
    )
