"""The topographic correction factor of cells in one pass."""

import numpy as np

from fifesim.ground.terrain.light import SlopeLight, topographic_factor
from fifesim.ground.terrain.sky import terrain_view
from fifesim.ground.terrain.slope_factors import slope_factor


def test_one_pass_has_the_bits_of_the_formula():
    drawn = np.random.default_rng(3)
    light = SlopeLight(*drawn.uniform(0.6, 1.0, (4, 5, 7)))
    light.cosine[2, 3] = light.sky_view[2, 3] = np.nan
    rho, direct, total = drawn.uniform(0, 0.5, (3, 5, 7)), np.array([0.5, 0.6, 0.7]), np.array([0.8, 0.85, 0.9])
    land = terrain_view(light.sky_view, light.cosine)
    bands = direct[:, None, None], total[:, None, None]
    expected = topographic_factor(light.sky_view, land, rho, light.mu_s_local, 0.88, *bands)
    found = slope_factor(light, rho, 0.88, direct, total)
    assert np.isnan(found[:, 2, 3]).all() and np.isnan(found).sum() == 3
    assert found.tobytes() == expected.tobytes()


def test_bands_last_in_memory_are_no_other_bands():
    drawn = np.random.default_rng(4)
    light, rho = SlopeLight(*drawn.uniform(0.6, 1.0, (4, 5, 7))), drawn.uniform(0, 0.5, (5, 7, 2))
    air = 0.88, [0.5, 0.6], [0.8, 0.9]
    turned = np.moveaxis(rho, -1, 0)
    np.testing.assert_array_equal(slope_factor(light, turned, *air), slope_factor(light, turned.copy(), *air))
