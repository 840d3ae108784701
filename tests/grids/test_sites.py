"""The FIFE site."""

import numpy as np
import odc.geo.xr  # noqa: F401  registers .odc
import pytest

import fifesim
from fifesim.grids.sites import is_fife, made_on_site, on_fife_site

CELL = 30 / 9


def test_site_is_15_km_of_cells_from_its_corner():
    grid = fifesim.fife_site(CELL)
    assert tuple(grid.shape) == (4500, 4500)
    assert grid.crs.epsg == 26914
    box = grid.boundingbox
    np.testing.assert_allclose(
        (box.left, box.top, box.right, box.bottom), (704970, 4334220, 719970, 4319220), rtol=0, atol=1e-6
    )


def test_site_corner_lies_on_the_30_m_lattice():
    corner = fifesim.fife_site(30).affine
    assert corner.c % 30 == 0 and corner.f % 30 == 0


def test_site_in_its_own_datum():
    grid = fifesim.fife_site(30, datum="NAD27")
    assert grid.crs.epsg == 26714
    assert (grid.affine.c, grid.affine.f) == (705000.0, 4334000.0)


def test_only_whole_cells_are_kept():
    assert tuple(fifesim.fife_site(29).shape) == (517, 517)
    assert tuple(fifesim.grid_at("EPSG:32614", 0, 1e6, 100, 70, 30).shape) == (2, 3)


@pytest.mark.parametrize(
    "options, message",
    [
        ({"cell": 0}, r"cell must be in \(0, 15000\] m, got 0"),
        ({"cell": 30, "datum": "WGS84"}, "datum must be one of NAD83, NAD27, got 'WGS84'"),
        ({"cell": 30, "window": ((0, 10), (0, 501))}, "within 500 rows and 500 columns"),
        ({"cell": 30, "window": ((5, 5), (0, 10))}, "within 500 rows"),
        ({"cell": 30, "window": 10}, "window must be"),
    ],
)
def test_site_refuses_what_makes_no_grid(options, message):
    with pytest.raises(ValueError, match=message):
        fifesim.fife_site(**options)


@pytest.mark.parametrize(
    ("east", "north", "inside"),
    [(0, 0, True), (7000, 7000, True), (8500, 0, False), (-8500, 0, False), (0, 8500, False), (0, -8500, False)],
)
def test_scenes_that_are_made_on_the_site_say_so(east, north, inside):
    """A square of 300 m beside the middle of the site."""
    grid = fifesim.grid_at("EPSG:26914", 712470 + east - 150, 4326720 + north + 150, 300, 300, 30)
    lai = fifesim.lai_scene(grid)
    assert is_fife(lai) == is_fife(fifesim.flint_hills(grid)) == inside
    assert made_on_site(grid) == ({"site": "FIFE"} if inside else {})


@pytest.mark.parametrize("datum", ["NAD83", "NAD27"])
def test_the_site_is_the_site_in_any_reference_system(datum):
    corner = fifesim.fife_site(30, datum=datum)[:2, :2]
    assert on_fife_site(corner) and not on_fife_site(corner.pad(20)[:3, :3])
    geodetic = fifesim.grid_at("EPSG:5070", -50000.0, 1788000.0, 300.0, 300.0, 30)
    assert on_fife_site(geodetic)
    assert not on_fife_site(fifesim.grid_at("EPSG:32735", 712000.0, 4327000.0 + 1e6, 300.0, 300.0, 30))


def test_the_site_is_where_it_is(lai):
    """Arithmetic spreads attributes, and coordinates may be changed."""
    assert is_fife(lai) and not is_fife(lai.assign_coords(x=lai.x + 500e3))
