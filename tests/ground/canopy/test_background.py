"""Canopy and background together: what bare ground shows, and both ways of writing it."""

import numpy as np
import pytest

from fifesim.ground.canopy.sail_model import over_background, reflectance_factor, sail, with_background

RHO = np.linspace(0, 1, 6)[:, None, None]
SZA = np.array([0, 28.5, 60, 85, 89.9])[:, None]
VZA = np.array([0, 30, 75, 89.9])


@pytest.mark.parametrize("r", [0.0, 0.15, 1.0])
def test_bare_ground_shows_the_background_exactly(r):
    for reflectance in with_background(sail(0.0, RHO, 1 - RHO, sza=SZA, vza=VZA, hotspot=0.05), r):
        assert np.all(reflectance == r)


def test_skylight_mixes_the_two_reflectances():
    assert reflectance_factor(0.3, 0.5, 0.0) == 0.3
    assert reflectance_factor(0.3, 0.5, 1.0) == 0.5


@pytest.mark.parametrize("r", [0.0, 0.15, 0.6, 1.0])
def test_terms_of_the_layer_give_the_reflectance_of_both(r):
    """What is reflected back and forth between leaves and ground, order by order."""
    c = sail(2.0, RHO, 0.9 - 0.9 * RHO, sza=SZA, vza=VZA, raa=20, hotspot=0.1)
    terms = c.rso, c.tsstoo - c.tss * c.too, (c.tss + c.tsd) * (c.too + c.tdo), c.rdd
    found = over_background(*terms, r)
    np.testing.assert_allclose(found, with_background(c, r).rso, rtol=1e-13)
    alone, hot, through, rdd = terms
    orders = sum(through * r * (r * rdd) ** n for n in range(4000))
    converged = r * np.broadcast_to(rdd, found.shape) < 0.99
    np.testing.assert_allclose(found[converged], (alone + hot * r + orders)[converged], rtol=1e-12)
