"""Where light goes: what green leaves, dead leaves and the ground absorb, and what is reflected."""

from typing import NamedTuple

import numpy as np

from fifesim.ground.canopy.background import with_background
from fifesim.ground.canopy.crowns import SHAPE, clumped, crown_shares, lai_in_crowns
from fifesim.ground.canopy.layers import added, layers_of, mixed
from fifesim.ground.canopy.leaf_angles import leaf_angle_classes
from fifesim.ground.canopy.sail_model import scattered_again, scattering


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
    What a canopy of green and dead leaves does with the light of one wavelength.

    Parameters
    ----------
    lai : array
        Of the ground, both kinds together. NaN gives NaN. [m2 m-2]
    leaf_reflectance, leaf_transmittance, brown_reflectance, brown_transmittance, background : array
        [1]
    brown, dissociation : array
        As in `layers_of`. [1]
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

    Examples
    --------
    >>> budget = light_budget(3.0, 0.07, 0.04, 0.28, 0.12, 0.15, brown=0.3, dissociation=0.5, sza=30)
    >>> round(float(sum(budget)), 12)
    1.0
    """
    green, dead = (leaf_reflectance, leaf_transmittance), (brown_reflectance, brown_transmittance)
    cover = np.asarray(crown_cover, float)
    layers = layers_of(lai_in_crowns(lai, cover), brown, dissociation)
    angles = sza, 0.0, 0.0, leaf_angle_classes(leaf_angles)
    top, bottom = (
        scattered_again(area, scattering(*mixed(green, dead, share), *angles))
        for area, share in ((layers.lai, layers.brown), (layers.lai_below, layers.brown_below))
    )
    crowns = crown_shares(cover, SHAPE, sza, 0.0, 0.0)
    canopy = clumped(added(top, bottom), crowns)
    r, sky = np.asarray(background, float), np.asarray(diffuse_fraction, float)
    down = ((1 - sky) * (canopy.tss + canopy.tsd) + sky * canopy.tdd) / (1 - r * canopy.rdd_below)
    sunlit, skylit, lit_from_below = _absorbed(top, bottom)
    absorbed = [
        (1 - sky) * crowns.sun * of_sun + cover * (sky * of_sky + r * down * of_ground)
        for of_sun, of_sky, of_ground in zip(sunlit, skylit, lit_from_below, strict=True)
    ]
    shares = [_dead_share(share, green, dead) for share in (layers.brown, layers.brown_below)]
    by_dead = sum(taken * share for taken, share in zip(absorbed, shares, strict=True))
    surface = with_background(canopy, r)
    reflected = (1 - sky) * surface.rsd + sky * surface.rdd
    return LightBudget(sum(absorbed) - by_dead, by_dead, (1 - r) * down, reflected)


def _absorbed(top, bottom):
    """What the upper and the lower layer absorb over black ground of the sunbeam, skylight, and light from below."""
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
    """Share of dead leaves in what a layer absorbs; 0 where none absorbs."""
    of_green, of_dead = (1 - np.add(*optics) for optics in (green, dead))
    by_dead = brown * of_dead
    total = (1 - brown) * of_green + by_dead
    return np.where(total > 0, by_dead / np.where(total > 0, total, 1), 0.0)
