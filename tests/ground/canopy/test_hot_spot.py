"""What sun and observer both reach, against quadrature and limits."""

import numpy as np
import pytest
from oracles_canopy import sunlit_and_seen

from fifesim.ground.canopy.sail_model import bidirectional_gap, direction_distance, hotspot_decay


@pytest.mark.parametrize("alpha", [0.0, 1e-3, 1.0, 40.0, np.inf])
@pytest.mark.parametrize("lai", [0.01, 2.0, 30.0])
def test_gap_and_leaf_area_are_those_of_quadrature(lai, alpha):
    ks, ko = 0.7, 0.55
    tsstoo, seen = bidirectional_gap(lai, ks, ko, alpha)
    if np.isinf(alpha):
        expected, gap = -np.expm1(-(ks + ko) * lai) / (ks + ko), np.exp(-(ks + ko) * lai)
    else:
        expected = sunlit_and_seen(lai, ks, ko, alpha)
        overlap = 1.0 if alpha == 0 else -np.expm1(-alpha) / alpha
        gap = np.exp(-(ks + ko) * lai + np.sqrt(ks * ko) * lai * overlap)
    np.testing.assert_allclose([seen, tsstoo], [expected, gap], rtol=1e-9)


def test_directions_are_as_far_apart_as_their_tangents():
    """By complex numbers on the plane; 0 in the hot spot, and no hot spot without size."""
    sza, vza, raa = np.array([30, 60, 45]), np.array([50, 0, 45]), np.array([70, 10, 180])
    sun, view = np.tan(np.radians(sza)), np.tan(np.radians(vza)) * np.exp(1j * np.radians(raa))
    np.testing.assert_allclose(direction_distance(sza, vza, raa), np.abs(sun - view), rtol=1e-13)
    assert hotspot_decay(40.0, 40.0, 0.0, 1.2, np.array(0.1)) == 0
    assert hotspot_decay(40.0, 10.0, 0.0, 1.2, np.array(0.0)) == np.inf
    np.testing.assert_allclose(hotspot_decay(60.0, 0.0, 0.0, 1.2, np.array(0.1)), 2 * np.sqrt(3) / (1.2 * 0.1))
