"""Surface-atmosphere coupling: forward, inverse, and from wavelengths to bands."""

from itertools import pairwise

import numpy as np
import pytest

from fifesim.atmosphere.coupling import (
    WAVELENGTHS,
    Scattering,
    TargetTerms,
    apparent_reflectance,
    apparent_reflectance_of_cell,
    corrected_reflectance,
    corrected_reflectance_of_cell,
    inhomogeneous_reflectance,
    on_wavelengths,
    spectral_nodes,
)
from fifesim.atmosphere.engines import band_terms
from fifesim.atmosphere.models import Atmosphere
from fifesim.base.bands import Band, solar_irradiance

UNIFORM = (0.09, 0.8, 0.83, 0.19, 0.98)
TERMS = TargetTerms(0.09, 0.8, 0.52, 0.31, 0.19, 0.98)


def test_reflectance_in_percent_raises():
    with pytest.raises(ValueError, match="must be below 1, got 3: reflectance is a fraction"):
        apparent_reflectance(30.0, 0.1, 0.8, 0.9, 0.1)


def test_reflections_between_ground_and_air_are_a_geometric_series():
    """Each reflection contributes a factor rho S; 60 orders are sufficient."""
    path, down, up, albedo, gas = UNIFORM
    rho = np.array([0.0, 0.3, 1.0])
    series = gas * (path + down * up * sum(rho * (rho * albedo) ** order for order in range(60)))
    np.testing.assert_allclose(apparent_reflectance(rho, *UNIFORM), series, rtol=1e-14)


@pytest.mark.parametrize("shape", [(1, 1), (3, 1, 1), (3, 4, 1), (3, 4, 5), (5,), (4, 5), (2, 1, 4, 5)])
@pytest.mark.parametrize("function", [apparent_reflectance, corrected_reflectance])
def test_arrays_broadcast_and_equal_the_scalars(function, shape):
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


@pytest.mark.parametrize("function", [apparent_reflectance, corrected_reflectance])
def test_single_precision_becomes_double_and_scalars_stay_scalars(function):
    values = np.linspace(0, 1, 6, dtype=np.float32)
    found = function(values, *UNIFORM)
    assert found.dtype == np.float64
    np.testing.assert_array_equal(found, function(values.astype(float), *UNIFORM))
    assert isinstance(function(0.3, *UNIFORM), np.float64)
    assert function(np.zeros((2, 0)), *UNIFORM).shape == (2, 0)


def test_uniform_ground_uses_the_total_transmittance():
    path, down, direct, diffuse, albedo, gas = TERMS
    uniform = gas * (path + down * (direct + diffuse) * 0.3 / (1 - 0.3 * albedo))
    assert inhomogeneous_reflectance(0.3, 0.3, TERMS) == pytest.approx(uniform, rel=1e-14)
    with pytest.raises(ValueError, match=r"must be below 1, got 5\.7: reflectance is a fraction"):
        inhomogeneous_reflectance(30.0, 30.0, TERMS)


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


@pytest.mark.parametrize("low, high", [(0.6, 0.65), (0.4, 0.41), (2.1, 2.5), (0.55, 0.59)])
def test_spectral_interval_has_two_nodes_on_each_side(low, high):
    nodes = spectral_nodes(low, high)
    inside = np.flatnonzero((nodes > low) & (nodes < high))
    assert np.isin(nodes, WAVELENGTHS).all()
    assert (nodes <= low).sum() >= min(2, (low >= WAVELENGTHS).sum())
    assert (nodes >= high).sum() >= min(2, (high <= WAVELENGTHS).sum())
    assert np.array_equal(nodes[inside], WAVELENGTHS[(low < WAVELENGTHS) & (high > WAVELENGTHS)])
