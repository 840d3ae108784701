"""Optics of the components beside the tables that they are read from."""

import numpy as np
import pytest

from fifesim.atmosphere.mixtures import COMPONENTS, component_phase_moments, cross_sections, phase, polarized_phase
from fifesim.base import files


def of(name, component):
    return files.table(name).query("component == @component").drop(columns="component")


@pytest.mark.parametrize("component", COMPONENTS)
def test_cross_sections_pass_through_the_table_by_powers(component):
    wavelength, extinction, scattering, directed = of("aerosol_optics.csv", component).to_numpy(float).T
    found = cross_sections(component, wavelength)
    np.testing.assert_allclose(found, [extinction, scattering, directed], rtol=1e-12)
    between, _, _ = cross_sections(component, np.sqrt(wavelength[1:] * wavelength[:-1]))
    np.testing.assert_allclose(between, np.sqrt(extinction[1:] * extinction[:-1]), rtol=1e-12)


@pytest.mark.parametrize("component", COMPONENTS)
def test_phase_and_polarization_pass_through_the_tables(component):
    """But for one factor at each wavelength, which makes the mean 1: of the kinks between angles, .2 %."""
    wavelength = of("aerosol_optics.csv", component).iloc[:, 0].to_numpy(float)
    table, degree = of("aerosol_phase.csv", component), of("aerosol_polarization.csv", component)
    cosine = np.cos(np.radians(table["angle"].to_numpy()))[:, None]
    tabulated = table.drop(columns="angle").to_numpy(float)
    found = phase(component, cosine, wavelength)
    # At 0 and 180 degrees the cosine does not tell the angle to more than 1e-6.
    scale = (found / tabulated)[1:-1]
    np.testing.assert_allclose(scale, np.broadcast_to(scale[:1], scale.shape), rtol=1e-6)
    np.testing.assert_allclose(scale[0], 1, atol=2e-3)
    ratio = polarized_phase(component, cosine, wavelength) / found
    np.testing.assert_allclose(ratio, degree.drop(columns="angle").to_numpy(float), atol=1e-6)


@pytest.mark.parametrize("component", COMPONENTS)
def test_moments_are_means_of_legendre_polynomials(component):
    """By a quadrature of its own, which the kinks between angles leave at 1e-4."""
    edges = np.radians(np.concatenate([np.arange(0, 10, 0.05), np.arange(10, 180.1, 0.5)]))
    points, weights = np.polynomial.legendre.leggauss(3)
    angle = (edges[:-1, None] + np.diff(edges)[:, None] * (1 + points) / 2).ravel()
    weights = (np.diff(edges)[:, None] / 2 * weights).ravel() * np.sin(angle) / 2
    wavelength = np.array([0.5, 0.86])
    values = phase(component, np.cos(angle), wavelength[:, None]) * weights
    expected = values @ np.polynomial.legendre.legvander(np.cos(angle), 6)
    np.testing.assert_allclose(component_phase_moments(component, wavelength, 7), expected, atol=1e-4)
