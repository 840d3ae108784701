"""Directions, and Equations 4 and 5."""

import numpy as np

from fifesim.ground.terrain import slope as lights


def test_directions_point_where_angles_say():
    rng = np.random.default_rng(1)
    zenith, azimuth = rng.uniform(0, [[90], [360]], (2, 50))
    a, b = np.radians((zenith, azimuth))
    toward = np.stack([np.sin(a) * np.sin(b), np.sin(a) * np.cos(b), np.cos(a)])
    np.testing.assert_allclose(lights.direction_vector(zenith, azimuth), toward, atol=1e-15)


def test_kt_is_the_light_on_a_slope_over_that_on_level_ground():
    """Sunbeam, skylight and light of the land, each by itself."""
    rng = np.random.default_rng(2)
    sky, land, rho, local, level, direct = rng.uniform(0.1, 0.9, (6, 40))
    total = direct + rng.uniform(0.01, 0.1, 40)
    light = direct * local / level + (total - direct) * sky + total * rho * land
    found = lights.topographic_factor(sky, land, rho, local, level, direct, total)
    np.testing.assert_allclose(found, light / total, rtol=1e-12)


def test_a_slope_that_faces_away_is_not_seen():
    assert lights.upwelling_factor(np.array([0.3, 0.6, -0.2]), 0.6).tolist() == [0.5, 1.0, 0.0]
