"""The environment on blocks, of ground that is known and of apparent reflectance."""

import numpy as np
import pytest

from fifesim.atmosphere.adjacency import (
    Blocks,
    block_environment,
    block_sums,
    environment_of_target,
    point_spread,
    spread_over,
    whole_blocks,
)
from fifesim.atmosphere.coupling import TargetTerms, inhomogeneous_reflectance

# Cells as large as blocks: what is between blocks is not asked for.
Y, X = Blocks(1, 0, 9), Blocks(1, 0, 12)
CELL, VZA, WEIGHTS = (60.0, 80.0), 30.0, (0.3, 0.6)
TERMS = TargetTerms(0.09, 0.8, 0.52, 0.31, 0.19, 0.98)


def spread(margin=(1, 1)):
    return spread_over(Y, X, CELL, margin, VZA, *WEIGHTS)


def sums_of(values, linear=False):
    along_y, along_x = (axis.pieces((axis.n_cells,))[0] for axis in (Y, X))
    sums = block_sums(slice(0, 9), slice(0, 12), values, along_y=along_y, along_x=along_x, linear=linear)
    return whole_blocks(sums, along_y, along_x)


@pytest.fixture
def ground():
    ground = np.random.default_rng(3).random((9, 12)) * 0.5
    ground[2:4, 5:8] = np.nan
    return ground


def test_one_bright_block_is_seen_by_the_point_spread():
    """Also from the ring around the scene, and not around the back of the Fourier transform."""
    field = np.zeros((11, 14))
    field[1 + 2, 1 + 3] = 1.0
    expected = point_spread((9, 12), CELL, VZA, *WEIGHTS)
    i, j = np.abs(np.arange(-1, 10) - 2), np.abs(np.arange(-1, 13) - 3)
    np.testing.assert_allclose(spread()(field), expected[np.ix_(i, j)], rtol=0, atol=1e-15)


@pytest.mark.parametrize("around", [None, 0.3, np.full((13, 16), 0.3)], ids=["mean", "number", "raster"])
def test_even_ground_with_holes_is_its_own_environment(ground, around):
    even = np.where(np.isnan(ground), np.nan, 0.3)
    margin = (1, 1) if np.ndim(around) == 0 else (2, 2)
    np.testing.assert_allclose(block_environment(sums_of(even), around, spread(margin)), 0.3, rtol=0, atol=1e-14)


def test_bright_surroundings_are_seen_where_they_are():
    """In the east: more the nearer, on a black scene."""
    around = np.zeros((13, 16))
    around[:, -2:] = 0.8
    found = block_environment(sums_of(np.zeros((9, 12))), around, spread((2, 2)))
    share = found - found[:, :1]
    assert np.all(np.diff(share[1:-1], axis=1)[:, -5:] > 0)
    assert found.max() < 0.8


@pytest.mark.parametrize("around", [None, 0.2])
def test_environment_is_found_from_apparent_reflectance(ground, around):
    """Solved to 1e-12."""
    known = block_environment(sums_of(ground), around, spread())
    toa = inhomogeneous_reflectance(ground, known[1:-1, 1:-1], TERMS)
    found = environment_of_target(sums_of(toa, linear=True), around, spread(), TERMS)
    np.testing.assert_allclose(found, known, rtol=0, atol=1e-11)


def test_scene_without_cells_has_no_environment_of_its_own():
    nothing = sums_of(np.full((9, 12), np.nan))
    assert np.isnan(block_environment(nothing, None, spread())).all()
    np.testing.assert_allclose(block_environment(nothing, 0.2, spread()), 0.2)
