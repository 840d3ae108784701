"""From cells to pixels without labels."""

from dataclasses import replace

import numpy as np
import pytest

import fifesim
from fifesim.base.line_spread import Boxcar
from fifesim.chain.arrays import ArrayChain, shared_operators
from fifesim.chain.kernels import Kernels
from fifesim.chain.setup import image_of, reflectance_of
from fifesim.rasters import grid as grids

GRID = fifesim.fife_site(10.0, ((300, 348), (200, 254)))


@pytest.fixture(scope="module")
def scene():
    return fifesim.lai_scene(GRID, arp=0.2, seed=3)


@pytest.mark.parametrize(
    "own",
    [
        {},
        {"interval": "native", "offset": (0.4, -0.3)},
        {"instrument": "OLI", "bands": ("B4", "B5"), "noise": ("thermal",), "seed": 5},
        {"quantise": False, "interval": 45.0, "min_valid": 0.8},
    ],
)
def test_an_image_is_the_labelled_one_to_the_bit(scene, own):
    setup = fifesim.Setup(**{"bands": ("TM3", "TM4"), "geometry": fifesim.fife_geometry()} | own)
    chain, level = ArrayChain(setup, GRID), reflectance_of(setup, scene)
    found, expected = chain.image(chain.kernels.toa(level.values)), image_of(setup, level)
    assert found.dtype == expected.dtype
    np.testing.assert_array_equal(found, expected)
    assert grids.same_grid(chain.pixels, grids.geobox(expected))
    np.testing.assert_array_equal(
        chain.means(scene.values, 35.0), fifesim.aggregate(scene, 35.0, min_valid=setup.min_valid)
    )


def test_shared_kernels_give_each_setup_its_own_seed(scene):
    setup = fifesim.Setup("OLI", bands=("B4", "B5"), geometry=fifesim.fife_geometry(), noise=("thermal",))
    kernels = Kernels(setup)
    toa = kernels.toa(kernels.reflectance(scene.values))
    images = [ArrayChain(replace(setup, seed=seed), GRID, kernels).image(toa) for seed in (1, 2)]
    assert (images[0] != images[1]).any()
    np.testing.assert_array_equal(images[1], ArrayChain(replace(setup, seed=2), GRID).image(toa))


def test_operators_are_kept_for_grids_of_one_place():
    pixels = grids.aligned(GRID, 30.0)
    first = shared_operators((Boxcar(30.0), Boxcar(30.0)), GRID, pixels)
    assert shared_operators((Boxcar(30.0), Boxcar(30.0)), GRID, pixels) is first
    assert shared_operators((Boxcar(30.0), Boxcar(30.0)), GRID, pixels, (3.0, 0.0)) is not first
