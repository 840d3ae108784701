"""Molecules and aerosol mixed: what successive orders of scattering say of an atmosphere."""

from functools import lru_cache

import numpy as np

from fifesim.atmosphere.air import aerosols
from fifesim.atmosphere.schemes.phase_expansion import matrix_moments
from fifesim.atmosphere.schemes.successive_orders import flux_transmittance, path_reflectance
from fifesim.atmosphere.schemes.terms import Scattering
from fifesim.base.geometry import scattering_angle_cosine

_MOMENTS = 48  # of the aerosol's scattering matrix: the solver uses the first 33
_COSINES = 500  # of a quadrature fine enough for the forward peak of coarse particles


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


@lru_cache(maxsize=1024)
def _at_wavelength(atmosphere, wavelength, sza, vza, raa, polarized):
    at = np.array([wavelength])
    tau_r, tau_a = float(atmosphere.rayleigh_optical_depth(at)[0]), float(atmosphere.aerosol_optical_depth(at)[0])
    cosine = scattering_angle_cosine(sza, np.array(vza)[:, None], np.array(raa))
    albedo, moments, phase = _aerosol(atmosphere, at, cosine, polarized)

    options = {"polarized": polarized, "vertical": aerosols.vertical(atmosphere.aerosol)}

    def reflectance(tau_aerosol):
        return path_reflectance(tau_r, tau_aerosol, albedo, moments, phase, sza, vza, raa, **options)

    def flux(tau_molecules, tau_aerosol):
        return flux_transmittance(tau_molecules, tau_aerosol, albedo, moments, (sza, *vza), **options)

    total, spherical_albedo = flux(tau_r, tau_a)
    molecules, _ = flux(tau_r, 0.0)
    aerosol, _ = flux(0.0, tau_a)
    mu_s, mu_v = np.cos(np.radians(sza)), np.cos(np.radians(vza))[:, None]
    tau = tau_r + tau_a
    return Scattering(
        reflectance=reflectance(tau_a),
        molecules_reflectance=reflectance(0.0),
        transmittance_down=total[0],
        transmittance_up=total[1:, None],
        spherical_albedo=spherical_albedo,
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


@lru_cache(maxsize=256)
def _moments(aerosol, wavelength, polarized):
    if not polarized:
        return aerosols.phase_moments(aerosol, np.array([wavelength]), _MOMENTS)[0]
    cosines, weights = np.polynomial.legendre.leggauss(_COSINES)
    phase = aerosols.aerosol_phase(aerosol, cosines, wavelength)
    polarization = aerosols.aerosol_polarization(aerosol, cosines, wavelength)
    return matrix_moments(phase, polarization, cosines, weights, _MOMENTS)
