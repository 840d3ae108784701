"""Elevation models under a grid: what tiles read, means of finer cells, and filled holes."""

import numpy as np
import pytest
import rioxarray
from affine import Affine
from elevations import AMPLITUDE, CRS, NORTH, WEST, grid, model, truth, with_hole, write

import fifesim
from fifesim.grids import grid as grids
from fifesim.ground.terrain.source_labels import ELEVATION_TILE, looked_up, model_under


@pytest.mark.parametrize("fill", [True, 0, -3])
def test_fill_is_a_distance(path, fill):
    with pytest.raises((TypeError, ValueError), match=r"fill (is a distance|must be a number, got True)"):
        fifesim.fine_dem(path, grid(), fill=fill)


def test_fill_goes_at_most_250_cells_of_the_source(path):
    """Of 30 m."""
    model_under(grid(), path, 7500, None)
    with pytest.raises(ValueError, match=r"fill=7501 is more than 250 cells .* at most fill=7500"):
        model_under(grid(), path, 7501, None)


def test_a_window_too_fine_to_read_is_refused(path, monkeypatch):
    fifesim.fine_dem(path, grid())
    monkeypatch.setattr("fifesim.ground.terrain.source_labels._MOST_CELLS", 100)
    with pytest.raises(ValueError, match=r"far finer than the cells.*gdalwarp -r average"):
        fifesim.fine_dem(path, grid(size=600.0))


def test_filled_hole_is_the_same_in_any_chunks(tmp_path):
    where = with_hole(tmp_path)
    whole = fifesim.fine_dem(where, grid(), fill=90)
    np.testing.assert_array_equal(fifesim.fine_dem(where, grid(), fill=90, chunks=100).compute(), whole)


def test_finer_source_is_averaged(tmp_path):
    """A wave of two cells of the source is gone, the mean of the surface stays."""
    values, affine = model(cell=10.0)
    ripple = 5.0 * (-1.0) ** np.arange(values.shape[1])
    where = write(tmp_path / "fine.tif", values + ripple, affine)
    dem = fifesim.fine_dem(where, grid(40.0, size=880.0))
    assert dem.attrs["source_resolution"] == pytest.approx(40)
    expected = fifesim.fine_dem(write(tmp_path / "smooth.tif", values, affine), grid(40.0, size=880.0))
    np.testing.assert_allclose(dem, expected, rtol=0, atol=1e-9)
    # A mean over 40 m of waves of 160 m is 0.9 of their amplitude.
    np.testing.assert_allclose(dem, truth(dem), rtol=0, atol=0.1 * 2 + 0.05 * 4 + 0.2)


def test_cells_of_the_grid_need_not_be_square(path):
    square = fifesim.grid_at(CRS, WEST, NORTH, 900, 900, 5.0)
    tall = type(square)((90, 180), Affine(5.0, 0, WEST, 0, -10.0, NORTH), CRS)
    dem = fifesim.fine_dem(path, tall)
    np.testing.assert_allclose(dem, truth(dem), rtol=0, atol=1e-3 * AMPLITUDE)


def test_lazy_array_gives_the_same_bits_in_any_chunks(path):
    raster = rioxarray.open_rasterio(path, masked=True)
    whole = fifesim.fine_dem(raster, grid())
    for chunks in ({"y": 100, "x": 77}, "auto"):
        lazy = fifesim.fine_dem(raster.chunk({"y": 17, "x": 40}), grid(), chunks=chunks)
        np.testing.assert_array_equal(lazy.compute(), whole)


@pytest.mark.parametrize("crs", ["EPSG:26914", "EPSG:26915"])
def test_window_of_a_part_holds_what_its_tiles_read(path, crs):
    """Under a grid of the source's own rows and columns, and under one that is turned and bent."""
    place = {} if crs == "EPSG:26914" else {"west": 187700.0, "north": 4340000.0}
    under = model_under(grid(crs=crs, **place), path, 60.0, None)
    rows, columns = slice(20, 60), slice(100, 101)
    window = under.tile_window(rows, columns)
    origin = grids.lattice_position(under.place.grid)
    first = [
        (start + part.start) // ELEVATION_TILE * ELEVATION_TILE - start
        for start, part in zip(origin, (rows, columns), strict=True)
    ]
    top, left, height, width = under.window(*under.place.positions(*(at + np.arange(ELEVATION_TILE) for at in first)))
    for part, start, length, size in zip(window, (top, left), (height, width), under.source.shape, strict=True):
        assert part.start <= max(start, 0) and part.stop >= min(start + length, size)


def test_places_beyond_all_cells_are_unknown():
    known = np.array([[True, False], [True, True]])
    found = looked_up(known, np.array([[-0.6], [-0.4], [1.4], [1.6]]), np.array([[0.4, 0.6, 1.6]]))
    np.testing.assert_array_equal(found, [[False] * 3, [True, False, False], [True, True, False], [False] * 3])
    assert not looked_up(np.ones((0, 3), bool), np.zeros((2, 1)), np.zeros((1, 2))).any()
