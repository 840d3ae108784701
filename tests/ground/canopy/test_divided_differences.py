"""Nested integrals of exponentials beside a matrix exponential."""

import numpy as np
import pytest
from scipy.linalg import expm

from fifesim.ground.canopy import sail_model
from fifesim.ground.canopy.sail_model import exponential_chain


@pytest.mark.parametrize("gap", [0, 1e-12, 1e-6, 0.01, 0.66, 0.67, 0.68, 1, 10, 1000])
def test_chain_matches_a_triangular_matrix_exponential(gap):
    """Opitz: the corner of exp of a bidiagonal matrix is the divided difference. Across the series' limit too."""
    rates = np.array([0.3, 0.3 + gap, 0.1, 0.3, 0.2 + 2 * gap])
    corner = expm(3.0 * (np.diag(-rates) + np.diag(np.ones(4), 1)))[0, -1]
    np.testing.assert_allclose(exponential_chain(3.0, *rates), corner, rtol=1e-11)


@pytest.mark.parametrize("gap", [0, 0.01, 10])
def test_compiled_chains_stay_within_their_arrays(gap):
    """Beside the same in plain Python, which would notice a place beyond."""
    x, difference, homogeneous = np.sort([-0.9, -0.9 - 3 * gap, -0.3, -0.9]), np.empty(4), np.empty(4)
    sail_model._recursion.py_func(x, difference, homogeneous)
    assert 3.0**3 * difference[0] == pytest.approx(exponential_chain(3.0, *(-x / 3)), rel=1e-12)


def test_arrays_broadcast_and_cells_do_not_touch_each_other():
    """In any order of the rates; one that is not a number stays in its cell."""
    rng = np.random.default_rng(2)
    lai, one, other, third = rng.gamma(2, 1, (3, 1)), rng.uniform(0, 3, 4), 1e-9, rng.uniform(0, 3, (2, 1, 1))
    found = exponential_chain(lai, one, other, third)
    assert found.shape == (2, 3, 4)
    np.testing.assert_allclose(found, exponential_chain(lai, third, one, other), rtol=1e-12)
    assert found[1, 2, 3] == exponential_chain(lai[2, 0], one[3], other, third[1, 0, 0])
    one[1] = np.nan
    holed = exponential_chain(lai, one, other, third)
    assert np.isnan(holed[..., 1]).all()
    np.testing.assert_array_equal(np.delete(holed, 1, -1), np.delete(found, 1, -1))


def test_a_chain_of_two_is_the_integral_of_one_exponential():
    lai = np.array([0.0, 0.1, 3.0, 50.0])
    np.testing.assert_allclose(exponential_chain(lai, 0.7, 0.0), -np.expm1(-0.7 * lai) / 0.7, rtol=1e-13)
    assert isinstance(exponential_chain(1.0, 0.7, 0.0), float)
