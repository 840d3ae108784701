"""The closed forms of 5S for what molecules and aerosol do to light."""

import numpy as np

from fifesim.atmosphere.air import aerosols, molecules
from fifesim.atmosphere.schemes import scattering
from fifesim.atmosphere.schemes.terms import Scattering
from fifesim.base.geometry import scattering_angle_cosine


def five_s_scattering(atmosphere, wavelength, sza, vza, raa):
    r"""
    Scattering by wavelength after 5S.

    Molecules and aerosol are added without a cross term, :math:`\rho_a = \rho_R + \rho_A` and
    :math:`S = S_R + S_A`, and their transmittances multiplied, :math:`T = T_R T_A`.

    Parameters
    ----------
    atmosphere, wavelength, sza, vza, raa
        As in `engines.scattering`.

    Returns
    -------
    scattering : terms.Scattering

    Notes
    -----
    Beside 6SV1.1, continental aerosol, visibility 23 km and more, sun within 45 and view within 55 degrees: at a
    reflectance of 0.3 the rms difference is 1.9, 1.1, 0.8, 0.3, 0.2 and 0.1 % in Landsat TM1 to 5 and 7.

    References
    ----------
    [Tanre1990]_

    Examples
    --------
    >>> from fifesim.atmosphere.air.models import Atmosphere
    >>> air = five_s_scattering(Atmosphere(), np.array([0.45, 0.65]), 30.0, np.zeros(1), np.zeros(1))
    >>> blue, red = air.reflectance[0, 0]
    >>> bool(blue > red)
    True
    """
    mu_s, mu_v = np.cos(np.radians(sza)), np.cos(np.radians(vza))[:, None, None]
    cosine = scattering_angle_cosine(sza, vza[:, None], raa)[..., None]
    tau_r, tau_a = atmosphere.rayleigh_optical_depth(wavelength), atmosphere.aerosol_optical_depth(wavelength)
    phase = molecules.rayleigh_phase(cosine)
    molecules_reflectance = scattering.sobolev_conservative_reflectance(tau_r, phase, mu_s, mu_v)
    albedo, asymmetry, aerosol_reflectance = _aerosol(atmosphere, tau_a, cosine, wavelength, mu_s, mu_v)
    down_r, up_r = (scattering.conservative_transmittance(tau_r, mu) for mu in (mu_s, mu_v))
    (_, down_a), (_, up_a) = (scattering.delta_eddington(tau_a, albedo, asymmetry, mu) for mu in (mu_s, mu_v))
    spherical_r = scattering.conservative_spherical_albedo(tau_r)
    spherical_a = scattering.spherical_albedo(tau_a, albedo, asymmetry)
    tau = tau_r + tau_a
    return Scattering(
        reflectance=molecules_reflectance + aerosol_reflectance,
        molecules_reflectance=molecules_reflectance,
        transmittance_down=down_r * down_a,
        transmittance_up=up_r * up_a,
        spherical_albedo=spherical_r + spherical_a,
        optical_depth=tau,
        direct_transmittance_down=np.exp(-tau / mu_s),
        direct_transmittance_up=np.exp(-tau / mu_v),
        diffuse_up_molecules=up_r - np.exp(-tau_r / mu_v),
        diffuse_up_aerosol=up_a - np.exp(-tau_a / mu_v),
    )


def _aerosol(atmosphere, tau, cosine, wavelength, mu_s, mu_v):
    """Single scattering albedo and asymmetry of the aerosol, and its reflectance."""
    if atmosphere.aot == 0:
        return np.zeros_like(tau), np.zeros_like(tau), np.zeros(cosine.shape[:-1] + tau.shape)
    _, albedo, asymmetry = aerosols.aerosol_optics(atmosphere.aerosol, wavelength)
    phase = aerosols.aerosol_phase(atmosphere.aerosol, cosine, wavelength)
    return albedo, asymmetry, scattering.sobolev_reflectance(tau, albedo, asymmetry, phase, mu_s, mu_v)
