"""Where grids and files lie."""

import pytest

import fifesim
from fifesim.grids import projection


def test_middle_of_the_site():
    """The paper's place, to a hundredth of a degree."""
    assert projection.middle(fifesim.fife_site(30)) == pytest.approx((-96.54, 39.06), abs=0.02)


def test_grid_in_words_has_its_crs_and_degrees():
    grid = fifesim.grid_at("EPSG:32735", 620000.0, 7220000.0, 300.0, 200.0, 10.0)
    said = "620000 to 620300 E and 7219800 to 7220000 N in EPSG:32735 (latitude -25.13, longitude 28.19)"
    assert projection.lies_in_words(grid.affine, grid.shape, grid.crs) == said
