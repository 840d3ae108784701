"""Streams: least ways, drainage and erosion against closed forms."""

import numpy as np
import pytest

from fifesim.ground.terrain.flint_hills import StreamPower, erode, least_ways

LAW = StreamPower(steps=50, area_exponent=0.5, uplift=30.0, creep=0.0, node=25.0)


def without_preference(size):
    return np.ones((8, size * size))


def test_least_way_through_even_ground_is_straight_to_the_nearest_border():
    i, j = np.indices((11, 11))
    found = least_ways(np.full((11, 11), 2.5))
    np.testing.assert_allclose(found, 2.5 * np.minimum(np.minimum(i, 10 - i), np.minimum(j, 10 - j)), rtol=1e-13)


def test_least_way_goes_round_a_wall():
    """One gap in a dear ring: from the middle through the gap, not across the ring."""
    cost = np.ones((9, 9))
    cost[2:7, 2:7] = 1e3
    cost[3:6, 3:6] = 1.0
    cost[2, 4] = 1.0
    assert least_ways(cost)[4, 4] == pytest.approx(4.0)


def test_ground_that_nothing_cuts_rises_by_its_uplift_and_its_border_stays():
    start = np.random.default_rng(1).uniform(300, 310, (12, 12))
    found = erode(start, np.zeros_like(start), without_preference(12), LAW)
    expected = start.copy()
    expected[1:-1, 1:-1] += 30.0
    np.testing.assert_allclose(found, expected, rtol=1e-13)


def test_creep_without_streams_is_diffusion():
    """A wave between borders at rest decays as exp(-2 D k**2 t); explicit steps are good to one in a thousand."""
    size, law = 41, LAW._replace(uplift=0.0, creep=2000.0)
    across = np.sin(np.pi * np.arange(size) / (size - 1))
    wave = across[:, None] * across
    k = np.pi / ((size - 1) * law.node)
    found = erode(100 + wave, np.zeros((size, size)), without_preference(size), law)
    np.testing.assert_allclose(found - 100, wave * np.exp(-2 * law.creep * k**2), rtol=0, atol=1e-3)


def test_ridge_is_cut_by_one_implicit_step_as_its_areas_grow():
    """Every line drains to its ends, the top to one of them: four nodes, one after the other."""
    size, law, rock = 9, LAW._replace(steps=1, uplift=0.0), 0.02
    ridge = np.tile(10.0 * (4 - np.abs(np.arange(size) - 4)), (size, 1))
    found = erode(ridge, np.full((size, size), rock), without_preference(size), law)
    below = 0.0
    for column, nodes in zip((1, 2, 3, 4), (4, 3, 2, 1), strict=True):
        factor = rock * np.sqrt(nodes * law.node**2) / law.node
        below = (10.0 * column + factor * below) / (1 + factor)
        assert found[4, column] == pytest.approx(below, rel=1e-12)


def test_preferred_neighbour_takes_the_water():
    """On a plane that falls to the east, north-east is liked so much that the diagonal wins."""
    size, law = 7, LAW._replace(steps=1, uplift=0.0)
    plane = np.tile(-10.0 * np.arange(size), (size, 1))
    liked = without_preference(size)
    liked[2] = 2.0  # of the eight neighbours, row by row from the north-west, the third
    found = erode(plane, np.full((size, size), 0.02), liked, law)
    factor = 0.02 * law.node / (law.node * np.sqrt(2))
    # The corner node drains to the border, and nothing through it.
    assert found[5, 1] == pytest.approx((plane[5, 1] + factor * found[4, 2]) / (1 + factor), rel=1e-12)


def test_water_that_joins_cuts_with_the_area_of_all_that_comes():
    """Two lines of unlike length meet in a third: areas of nodes that drain through it, not of the longest way."""
    size, law, rock = 9, LAW._replace(steps=1, uplift=0.0), 0.02
    ground = np.full((size, size), 100.0)
    ground[:, 0] = 0.0
    # Down along row 4; from the north three nodes of column 4 and from the south one flow into it.
    ground[4, 1:5] = [10.0, 20.0, 30.0, 40.0]
    ground[1:4, 4] = [70.0, 60.0, 50.0]
    ground[5, 4] = 55.0
    liked = without_preference(size)
    found = erode(ground, np.full((size, size), rock), liked, law)
    drained = _drained_by_hand(ground, law.node)
    factor = rock * np.sqrt(drained[4, 1] * law.node**2) / law.node
    assert drained[4, 1] > 8
    assert found[4, 1] == pytest.approx((10.0 + factor * 0.0) / (1 + factor), rel=1e-12)


def _drained_by_hand(ground, node):
    """Nodes that drain through each, by following every one of them down."""
    size, drained = ground.shape[0], np.zeros(ground.shape, int)
    around = [(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1) if a or b]
    for i in range(1, size - 1):
        for j in range(1, size - 1):
            y, x = i, j
            while 0 < y < size - 1 and 0 < x < size - 1:
                drained[y, x] += 1
                falls = [(ground[y, x] - ground[y + a, x + b]) / (node * np.hypot(a, b)) for a, b in around]
                if max(falls) <= 0:
                    break
                a, b = around[int(np.argmax(falls))]
                y, x = y + a, x + b
    return drained
