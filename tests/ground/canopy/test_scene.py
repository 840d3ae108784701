"""The models of a scene, chosen by what it has."""

import numpy as np
from fifesim.ground.canopy.scene import Scene, canopy_of, cell_by_cell, decay, leaves_of, reflectance_of, sky_of

from fifesim.ground.canopy.background import reflectance_factor, with_background
from fifesim.ground.canopy.crowns import clumped, crown_shares
from fifesim.ground.canopy.layers import two_layers
from fifesim.ground.canopy.leaf_angles import leaf_angle_classes
from fifesim.ground.canopy.sail_model import sail

GREEN, DEAD = ((0.07, 0.45), (0.04, 0.42)), ((0.28, 0.42), (0.12, 0.3))
BY_BAND = [np.array(each)[:, None] for each in (*GREEN, *DEAD)]
ANGLES = {"sza": 40.0, "vza": 20.0, "raa": 30.0}
PLAIN = Scene(*GREEN, (0.2, 0.1), *ANGLES.values(), leaf_angle_classes("spherical"), 0.1)
LAI, BROWN = np.array([0.5, 2.0, 4.0]), np.array([0.1, 0.4, 0.9])


def test_models_are_those_that_a_scene_needs():
    light = ANGLES | {"hotspot": 0.1}
    np.testing.assert_array_equal(canopy_of(LAI, PLAIN).rso, sail(LAI, *BY_BAND[:2], **light).rso)
    both = PLAIN._replace(brown_reflectance=DEAD[0], brown_transmittance=DEAD[1], brown=BROWN, dissociation=0.3)
    expected = two_layers(LAI / 0.5, *BY_BAND, brown=BROWN, dissociation=0.3, **light)
    crowns = both._replace(crown_cover=0.5, crown_shape=2.0)
    np.testing.assert_array_equal(leaves_of(LAI / 0.5, both).rso, expected.rso)
    expected = clumped(expected, crown_shares(0.5, 2.0, *ANGLES.values()))
    np.testing.assert_array_equal(canopy_of(LAI, crowns).rso, expected.rso)
    surface = with_background(expected, 0.2)
    expected = reflectance_factor(surface.rso, surface.rdo, np.array([[0.2], [0.1]]))
    np.testing.assert_array_equal(reflectance_of(LAI, np.full((2, 1), 0.2), crowns), expected)
    np.testing.assert_array_equal(cell_by_cell(LAI, np.full((2, 1), 0.2), crowns), expected)
    assert crowns.varies() and not PLAIN.varies()


def test_part_of_a_scene_has_part_of_what_varies():
    part = PLAIN._replace(brown=BROWN, sky=np.ones((2, 1))).part(slice(1, 2))
    assert part.brown.tolist() == [0.4] and part.sky.shape == (2, 1) and part.hotspot == 0.1
    assert sky_of(PLAIN).tolist() == [[0.2], [0.1]]


def test_light_decays_by_sun_and_view_together():
    mu = np.cos(np.radians([40.0, 20.0]))
    np.testing.assert_allclose(decay(PLAIN), 0.5 / mu[0] + 0.5 / mu[1], rtol=1e-12)
