"""Surface-atmosphere coupling, band terms and closed forms of 5S, compared with series, quadrature and 6S."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from fifesim.atmosphere.coupling import (
    WAVELENGTHS,
    Scattering,
    apparent_reflectance,
    apparent_reflectance_of_cell,
    corrected_reflectance,
    corrected_reflectance_of_cell,
    on_wavelengths,
    spectral_nodes,
)
from fifesim.atmosphere.engines import band_terms, mixed_scattering, whole_scattering
from fifesim.atmosphere.five_s import (
    conservative_spherical_albedo,
    conservative_transmittance,
    delta_eddington,
    five_s_scattering,
    sobolev_conservative_reflectance,
    sobolev_reflectance,
    spherical_albedo,
)
from fifesim.atmosphere.models import Atmosphere
from fifesim.base.bands import Band, solar_irradiance
from fifesim.sensor.description.instruments import instrument

DATA = Path(__file__).parents[1] / "data"
UNIFORM = (0.09, 0.8, 0.83, 0.19, 0.98)
LIMITS = {"gas_transmittance": 1e-3, "direct_transmittance_down": 1e-3, "spherical_albedo": 0.025}
LIMITS |= {"transmittance_down": 2e-3, "transmittance_up": 2e-3}


def test_reflections_between_ground_and_air_are_a_geometric_series():
    """Each reflection contributes a factor rho S; 60 orders are sufficient."""
    path, down, up, albedo, gas = UNIFORM
    rho = np.array([0.0, 0.3, 1.0])
    series = gas * (path + down * up * sum(rho * (rho * albedo) ** order for order in range(60)))
    np.testing.assert_allclose(apparent_reflectance(rho, *UNIFORM), series, rtol=1e-14)


@pytest.mark.parametrize("shape", [(1, 1), (3, 1, 1), (5,), (2, 1, 4, 5)])
@pytest.mark.parametrize("function", [apparent_reflectance, corrected_reflectance])
def test_arrays_broadcast_and_equal_the_scalars(function, shape):
    """Single precision becomes double, and scalars stay scalars."""
    random = np.random.default_rng(1)
    values, terms = random.random((3, 4, 5)), [term * random.uniform(0.9, 1.0, shape) for term in UNIFORM]
    found, all_terms = function(values, *terms), np.broadcast_arrays(values, *terms)
    assert found.shape == all_terms[0].shape
    for place in np.ndindex(found.shape):
        value, *here = (float(each[place]) for each in all_terms)
        if function is apparent_reflectance:
            assert found[place] == apparent_reflectance_of_cell(value, value, *here)
        else:
            assert found[place] == corrected_reflectance_of_cell(value, *here)
    narrow = values.astype(np.float32)
    np.testing.assert_array_equal(function(narrow, *UNIFORM), function(narrow.astype(float), *UNIFORM), strict=True)
    assert isinstance(function(0.3, *UNIFORM), np.float64)
    assert function(np.zeros((2, 0)), *UNIFORM).shape == (2, 0)


def test_opaque_gas_gives_non_finite_surface_reflectance():
    """For example in the centre of a water vapour band; no error is raised."""
    assert not np.isfinite(corrected_reflectance(np.array([0.0]), 0.1, 0.8, 0.9, 0.0, 0.0)).any()


# ------------------------------------------------------------------------------------------ bands


@pytest.mark.parametrize("visibility", [8.0, 45.0])
def test_band_terms_approximate_the_spectral_sum(visibility):
    """One wide band compared with the mean of its 34 slices: 5e-4 at a reflectance of 0.5."""
    atmosphere = Atmosphere(visibility=visibility)
    edges = np.linspace(0.75, 0.92, 35)
    slices = [Band("slice", (low, high), (1, 1)) for low, high in pairwise(edges)]
    whole = Band("whole", (edges[0], edges[-1]), (1, 1))
    weight = np.array([solar_irradiance(part) for part in slices])
    parts = apparent_reflectance(0.5, **band_terms(atmosphere, slices, 40.0, 20.0, 60.0).uniform)
    once = apparent_reflectance(0.5, **band_terms(atmosphere, [whole], 40.0, 20.0, 60.0).uniform)
    assert once[0] == pytest.approx(np.average(parts, weights=weight), abs=5e-4)


def test_power_laws_in_wavelength_are_interpolated_exactly():
    """Depths and reflectances that follow a power law, and the transmittance of a power-law depth."""
    between = np.sqrt(WAVELENGTHS[1:] * WAVELENGTHS[:-1])

    def spectra(wavelength):
        depth = 0.1 * wavelength**-3.5
        return Scattering(*(np.exp(-depth) if "transmittance" in name else depth for name in Scattering._fields))

    found = on_wavelengths(spectra(WAVELENGTHS), WAVELENGTHS, between)
    np.testing.assert_allclose(found, spectra(between), rtol=1e-12)


def test_spectral_interval_has_two_nodes_on_each_side():
    for low, high in ((0.6, 0.65), (0.4, 0.41), (2.1, 2.5), (0.55, 0.59)):
        nodes = spectral_nodes(low, high)
        assert (nodes <= low).sum() == min(2, (low >= WAVELENGTHS).sum())
        assert (nodes >= high).sum() == min(2, (high <= WAVELENGTHS).sum())


def test_factors_of_the_fife_case_agree_with_6s():
    """
    Gas transmittance 1e-3 and transmittances 2e-3, since 6S has other filters.

    Spherical albedo 0.025, since S_R + S_A omits the coupling. Terms are shared between calls, so they are read-only.
    """
    table = pd.read_csv(DATA / "sixs_fife.csv", comment="#").query("surface_reflectance == 0")
    responses = {band.name: band.response for band in instrument("TM").bands}
    for (visibility, altitude, *angles), rows in table.groupby(["visibility", "altitude", "sza", "vza", "raa"]):
        air = Atmosphere(visibility=visibility, altitude=altitude)
        terms = band_terms(air, [responses[name] for name in rows["band"]], *angles)
        assert not terms.gas_transmittance.flags.writeable
        for name, limit in LIMITS.items():
            np.testing.assert_allclose(getattr(terms, name), rows[name], rtol=0, atol=limit, err_msg=name)
        diffuse = 1 - rows["direct_transmittance_down"] / rows["transmittance_down"]
        np.testing.assert_allclose(terms.diffuse_fraction, diffuse, rtol=0, atol=2e-3)
        depth = rows["rayleigh_optical_depth"] + rows["aerosol_optical_depth"]
        np.testing.assert_allclose(terms.optical_depth, depth, rtol=0, atol=1e-3)


# ------------------------------------------------------------------------------------------ scattering by wavelength


SPECTRUM = np.array([0.47, 0.86])
DIRECTIONS = 50.0, np.array([0.0, 35.0]), np.array([0.0, 90.0, 180.0])
HAZE = Atmosphere(visibility=8.0)


@pytest.mark.parametrize("function", [five_s_scattering, mixed_scattering])
def test_molecules_of_haze_equal_air_without_aerosol(function):
    """In 5S, transmittances of molecules and aerosol are multiplied."""
    both, air = (function(each, SPECTRUM, *DIRECTIONS) for each in (HAZE, Atmosphere(aerosol="none")))
    np.testing.assert_allclose(air.reflectance, air.molecules_reflectance, rtol=1e-12)
    np.testing.assert_allclose(both.molecules_reflectance, air.molecules_reflectance, rtol=1e-12)
    np.testing.assert_allclose(air.diffuse_up_aerosol, 0, atol=1e-11)
    np.testing.assert_allclose(air.diffuse_up_molecules, air.transmittance_up - air.direct_transmittance_up, rtol=1e-12)
    np.testing.assert_allclose(both.diffuse_up_molecules, air.diffuse_up_molecules, rtol=1e-12)
    assert np.all(both.reflectance > air.reflectance) and np.all(both.spherical_albedo > air.spherical_albedo)
    assert np.all(both.direct_transmittance_up < both.transmittance_up) and np.all(both.transmittance_up < 1)
    if function is five_s_scattering:
        direct = np.exp(-HAZE.aerosol_optical_depth(SPECTRUM) / np.cos(np.radians(DIRECTIONS[1]))[:, None, None])
        expected = both.transmittance_up / air.transmittance_up - direct
        np.testing.assert_allclose(both.diffuse_up_aerosol, expected, rtol=1e-9)
    else:
        for name, values in whole_scattering(HAZE, SPECTRUM, *DIRECTIONS)._asdict().items():
            np.testing.assert_array_equal(values, getattr(both, name))


def test_sobolev_and_delta_eddington_agree_with_numerical_solutions():
    known = pd.read_csv(DATA / "eddington.csv", comment="#")
    layer = known["tau"], known["albedo"], known["asymmetry"]
    found = sobolev_reflectance(*layer, known["phase"], known["mu_s"], known["mu_v"])
    np.testing.assert_allclose(found, known["reflectance"], rtol=1e-7)
    found = delta_eddington(*layer, known["mu_s"])
    np.testing.assert_allclose(found, known[["plane_albedo", "transmittance"]].T, rtol=1e-7)


def test_conservative_layers_are_the_limit_of_absorbing_layers():
    """The absorbing solution is evaluated 1e-6 away from its pole. The spherical albedo is the mean plane albedo."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    tau, mu = np.array([0.01, 0.1, 0.5]), (nodes + 1) / 2
    conservative = conservative_transmittance(tau[:, None], mu)
    np.testing.assert_allclose(delta_eddington(tau[:, None], 1.0, 0.0, mu)[1], conservative, atol=2e-6)
    mean = (1 - conservative) @ (mu * weights)
    np.testing.assert_allclose(conservative_spherical_albedo(tau), mean, atol=1e-7)
    np.testing.assert_allclose(spherical_albedo(tau, 1.0, 0.0), mean, atol=2e-6)
    mean = delta_eddington(tau[:, None], 0.8, 0.6, mu)[0] @ (mu * weights)
    np.testing.assert_allclose(spherical_albedo(tau, 0.8, 0.6), mean, atol=2e-6)
    phase, mu_s, mu_v = np.array([0.9, 1.2, 0.8]), 0.5, np.array([1.0, 0.7, 0.5])
    absorbing = sobolev_reflectance(tau, 1.0, 0.0, phase, mu_s, mu_v)
    np.testing.assert_allclose(absorbing, sobolev_conservative_reflectance(tau, phase, mu_s, mu_v), atol=2e-6)


def test_two_stream_solution_is_smooth_at_its_removable_pole():
    """At k mu = 1 the two-stream solution is 0/0; the value there is the mean of its neighbours."""
    mu_s = 1 / np.sqrt((1 - 0.5) * 3)
    around = [float(sobolev_reflectance(0.5, 0.5, 0.0, 1.0, mu_s + shift, 0.9)) for shift in (-1e-4, 0, 1e-4)]
    assert around[1] == pytest.approx((around[0] + around[2]) / 2, rel=1e-6)
