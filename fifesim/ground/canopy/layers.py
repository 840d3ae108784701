"""Canopies of green and dead leaves: two SAIL layers, and the light that leaves and ground absorb."""

from typing import NamedTuple

import numpy as np

from fifesim.base.arrays import numbers
from fifesim.ground.canopy.crowns import SHAPE, clumped, crown_shares, lai_in_crowns
from fifesim.ground.canopy.leaf_angles import leaf_angle_classes, leaf_projection
from fifesim.ground.canopy.sail_model import (
    CanopyLayer,
    bidirectional_gap,
    folded,
    hotspot_decay,
    leaf_scattering,
    scattered_again,
    with_background,
)


class Layers(NamedTuple):
    """Leaf areas and dead shares of two layers; fields broadcast against each other."""

    lai: np.ndarray  # leaf area of the upper layer. [m2 m-2]
    lai_below: np.ndarray  # and of the lower one. [m2 m-2]
    brown: np.ndarray  # dead share of the leaf area in the upper layer. [1]
    brown_below: np.ndarray  # and in the lower one. [1]


def leaf_layers(lai, brown, dissociation):
    r"""
    Leaf areas of two layers, and their dead shares, [VerhoefBach2007]_. :math:`L_1 = (1 - f_B) \, L, \quad b_1 = (1 -
    D) \, f_B \quad L_2 = f_B \, L, b_2 = 1 - (1 - D) (1 - f_B)` with the leaf area L [m2 m-2], its dead share
    :math:`f_B` and the dissociation D: 0 where all leaves are mixed, 1 where the dead ones lie below.
    """
    lai, brown, mixed = numbers(lai), numbers(brown), 1 - numbers(dissociation)
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
    """
    Reflectances and transmittances of a canopy of green and dead leaves, after 4SAIL2.

    Parameters
    ----------
    lai : array
        Leaf area index of both kinds together. NaN gives NaN. [m2 m-2]
    leaf_reflectance, leaf_transmittance, brown_reflectance, brown_transmittance : array
        Optics of green leaves, and of dead leaves. [1]
    brown, dissociation : array
        As in `leaf_layers`. [1]
    sza, vza, raa, leaf_angles, hotspot
        As in `sail`, the same in both layers; the hot spot is one over the depth of both.

    Returns
    -------
    canopy : Canopy
        Fields of the broadcast shape of all arguments, or broadcastable to it. [1]

    Notes
    -----
    Each layer has the mean optics of its leaves, and the two are added. Single scattering to the observer is
    :math:`w_1 A_1 + w_2 A_2` with the leaf areas :math:`A` that sun and observer both reach in each, from Kuusk's
    gap over both; its integral is the series of `bidirectional_gap`, for which the authors' program takes 20 steps.

    References
    ----------
    [VerhoefBach2007]_; [Kuusk1991]_
    """
    raa = folded(raa)
    green, dead = (leaf_reflectance, leaf_transmittance), (brown_reflectance, brown_transmittance)
    layers = leaf_layers(lai, brown, dissociation)
    angles = sza, vza, raa, leaf_angle_classes(leaf_angles)
    upper = leaf_scattering(*mixed(green, dead, layers.brown), *angles)
    lower = leaf_scattering(*mixed(green, dead, layers.brown_below), *angles)
    alpha = hotspot_decay(sza, vza, raa, upper.ks + upper.ko, numbers(hotspot))
    # Without a hot spot the decay is infinite, which no share of the depth makes less.
    none = np.isinf(alpha)
    alpha_above = np.where(none, np.inf, np.where(none, 0, alpha) * (1 - numbers(brown)))
    lai = numbers(lai)
    tsstoo, seen = bidirectional_gap(lai, upper.ks, upper.ko, alpha)
    _, seen_above = bidirectional_gap(layers.lai, upper.ks, upper.ko, alpha_above)
    both = added(scattered_again(layers.lai, upper), scattered_again(layers.lai_below, lower))
    once = upper.w * seen_above + lower.w * (seen - seen_above)
    return both._replace(rso=once + both.rso, tsstoo=tsstoo)


def mixed(green, dead, brown):
    """Mean optics of a mixture of green and dead leaves. [1]"""
    pairs = ((numbers(one), numbers(other)) for one, other in zip(green, dead, strict=True))
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
    """
    back_and_forth = 1 / (1 - top.rdd_below * bottom.rdd)
    up = (top.tss * bottom.rsd + top.tsd * bottom.rdd) * back_and_forth
    down = top.tsd + top.rdd_below * up
    # Diffuse light toward the observer from the upward and downward fluxes between the layers.
    seen_up = (top.tdo + top.rdd_below * bottom.rdo * top.too) * back_and_forth
    sky_up = top.tdd * bottom.rdd * back_and_forth
    sky_down = top.tdd * back_and_forth
    return CanopyLayer(
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


FPAR_INF = 0.94  # FPAR of an infinitely thick canopy [1]; Friedl et al. (1995), below Eq. 6.


def extinction_coefficient(sza, leaf_angles="spherical"):
    r"""
    Extinction coefficient of the direct beam per leaf area.

    .. math:: K = G(\theta_s) / \mu_s

    Parameters
    ----------
    sza : array
        Below 90. [degree]
    leaf_angles : optional
        As in `leaf_angle_classes`. Spherical leaves have exactly :math:`G = 1/2`; other distributions are summed over
        their classes.

    Returns
    -------
    extinction : array, shape of sza
        :math:`K`. [1]

    References
    ----------
    [Monteith1990]_
    """
    leaf_angles = leaf_angle_classes(leaf_angles)
    mu_s = np.cos(np.radians(np.asarray(sza, float)))
    if leaf_angles == leaf_angle_classes("spherical"):
        return 0.5 / mu_s
    projection = leaf_projection(np.asarray(leaf_angles.inclination), np.asarray(sza, float)[..., None])
    return projection @ np.asarray(leaf_angles.fraction) / mu_s


def beer_fpar(lai, extinction, fpar_inf=FPAR_INF):
    r"""
    Fraction of photosynthetically active radiation absorbed by a canopy, by Beer's law, [Friedl1995]_, Eq. 6. [1]
    :math:`\mathrm{FPAR} = \mathrm{FPAR}_\infty \left[ 1 - e^{-K \, \mathrm{LAI}} \right]` with the leaf area index [m2
    m-2] and the `extinction_coefficient` K [1]. NaN gives NaN.
    """
    return -fpar_inf * np.expm1(-np.asarray(extinction, float) * np.asarray(lai, float))


def green_fpar(lai, extinction, brown, dissociation=0.0, fpar_inf=FPAR_INF):
    r"""
    Fraction of photosynthetically active radiation absorbed by the green leaves of a canopy.

    .. math::

        \mathrm{FPAR}_g = \mathrm{FPAR}_\infty \, \big[ &(1 - b_1) \left( 1 - e^{-K L_1} \right) \\
            &+ (1 - b_2) \, e^{-K L_1} \left( 1 - e^{-K L_2} \right) \big]

    Parameters
    ----------
    lai : array
        Leaf area index of both kinds. NaN gives NaN. [m2 m-2]
    extinction, fpar_inf : array
        As in `beer_fpar`. [1]
    brown, dissociation : array
        Dead share :math:`f_B`, and :math:`D`, as in `leaf_layers`, which gives the layers and their shares. [1]

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
    """
    if not np.ndim(dissociation) and dissociation == 0:
        return (1 - np.asarray(brown, float)) * beer_fpar(lai, extinction, fpar_inf)
    layers, k = leaf_layers(lai, brown, dissociation), np.asarray(extinction, float)
    above = beer_fpar(layers.lai, k, fpar_inf)
    below = np.exp(-k * layers.lai) * beer_fpar(layers.lai_below, k, fpar_inf)
    return (1 - layers.brown) * above + (1 - layers.brown_below) * below


class LightBudget(NamedTuple):
    """Shares of the irradiance, which sum to 1. [1]"""

    green: np.ndarray
    brown: np.ndarray
    ground: np.ndarray
    reflected: np.ndarray


def light_budget(
    lai,
    leaf_reflectance,
    leaf_transmittance,
    brown_reflectance,
    brown_transmittance,
    background,
    *,
    brown,
    dissociation=0.0,
    sza,
    leaf_angles="spherical",
    diffuse_fraction=0.0,
    crown_cover=1.0,
):
    r"""
    Light budget of a canopy of green and dead leaves at one wavelength.

    Parameters
    ----------
    lai : array
        Leaf area of both kinds per ground area. NaN gives NaN. [m2 m-2]
    leaf_reflectance, leaf_transmittance, brown_reflectance, brown_transmittance, background : array
        [1]
    brown, dissociation : array
        As in `leaf_layers`. [1]
    sza : array
        [degree]
    leaf_angles : optional
        Whatever `leaf_angle_classes` accepts.
    diffuse_fraction : array, optional
        Share of skylight in the irradiance. [1]
    crown_cover : array, optional
        [1]

    Returns
    -------
    budget : LightBudget
        Fields of the broadcast shape of all arguments. [1]

    Notes
    -----
    A layer absorbs what goes in less what comes out; of that its dead leaves have the share
    :math:`b \, \alpha_B / [(1 - b) \, \alpha_G + b \, \alpha_B]`, with the absorptances :math:`\alpha` of both kinds
    and the dead share :math:`b` of its leaf area, as they lie in the same light.

    References
    ----------
    [VerhoefBach2007]_
    """
    optics = (leaf_reflectance, leaf_transmittance), (brown_reflectance, brown_transmittance)
    terms, canopy = light_terms(
        lai, *optics, brown=brown, dissociation=dissociation, sza=sza, leaf_angles=leaf_angles,
        diffuse_fraction=diffuse_fraction, crown_cover=crown_cover,
    )  # fmt: skip
    r, sky = np.asarray(background, float), np.asarray(diffuse_fraction, float)
    down = terms.down / (1 - r * terms.rdd_below)
    surface = with_background(canopy, r)
    reflected = (1 - sky) * surface.rsd + sky * surface.rdd
    return LightBudget(
        terms.green + r * down * terms.green_below,
        terms.brown + r * down * terms.brown_below,
        (1 - r) * down,
        reflected,
    )


class LightTerms(NamedTuple):
    """Light of a canopy over black ground, and of a canopy lit from below. [1]"""

    green: np.ndarray  # absorbed by green leaves over black ground
    brown: np.ndarray  # and by dead leaves
    down: np.ndarray  # reaches black ground
    green_below: np.ndarray  # absorbed by green leaves from diffuse light of 1 from below
    brown_below: np.ndarray  # and by dead leaves
    rdd_below: np.ndarray  # reflected back to the ground from diffuse light of 1


def light_terms(lai, green, dead, *, brown, dissociation, sza, leaf_angles, diffuse_fraction, crown_cover):
    """LightTerms of a canopy from optics of green and dead leaves, pairs; and the canopy without the ground."""
    cover, sky = np.asarray(crown_cover, float), np.asarray(diffuse_fraction, float)
    layers = leaf_layers(lai_in_crowns(lai, cover), brown, dissociation)
    angles = sza, 0.0, 0.0, leaf_angle_classes(leaf_angles)
    top, bottom = (
        scattered_again(area, leaf_scattering(*mixed(green, dead, share), *angles))
        for area, share in ((layers.lai, layers.brown), (layers.lai_below, layers.brown_below))
    )
    crowns = crown_shares(cover, SHAPE, sza, 0.0, 0.0)
    canopy = clumped(added(top, bottom), crowns)
    sunlit, skylit, lit_from_below = _absorbed(top, bottom)
    above = [
        (1 - sky) * crowns.sun * of_sun + cover * sky * of_sky for of_sun, of_sky in zip(sunlit, skylit, strict=True)
    ]
    below = [cover * each for each in lit_from_below]
    shares = [_dead_share(share, green, dead) for share in (layers.brown, layers.brown_below)]
    of_dead, of_dead_below = (
        sum(taken * share for taken, share in zip(each, shares, strict=True)) for each in (above, below)
    )
    down = (1 - sky) * (canopy.tss + canopy.tsd) + sky * canopy.tdd
    terms = LightTerms(sum(above) - of_dead, of_dead, down, sum(below) - of_dead_below, of_dead_below, canopy.rdd_below)
    return terms, canopy


def _absorbed(top, bottom):
    """Absorption by both layers over black ground, of direct light, skylight, and light from below."""
    again = 1 / (1 - top.rdd_below * bottom.rdd)
    up = (top.tss * bottom.rsd + top.tsd * bottom.rdd) * again
    down = top.tsd + top.rdd_below * up
    below = top.tss * (1 - bottom.tss - bottom.tsd) + down * (1 - bottom.tdd) - up
    sun = 1 - top.rsd - top.tss - down + up * (1 - top.tdd), below
    up = top.tdd * bottom.rdd * again
    down = top.tdd + top.rdd_below * up
    sky = 1 - top.rdd - down + up * (1 - top.tdd), down * (1 - bottom.tdd) - up
    up = bottom.tdd * again
    down = top.rdd_below * up
    ground = up * (1 - top.tdd) - down, 1 - bottom.rdd_below + down * (1 - bottom.tdd) - up
    return sun, sky, ground


def _dead_share(brown, green, dead):
    """Share of dead leaves in the absorption of a layer, 0 if it absorbs nothing."""
    of_green, of_dead = (1 - np.add(*optics) for optics in (green, dead))
    by_dead = brown * of_dead
    total = (1 - brown) * of_green + by_dead
    return np.where(total > 0, by_dead / np.where(total > 0, total, 1), 0.0)
