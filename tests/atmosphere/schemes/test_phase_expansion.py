"""Phase functions and matrices as series."""

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss, legval

from fifesim.atmosphere.column import matrix_moments, rayleigh_expansion, stokes_basis, truncated_expansion, wigner
from fifesim.atmosphere.gases import rayleigh_phase

NODES, WEIGHTS = leggauss(500)
ORDERS = 2 * np.arange(64) + 1

# Rayleigh scattering without depolarization.
PURE_RAYLEIGH = np.array([[1, 0, 0, 0], [0, 0, 0, 0], [0.1, 0.6, 0, np.sqrt(6) / 10]])


@pytest.mark.parametrize("order, spin", [(0, 0), (1, 0), (0, 2), (2, 2), (2, -2), (3, 2), (5, -2)])
def test_wigner_functions_are_orthogonal(order, spin):
    nodes, weights = leggauss(40)
    lowest = max(order, abs(spin))
    functions = wigner(order, spin, nodes, 30)
    assert not functions[:lowest].any()
    norms = (functions * weights) @ functions.T
    expected = np.diag(np.where(np.arange(30) < lowest, 0, 2 / ORDERS[:30]))
    np.testing.assert_allclose(norms, expected, atol=1e-12)


def test_wigner_functions_are_the_closed_forms():
    x = np.linspace(-1, 1, 9)
    np.testing.assert_allclose(wigner(2, 2, x, 3)[2], ((1 + x) / 2) ** 2, atol=1e-14)
    np.testing.assert_allclose(wigner(2, -2, x, 3)[2], ((1 - x) / 2) ** 2, atol=1e-14)
    np.testing.assert_allclose(wigner(0, 2, x, 3)[2], np.sqrt(6) / 4 * (1 - x**2), atol=1e-14)


def test_molecules_are_expanded_as_they_scatter():
    expansion = rayleigh_expansion(3)
    np.testing.assert_allclose(legval(NODES, expansion[:, 0]), rayleigh_phase(NODES), rtol=1e-12)
    polarization = expansion[2, 3] * wigner(0, 2, NODES, 3)[2]
    # At right angles, light of molecules with depolarization d is polarized by (1 - d) / (1 + d).
    assert np.interp(0, NODES, polarization / rayleigh_phase(NODES)) == pytest.approx((1 - 0.0279) / (1 + 0.0279), 1e-4)


def test_moments_give_the_phase_function_back():
    degree = (1 - NODES**2) / (1 + NODES**2)
    found = matrix_moments(0.75 * (1 + NODES**2), degree, NODES, WEIGHTS, 6)
    np.testing.assert_allclose(found[:3, [0, 3]], PURE_RAYLEIGH[:, [0, 3]], atol=1e-12)
    np.testing.assert_allclose(found[3:, [0, 3]], 0, atol=1e-12)


def test_truncation_keeps_the_light_that_is_not_in_the_peak():
    moments = 0.9 ** np.arange(100)
    expansion, peak = truncated_expansion(moments, 32)
    assert peak == pytest.approx(0.9**32)
    np.testing.assert_allclose(expansion[:, 0] / ORDERS[:32] * (1 - peak) + peak, moments[:32], rtol=1e-12)


def test_polarized_basis_is_orthogonal_and_turns_over_with_the_light():
    """Q and U of light going down are those of light going up, with another sign of U where the degree is even."""
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
