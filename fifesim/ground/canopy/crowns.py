"""Leaves in crowns with gaps between them: reflectance of a clumped canopy."""

from typing import NamedTuple

import numpy as np

from fifesim.base.arrays import jitable, numbers
from fifesim.ground.canopy.leaf_angles import RADIANS_PER_DEGREE
from fifesim.ground.canopy.leaf_area import LARGEST_LAI, check_share
from fifesim.ground.canopy.sail_model import direction_distance, over_background

SHAPE = 1.0  # crown diameter over height of round crowns [1]


class CrownShares(NamedTuple):
    """Shares of the ground covered by crowns, each 1 for full cover. [1]"""

    cover: np.ndarray  # below crowns, by the vertical: Cv
    sun: np.ndarray  # whose sunbeam goes through a crown: Cs
    view: np.ndarray  # whose view does: Co
    both: np.ndarray  # of which both do: Cso
    apart: np.ndarray  # what both share beyond chance: Cso - Cs Co
    lit: np.ndarray  # weight of the crowns in sunlight that an observer sees


def crown_shares(crown_cover, crown_shape, sza, vza, raa):
    r"""
    Shares of the ground covered by crowns, as seen by sun and observer.

    .. math::

        C_s &= 1 - (1 - C_v)^{1 / \mu_s}, \quad C_o = 1 - (1 - C_v)^{1 / \mu_v} \\
        C_{so} &= C_s C_o + \min[C_s (1 - C_o), C_o (1 - C_s)] \, e^{-\Delta / \zeta}

    Parameters
    ----------
    crown_cover : array
        Share of the ground below crowns, :math:`C_v`, 0 to 1. [1]
    crown_shape : array
        Crown diameter over height, :math:`\zeta`: the flatter, the wider the hot spot of the crowns; 0 is none. [1]
    sza, vza, raa : array
        [degree]

    Returns
    -------
    shares : CrownShares

    Notes
    -----
    :math:`\Delta` is the distance of the two directions on a plane one unit below. The chance of a gap between crowns
    is for randomly placed crowns (Nilson 1971): :math:`1 - C_v = e^{-n A}` for n crowns of area A, and a slant
    beam meets the shadow of each, :math:`A / \mu` of a round crown. Crowns that are lit and seen weigh
    :math:`1 - (1 - C_{so})^{(1 / \mu_s + 1 / \mu_v) / 2}`, which goes to 1 toward the horizon.

    References
    ----------
    [VerhoefBach2007]_; [Nilson1971]_
    """
    gap = 1 - numbers(crown_cover)
    sun_path, view_path = (1 / np.cos(numbers(angle) * RADIANS_PER_DEGREE) for angle in (sza, vza))
    sun, view = 1 - gap**sun_path, 1 - gap**view_path
    shape = numbers(crown_shape)
    close = np.where(shape > 0, np.exp(-direction_distance(sza, vza, raa) / np.where(shape > 0, shape, 1)), 0)
    beyond = np.minimum(sun * (1 - view), view * (1 - sun)) * close
    both = sun * view + beyond
    lit = 1 - (1 - both) ** ((sun_path + view_path) / 2)
    return CrownShares(1 - gap, sun, view, both, beyond, lit)


def clumped(canopy, shares):
    r"""
    Reflectances and transmittances of crowns with gaps between them.

    .. math::

        \tau_{ss}' &= 1 - C_s + C_s \tau_{ss} \\
        \tau_{ssoo}' &= C_{so} \tau_{ssoo} + (C_o - C_{so}) \tau_{oo} + (C_s - C_{so}) \tau_{ss} \\
            &\quad + 1 - C_s - C_o + C_{so}

    Parameters
    ----------
    canopy : Canopy
        Canopy of the crowns, whose leaf area index is the one of the ground divided by the crown cover.
    shares : CrownShares

    Returns
    -------
    canopy : Canopy
        Reflectances and transmittances of crowns and gaps together. [1]

    References
    ----------
    [VerhoefBach2007]_; its errors in scenes of [Widlowski2007]_ are in the physics page
    """
    c, s = canopy, shares
    return c._replace(
        rso=s.lit * c.rso,
        rdo=s.view * c.rdo,
        rsd=s.sun * c.rsd,
        rdd=s.cover * c.rdd,
        tss=1 - s.sun + s.sun * c.tss,
        too=1 - s.view + s.view * c.too,
        tsd=s.sun * c.tsd,
        tdo=s.view * c.tdo,
        tdd=1 - s.cover + s.cover * c.tdd,
        tsstoo=s.both * c.tsstoo + (s.view - s.both) * c.too + (s.sun - s.both) * c.tss + (1 - s.sun - s.view + s.both),
        rdd_below=s.cover * c.rdd_below,
    )


class CrownTerms(NamedTuple):
    """Terms of the leaves within crowns that `crowns_over_background` needs, 0 without leaves. [1]"""

    seen: np.ndarray  # sunlight's share times rso
    seen_in_skylight: np.ndarray  # skylight's share times rdo
    kept: np.ndarray  # sunlight's share times that which does not come through, 1 - tss - tsd
    kept_of_skylight: np.ndarray  # skylight's share times 1 - tdd
    hidden: np.ndarray  # of the ground's light, 1 - too - tdo
    rdd_below: np.ndarray
    # Sunlight's share times what sun and observer see together of the ground beyond chance, tsstoo - tss too.
    hot: np.ndarray
    missed: np.ndarray  # sunlight's share times (1 - tss) (1 - too)


def crown_terms(canopy, sky):
    """Terms of `crowns_over_background`, for reflectances of crowns and a share of skylight. [1]"""
    c, sun = canopy, 1 - sky
    return CrownTerms(
        seen=sun * c.rso,
        seen_in_skylight=sky * c.rdo,
        kept=sun * (1 - c.tss - c.tsd),
        kept_of_skylight=sky * (1 - c.tdd),
        hidden=1 - c.too - c.tdo,
        rdd_below=c.rdd_below,
        hot=sun * (c.tsstoo - c.tss * c.too),
        missed=sun * (1 - c.tss) * (1 - c.too),
    )


@jitable
def crowns_over_background(terms, shares, background):
    """
    Reflectance factor of crowns and gaps over a background, from `CrownTerms` and the shares of `CrownShares`. [1]
    Shares are ``cover``, ``sun``, ``view``, ``apart`` and ``lit``. Equals `clumped` `with_background` to rounding,
    mixed by `reflectance_factor`. [VerhoefBach2007]_
    """
    seen, seen_in_skylight, kept, kept_of_skylight, hidden, rdd, gaps, missed = terms
    cover, sun, view, apart, lit = shares
    hot = (sun * view + apart) * gaps + apart * missed
    through = (1 - sun * kept - cover * kept_of_skylight) * (1 - view * hidden)
    return over_background(lit * seen + view * seen_in_skylight, hot, through, cover * rdd, background)


def lai_in_crowns(lai, crown_cover):
    """Leaf area index within crowns, 0 where there are none. [m2 m-2]"""
    lai, cover = numbers(lai), numbers(crown_cover)
    # NaN of the leaf area stays.
    return np.where(cover > 0, lai / np.where(cover > 0, cover, 1), 0 * lai)


def check_crowns(lai, crown_cover):
    """Raise ValueError if crowns hold more leaves than any canopy; NaN and a cover of 0, bare ground, pass."""
    check_share("crown_cover", crown_cover)
    lai, cover = np.asarray(lai, float), np.asarray(crown_cover, float)
    if np.any((lai > LARGEST_LAI * cover) & (cover > 0)):
        with np.errstate(over="ignore"):
            inside = lai / np.where(cover > 0, cover, np.inf)
        raise ValueError(
            f"leaf area index within the crowns is lai / crown_cover, at most {LARGEST_LAI:g}, got up to "
            f"{np.nanmax(inside):g}: where crowns cover that little lower the leaf area, or give crown_cover 0"
        )
