"""Water that darkens a soil: films of it that lie on the grains by chance."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numba.extending import register_jitable

from fifesim.base import datasets
from fifesim.ground.canopy.prospect import interface_transmissivity
from fifesim.ground.canopy.ranges import outside
from fifesim.ground.canopy.soil import check_range, check_span, in_cells
from fifesim.ground.canopy.spectra import band_means

# Of the brightness-shape-moisture model, Yang et al. (2020): the water of the driest and of the wettest soil that it is
# for, and what a soil holds in its first film, in percent of the volume; the thickness of a film [cm]; and the index of
# refraction of what soils are made of.
DRIEST, WETTEST = 5.0, 55.0
CAPACITY = 25.0
FILM = 0.015
SOIL_INDEX = 2.0

# Half opening of the cone from which light falls on a film, as on a leaf in PROSPECT. [degree]
_CONE = 40.0

# Films on average of a soil that is saturated.
_PER_MOISTURE = (WETTEST - DRIEST) / CAPACITY

# Deeper than so many films is less than 2 % of the wettest soil, which counts as so many.
_FILMS = 6

# Cells that are done together, so that they stay in the nearest cache, and in the next.
_RUN, _AT_ONCE = 256, 2**14


class WaterFilms(NamedTuple):
    """What films of water on a soil do to the light of bands."""

    surface: np.ndarray
    """Reflectance of the upper side of the water for light from the air, shape (band,). [1]"""
    inside: np.ndarray
    """The same of its lower side, for diffuse light from below, shape (band,). [1]"""
    entrance: np.ndarray
    """Light that enters the soil's grains from water over that from air, shape (band,). [1]"""
    passed: np.ndarray
    """Light that one to six films let pass down and up, shape (band, 6). [1]"""


@lru_cache(maxsize=64)
def water_films(bands):
    """
    Optics of films of water in bands.

    Parameters
    ----------
    bands : tuple of fifesim.base.bands.Band

    Returns
    -------
    films : WaterFilms

    Raises
    ------
    ValueError
        If a band lies beyond 0.4 to 2.5 um.
    """
    water, absorbing = datasets.table("water_index.csv"), datasets.table("prospect_d.csv")
    wavelength, absorption = absorbing["wavelength"].to_numpy(), absorbing["water"].to_numpy()
    check_range(bands, wavelength)
    index = np.interp(wavelength, water["wavelength"], water["refractive_index"])
    upward = interface_transmissivity(index, 90.0) / index**2
    entrance = interface_transmissivity(SOIL_INDEX / index, 90.0) / interface_transmissivity(SOIL_INDEX, 90.0)
    deep = np.arange(1, _FILMS + 1)[:, None]
    spectra = [1 - interface_transmissivity(index, _CONE), 1 - upward, entrance, *np.exp(-2 * absorption * FILM * deep)]
    surface, inside, entrance, *passed = band_means(bands, wavelength, np.array(spectra))
    return WaterFilms(surface, inside, entrance, np.ascontiguousarray(np.transpose(passed)))


@register_jitable
def wet_soil(below, passed, surface, inside):
    r"""
    Reflectance of a soil below a film of water.

    .. math:: r_w = \rho_{12} + \frac{(1 - \rho_{12}) (1 - \rho_{21}) \, t \, r_b}{1 - \rho_{21} \, t \, r_b}

    Parameters
    ----------
    below : array
        Reflectance :math:`r_b` of the grains in the water, `grains_in_water`. [1]
    passed : array
        What the film lets pass down and up, :math:`t`. [1]
    surface, inside : array
        Reflectance of the water's surface from above, :math:`\rho_{12}`, and from below, :math:`\rho_{21}`. [1]

    Returns
    -------
    reflectance : array
        [1]

    References
    ----------
    [Lekner1988]_; [Yang2020]_

    Examples
    --------
    A mirror below clear water loses nothing:

    >>> round(wet_soil(1.0, 1.0, 0.02, 0.47), 12)
    1.0
    """
    up, kept = below_film(below, passed, inside)
    return surface + (1 - surface) * (1 - inside) * up / kept


@register_jitable
def below_film(below, passed, inside):
    """
    Light below a film of water after one way down and up, and what of it does not go round again.

    Parameters
    ----------
    below, passed, inside : array
        As in `wet_soil`. [1]

    Returns
    -------
    up, kept : array
        Whose quotient is the sum over all ways. [1]
    """
    up = passed * below
    return up, 1 - inside * up


@register_jitable
def grains_in_water(dry, entrance):
    r"""
    Reflectance of a soil whose grains lie in water, which bends light less into them than air does.

    .. math:: r_b = 1 - (1 - r) \, (r e + 1 - r)

    Parameters
    ----------
    dry : array
        Reflectance :math:`r` of the dry soil. [1]
    entrance : array
        Light that enters the grains from water over that from air, :math:`e`. [1]

    Returns
    -------
    reflectance : array
        [1]

    References
    ----------
    [Lekner1988]_

    Examples
    --------
    >>> round(grains_in_water(0.3, 1.0), 12)
    0.3
    """
    return 1 - (1 - dry) * (dry * entrance + 1 - dry)


def moistened(dry, moisture, films):
    r"""
    Reflectance of a moist soil: parts of it lie dry, and below one, two and more films of water.

    .. math:: r = \sum_k \frac{\mu^k e^{-\mu}}{k!} \, r_k, \quad \mu = \frac{\theta - 5}{25}

    where :math:`r_0` is dry, and :math:`\theta` from 5 to 55 percent of the volume is a moisture of 0 to 1.

    Parameters
    ----------
    dry : array, shape (band,) or (..., band)
        Reflectance of the dry soil; NaN gives NaN. [1]
    moisture : array, shape (...)
        0 is dry and 1 saturated; NaN gives NaN. [1]
    films : WaterFilms

    Returns
    -------
    reflectance : array, shape (..., band)
        At moisture 0 that of the dry soil, to the bit. [1]

    Raises
    ------
    ValueError
        If a moisture is outside 0 to 1.

    Notes
    -----
    Absorption is the mean of what films let pass over a band, and the dry soil is taken as flat in it. The surface of
    the water reflects 2 %: a soil darker than 4 % becomes brighter. More than six films count as six.

    References
    ----------
    [Yang2020]_, after [Verhoef2018]_; [HaleQuerry1973]_ and [Feret2017]_ for water

    Examples
    --------
    >>> from fifesim.base.bands import Band
    >>> films = water_films((Band("red", (0.63, 0.66, 0.69), (0, 1, 0)),))
    >>> moistened(np.array([0.3]), np.array([0.0, 0.5, 1.0]), films).round(3).ravel().tolist()
    [0.3, 0.23, 0.205]
    """
    return in_cells(_moisten, dry, moisture, *films, check=check_moisture)


def _moisten(dry, moisture, surface, inside, entrance, passed, out):
    wrong = 0
    for start in range(0, moisture.size, _AT_ONCE):
        bare = np.exp(moisture[start : start + _AT_ONCE] * -_PER_MOISTURE)
        wrong += _films(dry, moisture, start, bare, surface, inside, entrance, passed, out)
    return wrong


# No divisor is 0: without that being asked, cells are done several at once.
@njit(nogil=True, cache=True, error_model="numpy")
def _films(dry, moisture, start, bare, surface, inside, entrance, passed, out):
    covered, by_cell, wrong = np.empty((_FILMS, _RUN)), dry.shape[1] > 1, 0
    for begin in range(0, bare.size, _RUN):
        free = bare[begin : begin + _RUN]
        run = slice(start + begin, start + begin + free.size)
        wrong += outside(moisture[run], 0.0, 1.0)
        _covered(moisture[run], free, covered)
        for band in range(out.shape[0]):
            soil, wet = dry[band, run] if by_cell else dry[band], out[band, run]
            above_all, back, entering = surface[band], inside[band], entrance[band]
            through = (1 - above_all) * (1 - back)
            for i in range(free.size):
                own = soil[i if by_cell else 0]
                below, above, under = grains_in_water(own, entering), 0.0, 1.0
                # The sum of the quotients of all films as one of two products: a division takes longer than the rest.
                for k in range(_FILMS):
                    up, kept = below_film(below, passed[band, k], back)
                    above = above * kept + covered[k, i] * up * under
                    under *= kept
                wet[i] = free[i] * own + (1 - free[i]) * above_all + through * above / under
    return wrong


@register_jitable
def _covered(moisture, bare, covered):
    """Shares of a soil below one film, two and more."""
    for i in range(moisture.size):
        mean = moisture[i] * _PER_MOISTURE
        share, rest = bare[i], 1.0 - bare[i]
        for k in range(1, _FILMS):
            share *= mean * (1.0 / k)
            covered[k - 1, i] = share
            rest -= share
        covered[_FILMS - 1, i] = rest


def check_moisture(moisture):
    """
    Refuse a moisture that is no share; NaN passes.

    Parameters
    ----------
    moisture : array
        [1]

    Raises
    ------
    ValueError
        If one is outside 0 to 1.

    Examples
    --------
    >>> check_moisture(0.3)
    """
    check_span(moisture, 0.0, "moisture is 0 where the soil is dry and 1 where it is saturated", "moisture=0.3")
