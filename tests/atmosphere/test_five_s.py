"""Closed forms of 5S, separately and combined."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from oracles_atmosphere import eddington_flux
from oracles_atmosphere import sobolev_reflectance as integrated_reflectance

from fifesim.atmosphere.aerosols import aerosol_optics, aerosol_phase
from fifesim.atmosphere.five_s import (
    conservative_spherical_albedo,
    conservative_transmittance,
    delta_eddington,
    five_s_scattering,
    sobolev_conservative_reflectance,
    sobolev_reflectance,
    spherical_albedo,
)
from fifesim.atmosphere.gases import rayleigh_phase
from fifesim.atmosphere.models import Atmosphere
from fifesim.base.geometry import scattering_angle_cosine

SIXS = pd.read_csv(Path(__file__).parents[1] / "data" / "sixs_grid.csv", comment="#")
MU_S, MU_V = (np.cos(np.radians(SIXS[name].to_numpy())) for name in ("sza", "vza"))
COSINE = scattering_angle_cosine(SIXS["sza"], SIXS["vza"], SIXS["raa"]).to_numpy()
WAVELENGTH = SIXS["wavelength"].to_numpy()
TAU_R, TAU_A = (SIXS[f"{name}_optical_depth"].to_numpy() for name in ("rayleigh", "aerosol"))
_, ALBEDO, ASYMMETRY = aerosol_optics("continental", WAVELENGTH)
# The scalar runs of 6S ignore Rayleigh scattering in the infrared.
VISIBLE = SIXS["band"].isin(["TM1", "TM2", "TM3", "TM4"]).to_numpy()
LAYERS = [(0.2, 0.9, 0.65, 0.3, 0.8, 0.9), (0.8, 0.85, 0.6, 0.2, 0.5, 1.0), (2.0, 0.5, 0.2, 1.4, 0.35, 0.4)]


@pytest.mark.parametrize("layer", LAYERS)
def test_sobolev_formula_equals_the_integral(layer):
    assert sobolev_reflectance(*layer) == pytest.approx(integrated_reflectance(*layer), rel=1e-7)


@pytest.mark.parametrize("tau, albedo, asymmetry, _phase, mu_s, _mu_v", LAYERS)
def test_delta_eddington_equals_eddington_flux_of_the_scaled_layer(tau, albedo, asymmetry, _phase, mu_s, _mu_v):
    peak = asymmetry**2
    scaled = ((1 - albedo * peak) * tau, (1 - peak) * albedo / (1 - albedo * peak), asymmetry / (1 + asymmetry))
    assert delta_eddington(tau, albedo, asymmetry, mu_s) == pytest.approx(eddington_flux(*scaled, mu_s), rel=1e-7)


def test_conservative_sobolev_is_the_limit_of_absorbing_sobolev():
    """The absorbing solution is evaluated 1e-6 away from its pole."""
    arguments = 0.9, MU_S, MU_V
    absorbing = sobolev_reflectance(TAU_R, 1.0, 0.0, *arguments)
    np.testing.assert_allclose(absorbing, sobolev_conservative_reflectance(TAU_R, *arguments), atol=2e-6)


def test_conservative_transmittance_equals_eddingtons():
    np.testing.assert_allclose(
        delta_eddington(TAU_R, 1.0, 0.0, MU_S)[1], conservative_transmittance(TAU_R, MU_S), atol=2e-6
    )


def test_conservative_spherical_albedo_is_the_mean_plane_albedo():
    nodes, weights = np.polynomial.legendre.leggauss(40)
    mu = (nodes + 1) / 2
    tau = np.array([0.01, 0.1, 0.5])
    mean = (1 - conservative_transmittance(tau[:, None], mu)) @ (mu * weights)
    np.testing.assert_allclose(conservative_spherical_albedo(tau), mean, atol=1e-7)
    np.testing.assert_allclose(spherical_albedo(tau, 1.0, 0.0), mean, atol=2e-6)


def test_two_stream_solution_is_smooth_at_its_removable_pole():
    """At k mu = 1 the two-stream solution is 0/0; the value there is the mean of its neighbours."""
    mu_s = 1 / np.sqrt((1 - 0.5) * 3)
    around = [float(sobolev_reflectance(0.5, 0.5, 0.0, 1.0, mu_s + shift, 0.9)) for shift in (-1e-4, 0, 1e-4)]
    assert around[1] == pytest.approx((around[0] + around[2]) / 2, rel=1e-6)


def test_rayleigh_terms_agree_with_6s():
    """Compared with scalar successive orders, Sobolev is 1 % (near infrared) to 10 % (blue, slant view) low."""
    ours = sobolev_conservative_reflectance(TAU_R, rayleigh_phase(COSINE), MU_S, MU_V)[VISIBLE]
    ratio = ours / SIXS["scalar_rayleigh_reflectance"][VISIBLE]
    assert np.all((ratio > 0.9) & (ratio < 1))
    transmittance = conservative_transmittance(TAU_R, MU_S)
    np.testing.assert_allclose(transmittance, SIXS["rayleigh_transmittance_down"], atol=5e-4)
    np.testing.assert_allclose(conservative_spherical_albedo(TAU_R), SIXS["rayleigh_spherical_albedo"], atol=1e-3)


def test_aerosol_terms_agree_with_6s():
    """
    Difference from scalar successive orders: 0.001 near backscatter, 0.008 elsewhere.

    Two terms of the phase function miss the higher orders of the forward peak.
    """
    phase = aerosol_phase("continental", COSINE, WAVELENGTH)
    ours = sobolev_reflectance(TAU_A, ALBEDO, ASYMMETRY, phase, MU_S, MU_V)
    errors = np.abs(ours - SIXS["scalar_aerosol_reflectance"].to_numpy())[VISIBLE]
    assert errors[COSINE[VISIBLE] < np.cos(np.radians(150))].max() < 1e-3
    assert errors.max() < 8e-3
    transmittance = delta_eddington(TAU_A, ALBEDO, ASYMMETRY, MU_S)[1]
    np.testing.assert_allclose(transmittance, SIXS["aerosol_transmittance_down"], atol=2e-3)
    ours = spherical_albedo(TAU_A, ALBEDO, ASYMMETRY)
    np.testing.assert_allclose(ours, SIXS["aerosol_spherical_albedo"], atol=4e-3)


# ------------------------------------------------------------------------------------------ combined terms


SPECTRUM = np.array([0.45, 0.65, 0.85, 1.65])
SZA, VZA, RAA = 50.0, np.array([0.0, 35.0]), np.array([0.0, 90.0, 180.0])
COS_V = np.cos(np.radians(VZA))[:, None, None]
HAZE = Atmosphere(visibility=8.0)


def test_molecules_and_aerosol_are_added_without_a_cross_term():
    both, air = (five_s_scattering(each, SPECTRUM, SZA, VZA, RAA) for each in (HAZE, Atmosphere(aerosol="none")))
    np.testing.assert_array_equal(air.reflectance, air.molecules_reflectance)
    np.testing.assert_allclose(air.diffuse_up_aerosol, 0, atol=1e-15)
    np.testing.assert_allclose(air.diffuse_up_molecules, air.transmittance_up - air.direct_transmittance_up, rtol=1e-12)
    assert np.all(both.reflectance > air.reflectance) and np.all(both.spherical_albedo > air.spherical_albedo)
    np.testing.assert_array_equal(both.molecules_reflectance, air.molecules_reflectance)
    direct = np.exp(-HAZE.aerosol_optical_depth(SPECTRUM) / COS_V)
    expected = both.transmittance_up / air.transmittance_up - direct
    np.testing.assert_allclose(both.diffuse_up_aerosol, expected, rtol=1e-9)


def test_sun_and_view_are_reciprocal():
    """Each transmittance depends on one angle only."""
    there, back = (
        five_s_scattering(HAZE, SPECTRUM, sza, np.array([vza]), RAA) for sza, vza in ((20.0, 55.0), (55.0, 20.0))
    )
    np.testing.assert_allclose(there.transmittance_down, back.transmittance_up[0, 0], rtol=1e-14)
    assert there.molecules_reflectance == pytest.approx(back.molecules_reflectance, rel=1e-12)
