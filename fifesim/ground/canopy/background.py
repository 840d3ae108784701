"""A canopy over a background: what both reflect together, in sunlight and skylight."""

from typing import NamedTuple

import numpy as np
from numba.extending import register_jitable


class Surface(NamedTuple):
    """Reflectances of canopy and background together, named as those of `Canopy`. [1]"""

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

    and likewise, without the second term, for the other three; :math:`r_{dd}` is that of light from below.

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
        Of the canopy, from below. [1]
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
