"""Checks of what scatters light: closed forms, quadratures, and tables that others computed."""

from functools import partial

import numpy as np
from numpy.polynomial.legendre import leggauss, legval, legvander
from scipy.integrate import quad

from fifesim.atmosphere.air.aerosols import aerosol_optics, aerosol_phase
from fifesim.atmosphere.air.models import Atmosphere
from fifesim.atmosphere.air.molecules import DEPOLARIZATION, rayleigh_phase
from fifesim.atmosphere.schemes import phase_expansion
from fifesim.atmosphere.schemes.single_scattering import once_on_nodes, scattered_once
from fifesim.atmosphere.schemes.successive_orders import flux_transmittance, path_reflectance
from fifesim.base import datasets
from fifesim.base.geometry import scattering_angle_cosine
from fifesim.experiments.verification.deviations import Deviation, largest
from fifesim.sensor.description.instruments import instrument

_deviation = partial(Deviation, "atmosphere")

_COSINE, _WEIGHTS = leggauss(40)
_SINE = np.sqrt(1 - _COSINE**2)

# Moments of Rayleigh's scattering matrix without depolarization.
_PURE_RAYLEIGH = np.array([[1, 0, 0, 0], [0, 0, 0, 0], [0.1, 0.6, 0, np.sqrt(6) / 10]])


def _wigner_functions():
    """Of the lowest degree they are known, and the others of one order and spin are orthogonal to it and each other."""
    lowest = {
        (0, 0): np.ones_like(_COSINE),
        (1, 0): -_SINE / np.sqrt(2),
        (0, 2): np.sqrt(6) / 4 * _SINE**2,
        (1, 2): _SINE * (1 + _COSINE) / 2,
        (2, 2): ((1 + _COSINE) / 2) ** 2,
        (2, -2): ((1 - _COSINE) / 2) ** 2,
    }
    degrees, worst = np.arange(24), 0.0
    for (order, spin), expected in lowest.items():
        found, first = phase_expansion.wigner(order, spin, _COSINE, degrees.size), max(order, abs(spin))
        norm = np.diag(2 / (2 * degrees + 1) * (degrees >= first))
        worst = np.max([worst, largest(found[first], expected), largest((found * _WEIGHTS) @ found.T, norm)])
    found = phase_expansion.wigner(0, 0, _COSINE, degrees.size).T
    worst = np.maximum(worst, largest(found, legvander(_COSINE, degrees[-1])))
    yield _deviation("Wigner functions", worst, 1e-12, "1", "closed forms, orthogonality")


def _expansions():
    """The scattering matrix of molecules is a polynomial of the second degree in the cosine."""
    anisotropy = 2 * (1 - DEPOLARIZATION) / (2 + DEPOLARIZATION)
    phase, crossed = rayleigh_phase(_COSINE), -0.75 * anisotropy * _SINE**2
    expansion = phase_expansion.rayleigh_expansion(4)
    beta, alpha, zeta, gamma = expansion.T
    linear, polarizing = (phase_expansion.wigner(order, 2, _COSINE, 4) for order in (2, 0))
    found = legval(_COSINE, beta), (alpha + zeta) @ linear, -gamma @ polarizing
    worst = largest(found, [phase, 0.75 * anisotropy * (1 + _COSINE) ** 2, crossed])
    yield _deviation("series of the scattering matrix of molecules", worst, 1e-12, "1", "Rayleigh")
    moments = phase_expansion.matrix_moments(phase, -crossed / phase, _COSINE, _WEIGHTS, 4)
    # Both of the linear ones are taken from F11.
    from_phase = linear @ (_WEIGHTS * phase) / 2
    orders = 2 * np.arange(4) + 1
    worst = largest(moments.T, [beta / orders, from_phase, from_phase, gamma / orders])
    yield _deviation("moments of the scattering matrix of molecules", worst, 1e-12, "1", "Rayleigh")
    asymmetry, orders = 0.7, np.arange(12)
    moments = np.outer(asymmetry ** np.arange(40.0), [1.0, 0.5, 0.25, 0.0])
    expansion, peak = phase_expansion.truncated_expansion(moments, orders.size)
    forward = np.outer(orders >= 0, [1, 0, 0, 0]) + np.outer(orders >= 2, [0, 1, 1, 0])
    expected = (2 * orders[:, None] + 1) * (moments[: orders.size] - asymmetry**12 * forward) / (1 - asymmetry**12)
    worst = np.maximum(largest(expansion, expected), largest(peak, asymmetry**12))
    yield _deviation("series without the forward peak", worst, 1e-12, "1", "Henyey and Greenstein")


def _polarized():
    """60 layers of even source are good to 5e-4 at a grazing view, and 1e-3 in what bright ground adds there."""
    table = datasets.table("verification/polarized_molecules.csv")
    mu_s = table["mu_s"][0]
    black, bright = table[table["ground"] == 0], table[table["ground"] > 0]
    found = mu_s * _reflectance(black, mu_s, 0.5, 1.0, _PURE_RAYLEIGH, lambda cosine: 0.75 * (1 + cosine**2))
    worst = 100 * largest(found, black["intensity"], relative=True)
    yield _deviation("polarized light of molecules", worst, 0.05, "%", "Natraj et al. (2009)")
    zenith = np.degrees(np.arccos([mu_s, *bright["mu_v"]]))
    transmittance, albedo = flux_transmittance(0.0, 0.5, 1.0, _PURE_RAYLEIGH, zenith)
    ground = bright["ground"].to_numpy()
    found = mu_s * ground * transmittance[0] * transmittance[1:] / (1 - ground * albedo)
    dark = black.set_index(["mu_v", "raa"])["intensity"].loc[list(zip(bright["mu_v"], bright["raa"], strict=True))]
    added = bright["intensity"].to_numpy() - dark.to_numpy()
    worst = 100 * largest(found, added, relative=True)
    yield _deviation("and over bright ground", worst, 0.12, "%", "Natraj et al. (2009)")
    series = datasets.table("verification/spheres_expansion.csv")
    coefficients = series[["beta", "alpha", "zeta", "gamma"]].to_numpy()
    moments = coefficients / (2 * series["order"].to_numpy()[:, None] + 1)
    table = datasets.table("verification/spheres_radiance.csv")
    found = 0.6 * _reflectance(table, 0.6, 1.0, 0.973527, moments, lambda cosine: legval(cosine, coefficients[:, 0]))
    yield _deviation("polarized light of spheres", largest(found, table["intensity"]), 6e-5, "1", "Siewert (2000)")


def _reflectance(table, mu_s, tau, albedo, moments, phase):
    """Of one layer of particles, at the view of each row."""
    sza, (mu_v, views), (raa, azimuths) = np.degrees(np.arccos(mu_s)), _numbered(table["mu_v"]), _numbered(table["raa"])
    vza = np.degrees(np.arccos(mu_v))
    cosine = scattering_angle_cosine(sza, vza[:, None], raa)
    return path_reflectance(0.0, tau, albedo, moments, phase(cosine), sza, vza, raa)[views, azimuths]


def _numbered(values):
    return np.unique(values, return_inverse=True)


def _once():
    """Also straight back. The phase function is read at quarters of a degree."""
    band, worst = instrument("TM").select(["TM3"])[0].response, 0.0
    at = np.array([band.center])
    cases = ("5S", (40.0, 25.0, 130.0)), ("successive-orders", (55.0, 40.0, 20.0)), ("5S", (35.0, 35.0, 0.0))
    for engine, angles in cases:
        air = Atmosphere(visibility=10.0, altitude=0.0, engine=engine)
        found = once_on_nodes(*(np.array([angle]) for angle in angles), scattered_once(air, (band,)))
        mu_s, mu_v = np.cos(np.radians(angles[:2]))
        # The closed forms know of no molecules above the aerosol.
        above = 0.0 if engine == "5S" else float(air.rayleigh_optical_depth(at)[0])
        depth, (_, albedo, _) = float(air.aerosol_optical_depth(at)[0]), aerosol_optics(air.aerosol, at)
        reached, _ = quad(_both_ways, above, above + depth, args=(mu_s, mu_v))
        phase = aerosol_phase(air.aerosol, scattering_angle_cosine(*angles), at)
        worst = np.maximum(worst, largest(found, albedo * phase / (4 * mu_s * mu_v) * reached, relative=True))
    yield _deviation("light that the aerosol scatters once", 100 * worst, 0.1, "%", "quadrature over its depth")


def _both_ways(depth, mu_s, mu_v):
    return np.exp(-depth / mu_s) * np.exp(-depth / mu_v)


CHECKS = (_wigner_functions, _expansions, _polarized, _once)
