"""Atmospheric layers, their direct transmittance, and series expansions of phase functions."""

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss

from fifesim.atmosphere.column import (
    mixed_column,
    stokes_basis,
    wigner,
)
from fifesim.atmosphere.successive_orders import flux_transmittance, path_reflectance

TAU_MOLECULES, TAU_AEROSOL, ALBEDO = 0.15, 0.4, 0.9
MU = np.array([0.2, 0.7, 1.0])


@pytest.fixture
def column():
    """Column whose truncated forward peak is 0.7^16."""
    return mixed_column(TAU_MOLECULES, TAU_AEROSOL, ALBEDO, 0.7 ** np.arange(40.0), 16, 50)


def test_layers_sum_to_the_total_optical_depth(column):
    peak = 0.7**16
    assert column.molecules.sum() * column.depth == pytest.approx(TAU_MOLECULES, rel=1e-12)
    assert column.aerosol_once.sum() * column.depth == pytest.approx(TAU_AEROSOL * ALBEDO, rel=1e-12)
    np.testing.assert_allclose(column.aerosol, column.aerosol_once * (1 - peak), rtol=1e-12)
    assert 50 * column.depth == pytest.approx(TAU_MOLECULES + TAU_AEROSOL * (1 - ALBEDO * peak), rel=1e-12)


def test_layers_combine_to_the_transmittance_of_the_column(column):
    tau = 50 * column.depth
    np.testing.assert_allclose(column.escape(MU).sum(axis=1), 1 - np.exp(-tau / MU), rtol=1e-12)
    np.testing.assert_allclose(
        column.layer_mean(MU).sum(axis=0) * column.depth, MU * (1 - np.exp(-tau / MU)), rtol=1e-12
    )
    through, averaged = column.steps(MU)
    np.testing.assert_allclose(through**50, np.exp(-tau / MU), rtol=1e-12)
    np.testing.assert_allclose((1 - averaged * column.depth / MU), through, rtol=1e-12)


@pytest.mark.parametrize("scale_height", [0.3, 2.0, 8.0])
def test_aerosol_above_an_altitude_is_a_power_of_the_molecules_above(scale_height):
    column = mixed_column(TAU_MOLECULES, TAU_AEROSOL, ALBEDO, 0.7 ** np.arange(40.0), 16, 50, vertical=scale_height)
    molecules, aerosol = (np.cumsum(part) / part.sum() for part in (column.molecules, column.aerosol))
    np.testing.assert_allclose(aerosol, molecules ** (8 / scale_height), rtol=1e-10, atol=1e-12)
    assert column.aerosol_once.sum() * column.depth == pytest.approx(TAU_AEROSOL * ALBEDO, rel=1e-12)


def test_uniform_aerosol_layer_lies_between_its_edges():
    """A fraction exp(-3/8) of the molecules lies above 3 km, and all aerosol lies below."""
    column = mixed_column(TAU_MOLECULES, TAU_AEROSOL, ALBEDO, 0.7 ** np.arange(40.0), 16, 400, vertical=(1.0, 3.0))
    above = np.cumsum(column.molecules) / column.molecules.sum()
    particles = np.cumsum(column.aerosol) / column.aerosol.sum()
    altitude = -8 * np.log(above)
    expected = np.clip((3 - altitude) / 2, 0, 1)
    np.testing.assert_allclose(particles[altitude < 20], expected[altitude < 20], atol=1e-4)
    assert column.aerosol_once.sum() * column.depth == pytest.approx(TAU_AEROSOL * ALBEDO, rel=1e-12)
    extinction = column.molecules + column.aerosol_once / ALBEDO * (1 - ALBEDO * 0.7**16)
    np.testing.assert_allclose(extinction, 1, rtol=1e-3)


def test_absorber_dims_molecules_below_it_but_not_above():
    """
    A pure absorber multiplies the light that crosses it, exactly at all orders.

    0.5 % of the molecules lie above 42 km.
    """
    soot = 0.3, 0.0, [1.0]
    views = 40.0, [25.0], [60.0]
    molecules = path_reflectance(0.3, 0.0, 0.0, [1.0], [[0.0]], *views)[0, 0]
    mu_s, mu_v = np.cos(np.radians([40.0, 25.0]))
    high, low = (
        path_reflectance(0.3, *soot, [[1.0]], *views, vertical=layer)[0, 0] for layer in ((42.0, 50.0), (0.0, 0.01))
    )
    assert high == pytest.approx(molecules * np.exp(-0.3 * (1 / mu_s + 1 / mu_v)), rel=4e-3)
    assert low == pytest.approx(molecules, rel=1e-3)
    clear, _ = flux_transmittance(0.3, 0.0, 0.0, [1.0], [40.0])
    dimmed, _ = flux_transmittance(0.3, *soot, [40.0], vertical=(42.0, 50.0))
    assert dimmed[0] == pytest.approx(clear[0] * np.exp(-0.3 / mu_s), rel=4e-3)


def test_two_way_attenuation_is_the_integral_over_depth(column):
    tau = 50 * column.depth
    up, down = (column.both_ways(0.7, MU, at_ground=at_ground).sum(axis=0) for at_ground in (False, True))
    slant = 1 / 0.7 + 1 / MU
    np.testing.assert_allclose(up, (1 - np.exp(-tau * slant)) / slant, rtol=1e-12)
    slant = (1 / MU - 1 / 0.7)[[0, 2]]
    expected = (np.exp(-tau / 0.7) - np.exp(-tau / MU[[0, 2]])) / slant
    np.testing.assert_allclose(down[[0, 2]], expected, rtol=1e-12)
    assert down[1] == pytest.approx(tau * np.exp(-tau / 0.7), rel=1e-12)


# ------------------------------------------------------------------------------------------ series expansions


NODES, WEIGHTS = leggauss(500)
ORDERS = 2 * np.arange(64) + 1


@pytest.mark.parametrize("order, spin", [(3, 2), (5, -2)])
def test_wigner_functions_are_orthogonal(order, spin):
    nodes, weights = leggauss(40)
    lowest = max(order, abs(spin))
    functions = wigner(order, spin, nodes, 30)
    assert not functions[:lowest].any()
    norms = (functions * weights) @ functions.T
    expected = np.diag(np.where(np.arange(30) < lowest, 0, 2 / ORDERS[:30]))
    np.testing.assert_allclose(norms, expected, atol=1e-12)


def test_polarized_basis_is_orthogonal_and_symmetric():
    """Reversing the direction multiplies terms of the same spin by (-1)^l and cross terms by -(-1)^l."""
    nodes, weights = leggauss(40)
    basis = stokes_basis(2, nodes, 8, 3)
    norms = basis.T @ (np.tile(weights, 3)[:, None] * basis)
    np.testing.assert_allclose(norms[:6, :6], np.diag(2 / ORDERS[2:8]), atol=1e-12)
    np.testing.assert_allclose(norms[6:, 6:], np.diag(np.tile(2 / ORDERS[2:8], 2)), atol=1e-12)
    np.testing.assert_array_equal(norms[:6, 6:], 0)
    same, cross = basis[40:80, 6:12], basis[40:80, 12:]
    sign = (-1.0) ** np.arange(2, 8)
    np.testing.assert_allclose(same[::-1], same * sign, atol=1e-12)
    np.testing.assert_allclose(cross[::-1], -cross * sign, atol=1e-12)
