"""Radiative transfer engines behind one function, and the successive-orders engine of mixed air."""

from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre
from scipy.linalg import eigvalsh_tridiagonal

from fifesim.atmosphere import aerosols
from fifesim.atmosphere.column import matrix_moments
from fifesim.atmosphere.coupling import BandTerms, Scattering, band_mean_terms, nodes_of
from fifesim.atmosphere.five_s import five_s_scattering
from fifesim.atmosphere.gases import gas_transmittance, table_wavelengths
from fifesim.atmosphere.successive_orders import flux_transmittance, path_reflectance
from fifesim.base.arguments import Range, check_number
from fifesim.base.bands import solar_irradiance_steps
from fifesim.base.caches import cached
from fifesim.base.geometry import scattering_angle_cosine

_MOMENTS = 48  # of the scattering matrix of the aerosol; the solver uses the first 33
_COSINES = 500  # of a quadrature fine enough for the forward peak of coarse particles


class WholeScattering(NamedTuple):
    """Joint scattering by molecules and aerosol, with wavelength as the last axis. [1]"""

    reflectance: np.ndarray  # over black ground, shape (V, R, n)
    transmittance_down: np.ndarray  # shape (n,)
    transmittance_up: np.ndarray  # shape (V, 1, n)
    spherical_albedo: np.ndarray  # shape (n,)


def mixed_scattering(atmosphere, wavelength, sza, vza, raa, *, polarized=True):
    """Scattering by wavelength, by successive orders, in a mixture of molecules and aerosol."""
    return _by_wavelength(_at_wavelength, atmosphere, wavelength, sza, vza, raa, polarized)


def whole_scattering(atmosphere, wavelength, sza, vza, raa, *, polarized=True):
    """Joint scattering by molecules and aerosol as in `mixed_scattering`, in less than half of the time."""
    return _by_wavelength(_whole, atmosphere, wavelength, sza, vza, raa, polarized)


def _by_wavelength(function, atmosphere, wavelength, sza, vza, raa, polarized):
    """Results of a function for each wavelength, stacked along a last axis."""
    views = tuple(np.asarray(vza, float).tolist()), tuple(np.asarray(raa, float).tolist())
    found = [function(atmosphere, float(w), float(sza), *views, polarized) for w in wavelength]
    return type(found[0])(*(np.stack(values, axis=-1) for values in zip(*found, strict=True)))


@cached(1024, "reflectance and transmittance by successive orders")
def _whole(atmosphere, wavelength, sza, vza, raa, polarized):
    tau_r, tau_a, reflectance, flux = _light(atmosphere, wavelength, sza, vza, raa, polarized)
    total, spherical_albedo = flux(tau_r, tau_a)
    return WholeScattering(reflectance(tau_a), total[0], total[1:, None], spherical_albedo)


def _light(atmosphere, wavelength, sza, vza, raa, polarized):
    """Optical depths of molecules and aerosol, and functions for the reflectance and transmittance of given depths."""
    at = np.array([wavelength])
    tau_r, tau_a = float(atmosphere.rayleigh_optical_depth(at)[0]), float(atmosphere.aerosol_optical_depth(at)[0])
    cosine = scattering_angle_cosine(sza, np.array(vza)[:, None], np.array(raa))
    albedo, moments, phase = scatterers(atmosphere, at, cosine, polarized)

    options = {"polarized": polarized, "vertical": aerosols.vertical(atmosphere.aerosol)}

    def reflectance(tau_aerosol):
        return path_reflectance(tau_r, tau_aerosol, albedo, moments, phase, sza, vza, raa, **options)

    def flux(tau_molecules, tau_aerosol):
        return flux_transmittance(tau_molecules, tau_aerosol, albedo, moments, (sza, *vza), **options)

    return tau_r, tau_a, reflectance, flux


@cached(1024, "scattering by successive orders")
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


def scatterers(atmosphere, wavelength, cosine, polarized):
    """Single scattering albedo, moments of the scattering matrix, and phase function of the aerosol."""
    if atmosphere.aot == 0:
        return 0.0, np.eye(1, _MOMENTS)[0], np.zeros(cosine.shape)
    _, albedo, _ = aerosols.aerosol_optics(atmosphere.aerosol, wavelength)
    phase = aerosols.aerosol_phase(atmosphere.aerosol, cosine, wavelength[0])
    return float(albedo[0]), _moments(atmosphere.aerosol, float(wavelength[0]), polarized), phase


@cached(128, "quadrature of phase functions")
def _quadrature():
    """Gauss-Legendre points and weights, identical to the bit to `numpy.polynomial.legendre.leggauss`."""
    # numpy computes the eigenvalues of a full matrix, which takes longer than all other work at a wavelength.
    last = np.append(np.zeros(_COSINES), 1)
    beside = np.diag(legendre.legcompanion(last), 1)
    cosines = eigvalsh_tridiagonal(np.zeros(_COSINES), beside)
    rise = legendre.legval(cosines, legendre.legder(last))
    cosines -= legendre.legval(cosines, last) / rise
    before = legendre.legval(cosines, last[1:])
    weights = 1 / ((before / np.abs(before).max()) * (rise / np.abs(rise).max()))
    cosines, weights = (cosines - cosines[::-1]) / 2, (weights + weights[::-1]) / 2
    return cosines, weights * (2 / weights.sum())


@cached(256, "moments of the scattering matrix of an aerosol")
def _moments(aerosol, wavelength, polarized):
    if not polarized:
        return aerosols.phase_moments(aerosol, np.array([wavelength]), _MOMENTS)[0]
    cosines, weights = _quadrature()
    phase = aerosols.aerosol_phase(aerosol, cosines, wavelength)
    polarization = aerosols.aerosol_polarization(aerosol, cosines, wavelength)
    return matrix_moments(phase, polarization, cosines, weights, _MOMENTS)


LARGEST_ZENITH = 75.0  # the plane-parallel atmosphere holds to here [degree]
_ZENITH = Range("degree", 0, LARGEST_ZENITH, note="the plane-parallel atmosphere is not valid beyond")

SCATTERING = {
    "5S": five_s_scattering,
    "successive-orders": mixed_scattering,
}


def band_terms(atmosphere, bands, sza, vza, raa):
    """
    Terms of the coupling equation in each band, by the engine of the atmosphere.

    Parameters
    ----------
    atmosphere : models.Atmosphere
    bands : sequence of Band, length (band,)
        Within 0.4 to 2.5 um.
    sza, vza : float
        0 to 75. [degree]
    raa : float
        0 has sun and sensor on the same side. [degree]

    Returns
    -------
    terms : BandTerms
        Read-only arrays of shape (band,). [1]

    References
    ----------
    [Tanre1990]_
    """
    return _band_terms(atmosphere, tuple(bands), float(sza), float(vza), float(raa))


def light_at_ground(atmosphere, bands, sza, photons=True):
    r"""
    Share of each band in the sunlight that reaches black ground, and the diffuse fraction of its flux.

    .. math:: w_i \propto T_i(\theta_s) \int_i E(\lambda) \, \lambda \, T_g(\lambda) \, d\lambda

    Parameters
    ----------
    atmosphere : models.Atmosphere
    bands : sequence of Band, length (band,)
        Within 0.4 to 2.5 um.
    sza : float
        [degree]
    photons : bool, optional
        Count photons; energy, without the factor :math:`\lambda`, if False.

    Returns
    -------
    shares, diffuse_fraction : array, shape (band,)
        The shares sum to 1. [1]

    Notes
    -----
    Light that the ground reflects and the atmosphere sends back is left out: it has nearly the same spectrum.
    """
    flux, diffuse_fraction = flux_at_ground(atmosphere, bands, sza, photons)
    return flux / flux.sum(), diffuse_fraction


def flux_at_ground(atmosphere, bands, sza, photons=True):
    """Relative flux of each band on level ground per cosine of the sun's zenith angle, and diffuse fraction."""
    terms = band_terms(atmosphere, tuple(bands), sza, 0.0, 0.0)
    wavelength = table_wavelengths()
    gas = gas_transmittance(wavelength, atmosphere, 1 / np.cos(np.radians(sza)))
    spectrum = solar_irradiance_steps(wavelength) * gas * (wavelength if photons else 1.0)
    means = [band.mean(spectrum, wavelength) * np.trapezoid(band.response, band.wavelength) for band in bands]
    return np.array(means) * terms.transmittance_down, terms.diffuse_fraction


def check_zenith(name, angle):
    """Raise ValueError if a zenith angle is outside of the range of all engines."""
    check_number(name, angle, _ZENITH)


def check_aerosol(atmosphere, what, low, high):
    """Raise ValueError if the tables of a user-defined aerosol do not cover some wavelengths."""
    own = atmosphere.aot > 0 and not isinstance(atmosphere.aerosol, str)
    if own and not aerosols.covers(atmosphere.aerosol, low, high):
        first, last = aerosols.wavelength_limits(atmosphere.aerosol)
        raise ValueError(
            f"{what} must lie within the wavelengths of the aerosol {atmosphere.aerosol}, {first:g} to {last:g} um, "
            f"got {low:g} to {high:g} um: add wavelengths to its tables, or choose other bands"
        )


def terms_at(atmosphere, bands, sza, vza, raa):
    """Terms of the coupling equation in each band for one sun and several views, shape (V or 1, R or 1, band). [1]"""
    for band in bands:
        check_aerosol(atmosphere, f"band {band.name}", *band.limits)
    nodes = nodes_of(bands)
    return band_mean_terms(scattering(atmosphere, nodes, sza, vza, raa), nodes, atmosphere, bands, sza, vza)


def scattering(atmosphere, wavelength, sza, vza, raa):
    """Scattering at some wavelengths, by the engine of the atmosphere; views of shape (V,) and (R,). [1]"""
    return SCATTERING[atmosphere.engine](atmosphere, wavelength, sza, vza, raa)


@cached(256, "terms of the atmosphere for a geometry")
def _band_terms(atmosphere, bands, sza, vza, raa):
    check_zenith("sza", sza)
    check_zenith("vza", vza)
    found = terms_at(atmosphere, bands, sza, np.array([vza]), np.array([raa]))
    terms = BandTerms(*(values.squeeze((0, 1)) for values in found))
    for values in terms:
        values.flags.writeable = False
    return terms
