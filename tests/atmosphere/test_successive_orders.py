"""Successive orders of scattering, their layers, and polarization, compared with other codes and limits."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.polynomial.legendre import leggauss
from oracles_atmosphere import henyey_greenstein

from fifesim.atmosphere.aerosols import aerosol_phase, aerosol_polarization
from fifesim.atmosphere.column import matrix_moments, mixed_column
from fifesim.atmosphere.successive_orders import flux_transmittance, path_reflectance, stokes_reflectance
from fifesim.base.geometry import scattering_angle_cosine

DATA = Path(__file__).parents[1] / "data"
SIXS = pd.read_csv(DATA / "sixs_scattering.csv", comment="#")
NODES, WEIGHTS = leggauss(500)
SZA = 50.0


def degrees(mu):
    return np.degrees(np.arccos(mu))


def cosine(sza, vza, raa):
    return scattering_angle_cosine(sza, np.asarray(vza, float)[:, None], np.asarray(raa, float))


@pytest.mark.parametrize("asymmetry", [0.3, 0.6])
def test_mixed_atmosphere_agrees_with_discrete_ordinates(asymmetry):
    """
    Exponential profiles in different layers: in the reference with equal numbers of molecules.

    2e-4: both codes use homogeneous layers, and discrete ordinates use only the first 32 moments.
    """
    table = pd.read_csv(DATA / "mixed_layers.csv", comment="#").query("asymmetry == @asymmetry")
    expected = table.pivot(index="mu_v", columns="raa", values="reflectance").loc[0.3:]
    views = SZA, degrees(expected.index), expected.columns
    air, phase = (0.2, 0.4, 0.9, asymmetry ** np.arange(64)), henyey_greenstein(asymmetry, cosine(*views))
    np.testing.assert_allclose(path_reflectance(*air, phase, *views, polarized=False), expected, rtol=2e-4)
    transmittance, _ = flux_transmittance(*air, [SZA], polarized=False)
    np.testing.assert_allclose(transmittance, table["transmittance"].iloc[0], rtol=2e-5)


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


VZA, RAA = np.array([0.0, 30.0, 70.0]), np.array([-120.0, -30.0, 0.0, 30.0, 120.0, 180.0])
HAZE = 0.1, 0.3, 0.97, 0.6 ** np.arange(64)


def test_intensity_above_aerosol_that_does_not_polarize_equals_the_path_reflectance():
    """Henyey and Greenstein's phase function: only the molecules polarize, in three Fourier modes."""
    phase = henyey_greenstein(0.6, cosine(SZA, VZA, RAA))
    found = stokes_reflectance(*HAZE, phase, 0 * phase, SZA, VZA, RAA)
    np.testing.assert_allclose(found[0], path_reflectance(*HAZE, phase, SZA, VZA, RAA), rtol=1e-12)


@pytest.mark.parametrize("ground", [0.0, 0.5])
def test_sky_flux_is_total_minus_direct_transmittance(ground):
    points, weights = leggauss(24)
    mu, raa = (points + 1) / 2, np.arange(4.5, 180, 9)
    phase, options = henyey_greenstein(0.6, -cosine(SZA, degrees(mu), raa)), {"at_ground": True, "ground": ground}
    sky = stokes_reflectance(*HAZE, phase, 0 * phase, SZA, degrees(mu), raa, **options)[0]
    (through,), albedo = flux_transmittance(*HAZE, [SZA])
    beam = np.exp(-0.4 / np.cos(np.radians(SZA)))
    assert (weights * mu * sky.mean(axis=1)).sum() == pytest.approx(through / (1 - ground * albedo) - beam, abs=1e-4)


# ------------------------------------------------------------------------------------------ layers


TAU_MOLECULES, TAU_AEROSOL, ALBEDO = 0.15, 0.4, 0.9
MU = np.array([0.2, 0.7, 1.0])


def column_of(layers=50, **options):
    """Column whose truncated forward peak is 0.7^16."""
    return mixed_column(TAU_MOLECULES, TAU_AEROSOL, ALBEDO, 0.7 ** np.arange(40.0), 16, layers, **options)


@pytest.fixture(scope="module")
def column():
    return column_of()


def test_layers_sum_to_the_total_optical_depth(column):
    peak = 0.7**16
    assert column.molecules.sum() * column.depth == pytest.approx(TAU_MOLECULES, rel=1e-12)
    assert column.aerosol_once.sum() * column.depth == pytest.approx(TAU_AEROSOL * ALBEDO, rel=1e-12)
    np.testing.assert_allclose(column.aerosol, column.aerosol_once * (1 - peak), rtol=1e-12)
    assert 50 * column.depth == pytest.approx(TAU_MOLECULES + TAU_AEROSOL * (1 - ALBEDO * peak), rel=1e-12)


@pytest.mark.parametrize("scale_height", [0.3, 2.0])
def test_aerosol_above_an_altitude_is_a_power_of_the_molecules_above(scale_height):
    column = column_of(vertical=scale_height)
    molecules, aerosol = (np.cumsum(part) / part.sum() for part in (column.molecules, column.aerosol))
    np.testing.assert_allclose(aerosol, molecules ** (8 / scale_height), rtol=1e-10, atol=1e-12)
    assert column.aerosol_once.sum() * column.depth == pytest.approx(TAU_AEROSOL * ALBEDO, rel=1e-12)


def test_uniform_aerosol_layer_lies_between_its_edges():
    """A fraction exp(-3/8) of the molecules lies above 3 km, and all aerosol lies below."""
    column = column_of(400, vertical=(1.0, 3.0))
    above = np.cumsum(column.molecules) / column.molecules.sum()
    particles = np.cumsum(column.aerosol) / column.aerosol.sum()
    altitude = -8 * np.log(above)
    expected = np.clip((3 - altitude) / 2, 0, 1)
    np.testing.assert_allclose(particles[altitude < 20], expected[altitude < 20], atol=1e-4)
    assert column.aerosol_once.sum() * column.depth == pytest.approx(TAU_AEROSOL * ALBEDO, rel=1e-12)
    extinction = column.molecules + column.aerosol_once / ALBEDO * (1 - ALBEDO * 0.7**16)
    np.testing.assert_allclose(extinction, 1, rtol=1e-3)


def test_two_way_attenuation_is_the_integral_over_depth(column):
    tau = 50 * column.depth
    up, down = (column.both_ways(0.7, MU, at_ground=at_ground).sum(axis=0) for at_ground in (False, True))
    slant = 1 / 0.7 + 1 / MU
    np.testing.assert_allclose(up, (1 - np.exp(-tau * slant)) / slant, rtol=1e-12)
    slant = (1 / MU - 1 / 0.7)[[0, 2]]
    expected = (np.exp(-tau / 0.7) - np.exp(-tau / MU[[0, 2]])) / slant
    np.testing.assert_allclose(down[[0, 2]], expected, rtol=1e-12)
    assert down[1] == pytest.approx(tau * np.exp(-tau / 0.7), rel=1e-12)
