"""Uplands between rivers: their borders, and what streams leave of the ground."""

import numpy as np
import pytest

from fifesim.ground.terrain.flint_hills import BASE, NODES, SADDLE, upland
from fifesim.ground.terrain.spline import SPLINE_REACH, spline_points


@pytest.fixture(scope="module")
def nodes():
    """Elevation at the nodes of one upland."""
    at = np.indices((NODES, NODES), float) + SPLINE_REACH
    return spline_points(upland(3, 5, -2), *at)


def test_rivers_are_where_both_sides_meet(nodes):
    """Along the rivers the base, and the saddle half way along the valleys that join them."""
    valley = BASE + SADDLE * (1 - np.abs(np.linspace(-1, 1, NODES))) ** 0.6
    for side, level in ((nodes[0], BASE), (nodes[-1], BASE), (nodes[:, 0], valley), (nodes[:, -1], valley)):
        np.testing.assert_allclose(side, level, rtol=0, atol=1e-6)


def test_ground_between_rivers_stands_above_them(nodes):
    inside = nodes[2:-2, 2:-2]
    assert inside.min() > BASE and 600 < np.median(inside) < 1100


def test_place_and_seed_decide_the_upland():
    one = upland(3, 5, -2)
    assert upland(3, 5, -2) is one
    assert not np.array_equal(upland(3, 6, -2), one)
    assert one.shape == (NODES + 2 * SPLINE_REACH,) * 2
