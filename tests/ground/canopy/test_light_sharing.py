"""What leaves and ground absorb, against light followed through the layers."""

import numpy as np
import pytest
from oracles_canopy import turned_leaves
from scipy.linalg import expm

from fifesim.ground.canopy.layers import leaf_layers, light_budget

GREEN, DEAD, GROUND = (0.4, 0.3), (0.3, 0.1), 0.25


def followed(lai, brown, dissociation, sza, inclination, beam, sky):
    """Three streams and what leaves of unit absorptance take of them in each layer, by matrix exponentials."""
    sun, *_ = turned_leaves(inclination, sza, 0.0, 0.0)
    ks, bf = sun / np.cos(np.radians(sza)), np.cos(np.radians(inclination)) ** 2
    layers, through, taken = leaf_layers(lai, brown, dissociation), np.eye(3), []
    for depth, dead in ((layers.lai, layers.brown), (layers.lai_below, layers.brown_below)):
        rho, tau = ((1 - dead) * one + dead * other for one, other in zip(GREEN, DEAD, strict=True))
        forward, backward = ([((k + s * bf) * rho + (k - s * bf) * tau) / 2 for k in (ks, 1.0)] for s in (-1, 1))
        streams = np.array(
            [[-ks, 0, 0], [forward[0], forward[1] - 1, backward[1]], [-backward[0], -backward[1], 1 - forward[1]]]
        )
        # The last row adds up what is met by leaves: beam by its extinction, diffuse light by 1.
        whole = expm(np.vstack([np.hstack([streams, np.zeros((3, 1))]), [[ks, 1, 1, 0]]]) * float(depth))
        taken.append(whole[3, :3] @ through)
        through = whole[:3, :3] @ through
    # The light up at the top is such that the ground sends up its share.
    known, up = through @ [beam, sky, 0], through @ [0, 0, 1]
    top = -(known[2] - GROUND * (known[0] + known[1])) / (up[2] - GROUND * (up[0] + up[1]))
    streams = np.array([beam, sky, top])
    met = [float(row @ streams) for row in taken]
    absorbed = [1 - sum(GREEN), 1 - sum(DEAD)]
    dead = [layers.brown, layers.brown_below]
    green = sum(each * (1 - share) for each, share in zip(met, dead, strict=True)) * absorbed[0]
    brown = sum(each * share for each, share in zip(met, dead, strict=True)) * absorbed[1]
    bottom = through @ streams
    return green, brown, (1 - GROUND) * (bottom[0] + bottom[1]), top


@pytest.mark.parametrize("lai, brown, dissociation, sza", [(2, 0.4, 0.5, 30), (0.3, 0.1, 0.0, 60), (5, 0.7, 1.0, 45)])
def test_budget_is_that_of_light_followed_through_the_layers(lai, brown, dissociation, sza):
    for sky in (0.0, 0.3, 1.0):
        budget = light_budget(
            lai, *GREEN, *DEAD, GROUND, brown=brown, dissociation=dissociation, sza=sza, leaf_angles="35: 1",
            diffuse_fraction=sky,
        )  # fmt: skip
        expected = followed(lai, brown, dissociation, sza, 35.0, 1 - sky, sky)
        np.testing.assert_allclose([float(each) for each in budget], expected, rtol=0, atol=1e-7)


def test_nothing_is_lost():
    lai, brown = np.array([0, 0.1, 3, 30])[:, None], np.array([0, 0.3, 1])
    for cover in (0.2, 1.0):
        budget = light_budget(
            lai, *GREEN, *DEAD, GROUND, brown=brown, dissociation=0.4, sza=50, diffuse_fraction=0.25, crown_cover=cover
        )  # fmt: skip
        np.testing.assert_allclose(sum(budget), 1, rtol=0, atol=1e-12)
        assert min(each.min() for each in budget) >= -1e-15
        np.testing.assert_allclose(budget.brown[:, 0], 0, atol=1e-15)
        np.testing.assert_allclose(budget.green[:, 2], 0, atol=1e-15)
