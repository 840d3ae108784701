"""SAIL: four-stream radiative transfer in a homogeneous leaf canopy with hot spot over a background."""

import math
from typing import NamedTuple

import numba
import numpy as np
from numba.extending import register_jitable

from fifesim.base.geometry import relative_azimuth
from fifesim.ground.canopy.leaf_angles import azimuth_limit, leaf_angle_classes, leaf_projection


class Surface(NamedTuple):
    """Reflectances of canopy and background together, with the names of `Canopy`. [1]"""

    rso: np.ndarray
    rdo: np.ndarray
    rsd: np.ndarray
    rdd: np.ndarray


def with_background(canopy, background):
    r"""
    Reflectances of a canopy over a Lambertian background.

    .. math::

        r_{so}^* &= r_{so} + (\tau_{ssoo} - \tau_{ss} \tau_{oo}) \, r \\
            &\quad + (\tau_{ss} + \tau_{sd}) \, \frac{r}{1 - r \, r_{dd}} \, (\tau_{oo} + \tau_{do})

    and likewise, without the second term, for the other three; :math:`r_{dd}` is for light from below.

    Parameters
    ----------
    canopy : Canopy
    background : array
        Reflectance :math:`r` of the background, a number or any shape that broadcasts. [1]

    Returns
    -------
    surface : Surface
        [1]

    References
    ----------
    [Verhoef2007]_

    Examples
    --------
    Without leaves the background is seen as it is:

    >>> from fifesim.ground.canopy.sail_model import sail
    >>> float(with_background(sail(0.0, 0.1, 0.1, sza=30), 0.15).rso)
    0.15
    """
    c, r = canopy, np.asarray(background, float)
    returned = r / (1 - r * c.rdd_below)
    sun_down, to_observer = c.tss + c.tsd, c.too + c.tdo
    return Surface(
        rso=c.rso + (c.tsstoo - c.tss * c.too) * r + sun_down * returned * to_observer,
        rdo=c.rdo + c.tdd * returned * to_observer,
        rsd=c.rsd + sun_down * returned * c.tdd,
        rdd=c.rdd + c.tdd * returned * c.tdd,
    )


@register_jitable
def over_background(alone, hot, through, rdd, background):
    r"""
    Reflectance factor of a canopy over a background, from terms of its layer.

    .. math:: \rho = A + r \left( B + \frac{C}{1 - r \, r_{dd}} \right)

    Parameters
    ----------
    alone : array
        A, of the canopy over black ground. [1]
    hot : array
        B, of the ground in the gaps that sun and observer share beyond chance. [1]
    through : array
        C, by the transmittance down and up. [1]
    rdd : array
        Reflectance of the canopy from below. [1]
    background : array
        r. [1]

    Returns
    -------
    reflectance : array
        That of `with_background` to rounding, mixed by `reflectance_factor`. [1]

    References
    ----------
    [Verhoef2007]_

    Examples
    --------
    >>> over_background(0.0, 0.0, 1.0, 0.0, 0.15)
    0.15
    """
    return alone + background * (hot + through / (1 - background * rdd))


def reflectance_factor(rso, rdo, diffuse_fraction):
    r"""
    Reflectance factor under a mixture of sunlight and isotropic skylight.

    .. math:: \rho = (1 - f) \, r_{so} + f \, r_{do}

    Parameters
    ----------
    rso, rdo : array
        Bidirectional and hemispherical-directional reflectance factors. [1]
    diffuse_fraction : array
        Share :math:`f` of skylight in the irradiance; 0 is sunlight alone. [1]

    Returns
    -------
    reflectance : array, shape of the broadcast inputs
        [1]

    References
    ----------
    [SchaepmanStrub2006]_

    Examples
    --------
    >>> reflectance_factor(0.5, 0.25, 0.5)
    0.375
    """
    return (1 - diffuse_fraction) * rso + diffuse_fraction * rdo


def direction_distance(sza, vza, raa):
    """Distance between two directions on a horizontal plane one unit below, 0 in the hot spot. [1]"""
    tan_s, tan_v = np.tan(np.radians(sza)), np.tan(np.radians(vza))
    # Without cancellation near the hot spot.
    chord = 4 * tan_s * tan_v * np.sin(np.radians(raa) / 2) ** 2
    return np.sqrt((tan_s - tan_v) ** 2 + chord)


def hotspot_decay(sza, vza, raa, extinction, hotspot):
    """
    Decay of the correlation between the gaps of sun and observer with the relative depth of the canopy.

    Parameters
    ----------
    sza, vza, raa : array
        [degree]
    extinction : array
        Extinction of direct beam and view together, ks + ko. [1]
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
    distance = direction_distance(sza, vza, raa)
    has = hotspot > 0
    return np.where(has, 2 * distance / (extinction * np.where(has, hotspot, 1)), np.inf)


def bidirectional_gap(lai, ks, ko, alpha):
    r"""
    Probability that both beams reach the background, and the leaf area that both reach.

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

    and the part below :math:`x = 1` is :math:`P(1)` times the same with :math:`\kappa e^{-\alpha}`. As
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


# The Taylor series takes over below this spread of exponents; recursion loses no more than a digit above it.
_SPREAD = 2.0
_TERMS = 22


def exponential_chain(lai, *rates):
    r"""
    Transmission through a layer whose light changes its attenuation rate at every possible depth.

    .. math::

        C(L; r_0 \dots r_n) &= L^n \exp[-r_0 L, \dots, -r_n L] \\
            &= \int\limits_{0 < t_1 < \dots < t_n < L}
            e^{-r_0 t_1 - r_1 (t_2 - t_1) - \dots - r_n (L - t_n)} \, dt_1 \dots dt_n

    Parameters
    ----------
    lai : array
        Depth of the layer, :math:`L`. [1]
    *rates : array
        Attenuation rates :math:`r_i` per leaf area, two to five. They may be equal, and in any order. [1]

    Returns
    -------
    chain : array, shape of the broadcast inputs

    Notes
    -----
    The brackets denote a divided difference. SAIL's functions J1 and J2 are chains of two rates, and where they
    are singular the two are equal. Close exponents go through a Taylor series about their centre, distant
    ones through the recursion for divided differences; so no rate is singular.

    References
    ----------
    [McCurdy1984]_

    Examples
    --------
    Equal rates are no singular case:

    >>> float(exponential_chain(3.0, 0.0, 0.0, 0.0))
    4.5
    """
    given = [np.asarray(each, float) for each in (lai, *rates)]
    flat = np.empty((len(given), *np.broadcast_shapes(*(each.shape for each in given))))
    for number, each in enumerate(given):
        flat[number] = each
    shape, flat = flat.shape[1:], flat.reshape(len(given), -1)
    chains = np.empty(flat.shape[1])
    _chains(flat[0], flat[1:], chains)
    return chains.reshape(shape)[()]


@numba.njit(nogil=True, cache=True)
def _chains(lai, rates, chains):
    """Divided differences of the exponential over all exponents of each cell, times a power of the depth."""
    count = rates.shape[0]
    x, difference, homogeneous = np.empty(count), np.empty(count), np.empty(count)
    for cell in range(lai.size):
        _sort_exponents(lai[cell], rates[:, cell], x)
        if math.isnan(x[0]):
            chains[cell] = math.nan
            continue
        if x[-1] - x[0] < _SPREAD:
            difference[0] = _series(x, 0, count, homogeneous)
        else:
            _recursion(x, difference, homogeneous)
        chains[cell] = lai[cell] ** (count - 1) * difference[0]


@numba.njit(nogil=True, cache=True)
def _sort_exponents(lai, rates, x):
    """Sort the exponents by insertion, NaN first; the recursion divides by the widest difference."""
    for i in range(x.size):
        exponent = -rates[i] * lai
        if math.isnan(exponent):
            x[0] = math.nan
            return
        j = i
        while j > 0 and x[j - 1] > exponent:
            x[j] = x[j - 1]
            j -= 1
        x[j] = exponent


@numba.njit(nogil=True, cache=True)
def _recursion(x, difference, homogeneous):
    """Divided differences over distant exponents, by recursion on their number."""
    for i in range(x.size):
        difference[i] = np.exp(x[i])
    for order in range(1, x.size):
        for i in range(x.size - order):
            spread = x[i + order] - x[i]
            if spread < _SPREAD:
                difference[i] = _series(x, i, order + 1, homogeneous)
            else:
                difference[i] = (difference[i + 1] - difference[i]) / spread


@numba.njit(nogil=True, cache=True)
def _series(x, start, count, homogeneous):
    """Divided difference over close exponents: e^c sum_n h_n(x - c) / (n + count - 1)!, h_n homogeneous."""
    centre = (x[start] + x[start + count - 1]) / 2
    # homogeneous[j] is the complete homogeneous polynomial of one degree in the first j + 1 offsets.
    homogeneous[:count] = 1.0
    factorial = 1.0
    for n in range(2, count):
        factorial *= n
    total = 1 / factorial
    for n in range(1, _TERMS):
        factorial *= n + count - 1
        homogeneous[0] *= x[start] - centre
        for j in range(1, count):
            homogeneous[j] = homogeneous[j - 1] + (x[start + j] - centre) * homogeneous[j]
        total += homogeneous[count - 1] / factorial
    return math.exp(centre) * total


class CanopyLayer(NamedTuple):
    """Reflectances and transmittances of a canopy layer: s sun, o observer, d diffuse light; in, then out. [1]"""

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


class LeafScattering(NamedTuple):
    """Coefficients of the four-stream equations per leaf area, in the notation of Verhoef. [1]"""

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
    Leaves without absorption conserve energy:

    >>> canopy = sail(2.0, 0.5, 0.5, sza=30)
    >>> float(round(canopy.rsd + canopy.tsd + canopy.tss, 12))
    1.0
    """
    lai = np.asarray(lai, float)
    rho, tau = np.asarray(leaf_reflectance, float), np.asarray(leaf_transmittance, float)
    raa = relative_azimuth(raa, 0.0)
    c = leaf_scattering(rho, tau, sza, vza, raa, leaf_angle_classes(leaf_angles))
    alpha = hotspot_decay(sza, vza, raa, c.ks + c.ko, np.asarray(hotspot, float))
    tsstoo, sunlit_and_seen = bidirectional_gap(lai, c.ks, c.ko, alpha)
    layer = scattered_again(lai, c)
    return layer._replace(rso=c.w * sunlit_and_seen + layer.rso, tsstoo=tsstoo)


def scattered_again(lai, c):
    """
    Reflectances and transmittances of a layer, without the single scattering toward the observer.

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
    return CanopyLayer(
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


def leaf_scattering(rho, tau, sza, vza, raa, leaf_angles):
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
    return LeafScattering(
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
    """Sum over leaf angles, whose last bits, unlike those in a matrix product, do not depend on the number of cells."""
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
    """Beam of extinction k converted to diffuse light that leaves on the side of entry, times A(L) e^(-m L)."""
    again = (c.a + c.m) * backward + c.sigma * forward
    beam = k + c.m
    return backward * exponential_chain(lai, beam, 2 * c.m) + again * exponential_chain(lai, beam, 2 * c.m, 0.0)


def _passed_on(lai, c, k, forward, backward):
    """Beam of extinction k converted to diffuse light that leaves on the far side, times A(L) e^(-m L)."""
    again = (c.a + c.m) * forward + c.sigma * backward
    beam = k + 2 * c.m
    return forward * exponential_chain(lai, beam, c.m) + again * exponential_chain(lai, beam, k, c.m)


def _multiple_scattering(lai, c):
    """Sunlight that reaches the observer after two or more scatterings, times A(L) e^(-m L)."""
    down = _between(lai, c, c.ko, (c.sf, c.sb), (c.vb, c.vf))
    return down + _between(lai, c, c.ks, (c.vf, c.vb), (c.sb, c.sf))


def _between(lai, c, k, upper, lower):
    """Paths with the scatterings of one beam, of extinction k, above those by the other."""
    # Both beams cross the leaves above the upper scattering, only the other beam those between. Above and below, the
    # diffuse light is as in `_passed_on` and `_turned_back`.
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
