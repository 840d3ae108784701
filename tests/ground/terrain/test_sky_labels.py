"""Horizons of labelled elevation, and the sky that they leave."""

import numpy as np
import pytest
from elevations import labelled
from lazy import check_raster_function, no_compute
from oracles_terrain import hills, plane

import fifesim
from fifesim.base.geometry import Geometry
from fifesim.grids import grid as grids
from fifesim.ground.terrain import sky_labels as sky_raster
from fifesim.ground.terrain.sky_labels import places_of

SUN = Geometry(70.0, 117.0, 20.0, 40.0)


def test_horizon_keeps_the_promises_of_rasters(dem):
    dem.attrs["source_resolution"] = 10.0
    found = check_raster_function(lambda each: sky_raster.horizon(each, reach=60.0), dem, quantity="horizon")
    assert found.sizes == {"direction": 32, "y": 15, "x": 18}
    assert found["y"].isin(dem["y"]).all() and found["x"].isin(dem["x"]).all()


def test_coarse_horizons_stay_near_those_at_every_cell():
    """Ground of 200 m waves and more, which 30 m cells resolve; the figures of the docstring."""
    grid = fifesim.grid_at("EPSG:26914", 700000, 4330000, 900, 900, 10 / 3)
    z = hills((270, 270), seed=2, relief=26.0, length=60.0)
    coarse, fine = labelled(grid, z), labelled(grid, z, source_resolution=10 / 3)
    difference = fifesim.sky_view(coarse) - fifesim.sky_view(fine)
    assert float(fifesim.sky_view(fine).std()) > 0.003
    assert float(abs(difference).max()) < 0.004
    assert float(difference.std()) < 5e-4


def test_sun_below_every_horizon_is_refused(site):
    steep = labelled(site, plane(tuple(site.shape), 10 / 3, 10 / 3, 40.0, 0.0))
    for function in (fifesim.shadow, fifesim.illumination):
        with pytest.raises(ValueError, match=r"sza 60, 178.* from grid north.*below the horizon of every slope"):
            function(steep, Geometry(60.0, 180.0))


def test_horizons_longer_than_a_chunk_leave_no_seams(around, lai):
    around.attrs["source_resolution"] = 10 / 3
    whole = fifesim.surface_reflectance(lai, bands=["TM3", "TM4"], dem=around, geometry=SUN)
    for chunks in ({"y": 37, "x": 50}, {"y": 165, "x": 29}):
        parts = fifesim.surface_reflectance(lai, bands=["TM3", "TM4"], dem=around.chunk(chunks), geometry=SUN)
        np.testing.assert_array_equal(parts, whole)


@pytest.mark.parametrize("options", [{"directions": 12}, {"reach": 1.0}, {"resolution": 0.0}])
def test_horizon_of_too_little_is_refused(dem, options):
    with pytest.raises(ValueError, match=r"from 16 up|at least one cell|positive metres"):
        fifesim.horizon(dem, **options)


def test_lazy_horizon_beside_a_scene_has_a_chunk_for_each_of_its(around, dem):
    whole = fifesim.horizon(around, reach=90.0, resolution=10.0)
    with no_compute():
        lazy = fifesim.horizon(around.chunk(50), reach=90.0, resolution=10.0, beside=dem.chunk({"y": 15, "x": 27}))
    assert [len(sizes) for sizes in lazy.chunks[1:]] == [5, 4]
    np.testing.assert_array_equal(lazy, whole)


def test_horizon_that_does_not_cover_is_refused(lai, dem, around):
    horizon = fifesim.horizon(around.isel(x=slice(0, 90)))
    with pytest.raises(ValueError, match=r"horizon spans .* does not cover the dem's"):
        fifesim.sky_view(dem, horizon)
    with pytest.raises(ValueError, match="give dem= too"):
        fifesim.surface_reflectance(lai, horizon=horizon)
    with pytest.raises(ValueError, match="evenly spaced"):
        fifesim.sky_view(dem, fifesim.horizon(around).isel(direction=slice(0, 20)))


@pytest.mark.parametrize(
    "cut", [{"x": slice(1, None)}, {"x": slice(None, -1)}, {"y": slice(1, None)}, {"y": slice(None, -1)}], ids=str
)
def test_horizon_may_lack_less_than_a_place_on_each_side(cut):
    """Of ten places of 30 m, nine lack a whole one, and less where the elevation ends within."""
    dem = labelled(fifesim.fife_site(30 / 9, window=((0, 90), (0, 90))), np.full((90, 90), 7.0))
    horizon = fifesim.horizon(dem).isel(cut)
    with pytest.raises(ValueError, match="does not cover the dem's"):
        fifesim.sky_view(dem, horizon)
    np.testing.assert_allclose(fifesim.sky_view(dem.isel(cut), horizon), 1, rtol=1e-12)


def test_small_and_coarse_rasters_have_horizons_too():
    """Fewer cells than one of the source, and cells larger than the reach."""
    tiny = labelled(fifesim.grid_at("EPSG:26914", 700000, 4330000, 12, 9, 3), np.full((3, 4), 7.0))
    np.testing.assert_allclose(fifesim.sky_view(tiny), 1, rtol=1e-12)
    wide = labelled(fifesim.grid_at("EPSG:26914", 700000, 4330000, 80000, 60000, 10000), np.full((6, 8), 7.0))
    np.testing.assert_allclose(fifesim.sky_view(wide), 1, rtol=1e-12)


def test_windows_share_their_places():
    """In metres; their cells are those of a coarse grid, and the nearest of the elevation."""
    grid = fifesim.fife_site(30 / 9, window=((30, 195), (120, 294)))
    whole, part = places_of(grid, 25.0), places_of(grid[50:120, 31:99], 25.0)
    there = grids.coordinates(whole.coarse)
    for axis, centres in grids.coordinates(part.coarse).items():
        assert axis == "spatial_ref" or np.isin(centres, there[axis]).all()
    rows, columns = part.cells
    cells, coarse = grids.coordinates(part.grid), grids.coordinates(part.coarse)
    np.testing.assert_allclose(cells["y"][rows], coarse["y"], rtol=0, atol=1e-6)
    np.testing.assert_allclose(cells["x"][columns], coarse["x"], rtol=0, atol=1e-6)
    assert part.cell == pytest.approx((80 / 3, 80 / 3)) and part.step == (8.0, 8.0)


def test_cells_lie_between_places_by_their_distance():
    """What rises evenly from place to place is met at every cell, in blocks as in the whole."""
    grid = fifesim.fife_site(30 / 9, window=((30, 95), (120, 174)))
    places = places_of(grid, 25.0)
    values = (places.rows[:, None] * 2 - places.columns)[None].repeat(4, 0)
    between = places.between((3, 5), (40, 30))
    reads, (rows, columns) = between.reads(values), (slice(7, 29), slice(0, 11))
    sky = between.sky(values[(..., *reads.window(rows, columns))], rows, columns)
    layer = np.pad(sky.layers[0], ((0, 1), (0, 1)), mode="edge")
    by_row = (1 - sky.row_share)[:, None] * layer[sky.row] + sky.row_share[:, None] * layer[sky.row + 1]
    found = (1 - sky.column_share) * by_row[:, sky.column] + sky.column_share * by_row[:, sky.column + 1]
    expected = 2 * (3 + np.arange(7, 29))[:, None] - (5 + np.arange(11))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
