"""Chips of a landscape share no cell, and fill its tiles."""

import itertools

import pytest

from fifesim.scenario.chips import first_cell_of_chip, ring_place


def test_the_spiral_goes_step_by_step_through_all_places():
    places = [ring_place(number) for number in range(15**2)]
    assert set(places) == set(itertools.product(range(-7, 8), repeat=2))
    steps = [abs(a - c) + abs(b - d) for (a, b), (c, d) in itertools.pairwise(places)]
    assert set(steps) == {1}


@pytest.mark.parametrize("size", [(4, 5), (3, 5), (10, 3), (13, 4)])
@pytest.mark.parametrize("corner", [(0, 0), (-17, 23)])
def test_no_two_chips_share_a_cell(size, corner):
    cells = set()
    for number in range(60):
        row, column = first_cell_of_chip(number, size, corner, 10)
        own = set(itertools.product(range(row, row + size[0]), range(column, column + size[1])))
        assert not own & cells
        cells |= own


def test_chips_fill_a_tile_before_the_next():
    """333 cells fit thrice along a tile of 1008."""
    tiles = [
        tuple(at // 1008 for at in first_cell_of_chip(number, (333, 333), (211491, 5000), 1008)) for number in range(27)
    ]
    assert [len(set(tiles[first : first + 9])) for first in (0, 9, 18)] == [1, 1, 1]
    assert len(set(tiles)) == 3 and tiles[0] == (209, 4)
    for number in range(9):
        row, column = first_cell_of_chip(number, (333, 333), (211491, 5000), 1008)
        assert (row + 332) // 1008 == row // 1008 and (column + 332) // 1008 == column // 1008


def test_a_tile_holds_the_margins_of_its_chips():
    """With 24 cells around them only four chips of 333 fit into a tile of 1008."""
    places = [first_cell_of_chip(number, (333, 333), (211491, 5000), 1008, (24, 24)) for number in range(8)]
    for row, column in places:
        assert (row - 24) // 1008 == (row + 356) // 1008 and (column - 24) // 1008 == (column + 356) // 1008
    assert len({(row // 1008, column // 1008) for row, column in places}) == 2
