"""Windows of a lattice of tiles."""

import numpy as np
import pytest

from fifesim.base.lattice import assemble

TILE = 5


def place(row, column):
    """A value that tells the place."""
    return 1000.0 * row + column


def tile(tile_row, tile_column):
    rows, columns = (np.arange(TILE) + index * TILE for index in (tile_row, tile_column))
    return place(rows[:, None], columns)


@pytest.mark.parametrize("row, column", [(0, 0), (3, 4), (-7, 2), (-5, -10), (-1, -1), (10**9, -(10**9))])
@pytest.mark.parametrize("shape", [(1, 1), (5, 5), (4, 13), (11, 2)])
def test_window_holds_its_places(row, column, shape):
    found = assemble(tile, TILE, row, column, shape)
    expected = place(row + np.arange(shape[0])[:, None], column + np.arange(shape[1]))
    np.testing.assert_array_equal(found, expected)


def test_each_tile_is_made_once_and_no_other():
    made = []
    assemble(lambda i, j: made.append((i, j)) or tile(i, j), TILE, -2, 5, (7, 5))
    assert made == [(-1, 1), (0, 1)]


def test_empty_window_makes_no_tile():
    assert assemble(None, TILE, 3, 3, (0, 4)).shape == (0, 4)
