"""Soil below a canopy: its brightness along the soil line, and water that darkens it."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numba.extending import register_jitable

from fifesim.base import datasets
from fifesim.ground.canopy.prospect import interface_transmissivity
from fifesim.ground.canopy.spectra import band_means

# Where the reflectance of a soil is its brightness: in the midst of visible light, as for aerosol and visibility. [um]
GREEN = 0.55

# Of the brightness-shape-moisture model, Yang et al. (2020): the water of the driest and of the wettest soil that it is
# for, and what a soil holds in its first film, in percent of the volume; the thickness of a film [cm]; and the index of
# refraction of what soils are made of.
DRIEST, WETTEST = 5.0, 55.0
CAPACITY = 25.0
FILM = 0.015
SOIL_INDEX = 2.0

# Half opening of the cone from which light falls on a film, as on a leaf in PROSPECT. [degree]
_CONE = 40.0

# Deeper than so many films is less than 2 % of the wettest soil, which counts as so many.
_FILMS = 6


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


def soil_line(bands):
    r"""
    Change of the reflectance of bands along the soil line, for a change of brightness.

    .. math:: s_b = \frac{d_b}{d(0.55 \, \mu m)}, \quad d = r_{dry} - r_{wet}

    Parameters
    ----------
    bands : sequence of fifesim.base.bands.Band

    Returns
    -------
    slope : array, shape (band,)
        [1]

    Raises
    ------
    ValueError
        If a band lies beyond the spectra, 0.4 to 2.45 um.

    Notes
    -----
    The line leads through the two soils of ``data/ground_spectra.csv``: TM4 changes by 1.20 where TM3 changes by 1.

    References
    ----------
    [Baret1993]_ for soil lines of many bands

    Examples
    --------
    >>> from fifesim.base.bands import Band
    >>> soil_line([Band("green", (0.549, 0.55, 0.551), (0, 1, 0))]).round(3).tolist()
    [1.0]
    """
    table = datasets.table("ground_spectra.csv")
    wavelength, change = (each.to_numpy() for each in (table["wavelength"], table["soil_dry"] - table["soil_wet"]))
    _check_range(bands, wavelength)
    return band_means(bands, wavelength, change) / np.interp(GREEN, wavelength, change)


def brightened(reflectance, brightness, line):
    """
    Reflectance of a soil that is brighter, or darker, along the soil line.

    Parameters
    ----------
    reflectance : array, shape (..., band)
        NaN gives NaN. [1]
    brightness : array, shape (...)
        Change of the reflectance at 0.55 um; NaN gives NaN. [1]
    line : array, shape (band,)
        From `soil_line`.

    Returns
    -------
    reflectance : array, shape (..., band)
        Cut off at 0 and 1, where a soil cannot be darker or brighter. [1]

    Raises
    ------
    ValueError
        If a change is beyond -1 to 1.

    Examples
    --------
    >>> brightened(np.array([0.15, 0.19]), -0.1, np.array([1.0, 2.0])).round(3).tolist()
    [0.05, 0.0]
    """
    check_brightness(brightness)
    return np.clip(reflectance + np.asarray(brightness, float)[..., None] * line, 0.0, 1.0)


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
    _check_range(bands, wavelength)
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
    up = passed * below
    return surface + (1 - surface) * (1 - inside) * up / (1 - inside * up)


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
    the water reflects 2 %: a soil darker than 3 % becomes brighter. More than six films count as six.

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
    check_moisture(moisture)
    moisture, dry = np.asarray(moisture, float), np.asarray(dry, float)
    shape = np.broadcast_shapes((*moisture.shape, 1), dry.shape)
    dry = np.ascontiguousarray(np.broadcast_to(dry, shape)).reshape(-1, shape[-1])
    water = np.ascontiguousarray(np.broadcast_to(moisture, shape[:-1])).reshape(-1)
    out = np.empty(dry.shape)
    _moisten(dry, water, *films, out)
    return out.reshape(shape)


@njit(nogil=True, cache=True)
def _moisten(dry, moisture, surface, inside, entrance, passed, out):
    covered = np.empty(_FILMS + 1)
    for i in range(dry.shape[0]):
        mean = moisture[i] * ((WETTEST - DRIEST) / CAPACITY)
        share, rest = np.exp(-mean), 1.0
        for k in range(_FILMS):
            covered[k] = share
            rest -= share
            share *= mean / (k + 1)
        covered[_FILMS] = rest
        for band in range(dry.shape[1]):
            below = grains_in_water(dry[i, band], entrance[band])
            total = covered[0] * dry[i, band]
            for k in range(_FILMS):
                total += covered[k + 1] * wet_soil(below, passed[band, k], surface[band], inside[band])
            out[i, band] = total


def check_brightness(brightness):
    """
    Refuse a change of reflectance that none can have; NaN passes.

    Parameters
    ----------
    brightness : array
        [1]

    Raises
    ------
    ValueError
        If one is outside -1 to 1.

    Examples
    --------
    >>> check_brightness(-0.04)
    """
    _check(brightness, -1.0, "soil is a change of reflectance along the soil line", "soil=0.04, not percent")


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
    _check(moisture, 0.0, "moisture is 0 where the soil is dry and 1 where it is saturated", "moisture=0.3")


def _check(values, lowest, meaning, such_as):
    values = np.asarray(values, float)
    low, high = (np.fmin.reduce(values, axis=None, initial=0.0), np.fmax.reduce(values, axis=None, initial=0.0))
    if low < lowest or high > 1:
        name = meaning.partition(" ")[0]
        wrong = low if low < lowest else high
        raise ValueError(f"{name} must be in [{lowest:g}, 1], got {wrong:g}: {meaning}; give for instance {such_as}")


def _check_range(bands, wavelength):
    for band in bands:
        if band.limits[0] < wavelength[0] or band.limits[1] > wavelength[-1]:
            raise ValueError(
                f"no soil line for band {band.name}, {band.limits[0]:g} to {band.limits[1]:g} um: its spectra have "
                f"{wavelength[0]:g} to {wavelength[-1]:g} um; give bands= without it, or soil as background= by cell"
            )
