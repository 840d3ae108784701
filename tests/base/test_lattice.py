"""Windows of a lattice of tiles, and its random seeds and streams."""

from itertools import product

import numpy as np
import pytest

import fifesim
from fifesim.base.lattice import assemble, generator
from fifesim.ground.landscape.autoregression import periodic_field, streaming_field

TILE = 5


def place_code(row, column):
    """A value that encodes the row and column."""
    return 1000.0 * row + column


def tile(tile_row, tile_column):
    rows, columns = (np.arange(TILE) + index * TILE for index in (tile_row, tile_column))
    return place_code(rows[:, None], columns)


@pytest.mark.parametrize("row, column", [(0, 0), (3, 4), (-7, 2), (-5, -10), (-1, -1), (10**9, -(10**9))])
@pytest.mark.parametrize("shape", [(1, 1), (5, 5), (4, 13), (11, 2)])
def test_window_holds_the_right_cells(row, column, shape):
    found = assemble(tile, TILE, row, column, shape)
    expected = place_code(row + np.arange(shape[0])[:, None], column + np.arange(shape[1]))
    np.testing.assert_array_equal(found, expected)


def test_each_required_tile_is_made_once():
    made = []
    assemble(lambda i, j: made.append((i, j)) or tile(i, j), TILE, -2, 5, (7, 5))
    assert made == [(-1, 1), (0, 1)]


GRID = fifesim.fife_site(30 / 9, window=((90, 108), (180, 198)))


@pytest.fixture(scope="module")
def toa():
    return fifesim.lai_scene(GRID).fifesim.surface_reflectance("TM", bands=["TM4"]).fifesim.to_toa()


@pytest.fixture(params=["lai_scene", "periodic", "flint_hills", "streaming_field", "periodic_field", "sense"])
def draw(request, toa):
    """A public function that takes a seed."""
    return {
        "lai_scene": lambda seed: fifesim.lai_scene(GRID, seed=seed),
        "periodic": lambda seed: fifesim.lai_scene(GRID, seed=seed, method="periodic"),
        "flint_hills": lambda seed: fifesim.flint_hills(GRID, seed),
        "streaming_field": lambda seed: streaming_field(seed, 0.1, 0, 0, (3, 3)),
        "periodic_field": lambda seed: periodic_field(seed, 0.1, (3, 3)),
        "sense": lambda seed: toa.fifesim.sense(
            fifesim.instrument("TM", response="paper"),
            noise="thermal",
            noise_models=fifesim.NoiseModel(thermal=5.0, shot=0.0),
            seed=seed,
            quantise=False,
        ),
    }[request.param]


@pytest.mark.parametrize("seed", [7.0, 1.5, None, True, np.True_, "7", [7]])
def test_non_integer_seeds_are_rejected(draw, seed):
    with pytest.raises(TypeError, match=r"seed must be a whole number from 0 to 2\*\*63 - 1, got .*: give for inst"):
        draw(seed)


@pytest.mark.parametrize("seed", [-1, 2**63, 2**64 - 1, np.int8(-3), np.uint64(2**63)])
def test_seeds_that_scenarios_cannot_hold_are_rejected(draw, seed):
    with pytest.raises(ValueError, match=rf"seed must be a whole number from 0 to 2\*\*63 - 1, got {seed}: give"):
        draw(seed)


def test_integer_types_give_the_same_seed(draw):
    np.testing.assert_array_equal(draw(np.uint16(9)), draw(9))
    last, before = draw(np.int64(2**63 - 1)), draw(2**63 - 2)
    assert not np.array_equal(last, before)


def test_places_streams_and_seeds_give_independent_numbers():
    """Neighbouring integers above 2**63 are equal in double precision; place indices are 64-bit words."""
    keys = [(seed, stream, (0, 0, place, 0)) for seed, stream, place in product((0, 2**63 - 1), (1, 2**63), (0, -1))]
    keys += [(2**63 - 2, 1, (0, 0, 0, 0)), (0, 2**63 + 1, (0, 0, 0, 0)), (0, 1, (0, 0, -2, 0)), (0, 1, (0, 0, 0, -1))]
    drawn = [generator(*key).standard_normal(40_000) for key in keys]
    np.testing.assert_allclose(np.corrcoef(drawn), np.eye(len(keys)), rtol=0, atol=4.5 / 200)
