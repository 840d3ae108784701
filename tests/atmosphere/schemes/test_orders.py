"""Orders of scattering: `test_successive_orders` and `test_stokes` have what they add up to."""

import numpy as np
import pytest

from fifesim.atmosphere.column import mixed_column
from fifesim.atmosphere.successive_orders import (
    fluxes,
    leaving_light,
    lit_from_below,
    once_scattered,
    quadrature,
    rescattered_light,
)

ACCURACY = {"streams": 8, "tolerance": 1e-9}
MU = np.array([0.3, 0.9])


def column(terms=16, tau=0.3):
    return mixed_column(tau, 0.0, 0.0, [1.0], terms, 40)


def test_directions_of_a_hemisphere_carry_the_flux_of_an_even_sky():
    nodes, weights = quadrature(8)
    assert 2 * (nodes * weights)[:8].sum() == pytest.approx(1, rel=1e-12)
    np.testing.assert_array_equal(nodes[8:], -nodes[:8])


def test_terms_beyond_those_of_the_molecules_change_nothing():
    few, many = (list(rescattered_light(column(terms), 0.6, MU, stokes=True, **ACCURACY)) for terms in (3, 16))
    for (mode, radiance), (same, expected) in zip(few, many, strict=False):
        assert mode == same
        np.testing.assert_allclose(radiance, expected, atol=1e-9)


def test_even_air_looks_the_same_from_both_sides():
    """Light that a layer of one kind of scatterer sends up from below is what it sends down from above."""
    air = column()
    source = lit_from_below(air, **ACCURACY)
    (up,), (down,) = (leaving_light(air, 0, MU, source, at_ground=at_ground) for at_ground in (False, True))
    transmittance, albedo = fluxes(air, source, MU, 8)
    np.testing.assert_allclose(transmittance, np.exp(-0.3 / MU) + up, rtol=1e-12)
    assert (down > 0).all() and 0 < albedo < 0.3


def test_light_scattered_once_is_lost_nowhere():
    """Of a thin layer as much goes up as down, at the same angles."""
    air = column(tau=1e-6)
    up, down = (once_scattered(air, np.ones((2, 1)), np.ones((2, 1)), 0.6, MU, at_ground=g) for g in (False, True))
    np.testing.assert_allclose(up[:, 0], 1e-6 / (4 * 0.6 * MU), rtol=1e-5)
    np.testing.assert_allclose(down, up, rtol=1e-5)
