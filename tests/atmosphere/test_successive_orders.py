"""Successive orders of scattering compared with published tables, other codes and limits."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.polynomial.legendre import leggauss, legval
from oracles_atmosphere import SIEWERT, henyey_greenstein
from verification import tables

from fifesim.atmosphere.aerosols import aerosol_phase, aerosol_polarization
from fifesim.atmosphere.column import matrix_moments, rayleigh_expansion
from fifesim.atmosphere.gases import rayleigh_phase
from fifesim.atmosphere.successive_orders import (
    flux_transmittance,
    path_reflectance,
    stokes_reflectance,
)
from fifesim.base.geometry import scattering_angle_cosine

SIXS = pd.read_csv(Path(__file__).parents[1] / "data" / "sixs_scattering.csv", comment="#")
NODES, WEIGHTS = leggauss(500)
ORDERS = 2 * np.arange(64) + 1

# Rayleigh scattering without depolarization, given as an aerosol.
PURE_RAYLEIGH = np.array([[1, 0, 0, 0], [0, 0, 0, 0], [0.1, 0.6, 0, np.sqrt(6) / 10]])


def degrees(mu):
    return np.degrees(np.arccos(mu))


def cosine(sza, vza, raa):
    return scattering_angle_cosine(sza, np.asarray(vza, float)[:, None], np.asarray(raa, float))


def test_polarized_molecules_agree_with_natraj_tables():
    """
    Natraj, Li & Yung (2009), a correction of Coulson, Dave & Sekera (1960): depth 0.5, flux pi.

    Over black ground 2e-5: truncation of the orders, and 400 layers for a view at 89 degrees. Ground of reflectance 0.8
    minus black ground 1.2e-4: 200 layers, and the last digit of the table.
    """
    table = tables.table("polarized_molecules.csv")
    mu_s, mu_v, raa = 0.2, np.array([0.02, 0.4, 1.0]), [180.0, 120.0]
    black, bright = (table.loc[table["ground"] == ground, "intensity"].to_numpy() for ground in (0.0, 0.8))
    views = degrees(mu_s), degrees(mu_v), raa
    phase = 0.75 * (1 + cosine(*views) ** 2)
    found = mu_s * path_reflectance(0.0, 0.5, 1.0, PURE_RAYLEIGH, phase, *views, layers=400)
    # Azimuth does not matter at nadir.
    np.testing.assert_allclose(found.ravel(), [*black, black[-1]], rtol=2e-5)
    zenith = degrees(np.array([mu_s, *mu_v]))
    transmittance, albedo = flux_transmittance(0.0, 0.5, 1.0, PURE_RAYLEIGH, zenith, layers=200)
    found = mu_s * 0.8 * transmittance[0] * transmittance[1:] / (1 - 0.8 * albedo)
    np.testing.assert_allclose(found, bright - black[::2], rtol=1.2e-4)


def test_polarizing_aerosol_agrees_with_siewert():
    """Problem IIA of Siewert (2000), with V: depth 1, flux pi. 5e-6: five times the tolerance of the orders."""
    mu_s, mu_v, raa = 0.6, np.array([1.0, 0.5, 0.2]), [180.0, 0.0, 90.0]
    published = [[0.0506873] * 3, [0.339136, 0.0684106, 0.124626], [0.751295, 0.0801523, 0.169216]]
    moments = SIEWERT / ORDERS[:12, None]
    phase = legval(cosine(degrees(mu_s), degrees(mu_v), raa), SIEWERT[:, 0])
    views = degrees(mu_s), degrees(mu_v), raa
    found = mu_s * path_reflectance(0.0, 1.0, 0.973527, moments, phase, *views, layers=400)
    np.testing.assert_allclose(found, published, atol=5e-6)


def disort(share_edges, tau_molecules, tau_aerosol, albedo, moments, mu_s, azimuth):
    """Reflectance at the upward nodes of 32 streams, and total transmittance, by discrete ordinates."""
    pydisort = pytest.importorskip("PythonicDISORT.pydisort").pydisort
    air, particles = tau_molecules * np.diff(share_edges), tau_aerosol * np.diff(share_edges**4)
    rayleigh = np.zeros(moments.size)
    rayleigh[:3] = rayleigh_expansion(3)[:, 0] / ORDERS[:3]
    scattered = air + albedo * particles
    mixed = (air[:, None] * rayleigh + albedo * particles[:, None] * moments) / scattered[:, None]
    depths = np.cumsum(air + particles)
    mu, _, down, _, radiance = pydisort(
        depths, scattered / (air + particles), 32, mixed, mu_s, np.pi, 0.0, NLeg=32, NFourier=32
    )
    return mu[:16], radiance(0.0, azimuth)[:16] / mu_s, sum(down(depths[-1])) / (np.pi * mu_s)


@pytest.mark.filterwarnings("ignore:Some delta-scaled single-scattering albedos")
@pytest.mark.parametrize("asymmetry", [0.3, 0.6])
def test_mixed_atmosphere_agrees_with_discrete_ordinates(asymmetry):
    """
    Exponential profiles in different layers: here with equal numbers of molecules.

    2e-4: both codes use homogeneous layers, and discrete ordinates use only the first 32 moments.
    """
    albedo, tau_molecules, tau_aerosol, sza = 0.9, 0.2, 0.4, 50.0
    moments, raa = asymmetry ** np.arange(64), np.array([0.0, 60.0, 120.0, 180.0])
    mu_s = np.cos(np.radians(sza))
    column = np.linspace(0, 1, 61), tau_molecules, tau_aerosol, albedo, moments
    mu, expected, transmitted = disort(*column, mu_s, np.radians(180 - raa))
    phase = henyey_greenstein(asymmetry, cosine(sza, degrees(mu), raa))
    air = tau_molecules, tau_aerosol, albedo, moments
    found = path_reflectance(*air, phase, sza, degrees(mu), raa, polarized=False)
    np.testing.assert_allclose(found[mu > 0.3], expected[mu > 0.3], rtol=2e-4)
    transmittance, _ = flux_transmittance(*air, [sza], polarized=False)
    np.testing.assert_allclose(transmittance, transmitted, rtol=2e-5)


def test_thick_isotropic_layer_agrees_with_chandrasekhars_half_space():
    r""":math:`\rho = \omega H(\mu_s) H(\mu_v) / 4 (\mu_s + \mu_v)`, with H from fixed-point iteration."""
    albedo, points, weights = 0.8, (leggauss(64)[0] + 1) / 2, leggauss(64)[1] / 2

    def step(mu, values):
        return 1 / (np.sqrt(1 - albedo) + albedo / 2 * ((weights * points * values) / (mu[:, None] + points)).sum(1))

    values = np.ones(64)
    for _ in range(200):
        values = step(points, values)
    mu_s, mu_v = 0.5, np.array([0.3, 0.6, 1.0])
    expected = albedo / 4 * step(np.array([mu_s]), values) * step(mu_v, values) / (mu_s + mu_v)
    views = degrees(mu_s), degrees(mu_v), [0.0]
    found = path_reflectance(0.0, 15.0, albedo, [1.0], np.ones((3, 1)), *views, polarized=False, layers=1000)
    np.testing.assert_allclose(found[:, 0], expected, rtol=2e-4)


@pytest.mark.parametrize("polarized", [False, True])
def test_conservative_layer_conserves_flux(polarized):
    """Reflected and transmitted flux sum to 1, for direct and for isotropic light. 1e-4: number of layers."""
    points, weights = leggauss(24)
    mu, raa = (points + 1) / 2, np.arange(1.0, 180, 6)
    moments = 0.6 ** np.arange(64)
    air = 0.3, 0.5, 1.0, moments
    phase = henyey_greenstein(0.6, cosine(55.0, degrees(mu), raa))
    reflectance = path_reflectance(*air, phase, 55.0, degrees(mu), raa, polarized=polarized)
    transmittance, albedo = flux_transmittance(*air, [55.0, *degrees(mu)], polarized=polarized)
    assert (weights * mu * reflectance.mean(axis=1)).sum() + transmittance[0] == pytest.approx(1, abs=1e-4)
    assert (weights * mu * transmittance[1:]).sum() + albedo == pytest.approx(1, abs=1e-4)


def test_sun_and_view_are_reciprocal():
    """5e-6: tolerance of the sum over orders."""
    zenith, raa = np.array([20.0, 45.0, 60.0]), [0.0, 70.0, 180.0]
    found = np.empty((3, 3, 3))
    for number, sza in enumerate(zenith):
        phase = legval(cosine(sza, zenith, raa), SIEWERT[:, 0])
        found[number] = path_reflectance(0.2, 0.3, 0.9, SIEWERT / ORDERS[:12, None], phase, sza, zenith, raa)
    np.testing.assert_allclose(found, found.swapaxes(0, 1), rtol=5e-6)


def test_thin_layer_gives_single_scattering():
    """A depth of 1e-5 leaves a relative second order of similar size."""
    sza, vza, raa = 40.0, [0.0, 50.0], [0.0, 90.0, 180.0]
    scattering_cosine = cosine(sza, vza, raa)
    phase = henyey_greenstein(0.6, scattering_cosine)
    found = path_reflectance(1e-5, 2e-5, 0.9, 0.6 ** np.arange(64), phase, sza, vza, raa)
    mu_s, mu_v = np.cos(np.radians(sza)), np.cos(np.radians(vza))[:, None]
    once = (1e-5 * rayleigh_phase(scattering_cosine) + 2e-5 * 0.9 * phase) / (4 * mu_s * mu_v)
    np.testing.assert_allclose(found, once, rtol=3e-4)


def test_forward_peak_truncation_does_not_change_reflectance():
    """The truncated peak is 0.8^32 with 16 streams and 0.8^64 with 32 streams."""
    sza, vza, raa = 40.0, [0.0, 30.0, 55.0], [0.0, 90.0, 180.0]
    phase = henyey_greenstein(0.8, cosine(sza, vza, raa))
    air = 0.1, 0.6, 0.95, 0.8 ** np.arange(128), phase, sza, vza, raa
    np.testing.assert_allclose(path_reflectance(*air, streams=16), path_reflectance(*air, streams=32), rtol=1e-3)


def mixed(row):
    """Path reflectance of molecules and of the mixture, transmittances and albedo for a row of 6S."""
    optics = (function(row.aerosol, NODES, row.wavelength) for function in (aerosol_phase, aerosol_polarization))
    moments, polarized = matrix_moments(*optics, NODES, WEIGHTS, 48), bool(row.polarized)
    views = row.sza, [row.vza], [row.raa]
    phase = aerosol_phase(row.aerosol, cosine(*views), row.wavelength)
    tau_r, tau_a = row.rayleigh_optical_depth, row.aerosol_optical_depth
    aerosol = row.aerosol_scattering_depth / tau_a, moments
    found = [path_reflectance(tau_r, depth, *aerosol, phase, *views, polarized=polarized) for depth in (0.0, tau_a)]
    transmittance, albedo = flux_transmittance(tau_r, tau_a, *aerosol, [row.sza, row.vza], polarized=polarized)
    return [*(value[0, 0] for value in found), *transmittance, albedo]


@pytest.mark.parametrize(("polarized", "largest", "of_flux"), [(True, 0.007, 0.0012), (False, 0.008, 0.004)])
def test_atmosphere_agrees_with_6s(polarized, largest, of_flux):
    """
    Continental and urban aerosol, 0.4 to 0.86 um.

    The stated accuracy of 6SV1 is 0.7 % (Kotchenova et al. 2006), with 30 layers. The scalar fluxes of 6S differ by
    0.004 from its polarized fluxes and from fifesim: less converged.
    """
    rows = SIXS[(SIXS["polarized"] == polarized) & SIXS["aerosol"].isin(["continental", "urban"])]
    names = ["rayleigh_reflectance", "path_reflectance", "transmittance_down", "transmittance_up", "spherical_albedo"]
    found, expected = np.array([mixed(row) for row in rows.itertuples()]), rows[names].to_numpy()
    away = found[:, :2] / expected[:, :2] - 1
    assert np.abs(away).max() < largest and np.abs(found - expected)[:, 2:].max() < of_flux
    assert not polarized or np.sqrt((away[:, 1] ** 2).mean()) < 0.002


# ------------------------------------------------------------------------------------------ polarization


SPHERES = SIEWERT[:9]
MOMENTS = SPHERES / (2 * np.arange(9) + 1)[:, None]
SZA, VZA, RAA = 50.0, np.array([0.0, 30.0, 70.0]), np.array([-120.0, -30.0, 0.0, 30.0, 120.0, 180.0])


def spheres(tau_molecules, tau_aerosol, vza=VZA, raa=RAA, at_ground=False, **options):
    cosine = scattering_angle_cosine(SZA, np.asarray(vza)[:, None], np.asarray(raa)) * (-1 if at_ground else 1)
    phase = legval(cosine, SPHERES[:, 0])
    # d^l_02 for l >= 2: normalized Legendre functions of order 2.
    degree = np.arange(2, 9)
    second = [legval(cosine, np.polynomial.legendre.legder(np.eye(9)[n], 2)) * (1 - cosine**2) for n in degree]
    norm = 1 / np.sqrt((degree - 1.0) * degree * (degree + 1) * (degree + 2))
    polarization = np.tensordot(SPHERES[2:, 3] * norm, second, 1) / phase
    air = tau_molecules, tau_aerosol, 0.97, MOMENTS, phase, polarization
    return stokes_reflectance(*air, SZA, vza, raa, at_ground=at_ground, **options)


def test_intensity_at_the_top_equals_the_path_reflectance():
    phase = legval(scattering_angle_cosine(SZA, VZA[:, None], RAA), SPHERES[:, 0])
    expected = path_reflectance(0.1, 0.3, 0.97, MOMENTS, phase, SZA, VZA, RAA)
    np.testing.assert_allclose(spheres(0.1, 0.3)[0], expected, rtol=1e-12)


def test_intensity_above_aerosol_that_does_not_polarize_equals_the_path_reflectance():
    """Henyey and Greenstein's phase function: only the molecules polarize, in three Fourier modes."""
    phase = 0.64 / (1.36 - 1.2 * scattering_angle_cosine(SZA, VZA[:, None], RAA)) ** 1.5
    air = 0.1, 0.3, 0.97, 0.6 ** np.arange(64), phase
    found = stokes_reflectance(*air, 0 * phase, SZA, VZA, RAA)
    np.testing.assert_allclose(found[0], path_reflectance(*air, SZA, VZA, RAA), rtol=1e-12)


def test_light_added_by_ground_agrees_with_fluxes():
    transmittance, albedo = flux_transmittance(0.1, 0.3, 0.97, MOMENTS, [SZA, *VZA])
    added = spheres(0.1, 0.3, ground=0.4)[0] - spheres(0.1, 0.3)[0]
    expected = 0.4 * transmittance[0] * transmittance[1:, None] / (1 - 0.4 * albedo)
    np.testing.assert_allclose(added, np.broadcast_to(expected, added.shape), rtol=1e-9)


@pytest.mark.parametrize("ground", [0.0, 0.5])
def test_sky_flux_is_total_minus_direct_transmittance(ground):
    points, weights = leggauss(24)
    mu, raa = (points + 1) / 2, np.arange(4.5, 180, 9)
    sky = spheres(0.1, 0.3, np.degrees(np.arccos(mu)), raa, at_ground=True, ground=ground)[0]
    (through,), albedo = flux_transmittance(0.1, 0.3, 0.97, MOMENTS, [SZA])
    beam = np.exp(-0.4 / np.cos(np.radians(SZA)))
    assert (weights * mu * sky.mean(axis=1)).sum() == pytest.approx(through / (1 - ground * albedo) - beam, abs=1e-4)


@pytest.mark.parametrize("at_ground", [False, True])
def test_zenith_view_does_not_depend_on_azimuth(at_ground):
    """At the zenith and nadir, polarization rotates with the azimuth of the meridian; its degree is constant."""
    intensity, along, aslant = spheres(0.1, 0.3, [0.0], RAA, at_ground)[:, 0]
    np.testing.assert_allclose(intensity, intensity[0], rtol=1e-12)
    np.testing.assert_allclose(np.hypot(along, aslant), np.hypot(along, aslant)[0], rtol=1e-6)
    np.testing.assert_allclose(along, along[2] * np.cos(2 * np.radians(RAA)), atol=1e-6)


def test_depolarization_is_recovered_at_90_degrees():
    """Ratio of the intensities polarized parallel and perpendicular to the scattering plane."""
    air = 1e-5, 0.0, 0.0, [1.0], np.zeros((1, 2)), np.zeros((1, 2))
    found = stokes_reflectance(*air, 60.0, [30.0], [0.0, 180.0], at_ground=True, depolarization=0.06)[:, 0]
    near, turned = found.T
    assert (turned[0] + turned[1]) / (turned[0] - turned[1]) == pytest.approx(0.06, rel=2e-3)
    assert near[0] > turned[0]


@pytest.mark.parametrize("at_ground", [False, True])
def test_thin_air_polarizes_across_the_plane_of_scattering(at_ground):
    """All orders at a depth of 1e-4 compared with the Rayleigh scattering matrix."""
    delta, sza = 0.1, 50.0
    cosine = scattering_angle_cosine(sza, VZA[:, None], np.array([0.0, 180.0]))
    air = 1e-4, 0.0, 0.0, [1.0], 0 * cosine, 0 * cosine
    found = stokes_reflectance(*air, sza, VZA, [0.0, 180.0], at_ground=at_ground, depolarization=delta)
    expected = (1 - delta) * (1 - cosine**2) / (1 + delta + (1 - delta) * cosine**2)
    np.testing.assert_allclose(-found[1] / found[0], expected, atol=1e-3)


def test_sky_light_in_the_solar_direction_is_finite():
    """Both slant paths are equal there, so the integral over depth is a limit."""
    values = spheres(0.1, 0.3, [SZA - 1e-6, SZA, SZA + 1e-6], [0.0], at_ground=True)
    np.testing.assert_allclose(values[:, 0], values[:, 2], rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(values[:, 1], (values[:, 0] + values[:, 2]) / 2, rtol=1e-6, atol=1e-9)
