"""SAIL: four-stream radiative transfer in a homogeneous leaf canopy with hot spot over a background, also on slopes."""

import math
from typing import NamedTuple

import numpy as np

from fifesim.base.arrays import as_rows, compiled, distinct_columns, jitable, numbers
from fifesim.base.geometry import relative_azimuth
from fifesim.ground.canopy.leaf_angles import RADIANS_PER_DEGREE, azimuth_limit, leaf_angle_classes, leaf_projection


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
    """
    c, r = canopy, numbers(background)
    returned = r / (1 - r * c.rdd_below)
    sun_down, to_observer = c.tss + c.tsd, c.too + c.tdo
    return Surface(
        rso=c.rso + (c.tsstoo - c.tss * c.too) * r + sun_down * returned * to_observer,
        rdo=c.rdo + c.tdd * returned * to_observer,
        rsd=c.rsd + sun_down * returned * c.tdd,
        rdd=c.rdd + c.tdd * returned * c.tdd,
    )


@jitable
def over_background(alone, hot, through, rdd, background):
    r"""
    Reflectance factor of a canopy over a background r, from terms of its layer. [1] :math:`\rho = A + r \left( B +
    \frac{C}{1 - r \, r_{dd}} \right)` with A the canopy over black ground, B the ground in the gaps that sun and
    observer share beyond chance, C the transmittance down and up, and the reflectance from below; `with_background` to
    rounding, mixed by `reflectance_factor`. [Verhoef2007]_
    """
    return alone + background * (hot + through / (1 - background * rdd))


def reflectance_factor(rso, rdo, diffuse_fraction):
    r"""
    Reflectance factor under sunlight and a share f of isotropic skylight, [SchaepmanStrub2006]_. [1] :math:`\rho = (1 -
    f) \, r_{so} + f \, r_{do}`
    """
    return (1 - diffuse_fraction) * rso + diffuse_fraction * rdo


def direction_distance(sza, vza, raa):
    """Distance between two directions on a horizontal plane one unit below, 0 in the hot spot. [1]"""
    sza, vza, raa = (np.multiply(angle, RADIANS_PER_DEGREE) for angle in (sza, vza, raa))
    tan_s, tan_v = np.tan(sza), np.tan(vza)
    # Without cancellation near the hot spot.
    chord = 4 * tan_s * tan_v * np.sin(raa / 2) ** 2
    return np.sqrt((tan_s - tan_v) ** 2 + chord)


def hotspot_decay(sza, vza, raa, extinction, hotspot):
    """
    Decay of the correlation between the gaps of sun and observer with the relative depth of the canopy. [1] Infinite
    without a hot spot. The factor 2 / (ks + ko) is Breon's, as in [Verhoef2007]_; the decay is [Kuusk1991]_.
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
    shape, flat = as_rows(lai, ks, ko, alpha)
    gaps = np.empty((2, flat.shape[1]), flat.dtype)
    _gaps(*flat, gaps)
    tsstoo, seen = gaps.reshape(2, *shape)
    return tsstoo[()], seen[()]


@compiled
def _gaps(lai, ks, ko, alpha, gaps):
    """Gap fraction of both beams, and its integral, for each cell."""
    for cell in range(lai.size):
        depth, decay = lai[cell], alpha[cell]
        extinction, kappa = ks[cell] + ko[cell], np.sqrt(ks[cell] * ko[cell])
        if decay.real == np.inf:
            through = np.exp(-extinction * depth)
            gaps[0, cell], gaps[1, cell] = through, _of_two(depth, extinction, 0 * extinction, through, 1 + 0 * through)
            continue
        shade = np.exp(-decay)
        overlap = _of_two(1 + 0 * decay, decay, 0 * decay, shade, 1 + 0 * shade)
        through = np.exp(-(extinction - kappa * overlap) * depth)
        # At zero depth in the exact hot spot 0 / 0 stands for a term that does not count.
        term, below = 1 + 0 * through, through
        total, n = term - below, 0
        while n < 56 and abs(term) > 1e-18:
            n += 1
            rate = extinction * depth + n * decay
            ratio = kappa * depth / rate if rate.real > 0 else 0 * rate
            term, below = term * ratio, below * ratio * shade
            total += term - below
        gaps[0, cell], gaps[1, cell] = through, total / extinction


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
    """
    shape, flat = as_rows(lai, *rates)
    chains = np.empty(flat.shape[1], flat.dtype)
    _chains(flat[0], flat[1:], chains)
    return chains.reshape(shape)[()]


@compiled
def _chains(lai, rates, chains):
    """Divided differences of the exponential over all exponents of each cell, times a power of the depth."""
    count = rates.shape[0]
    x, difference, homogeneous = np.empty_like(rates[:, 0]), np.empty_like(rates[:, 0]), np.empty_like(rates[:, 0])
    for cell in range(lai.size):
        _sort_exponents(lai[cell], rates[:, cell], x)
        if np.isnan(x[0]):
            chains[cell] = math.nan
            continue
        if (x[-1] - x[0]).real < _SPREAD:
            difference[0] = _series(x, 0, count, homogeneous)
        else:
            _recursion(x, difference, homogeneous)
        chains[cell] = lai[cell] ** (count - 1) * difference[0]


@jitable
def _sort_exponents(lai, rates, x):
    """Sort the exponents by insertion, NaN first; the recursion divides by the widest difference."""
    for i in range(x.size):
        exponent = -rates[i] * lai
        if np.isnan(exponent):
            x[0] = math.nan
            return
        j = i
        while j > 0 and x[j - 1].real > exponent.real:
            x[j] = x[j - 1]
            j -= 1
        x[j] = exponent


@compiled
def _recursion(x, difference, homogeneous):
    """Divided differences over distant exponents, by recursion on their number."""
    for i in range(x.size):
        difference[i] = np.exp(x[i])
    for order in range(1, x.size):
        for i in range(x.size - order):
            spread = x[i + order] - x[i]
            if spread.real < _SPREAD:
                difference[i] = _series(x, i, order + 1, homogeneous)
            else:
                difference[i] = (difference[i + 1] - difference[i]) / spread


@jitable
def _series(x, start, count, homogeneous):
    """Divided difference over close exponents: e^c sum_n h_n(x - c) / (n + count - 1)!, h_n homogeneous."""
    centre = (x[start] + x[start + count - 1]) / 2
    # homogeneous[j] is the complete homogeneous polynomial of one degree in the first j + 1 offsets.
    homogeneous[:count] = 1.0
    factorial = 1.0
    for n in range(2, count):
        factorial *= n
    total = homogeneous[0] / factorial
    for n in range(1, _TERMS):
        factorial *= n + count - 1
        homogeneous[0] *= x[start] - centre
        for j in range(1, count):
            homogeneous[j] = homogeneous[j - 1] + (x[start + j] - centre) * homogeneous[j]
        total += homogeneous[count - 1] / factorial
    return np.exp(centre) * total


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
    tsstoo: np.ndarray  # probability that sun and observer both see a point of the background
    rdd_below: np.ndarray  # as rdd, of light from below; the same where all leaves are alike


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
    """
    lai, rho, tau = numbers(lai), numbers(leaf_reflectance), numbers(leaf_transmittance)
    raa = folded(raa)
    c = leaf_scattering(rho, tau, sza, vza, raa, leaf_angle_classes(leaf_angles))
    alpha = hotspot_decay(sza, vza, raa, c.ks + c.ko, numbers(hotspot))
    tsstoo, sunlit_and_seen = bidirectional_gap(lai, c.ks, c.ko, alpha)
    layer = scattered_again(lai, c)
    return layer._replace(rso=c.w * sunlit_and_seen + layer.rso, tsstoo=tsstoo)


def scattered_again(lai, c):
    """
    CanopyLayer of a leaf area [m2 m-2] and LeafScattering, without the single scattering toward the observer. Its rso
    is of two scatterings or more, its tsstoo without a hot spot. [Verhoef1984]_; [Verhoef2007]_
    """
    shape, flat = as_rows(lai, c.ks, c.ko, c.a, c.sigma, c.m, c.sf, c.sb, c.vf, c.vb)
    out = np.empty((9, flat.shape[1]), flat.dtype)
    nearly_vertical = np.zeros(flat.shape[1], bool)
    _slabs(*flat, out, nearly_vertical)
    if nearly_vertical.any():
        out[:, nearly_vertical] = _by_chains(*flat[:, nearly_vertical])
    rso, rdo, rsd, rdd, tss, too, tsd, tdo, tdd = (each[()] for each in out.reshape(9, *shape))
    return CanopyLayer(rso, rdo, rsd, rdd, tss, too, tsd, tdo, tdd, tss * too, rdd)


def folded(raa):
    """Relative azimuth folded to 0 to 180 degrees, also of complex numbers."""
    if not np.iscomplexobj(raa):
        return relative_azimuth(raa, 0.0)
    turned = np.real(raa) % 360
    return np.where(turned > 180, -1, 1) * 1j * np.imag(raa) + relative_azimuth(np.real(raa), 0.0)


def leaf_scattering(rho, tau, sza, vza, raa, leaf_angles):
    """LeafScattering of leaf optics [1] and directions [degree], summed over leaf angle classes, [Verhoef1984]_."""
    sums = leaf_angle_sums(sza, vza, raa, leaf_angles)
    return _scattering(rho, tau, sums, sums.bf, sums.bf, sums.bf)


def _scattering(rho, tau, sums, to_sun, to_view, both, sun_path=1.0, view_path=1.0):
    """LeafScattering for mean products of leaf normals, and for path lengths over those on level ground."""
    ks, ko = sums.ks * sun_path, sums.ko * view_path
    sigma, absorbed = ((1 + both) * rho + (1 - both) * tau) / 2, 1 - rho - tau
    return LeafScattering(
        ks=ks,
        ko=ko,
        a=absorbed + sigma,
        sigma=sigma,
        # a^2 - sigma^2 in factors: exact for conservative leaves, where it vanishes.
        m=np.sqrt(np.maximum(absorbed, 0) * (absorbed + 2 * sigma)),
        sf=((ks - to_sun) * rho + (ks + to_sun) * tau) / 2,
        sb=((ks + to_sun) * rho + (ks - to_sun) * tau) / 2,
        vf=((ko - to_view) * rho + (ko + to_view) * tau) / 2,
        vb=((ko + to_view) * rho + (ko - to_view) * tau) / 2,
        w=(sums.reflected * rho + sums.transmitted * tau) * sun_path * view_path,
    )


class LeafAngleSums(NamedTuple):
    """Sums over leaf angle classes, which depend on the directions alone. [1]"""

    ks: np.ndarray  # extinction of the sunbeam
    ko: np.ndarray  # and toward the observer
    bf: float  # mean squared cosine of the leaf inclination
    reflected: np.ndarray  # weight of leaf reflectance in the scattering from the sun to the observer
    transmitted: np.ndarray  # and of leaf transmittance


def leaf_angle_sums(sza, vza, raa, leaf_angles):
    """LeafAngleSums of directions [degree], of their broadcast shape, for a LeafAngles."""
    inclination, fraction = np.asarray(leaf_angles.inclination), np.asarray(leaf_angles.fraction)
    bf = np.cos(inclination * RADIANS_PER_DEGREE) ** 2 @ fraction
    shape, flat = as_rows(sza, vza, raa)
    if shape:
        # The sums cost more than SAIL, and views of one column of a scan are often the same.
        first, kind = distinct_columns(flat)
        flat = flat[:, first]
    sun, view, azimuth = flat[..., None]
    mu_s, mu_v = np.cos(sun * RADIANS_PER_DEGREE), np.cos(view * RADIANS_PER_DEGREE)
    reflected, transmitted = volume_scattering(inclination, sun, view, azimuth)
    terms = leaf_projection(inclination, sun) / mu_s, leaf_projection(inclination, view) / mu_v
    terms += np.pi * (reflected / (mu_s * mu_v)), np.pi * (transmitted / (mu_s * mu_v))
    # Rounding of these sums, unlike a matrix product, does not depend on the number of cells.
    sums = (np.sum(term * fraction, axis=-1) for term in terms)
    ks, ko, *scattered = (each[kind].reshape(shape) if shape else each[0] for each in sums)
    return LeafAngleSums(ks, ko, bf, *scattered)


def volume_scattering(inclination, sza, vza, raa):
    """
    Bidirectional area scattering of leaves of one inclination and random azimuth, angles in degrees, [Verhoef1984]_.
    Returns the weights of leaf reflectance and transmittance. [sr-1]
    """
    beta_s, cos_s, sin_s = azimuth_limit(inclination, sza)
    beta_o, cos_o, sin_o = azimuth_limit(inclination, vza)
    psi = np.multiply(raa, RADIANS_PER_DEGREE)
    near = np.maximum(beta_s - beta_o, beta_o - beta_s)
    far = np.minimum(beta_s + beta_o, 2 * np.pi - beta_s - beta_o)
    first, middle, last = np.minimum(psi, near), np.minimum(np.maximum(psi, near), far), np.maximum(psi, far)
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
# Where light crosses leaves that hardly intercept it, `_by_chains` keeps the digits that `_slabs` would lose.
_LEAST_EXTINCTION = 0.1


@compiled
def _slabs(lai, ks, ko, a, sigma, m, sf, sb, vf, vb, out, left):
    """Fill in the fields rso to tdd of `scattered_again`, and mark the cells that need `_by_chains` instead."""
    for i in range(lai.size):
        if (ks[i] + ko[i]).real < _LEAST_EXTINCTION or (min(ks[i].real, ko[i].real) + m[i].real) < _LEAST_EXTINCTION:
            left[i] = True
            continue
        depth, twice = lai[i], 2 * m[i]
        sun, view, diffuse = np.exp(-ks[i] * depth), np.exp(-ko[i] * depth), np.exp(-m[i] * depth)
        square = diffuse * diffuse
        # sinh(m L) / m and A(L) of a slab, both times e^(-m L).
        sinh = _of_two(depth, twice, 0 * twice, square, 1 + 0 * square)
        slab = 1 / (square + (a[i] + m[i]) * sinh)
        # Chains (k, m) and (k + m, 0), and (k + m, 2 m, 0), of each beam.
        sun_diffuse = _of_two(depth, ks[i], m[i], sun, diffuse)
        view_diffuse = _of_two(depth, ko[i], m[i], view, diffuse)
        sun_out = (1 - sun * diffuse) / (ks[i] + m[i])
        view_out = (1 - view * diffuse) / (ko[i] + m[i])
        sun_back = (sinh - diffuse * sun_diffuse) / (ks[i] + m[i])
        view_back = (sinh - diffuse * view_diffuse) / (ko[i] + m[i])
        sun_again = (a[i] + m[i]) * sb[i] + sigma[i] * sf[i]
        view_again = (a[i] + m[i]) * vb[i] + sigma[i] * vf[i]
        sun_forward = (a[i] + m[i]) * sf[i] + sigma[i] * sb[i]
        view_forward = (a[i] + m[i]) * vf[i] + sigma[i] * vb[i]
        # Paths on which one beam scatters above the other. Both beams cross the leaves above the upper scattering, and
        # only the other beam crosses the leaves between; elsewhere, each diffuse stream is as for one beam.
        both, both_through = ks[i] + ko[i], sun * view
        crossed = _of_two(depth, both, twice, both_through, square)
        rso = 0 * slab
        for upper in range(2):
            if upper == 0:
                k, other, forward, forward_again, turned = ko[i], ks[i], sf[i], sun_forward, vb[i]
                own_diffuse, other_diffuse, through = view_diffuse, sun_diffuse, view
                other_out, back, turned_again = sun_out, view_back, view_again
            else:
                k, other, forward, forward_again, turned = ks[i], ko[i], vf[i], view_forward, sb[i]
                own_diffuse, other_diffuse, through = sun_diffuse, view_diffuse, sun
                other_out, back, turned_again = view_out, sun_back, sun_again
            one, last = diffuse * own_diffuse, through * other_diffuse  # (k + m, 2 m) and (both, k + m)
            three = _of_three(depth, both - twice, k - m[i], one, last, crossed, square)  # (both, k + m, 2 m)
            direct = (one - through * diffuse * other_out) / both  # (both + 2 m, k + m, 2 m)
            above = (three - (last - both_through * sinh) / (other + m[i])) / both  # (both + 2 m, both, k + m, 2 m)
            below = (back - direct) / (both + twice)  # (both + 2 m, k + m, 2 m, 0)
            either = ((back - three) / both - above) / (both + twice)  # all five
            rso += turned * (forward * direct + forward_again * above)
            rso += turned_again * (forward * below + forward_again * either)
        out[0, i] = rso * slab
        out[1, i] = (vb[i] * diffuse * view_diffuse + view_again * view_back) * slab
        out[2, i] = (sb[i] * diffuse * sun_diffuse + sun_again * sun_back) * slab
        out[3, i] = sigma[i] * sinh * slab
        out[4, i], out[5, i] = sun, view
        out[6, i] = (sf[i] * diffuse * sun_out + sun_forward * (sun_diffuse - sun * sinh) / (ks[i] + m[i])) * slab
        out[7, i] = (vf[i] * diffuse * view_out + view_forward * (view_diffuse - view * sinh) / (ko[i] + m[i])) * slab
        out[8, i] = diffuse * slab


@jitable
def _of_two(depth, p, q, through_p, through_q):
    """Chain of two rates from their transmittances, by its series where they are nearly equal."""
    x = (p - q) * depth
    if abs(x) > 0.05:
        return (through_q - through_p) / (p - q)
    series = 1 / 720 - x * (1 / 5040 - x / 40320)
    return through_q * depth * (1 - x * (1 / 2 - x * (1 / 6 - x * (1 / 24 - x * (1 / 120 - x * series)))))


@jitable
def _of_three(depth, x, y, low, high, across, through):
    """Chain of the rates q + x, q + y and q from the chains of each two of them (low, high, across) and e^(-q L)."""
    widest = max(abs(x), abs(y), abs(x - y))
    if widest * depth.real > 0.5:
        if abs(x) == widest:
            return (low - high) / x
        return (across - high) / y if abs(y) == widest else (low - across) / (x - y)
    p, q = -x * depth, -y * depth
    power, homogeneous, factorial = 1 + 0 * p, 1 + 0 * p, 2.0
    total = homogeneous / factorial
    for n in range(1, 15):
        factorial *= n + 2
        power *= q
        homogeneous = power + p * homogeneous
        total += homogeneous / factorial
    return through * depth * depth * total


def _by_chains(lai, ks, ko, a, sigma, m, sf, sb, vf, vb):
    """Fields of `_slabs`, each a sum of chains; slower, and without a limit on the rates."""
    sinh = exponential_chain(lai, 2 * m, 0.0)
    slab = np.exp(-2 * m * lai) + (a + m) * sinh
    fields = []
    for k, forward, backward in ((ko, vf, vb), (ks, sf, sb)):
        again = (a + m) * backward + sigma * forward
        turned_back = backward * exponential_chain(lai, k + m, 2 * m)
        fields.append(turned_back + again * exponential_chain(lai, k + m, 2 * m, 0.0))
    for k, forward, backward in ((ks, sf, sb), (ko, vf, vb)):
        again = (a + m) * forward + sigma * backward
        passed_on = forward * exponential_chain(lai, k + 2 * m, m)
        fields.append(passed_on + again * exponential_chain(lai, k + 2 * m, k, m))
    both, twice, rso = ks + ko, 2 * m, 0.0
    for k, (forward, backward), (kept, turned) in ((ko, (sf, sb), (vf, vb)), (ks, (vf, vb), (sf, sb))):
        forward_again, turned_again = (a + m) * forward + sigma * backward, (a + m) * turned + sigma * kept
        from_above = forward_again * exponential_chain(lai, both + twice, both, k + m, twice)
        rso = rso + turned * (forward * exponential_chain(lai, both + twice, k + m, twice) + from_above)
        from_either = forward_again * exponential_chain(lai, both + twice, both, k + m, twice, 0.0)
        rso = rso + turned_again * (forward * exponential_chain(lai, both + twice, k + m, twice, 0.0) + from_either)
    rdo, rsd, tsd, tdo = fields
    through = np.exp(-ks * lai) * slab, np.exp(-ko * lai) * slab
    return np.stack([rso, rdo, rsd, sigma * sinh, *through, tsd, tdo, np.exp(-m * lai)]) / slab


_LEAST_COSINE = 1e-3  # of sun and view on the slope; below, the slope is as good as parallel to the light [1]


def upright_reflectance(
    lai, leaf_reflectance, leaf_transmittance, background, *, sza, vza, raa, cosine, mu_s_local, mu_v_local, sky_view,
    diffuse_fraction=0.0, leaf_angles="spherical", hotspot=0.0,
):  # fmt: skip
    r"""
    Reflectance factor of a canopy of upright plants on a slope, relative to the irradiance of level ground.

    .. math::

        \rho &= E_s r_{so} + (E_d + E_t) \, r_{do} \\
        E_s &= (1 - f) \, \mu_s' / \mu_s, \qquad E_d = f \, V_d, \qquad
            E_t = (1 - V_d) \, \frac{V_d \, r_{dd}}{1 - (1 - V_d) \, r_{dd}}

    Along a beam, leaves of upright plants have the path length of the slope: the extinction is
    :math:`k' = k \mu / \mu'` for the leaf area of the slope, :math:`L \cos S`.

    Parameters
    ----------
    lai : array
        Leaf area index, per level area. NaN gives NaN. [m2 m-2]
    leaf_reflectance, leaf_transmittance, background : array
        [1]
    sza, vza, raa : float
        On level ground. [degree]
    cosine : array
        Cosine of the slope, :math:`\cos S`. [1]
    mu_s_local, mu_v_local : array
        Cosines of the zenith angles of sun and sensor on the slope, :math:`\mu'`; 0 in shadow or hidden. [1]
    sky_view : array
        :math:`V_d`; land fills the rest of the view, :math:`1 - V_d`. [1]
    diffuse_fraction : array, optional
        :math:`f` on level ground. [1]
    leaf_angles : optional
        Whatever `leaf_angle_classes` accepts; inclinations from the vertical of the plants.
    hotspot : float, optional
        Ratio of leaf size to canopy height. [1]

    Returns
    -------
    reflectance : array, shape of the broadcast inputs
        0 where the slope is hidden from the sensor. [1]

    Notes
    -----
    The light of the surroundings is summed over all reflections. They have the canopy and the sky view of the slope,
    and face all directions: sun and sky that enter a hollow are spread over an area that is larger by
    :math:`1 / V_d`, and are reflected by :math:`r_{dd}`. This is exact for Lambertian ground in a spherical bowl. The
    leaf angle distribution keeps its axis in all coefficients, with the mean of the normals' outer products.

    References
    ----------
    [Yin2017]_, path length; [Sirguey2009]_, light between slopes; [Verhoef1984]_
    """
    leaves, raa = leaf_angle_classes(leaf_angles), folded(raa)
    seen = np.asarray(mu_v_local) > 0
    sun, view = (np.maximum(each, _LEAST_COSINE) for each in (mu_s_local, mu_v_local))
    mu_s, mu_v = np.cos(np.radians([sza, vza]))
    sums = leaf_angle_sums(sza, vza, raa, leaves)
    c = _on_slope(leaf_reflectance, leaf_transmittance, sums, cosine, mu_s / sun, mu_v / view)
    depth = numbers(lai) * cosine
    gaps, sunlit_and_seen = bidirectional_gap(depth, c.ks, c.ko, _decay(sza, vza, raa, sun, view, cosine, c, hotspot))
    layer = scattered_again(depth, c)
    layer = layer._replace(rso=c.w * sunlit_and_seen + layer.rso, tsstoo=gaps)
    r = with_background(layer, background)
    direct, sky = (1 - diffuse_fraction) * np.maximum(mu_s_local, 0) / mu_s, diffuse_fraction * sky_view
    land = 1 - sky_view
    around = land * sky_view * r.rdd / (1 - land * r.rdd)
    return seen * (direct * r.rso + (sky + around) * r.rdo)


def _on_slope(rho, tau, sums, cosine, sun_path, view_path):
    """Coefficients of the four-stream equations along the normal of a slope, per leaf area."""
    # The mean outer product of the leaf normals has bf along the vertical and `across` along both horizontal axes.
    across = (1 - sums.bf) / 2
    upright = (sums.bf - across) * cosine
    normals = across + upright * sun_path, across + upright * view_path, across + upright * cosine
    return _scattering(rho, tau, sums, *normals, sun_path, view_path)


def _decay(sza, vza, raa, sun, view, cosine, c, hotspot):
    """Decay of the correlation of the gaps with depth below the slope, as `sail_model.hotspot_decay`."""
    if not hotspot > 0:
        return np.inf
    sza, vza, raa = np.radians([sza, vza, raa])
    chord = 4 * (np.sin((sza - vza) / 2) ** 2 + np.sin(sza) * np.sin(vza) * np.sin(raa / 2) ** 2)
    distance = np.sqrt((1 / sun - 1 / view) ** 2 + chord / (sun * view))
    return 2 * distance * cosine / ((c.ks + c.ko) * hotspot)
