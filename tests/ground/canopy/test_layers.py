"""Tests of two layers of green and dead leaves, of FPAR, and of the light absorbed by leaves and ground."""

import numpy as np
import pytest
from oracles_canopy import turned_leaves
from scipy.integrate import quad
from scipy.linalg import expm
from verification import tables

from fifesim.ground.canopy.layers import (
    FPAR_INF,
    beer_fpar,
    extinction_coefficient,
    green_fpar,
    leaf_layers,
    light_budget,
    mixed,
    two_layers,
)
from fifesim.ground.canopy.leaf_angles import leaf_angle_classes
from fifesim.ground.canopy.sail_model import sail, with_background

LAI = np.array([0, 1e-6, 0.5, 3, 20, 100])[:, None]
BROWN = np.array([0, 1e-9, 0.2, 0.7, 1 - 1e-9, 1])
GREEN, DEAD = (0.45, 0.42), (0.3, 0.1)
VIEWS = [(28.5, 0, 0, 0.0), (28.5, 28.5, 0, 0.1), (60, 45, 120, 0.05), (75, 60, 180, 1.0)]


def canopies(brown, dissociation, view, green=GREEN, dead=DEAD, lai=LAI):
    sza, vza, raa, hotspot = view
    angles = {"sza": sza, "vza": vza, "raa": raa, "hotspot": hotspot}
    return two_layers(lai, *green, *dead, brown=brown, dissociation=dissociation, **angles)


def leaves(optics, view, lai=LAI):
    sza, vza, raa, hotspot = view
    return sail(lai, *optics, sza=sza, vza=vza, raa=raa, hotspot=hotspot)


def check_equal(found, expected, atol=1e-12):
    for name, value in expected._asdict().items():
        one, other = np.broadcast_arrays(getattr(found, name), value)
        np.testing.assert_allclose(one, other, rtol=0, atol=atol, err_msg=name)


def test_two_layers_agree_with_4sail2():
    """Reference layers by prosail, added; seven decimals, and leaf angle fractions accurate to 1e-8."""
    for row in tables.table("two_layers.csv").itertuples():
        canopy = two_layers(
            row.lai, row.rho_green, row.tau_green, row.rho_brown, row.tau_brown, brown=row.brown, sza=row.sza,
            dissociation=row.dissociation, vza=row.vza, raa=row.raa, hotspot=row.hotspot,
            leaf_angles=leaf_angle_classes(row.leaf_angles, classes=18),
        )  # fmt: skip
        expected = [row.rso, row.rdo, row.rsd, row.rdd]
        np.testing.assert_allclose(list(with_background(canopy, row.soil)), expected, rtol=0, atol=1.5e-7)


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("dissociation", [0.0, 0.4, 1.0])
def test_equal_leaves_or_leaves_of_one_kind_or_mixed_leaves_equal_sail(view, dissociation):
    check_equal(canopies(BROWN, dissociation, view, dead=GREEN), leaves(GREEN, view))
    check_equal(canopies(0.0, dissociation, view), leaves(GREEN, view))
    check_equal(canopies(1.0, dissociation, view), leaves(DEAD, view))
    check_equal(canopies(BROWN, 0.0, view), leaves(mixed(GREEN, DEAD, BROWN), view))


@pytest.mark.parametrize("dissociation", [0.0, 0.5, 1.0])
def test_two_layers_are_reciprocal(dissociation):
    there, back = (
        with_background(canopies(BROWN, dissociation, view), 0.2).rso for view in ((60, 25, 50, 0.1), (25, 60, 50, 0.1))
    )
    np.testing.assert_allclose(there, back, rtol=1e-11)


def test_nan_stays_in_its_cell():
    lai, brown = np.array([1.0, np.nan, 1.0]), np.array([0.3, 0.3, np.nan])
    found = canopies(brown, 0.5, VIEWS[1], lai=lai)
    assert [np.isnan(getattr(found, name)).tolist() for name in ("rso", "rdd_below", "tdo")] == 3 * [
        [False, True, True]
    ]


def test_extinction_of_spherical_leaves():
    """K = 0.5 / cos(sza), with values calculated by hand."""
    sza = np.array([0, 25, 28.5, 30, 45, 60])
    np.testing.assert_array_equal(extinction_coefficient(sza), 0.5 / np.cos(np.radians(sza)))
    np.testing.assert_allclose(extinction_coefficient(sza), [0.5, 0.5517, 0.5689, 0.5774, 0.7071, 1.0], atol=5e-5)


def test_extinction_of_vertical_leaves():
    """Monteith and Unsworth (1990), vertical cylinders: K = 2 / pi tan(sza)."""
    sza = np.array([10, 45, 80])
    np.testing.assert_allclose(extinction_coefficient(sza, "90: 1"), 2 / np.pi * np.tan(np.radians(sza)), rtol=1e-12)


@pytest.mark.parametrize("shape", ["planophile", "erectophile", "uniform"])
def test_extinction_equals_sail(shape):
    tss = sail(1.0, 0.1, 0.1, sza=40, leaf_angles=shape).tss
    np.testing.assert_allclose(extinction_coefficient(40.0, shape), -np.log(tss), rtol=1e-12)


def test_fpar_is_the_integral_of_absorption_over_depth():
    """Quadrature of K exp(-K L) for eq. 6 of the paper; limits without leaves and with infinitely many."""
    expected = 0.94 * quad(lambda depth: 0.569 * np.exp(-0.569 * depth), 0, 2.5)[0]
    np.testing.assert_allclose(beer_fpar(2.5, 0.569), expected, rtol=1e-12)
    assert beer_fpar(0.0, 0.5) == 0
    assert beer_fpar(np.inf, 0.5) == FPAR_INF == 0.94
    assert beer_fpar(1e4, 0.5, fpar_inf=0.9) == 0.9


@pytest.mark.parametrize("dissociation", [0.0, 0.4, 1.0])
def test_green_fpar_is_absorption_times_green_share_at_each_depth(dissociation):
    """Quadrature over depth."""
    lai, brown, extinction = 3.0, 0.4, 0.6
    layers = leaf_layers(lai, brown, dissociation)

    def absorbed(depth):
        share = layers.brown if depth < layers.lai else layers.brown_below
        return 0.94 * extinction * np.exp(-extinction * depth) * (1 - share)

    expected = quad(absorbed, 0, layers.lai)[0] + quad(absorbed, layers.lai, lai)[0]
    np.testing.assert_allclose(green_fpar(lai, extinction, brown, dissociation), expected, rtol=1e-12)
    for share, all_of_it in ((0.0, beer_fpar(lai, extinction)), (1.0, 0.0)):
        found = green_fpar(lai, extinction, share, dissociation)
        np.testing.assert_allclose(found, all_of_it, rtol=1e-14)


GREEN_LEAF, DEAD_LEAF, GROUND = (0.4, 0.3), (0.3, 0.1), 0.25


def followed(lai, brown, dissociation, sza, inclination, beam, sky):
    """Green, dead and ground absorption, and reflectance, by matrix exponentials of three streams."""
    sun, *_ = turned_leaves(inclination, sza, 0.0, 0.0)
    ks, bf = sun / np.cos(np.radians(sza)), np.cos(np.radians(inclination)) ** 2
    layers, through, intercepted = leaf_layers(lai, brown, dissociation), np.eye(3), []
    for depth, dead in ((layers.lai, layers.brown), (layers.lai_below, layers.brown_below)):
        rho, tau = ((1 - dead) * one + dead * other for one, other in zip(GREEN_LEAF, DEAD_LEAF, strict=True))
        forward, backward = ([((k + s * bf) * rho + (k - s * bf) * tau) / 2 for k in (ks, 1.0)] for s in (-1, 1))
        streams = np.array(
            [[-ks, 0, 0], [forward[0], forward[1] - 1, backward[1]], [-backward[0], -backward[1], 1 - forward[1]]]
        )
        # The last row sums the light intercepted by leaves, with coefficients ks for the beam and 1 for diffuse light.
        whole = expm(np.vstack([np.hstack([streams, np.zeros((3, 1))]), [[ks, 1, 1, 0]]]) * float(depth))
        intercepted.append(whole[3, :3] @ through)
        through = whole[:3, :3] @ through
    # Choose the upward light at the top so that the ground reflects its share of the light at the bottom.
    known, up = through @ [beam, sky, 0], through @ [0, 0, 1]
    top = -(known[2] - GROUND * (known[0] + known[1])) / (up[2] - GROUND * (up[0] + up[1]))
    streams = np.array([beam, sky, top])
    met = [float(row @ streams) for row in intercepted]
    absorbed = [1 - sum(GREEN_LEAF), 1 - sum(DEAD_LEAF)]
    dead = [layers.brown, layers.brown_below]
    green = sum(each * (1 - share) for each, share in zip(met, dead, strict=True)) * absorbed[0]
    brown = sum(each * share for each, share in zip(met, dead, strict=True)) * absorbed[1]
    bottom = through @ streams
    return green, brown, (1 - GROUND) * (bottom[0] + bottom[1]), top


@pytest.mark.parametrize("lai, brown, dissociation, sza", [(2, 0.4, 0.5, 30), (0.3, 0.1, 0.0, 60), (5, 0.7, 1.0, 45)])
def test_light_budget_agrees_with_matrix_exponentials(lai, brown, dissociation, sza):
    for sky in (0.0, 0.3, 1.0):
        budget = light_budget(
            lai, *GREEN_LEAF, *DEAD_LEAF, GROUND, brown=brown, dissociation=dissociation, sza=sza, leaf_angles="35: 1",
            diffuse_fraction=sky,
        )  # fmt: skip
        expected = followed(lai, brown, dissociation, sza, 35.0, 1 - sky, sky)
        np.testing.assert_allclose([float(each) for each in budget], expected, rtol=0, atol=1e-7)


def test_light_budget_sums_to_1():
    lai, brown = np.array([0, 0.1, 3, 30])[:, None], np.array([0, 0.3, 1])
    for cover in (0.2, 1.0):
        budget = light_budget(
            lai, *GREEN_LEAF, *DEAD_LEAF, GROUND, brown=brown, dissociation=0.4, sza=50, diffuse_fraction=0.25,
            crown_cover=cover,
        )  # fmt: skip
        np.testing.assert_allclose(sum(budget), 1, rtol=0, atol=1e-12)
        assert min(each.min() for each in budget) >= -1e-15
        np.testing.assert_allclose(budget.brown[:, 0], 0, atol=1e-15)
        np.testing.assert_allclose(budget.green[:, 2], 0, atol=1e-15)
