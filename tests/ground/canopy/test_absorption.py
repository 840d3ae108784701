"""Extinction and FPAR."""

import numpy as np
import pytest
from scipy.integrate import quad

from fifesim.ground.canopy.layers import FPAR_INF, beer_fpar, extinction_coefficient, green_fpar, leaf_layers
from fifesim.ground.canopy.sail_model import sail


def test_spherical_leaves_have_half_over_the_cosine():
    """Values by hand: 0.5 / cos."""
    sza = np.array([0, 25, 28.5, 30, 45, 60])
    np.testing.assert_array_equal(extinction_coefficient(sza), 0.5 / np.cos(np.radians(sza)))
    np.testing.assert_allclose(extinction_coefficient(sza), [0.5, 0.5517, 0.5689, 0.5774, 0.7071, 1.0], atol=5e-5)


def test_vertical_leaves_have_two_over_pi_times_the_tangent():
    """Monteith and Unsworth (1990), vertical cylinders."""
    sza = np.array([10, 45, 80])
    np.testing.assert_allclose(extinction_coefficient(sza, "90: 1"), 2 / np.pi * np.tan(np.radians(sza)), rtol=1e-12)


@pytest.mark.parametrize("mean", [30, 45, 57.3, 75])
def test_ellipsoidal_leaves_cast_the_shadow_of_an_ellipsoid(mean):
    """Campbell (1986): K grows as sqrt(x^2 + tan^2 sza), so K^2 is linear in tan^2; classes are good to 1e-3."""
    tangent = np.tan(np.radians([0, 10, 30, 50, 70]))
    square = extinction_coefficient(np.degrees(np.arctan(tangent)), ("campbell", mean)) ** 2
    slope = (square[1:] - square[0]) / tangent[1:] ** 2
    np.testing.assert_allclose(slope, slope[-1], rtol=1e-2)
    np.testing.assert_allclose(square, square[0] + slope[-1] * tangent**2, rtol=1e-3)


@pytest.mark.parametrize("shape", ["planophile", "erectophile", "uniform"])
def test_extinction_is_that_of_sail(shape):
    tss = sail(1.0, 0.1, 0.1, sza=40, leaf_angles=shape).tss
    np.testing.assert_allclose(extinction_coefficient(40.0, shape), -np.log(tss), rtol=1e-12)


def test_fpar_integrates_the_light_that_each_leaf_layer_takes():
    """Eq. 6 by quadrature of K exp(-K L)."""
    expected = 0.94 * quad(lambda depth: 0.569 * np.exp(-0.569 * depth), 0, 2.5)[0]
    np.testing.assert_allclose(beer_fpar(2.5, 0.569), expected, rtol=1e-12)


def test_fpar_ends():
    assert beer_fpar(0.0, 0.5) == 0
    assert beer_fpar(np.inf, 0.5) == FPAR_INF == 0.94
    assert beer_fpar(1e4, 0.5, fpar_inf=0.9) == 0.9


@pytest.mark.parametrize("dissociation", [0.0, 0.4, 1.0])
def test_green_leaves_absorb_their_share_of_each_depth(dissociation):
    """By quadrature: at each depth the light that is left meets green leaves by their share there."""
    lai, brown, extinction = 3.0, 0.4, 0.6
    layers = leaf_layers(lai, brown, dissociation)

    def taken(depth):
        share = layers.brown if depth < layers.lai else layers.brown_below
        return 0.94 * extinction * np.exp(-extinction * depth) * (1 - share)

    expected = quad(taken, 0, layers.lai)[0] + quad(taken, layers.lai, lai)[0]
    np.testing.assert_allclose(green_fpar(lai, extinction, brown, dissociation), expected, rtol=1e-12)
    for share, all_of_it in ((0.0, beer_fpar(lai, extinction)), (1.0, 0.0)):
        found = green_fpar(lai, extinction, share, dissociation)
        np.testing.assert_allclose(found, all_of_it, rtol=1e-14)
