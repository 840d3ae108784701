"""Light that the aerosol scatters once: sharper in angle than the rest of the path, and known in closed form."""

import dataclasses
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit

from fifesim.atmosphere.air import aerosols

STEP = 0.25  # between scattering angles of the phase function [degree]


class Once(NamedTuple):
    """What single scattering by the aerosol depends on in each band. [1]"""

    albedo: np.ndarray  # of single scattering, shape (band,)
    depth: np.ndarray  # of the aerosol, shape (band,)
    overlying: np.ndarray  # depth of the molecules above it, shape (band,)
    phase: np.ndarray  # by scattering angle every `STEP`, shape (band, 721)


@lru_cache(maxsize=64)
def scattered_once(atmosphere, bands):
    """
    Single scattering by the aerosol at the middle of each band.

    Parameters
    ----------
    atmosphere : models.Atmosphere
        Its altitude does not count.
    bands : tuple of Band

    Returns
    -------
    once : Once
    """
    wavelength = np.array([band.center for band in bands])
    cosine = np.cos(np.radians(np.arange(0, 180 + STEP / 2, STEP)))
    none = np.zeros(wavelength.size)
    if atmosphere.aot == 0:
        return Once(none, none, none, np.zeros((wavelength.size, cosine.size)))
    overlying = none
    if atmosphere.engine != "5S":
        # The closed forms know of no molecules above the aerosol.
        overlying = dataclasses.replace(atmosphere, altitude=0.0).rayleigh_optical_depth(wavelength)
    _, albedo, _ = aerosols.aerosol_optics(atmosphere.aerosol, wavelength)
    phase = aerosols.aerosol_phase(atmosphere.aerosol, cosine, wavelength[:, None])
    return Once(albedo, atmosphere.aerosol_optical_depth(wavelength), overlying, phase)


@njit(nogil=True, cache=True)
def once_reflectance(sza, vza, raa, once, band):
    r"""
    Reflectance by single scattering in one band.

    .. math:: \rho_1 = \frac{\omega P(\Theta)}{4 (\mu_s + \mu_v)} \left(1 - e^{-m \tau_A}\right) e^{-m \tau_R}

    Parameters
    ----------
    sza, vza, raa : float
        [degree]
    once : Once
    band : int
        Number of the band in it.

    Returns
    -------
    reflectance : float
        [1]

    References
    ----------
    [Tanre1990]_

    Examples
    --------
    No aerosol scatters nothing:

    >>> one = np.ones(1)
    >>> once_reflectance(30.0, 10.0, 50.0, Once(albedo=one, depth=0 * one, overlying=one, phase=np.ones((1, 721))), 0)
    0.0
    """
    mu_s, mu_v = np.cos(np.radians(sza)), np.cos(np.radians(vza))
    sines = np.sin(np.radians(sza)) * np.sin(np.radians(vza))
    cosine = min(max(-mu_s * mu_v - sines * np.cos(np.radians(raa)), -1.0), 1.0)
    place = np.degrees(np.arccos(cosine)) / STEP
    phase = once.phase[band]
    index = min(int(place), phase.size - 2)
    between = phase[index] + (place - index) * (phase[index + 1] - phase[index])
    air_mass = 1 / mu_s + 1 / mu_v
    turned = once.albedo[band] * between / (4 * (mu_s + mu_v))
    return turned * -np.expm1(-air_mass * once.depth[band]) * np.exp(-air_mass * once.overlying[band])


@njit(nogil=True, cache=True)
def once_on_nodes(sza, vza, raa, once):
    """
    The same at all combinations of some angles and bands.

    Parameters
    ----------
    sza, vza, raa : array, shape (S,), (V,) and (R,)
        [degree]
    once : Once

    Returns
    -------
    reflectance : array, shape (S, V, R, band)
        [1]

    References
    ----------
    [Tanre1990]_

    Examples
    --------
    >>> one = np.ones(1)
    >>> once_on_nodes(30 * one, one, one, Once(one, 0 * one, one, np.ones((1, 721)))).shape
    (1, 1, 1, 1)
    """
    out = np.empty((sza.size, vza.size, raa.size, once.albedo.size))
    for s in range(sza.size):
        for v in range(vza.size):
            for r in range(raa.size):
                for b in range(once.albedo.size):
                    out[s, v, r, b] = once_reflectance(sza[s], vza[v], raa[r], once, b)
    return out
