"""Pixels among cells: which of them a tile reads, and what does not fit."""

import numpy as np
import pytest
import xarray as xr

import fifesim
from fifesim.grids import grid as grids
from fifesim.ground.landscape.downscaling_labels import PIXEL_MARGIN, PixelReads, pixel_lattice


def raster(grid):
    return grids.place(xr.DataArray(np.ones(grid.shape), dims=("y", "x"), name="lai"), grid)


SOURCE = fifesim.grid_at("EPSG:32614", 699960, 4400040, 1000, 800, 10)


def test_tiles_hold_whole_pixels_and_are_counted_from_the_origin_of_the_crs():
    lattice = pixel_lattice(raster(SOURCE), SOURCE.zoom_out(1 / 3))
    assert lattice.ratio == (3, 3) and lattice.tile == 504 and lattice.pixels == (168, 168)
    assert lattice.pixel == (-440004, 69996) and lattice.cell == (-440004 * 3, 69996 * 3)
    assert lattice.shift == (0, 0)
    tiles = lattice.tiles(slice(0, 240), 0)
    assert tiles.start * 504 <= -440004 * 3 and tiles.stop * 504 >= -440004 * 3 + 240 and len(tiles) <= 2
    window = PixelReads(np.ones(SOURCE.shape), lattice).window(slice(0, 240), slice(0, 300))[0]
    assert (
        window.start == tiles.start * 168 - PIXEL_MARGIN + 440004
        and window.stop == tiles.stop * 168 + PIXEL_MARGIN + 440004
    )


def test_pixels_that_are_no_multiple_of_their_size_from_the_origin_keep_their_cells():
    source = fifesim.grid_at("EPSG:32614", 699966, 4400033, 1000, 800, 10)
    lattice = pixel_lattice(raster(source), source.zoom_out(1 / 5))
    corner = [place * 5 + shift for place, shift in zip(lattice.pixel, lattice.shift, strict=True)]
    assert corner == list(grids.lattice_position(source.zoom_out(1 / 5)))


@pytest.mark.parametrize("cells, tile", [((2, 3), 504), ((6, 6), 504), ((7, 7), 504), ((100, 100), 800)])
def test_tiles_hold_some_pixels_of_any_size(cells, tile):
    grid = fifesim.grid_at("EPSG:32614", 699960, 4400040, 1000, 1000, (10 / cells[0], 10 / cells[1]))
    lattice = pixel_lattice(raster(fifesim.grid_at("EPSG:32614", 699960, 4400040, 1000, 1000, 10)), grid)
    assert lattice.ratio == cells and lattice.tile == tile
    assert all(count * number == tile and count >= 8 for count, number in zip(lattice.pixels, cells, strict=True))


@pytest.mark.parametrize(
    "grid, message",
    [
        (
            fifesim.grid_at("EPSG:26914", 699960, 4400040, 100, 100, 10 / 3),
            r"is in EPSG:32614 and the grid in EPSG:26914",
        ),
        (fifesim.grid_at("EPSG:32614", 699960, 4400040, 100, 100, 4), r"10 x 10 m and the grid cells of 4 x 4 m"),
        (SOURCE, r"a pixel must be a whole number of cells, 2 or more"),
        (fifesim.grid_at("EPSG:32614", 699960, 4400040, 900, 900, 30), r"cells of 30 x 30 m"),
        (
            fifesim.grid_at("EPSG:32614", 699961, 4400040, 100, 100, 2.5),
            r"are 0.00 rows and 0.40 columns of cells away from",
        ),
        (
            fifesim.grid_at("EPSG:32614", 709960, 4400040, 100, 100, 2.5),
            r"does not overlap the grid, which spans 709960",
        ),
    ],
)
def test_grid_that_does_not_fit_says_what_to_type(grid, message):
    with pytest.raises(ValueError, match=message + r"[\s\S]*lai.odc.geobox.zoom_out\(1 / 3\) has 3 x 3 cells") as error:
        pixel_lattice(raster(SOURCE), grid)
    assert len(str(error.value)) <= 500
