"""Chips: landscapes lie apart, draws follow the study, and each chip is a scenario."""

import itertools
import warnings

import numpy as np
import pytest

from fifesim.grids.sites import on_fife_site
from fifesim.ground.landscape.autoregression import FIELD_TILE
from fifesim.scenario.chips import chips_of, first_cell_of_chip, ring_place
from fifesim.scenario.ground import warn_of_canopy
from fifesim.scenario.scenario import parse_scenario
from fifesim.scenario.simulation import simulate
from fifesim.scenario.studies import Study

SMALL = {"grid": {"width": 180.0, "height": 180.0}, "terrain": {"dem": "flat"}}
DRAWS = {
    "visibility": {"uniform": [10, 60]},
    "ground.arp": {"uniform": [0.05, 0.2]},
    "distribution": {"choice": ["burned-grazed", "burned-ungrazed"]},
}


def make_study(sections=(), **plan):
    return Study(parse_scenario(SMALL | dict(sections)), DRAWS, **{"landscapes": 8} | plan)


@pytest.fixture(scope="module")
def chips():
    return chips_of(make_study(), 300)


@pytest.mark.parametrize("sequence", ["sobol", "random"])
def test_chips_do_not_depend_on_their_number(sequence):
    few, many = (chips_of(make_study(sequence=sequence), count).table() for count in (13, 200))
    assert few.equals(many.isel(chip=slice(13)))
    other = chips_of(make_study(sequence=sequence, seed=1), 200).table()
    assert (other["atmosphere.visibility"] != many["atmosphere.visibility"]).all()
    assert (other.landscape != many.landscape).any()


def test_each_landscape_belongs_to_one_part(chips):
    parts = {name: set(chips.landscape[chips.split == name].tolist()) for name in ("train", "validation", "test")}
    assert [len(each) for each in parts.values()] == [6, 1, 1]
    assert set.union(*parts.values()) == set(range(8))


def test_first_chips_lie_in_the_tile_of_the_scenario(chips):
    """The eight landscapes start at the same upper left corner, in the scenario's tile of 1008 cells."""
    table, grid = chips.table(), chips.study.scenario.geobox()
    cell, side = grid.resolution.x, FIELD_TILE * grid.resolution.x
    first = table.isel(chip=slice(8))
    assert len({(float(west), float(north)) for west, north in zip(first.west, first.north, strict=True)}) == 1
    column, row = float(first.west[0]) / cell, -float(first.north[0]) / cell
    assert column == pytest.approx(round(column), abs=1e-6) and row == pytest.approx(round(row), abs=1e-6)
    for corner, own in ((float(first.west[0]), grid.affine.c), (-float(first.north[0]), -grid.affine.f)):
        assert own // side == corner // side == (corner + 180.0 - 1e-6) // side


def test_a_landscape_has_one_seed_and_one_arp(chips):
    table = chips.table()
    for name in ("ground.seed", "ground.arp"):
        assert len(np.unique(table[name])) == 8
        assert all(len(np.unique(each[name])) == 1 for _, each in table.groupby("landscape"))
    assert table["ground.seed"].values.min() == chips.study.scenario.ground.seed


def test_every_landscape_covers_the_range_of_chip_parameters():
    """Points of a Sobol sequence that are eight apart lie within an eighth of the first dimension."""
    table = chips_of(make_study(), 8 * 40).table()
    for _, each in table.groupby("landscape"):
        assert np.ptp(each["atmosphere.visibility"].values) > 35
        assert len(set(each["ground.distribution"].values.tolist())) == 2


def test_scenario_of_a_chip_matches_its_row_of_the_table(chips):
    table = chips.table()
    for chip in (0, 17, 299):
        scenario, row = chips.scenario(chip), table.isel(chip=chip)
        box = scenario.geobox()
        assert (box.affine.c, box.affine.f) == pytest.approx((float(row.west), float(row.north)), abs=1e-6)
        assert box.shape == (54, 54)
        assert scenario.atmosphere.visibility == float(row["atmosphere.visibility"])
        assert scenario.ground.arp == float(row["ground.arp"])
        assert scenario.ground.distribution == str(row["ground.distribution"].values)


def test_hills_and_noise_have_separate_seeds():
    sections = {"terrain": {"dem": "flint-hills", "seed": 100}, "sensor": {"instrument": "MSI", "noise": ["shot"]}}
    table = chips_of(make_study(sections), 24).table()
    np.testing.assert_array_equal(table["terrain.seed"], 100 + table.landscape)
    np.testing.assert_array_equal(table["sensor.seed"], np.arange(24))
    assert "terrain.seed" not in chips_of(make_study(), 2).table()


@pytest.mark.parametrize("count", [0, -1, 2.5, True])
def test_number_of_chips_must_be_a_positive_integer(count):
    with pytest.raises((ValueError, TypeError), match=r"n must be (at least 1|a whole number), got"):
        chips_of(make_study(), count)


@pytest.mark.parametrize("size", [(4, 5), (3, 5), (10, 3), (13, 4)])
@pytest.mark.parametrize("corner", [(0, 0), (-17, 23)])
def test_no_two_chips_share_a_cell(size, corner):
    cells = set()
    for number in range(60):
        row, column = first_cell_of_chip(number, size, corner, 10)
        own = set(itertools.product(range(row, row + size[0]), range(column, column + size[1])))
        assert not own & cells
        cells |= own


def test_chips_fill_one_tile_before_the_next():
    """A tile of 1008 cells holds three chips of 333 cells along each side."""
    tiles = [
        tuple(at // 1008 for at in first_cell_of_chip(number, (333, 333), (211491, 5000), 1008)) for number in range(27)
    ]
    assert [len(set(tiles[first : first + 9])) for first in (0, 9, 18)] == [1, 1, 1]
    assert len(set(tiles)) == 3 and tiles[0] == (209, 4)
    for number in range(9):
        row, column = first_cell_of_chip(number, (333, 333), (211491, 5000), 1008)
        assert (row + 332) // 1008 == row // 1008 and (column + 332) // 1008 == column // 1008


def test_spiral_visits_every_place_in_unit_steps():
    places = [ring_place(number) for number in range(15**2)]
    assert set(places) == set(itertools.product(range(-7, 8), repeat=2))
    steps = [abs(a - c) + abs(b - d) for (a, b), (c, d) in itertools.pairwise(places)]
    assert set(steps) == {1}
    # A ring starts up its right side. Chips larger than a tile lie in such rings, with north above south.
    assert [first_cell_of_chip(number, (13, 14), (0, 0), 10) for number in (0, 1, 2)] == [(0, 0), (0, 14), (-13, 14)]


def test_tile_includes_the_margins_of_its_chips():
    """With a margin of 24 cells, only four chips of 333 cells fit into a tile of 1008 cells."""
    places = [first_cell_of_chip(number, (333, 333), (211491, 5000), 1008, (24, 24)) for number in range(8)]
    for row, column in places:
        assert (row - 24) // 1008 == (row + 356) // 1008 and (column - 24) // 1008 == (column + 356) // 1008
    assert len({(row // 1008, column // 1008) for row, column in places}) == 2


@pytest.mark.parametrize("cover", ["none", "pastures"])
def test_chips_beside_the_site_have_the_vegetation_of_their_study(cover):
    """Landscapes of a study on the site begin west of it; a study elsewhere asks for its leaves."""
    keys = {"grid": {"width": 600.0, "height": 600.0}, "terrain": {"dem": "flat"}, "landscape": {"cover": cover}}
    chip = chips_of(Study(parse_scenario(keys), {"visibility": {"uniform": [10, 60]}}, landscapes=3), 6).scenario(4)
    assert not on_fife_site(chip.geobox())
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        warn_of_canopy(chip)
        simulate(chip.complete(), complete=True)
    keys["grid"] |= {"west": 600000.0, "north": 4300000.0}
    keys |= {"geometry": {"sza": 30.0, "saa": 150.0}, "atmosphere": {"altitude": 0.3}}
    chip = chips_of(Study(parse_scenario(keys), {"visibility": {"uniform": [10, 60]}}, landscapes=3), 6).scenario(4)
    with pytest.warns(UserWarning, match="vegetation of the scene is unknown"):
        warn_of_canopy(chip)
