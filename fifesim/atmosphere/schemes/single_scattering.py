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
    if atmosphere.aot == 0:
        return Once(*np.zeros((3, wavelength.size)), np.zeros((wavelength.size, cosine.size)))
    overlying = np.zeros(wavelength.size)
    if atmosphere.engine != "5S":
        # The closed forms know of no molecules above the aerosol.
        overlying = dataclasses.replace(atmosphere, altitude=0.0).rayleigh_optical_depth(wavelength)
    _, albedo, _ = aerosols.aerosol_optics(atmosphere.aerosol, wavelength)
    phase = aerosols.aerosol_phase(atmosphere.aerosol, cosine, wavelength[:, None])
    return Once(albedo, atmosphere.aerosol_optical_depth(wavelength), overlying, phase)


@njit(nogil=True, cache=True)
def once_reflectance(sza, vza, raa, albedo, depth, overlying, phase):
    r"""
    Reflectance by single scattering in one band.

    .. math:: \rho_1 = \frac{\omega P(\Theta)}{4 (\mu_s + \mu_v)} \left(1 - e^{-m \tau_A}\right) e^{-m \tau_R}

    Parameters
    ----------
    sza, vza, raa : float
        [degree]
    albedo, depth, overlying : float
    phase : array, shape (721,)
        As in `Once`. [1]

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

    >>> once_reflectance(30.0, 10.0, 50.0, 0.9, 0.0, 0.1, np.ones(721))
    0.0
    """
    mu_s, mu_v = np.cos(np.radians(sza)), np.cos(np.radians(vza))
    sines = np.sin(np.radians(sza)) * np.sin(np.radians(vza))
    cosine = min(max(-mu_s * mu_v - sines * np.cos(np.radians(raa)), -1.0), 1.0)
    place = np.degrees(np.arccos(cosine)) / STEP
    index = min(int(place), phase.size - 2)
    between = phase[index] + (place - index) * (phase[index + 1] - phase[index])
    air_mass = 1 / mu_s + 1 / mu_v
    return albedo * between / (4 * (mu_s + mu_v)) * -np.expm1(-air_mass * depth) * np.exp(-air_mass * overlying)


@njit(nogil=True, cache=True)
def once_on_nodes(sza, vza, raa, albedo, depth, overlying, phase):
    """
    The same at all combinations of some angles and bands.

    Parameters
    ----------
    sza, vza, raa : array, shape (S,), (V,) and (R,)
        [degree]
    albedo, depth, overlying, phase : array
        As in `Once`. [1]

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
    >>> once_on_nodes(30 * one, one, one, one, 0 * one, one, np.ones((1, 721))).shape
    (1, 1, 1, 1)
    """
    out = np.empty((sza.size, vza.size, raa.size, albedo.size))
    for s in range(sza.size):
        for v in range(vza.size):
            for r in range(raa.size):
                for b in range(albedo.size):
                    out[s, v, r, b] = once_reflectance(
                        sza[s], vza[v], raa[r], albedo[b], depth[b], overlying[b], phase[b]
                    )
    return out
