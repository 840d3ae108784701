"""Molecules and aerosol mixed: what successive orders of scattering say of an atmosphere."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre
from scipy.linalg import eigvalsh_tridiagonal

from fifesim.atmosphere.air import aerosols
from fifesim.atmosphere.schemes.phase_expansion import matrix_moments
from fifesim.atmosphere.schemes.stokes import stokes_reflectance
from fifesim.atmosphere.schemes.successive_orders import flux_transmittance, path_reflectance
from fifesim.atmosphere.schemes.terms import Scattering
from fifesim.base.geometry import scattering_angle_cosine

_MOMENTS = 48  # of the aerosol's scattering matrix: the solver uses the first 33
_COSINES = 500  # of a quadrature fine enough for the forward peak of coarse particles


class WholeScattering(NamedTuple):
    """What molecules and aerosol do together, along wavelength as last axis. [1]"""

    reflectance: np.ndarray  # over black ground, shape (V, R, n)
    transmittance_down: np.ndarray  # shape (n,)
    transmittance_up: np.ndarray  # shape (V, 1, n)
    spherical_albedo: np.ndarray  # shape (n,)


def mixed_scattering(atmosphere, wavelength, sza, vza, raa, *, polarized=True):
    """
    Scattering by wavelength after successive orders, in an atmosphere that mixes molecules and aerosol.

    Parameters
    ----------
    atmosphere, wavelength, sza, vza, raa
        As in `engines.scattering`.
    polarized : bool, optional
        Whether light is polarized, by molecules and aerosol.

    Returns
    -------
    scattering : terms.Scattering

    See Also
    --------
    fifesim.atmosphere.schemes.successive_orders.path_reflectance,
    fifesim.atmosphere.schemes.successive_orders.flux_transmittance

    Examples
    --------
    >>> from fifesim.atmosphere.air.models import Atmosphere
    >>> air = mixed_scattering(Atmosphere(), np.array([0.55]), 30.0, np.zeros(1), np.zeros(1))
    >>> bool(air.reflectance[0, 0, 0] > air.molecules_reflectance[0, 0, 0])
    True
    """
    views = tuple(np.asarray(vza, float).tolist()), tuple(np.asarray(raa, float).tolist())
    found = [_at_wavelength(atmosphere, float(w), float(sza), *views, polarized) for w in wavelength]
    return Scattering(*(np.stack(values, axis=-1) for values in zip(*found, strict=True)))


def whole_scattering(atmosphere, wavelength, sza, vza, raa, *, polarized=True):
    """
    What `mixed_scattering` says of molecules and aerosol together, in less than half of its time.

    Parameters
    ----------
    atmosphere, wavelength, sza, vza, raa, polarized
        As in `mixed_scattering`.

    Returns
    -------
    scattering : WholeScattering

    Examples
    --------
    >>> from fifesim.atmosphere.air.models import Atmosphere
    >>> case = Atmosphere(), np.array([0.55]), 30.0, np.zeros(1), np.zeros(1)
    >>> bool(whole_scattering(*case).reflectance == mixed_scattering(*case).reflectance)
    True
    """
    views = tuple(np.asarray(vza, float).tolist()), tuple(np.asarray(raa, float).tolist())
    found = [_whole(atmosphere, float(w), float(sza), *views, polarized) for w in wavelength]
    return WholeScattering(*(np.stack(values, axis=-1) for values in zip(*found, strict=True)))


@lru_cache(maxsize=1024)
def _whole(atmosphere, wavelength, sza, vza, raa, polarized):
    tau_r, tau_a, reflectance, flux = _light(atmosphere, wavelength, sza, vza, raa, polarized)
    total, spherical_albedo = flux(tau_r, tau_a)
    return WholeScattering(reflectance(tau_a), total[0], total[1:, None], spherical_albedo)


def _light(atmosphere, wavelength, sza, vza, raa, polarized):
    """Optical depths of molecules and aerosol, and functions that give reflectance and transmittance of some depths."""
    at = np.array([wavelength])
    tau_r, tau_a = float(atmosphere.rayleigh_optical_depth(at)[0]), float(atmosphere.aerosol_optical_depth(at)[0])
    cosine = scattering_angle_cosine(sza, np.array(vza)[:, None], np.array(raa))
    albedo, moments, phase = _aerosol(atmosphere, at, cosine, polarized)

    options = {"polarized": polarized, "vertical": aerosols.vertical(atmosphere.aerosol)}

    def reflectance(tau_aerosol):
        return path_reflectance(tau_r, tau_aerosol, albedo, moments, phase, sza, vza, raa, **options)

    def flux(tau_molecules, tau_aerosol):
        return flux_transmittance(tau_molecules, tau_aerosol, albedo, moments, (sza, *vza), **options)

    return tau_r, tau_a, reflectance, flux


@lru_cache(maxsize=1024)
def _at_wavelength(atmosphere, wavelength, sza, vza, raa, polarized):
    whole = _whole(atmosphere, wavelength, sza, vza, raa, polarized)
    tau_r, tau_a, reflectance, flux = _light(atmosphere, wavelength, sza, vza, raa, polarized)
    molecules, _ = flux(tau_r, 0.0)
    aerosol, _ = flux(0.0, tau_a)
    mu_s, mu_v = np.cos(np.radians(sza)), np.cos(np.radians(vza))[:, None]
    tau = tau_r + tau_a
    return Scattering(
        **whole._asdict(),
        molecules_reflectance=reflectance(0.0),
        optical_depth=tau,
        direct_transmittance_down=np.exp(-tau / mu_s),
        direct_transmittance_up=np.exp(-tau / mu_v),
        diffuse_up_molecules=molecules[1:, None] - np.exp(-tau_r / mu_v),
        diffuse_up_aerosol=aerosol[1:, None] - np.exp(-tau_a / mu_v),
    )


def _aerosol(atmosphere, wavelength, cosine, polarized):
    """Single scattering albedo, moments of the scattering matrix, and phase function of the aerosol."""
    if atmosphere.aot == 0:
        return 0.0, np.eye(1, _MOMENTS)[0], np.zeros(cosine.shape)
    _, albedo, _ = aerosols.aerosol_optics(atmosphere.aerosol, wavelength)
    phase = aerosols.aerosol_phase(atmosphere.aerosol, cosine, wavelength[0])
    return float(albedo[0]), _moments(atmosphere.aerosol, float(wavelength[0]), polarized), phase


@lru_cache
def _quadrature():
    """
    Gauss points and weights, to the bit those of `numpy.polynomial.legendre.leggauss`.

    That takes the eigenvalues of a full matrix, which is longer than all else at a wavelength.
    """
    last = np.append(np.zeros(_COSINES), 1)
    beside = np.diag(legendre.legcompanion(last), 1)
    cosines = eigvalsh_tridiagonal(np.zeros(_COSINES), beside)
    rise = legendre.legval(cosines, legendre.legder(last))
    cosines -= legendre.legval(cosines, last) / rise
    before = legendre.legval(cosines, last[1:])
    weights = 1 / ((before / np.abs(before).max()) * (rise / np.abs(rise).max()))
    cosines, weights = (cosines - cosines[::-1]) / 2, (weights + weights[::-1]) / 2
    return cosines, weights * (2 / weights.sum())


@lru_cache(maxsize=256)
def _moments(aerosol, wavelength, polarized):
    if not polarized:
        return aerosols.phase_moments(aerosol, np.array([wavelength]), _MOMENTS)[0]
    cosines, weights = _quadrature()
    phase = aerosols.aerosol_phase(aerosol, cosines, wavelength)
    polarization = aerosols.aerosol_polarization(aerosol, cosines, wavelength)
    return matrix_moments(phase, polarization, cosines, weights, _MOMENTS)


def mixed_stokes(atmosphere, wavelength, sza, vza, raa, *, at_ground=False, ground=0.0):
    """
    Polarized light at the top of an atmosphere, or of its sky at the ground, without gases.

    Parameters
    ----------
    atmosphere : models.Atmosphere
    wavelength : array, shape (n,)
        [um]
    sza : float
        [degree]
    vza, raa : array, shape (V,) and (R,)
        [degree]
    at_ground : bool, optional
    ground : float, optional
        Reflectance of the ground. [1]

    Returns
    -------
    stokes : array, shape (3, V, R, n)
        I, Q and U, in the signs of `stokes.stokes_reflectance`. [1]

    Examples
    --------
    >>> from fifesim.atmosphere.air.models import Atmosphere
    >>> sky = mixed_stokes(Atmosphere(), np.array([0.45, 0.7]), 30.0, np.zeros(1), np.zeros(1), at_ground=True)
    >>> bool(sky[0, 0, 0, 0] > sky[0, 0, 0, 1])
    True
    """
    cosine = scattering_angle_cosine(sza, np.asarray(vza, float)[:, None], np.asarray(raa, float))
    cosine = -cosine if at_ground else cosine
    vertical = aerosols.vertical(atmosphere.aerosol)
    options = {"at_ground": at_ground, "ground": ground, "vertical": vertical}
    found = []
    for at in np.asarray(wavelength, float)[:, None]:
        depths = (
            float(depth(at)[0]) for depth in (atmosphere.rayleigh_optical_depth, atmosphere.aerosol_optical_depth)
        )
        *aerosol, phase = _aerosol(atmosphere, at, cosine, True)
        none = np.zeros(cosine.shape)
        polarization = aerosols.aerosol_polarization(atmosphere.aerosol, cosine, at[0]) if atmosphere.aot else none
        optics = *depths, *aerosol, phase, polarization
        found.append(stokes_reflectance(*optics, sza, vza, raa, **options))
    return np.stack(found, axis=-1)
