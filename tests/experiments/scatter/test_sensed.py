"""The sensor's stages at work or ideal, by means that are taken by hand."""

import numpy as np
import pytest

from fifesim.experiments.scatter.stages import _scene, images_of
from fifesim.scenario.scenario import Scenario

IDEAL = ((False,), (False,), (False,), (False,), (False,))


@pytest.fixture(scope="module")
def scene():
    return _scene(Scenario(grid={"width": 300, "height": 300}, terrain={"dem": "flat"}, sensor={"offset": [0.0, 1.0]}))


@pytest.fixture(scope="module")
def cells(scene):
    red, nir = np.random.default_rng(2).uniform([[[0.04]], [[0.2]]], [[[0.1]], [[0.4]]], (2, 90, 90))
    return np.stack([red, nir, (nir - red) / (nir + red)])


def blocks(cells):
    return cells.reshape(len(cells), 10, 9, 10, 9).mean((2, 4))


def test_ideal_stages_give_the_mean_ndvi_of_the_cells(scene, cells):
    found = images_of(scene, cells, IDEAL)
    assert found.shape == (1, 1, 1, 1, 1, *scene.shape)
    np.testing.assert_allclose(found[0, 0, 0, 0, 0], blocks(cells)[2, : scene.shape[0], : scene.shape[1]], atol=1e-12)


def test_scaling_is_the_ndvi_of_the_mean_reflectances(scene, cells):
    red, nir, _ = blocks(cells)[:, : scene.shape[0], : scene.shape[1]]
    found = images_of(scene, cells, ((False, True), *IDEAL[1:]))
    np.testing.assert_allclose(found[1, 0, 0, 0, 0], (nir - red) / (nir + red), atol=1e-12)


def test_counts_move_an_ideal_image_by_what_they_move_that_of_the_means(scene, cells):
    """Whether NDVI is of cells or of means, the detector's steps are the same, and not larger than a count or two."""
    found = images_of(scene, cells, ((False, True), (False,), (False,), (False, True), (False,)))[:, 0, 0, :, 0]
    steps = found[:, 1] - found[:, 0]
    np.testing.assert_allclose(steps[0], steps[1], atol=1e-12)
    assert 1e-4 < np.abs(steps).max() < 0.03


def test_a_displaced_image_sees_the_pixel_beside(scene, cells):
    found = images_of(scene, cells, ((False,), (False,), (False, True), (False,), (False,)))[0, 0, :, 0, 0]
    np.testing.assert_allclose(found[1, :, :-1], found[0, :, 1:], atol=1e-12)
