"""Closed forms of 5S for scattering by molecules and aerosol."""

import numpy as np
from scipy.special import expn

from fifesim.atmosphere import aerosols, gases
from fifesim.atmosphere.coupling import Scattering
from fifesim.atmosphere.two_stream import POLE, conservative_transmittance, delta_eddington, eddington_field
from fifesim.base.geometry import scattering_angle_cosine

# Zenith cosines and weights over the hemisphere: 16 nodes integrate a plane albedo to 1e-7.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_MU, _MU_WEIGHTS = (_NODES + 1) / 2, _WEIGHTS / 2


def sobolev_conservative_reflectance(tau, phase, mu_s, mu_v):
    r"""
    Reflectance of a conservative layer whose scattering is symmetric forward and back, such as the molecules.

    .. math::

        \rho &= 1 - \frac{R(\mu_s) R(\mu_v)}{4 + 3 \tau} \\
            &\quad + \left[P - 2 (\mu_s + \mu_v) + 3 \mu_s \mu_v\right] \frac{1 - e^{-m \tau}}{4 (\mu_s + \mu_v)} \\
        R(\mu) &= 1 + \tfrac{3}{2} \mu + \left(1 - \tfrac{3}{2} \mu\right) e^{-\tau / \mu} \\
        m &= \frac{1}{\mu_s} + \frac{1}{\mu_v}

    Parameters
    ----------
    tau : array
        Optical depth. [1]
    phase : array
        Phase function at the scattering angle, :math:`P`; single scattering is exact in it. [1]
    mu_s, mu_v : array
        Cosines of the zenith angles of sun and sensor. [1]

    Returns
    -------
    reflectance : array, shape of the broadcast inputs
        Reflectance of the layer over a black surface. [1]

    Notes
    -----
    Scalar, without polarization. Compared with scalar successive orders it is 5.5, 2.1 and 0.9 % low at 0.44, 0.66 and
    0.84 um with the sun at 28 degrees and a nadir view; 11, 5 and 2 % with the sun at 60 and the view at 40.

    References
    ----------
    [Sobolev1975]_; [Tanre1990]_
    """
    down, up = (1 + 1.5 * mu + (1 - 1.5 * mu) * np.exp(-tau / mu) for mu in (mu_s, mu_v))
    single = -np.expm1(-tau * (1 / mu_s + 1 / mu_v)) / (4 * (mu_s + mu_v))
    return 1 - down * up / (4 + 3 * tau) + (phase - 2 * (mu_s + mu_v) + 3 * mu_s * mu_v) * single


def conservative_spherical_albedo(tau):
    r"""
    Spherical albedo of a conservative layer whose scattering is symmetric forward and back.

    .. math:: S = \frac{3 \tau - 4 E_3(\tau) + 6 E_4(\tau)}{4 + 3 \tau}

    Parameters
    ----------
    tau : array
        Optical depth. [1]

    Returns
    -------
    spherical_albedo : array
        The hemispherical mean of :math:`1 - T`. [1]

    References
    ----------
    [Tanre1990]_
    """
    return (3 * tau - 4 * expn(3, tau) + 6 * expn(4, tau)) / (4 + 3 * tau)


def spherical_albedo(tau, single_scattering_albedo, asymmetry):
    r"""
    Spherical albedo of a layer from the delta-Eddington plane albedo.

    .. math:: S = 2 \int_0^1 R(\mu) \, \mu \, \mathrm{d}\mu

    Parameters
    ----------
    tau, single_scattering_albedo, asymmetry : array
        As in `delta_eddington`. [1]

    Returns
    -------
    spherical_albedo : array, shape of the broadcast inputs
        [1]

    References
    ----------
    [Joseph1976]_; [Tanre1990]_
    """
    layer = [np.asarray(value, float)[..., None] for value in (tau, single_scattering_albedo, asymmetry)]
    albedo, _ = delta_eddington(*layer, _MU)
    return 2 * albedo @ (_MU * _MU_WEIGHTS)


def sobolev_reflectance(tau, single_scattering_albedo, asymmetry, phase, mu_s, mu_v):
    r"""
    Reflectance of an absorbing layer, with the exact phase function for single scattering and two terms for the rest.

    .. math::

        \rho = \frac{1}{\mu_s} \int_0^\tau \left[\omega J + 3 \omega g \mu_v H
            + \frac{\omega}{4} P e^{-t / \mu_s}\right] e^{-t / \mu_v} \frac{\mathrm{d}t}{\mu_v}

    where :math:`J` and :math:`H` are the mean and the net upward diffuse intensity of the Eddington approximation.

    Parameters
    ----------
    tau, single_scattering_albedo, asymmetry : array
        As in `delta_eddington`, of the whole phase function with its forward peak. [1]
    phase, mu_s, mu_v : array
        As in `sobolev_conservative_reflectance`. [1]

    Returns
    -------
    reflectance : array, shape of the broadcast inputs
        Reflectance of the layer over a black surface. [1]

    Notes
    -----
    Compared with scalar successive orders, for continental aerosol, visibility from 23 km and sun within 45 degrees:
    within 6 % (0.0007) at scattering angles above 150 degrees, 1 to 21 % low (0.007) at 80 to 150, where the second
    order of the forward peak counts.

    References
    ----------
    [Sobolev1975]_; [Tanre1990]_
    """
    albedo = np.minimum(single_scattering_albedo, 1 - POLE)
    field = eddington_field(tau, albedo, asymmetry, mu_s)
    coupling = 3 * albedo * asymmetry * mu_v
    # Integrals over t of e^{-t / mu_v} with e^{k (t - tau)}, with e^{-k t} and with e^{-t / mu_s}.
    difference = 1 / mu_v - field.rate
    difference = np.where(np.abs(difference) < POLE, POLE, difference)
    upward = (np.exp(-field.rate * tau) - np.exp(-tau / mu_v)) / difference
    downward = -np.expm1(-tau * (1 / mu_v + field.rate)) / (1 / mu_v + field.rate)
    slant = 1 / mu_v + 1 / field.mu_s
    beam = -np.expm1(-tau * slant) / slant
    source = (
        field.growing * (albedo + coupling * field.ratio) * upward
        + field.decaying * (albedo - coupling * field.ratio) * downward
        + (albedo * field.mean_direct + coupling * field.net_direct + albedo / 4 * phase) * beam
    )
    return source / (mu_s * mu_v)


def five_s_scattering(atmosphere, wavelength, sza, vza, raa):
    r"""
    Scattering by wavelength according to 5S.

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
    Compared with 6SV1.1 for continental aerosol, visibility of at least 23 km, sun within 45 and view within 55
    degrees, the rms difference at a reflectance of 0.3 is 1.9, 1.1, 0.8, 0.3, 0.2 and 0.1 % in Landsat TM1 to 5 and 7.

    References
    ----------
    [Tanre1990]_
    """
    mu_s, mu_v = np.cos(np.radians(sza)), np.cos(np.radians(vza))[:, None, None]
    cosine = scattering_angle_cosine(sza, vza[:, None], raa)[..., None]
    tau_r, tau_a = atmosphere.rayleigh_optical_depth(wavelength), atmosphere.aerosol_optical_depth(wavelength)
    phase = gases.rayleigh_phase(cosine)
    molecules_reflectance = sobolev_conservative_reflectance(tau_r, phase, mu_s, mu_v)
    albedo, asymmetry, aerosol_reflectance = _aerosol(atmosphere, tau_a, cosine, wavelength, mu_s, mu_v)
    down_r, up_r = (conservative_transmittance(tau_r, mu) for mu in (mu_s, mu_v))
    (_, down_a), (_, up_a) = (delta_eddington(tau_a, albedo, asymmetry, mu) for mu in (mu_s, mu_v))
    spherical_r = conservative_spherical_albedo(tau_r)
    spherical_a = spherical_albedo(tau_a, albedo, asymmetry)
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
    """Single scattering albedo, asymmetry and reflectance of the aerosol."""
    if atmosphere.aot == 0:
        return np.zeros_like(tau), np.zeros_like(tau), np.zeros(cosine.shape[:-1] + tau.shape)
    _, albedo, asymmetry = aerosols.aerosol_optics(atmosphere.aerosol, wavelength)
    phase = aerosols.aerosol_phase(atmosphere.aerosol, cosine, wavelength)
    return albedo, asymmetry, sobolev_reflectance(tau, albedo, asymmetry, phase, mu_s, mu_v)
