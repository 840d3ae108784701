"""Grids: where the FIFE site lies, what a raster's grid is, and which grids are refused."""

from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction

import netCDF4
import numpy as np
import odc.geo.xr  # noqa: F401  registers .odc
import pytest
import xarray as xr
from affine import Affine
from lazy import check_place
from odc.geo.geobox import GeoBox

import fifesim
from fifesim.grids import grid as grids
from fifesim.grids import sites

CELL = 30 / 9


def ramp(grid):
    """A raster on a grid, no two of whose cells are the same."""
    values = np.arange(grid.shape.y * grid.shape.x, dtype=float).reshape(tuple(grid.shape))
    return grids.place(xr.DataArray(values, dims=("y", "x")), grid)


@pytest.mark.parametrize("cell", [CELL, 30 / 7, 1.1])
def test_coordinates_of_a_window_are_those_of_the_whole_to_the_bit(cell):
    """xarray aligns exactly: a difference of 1e-10 m makes the sum of two rasters empty."""
    whole = grids.coordinates(fifesim.fife_site(cell, window=((0, 900), (0, 900))))
    part = grids.coordinates(fifesim.fife_site(cell, window=((123, 456), (789, 899))))
    np.testing.assert_array_equal(part["y"], whole["y"][123:456])
    np.testing.assert_array_equal(part["x"], whole["x"][789:899])


def test_coordinates_are_cell_centres():
    """Beside exact fractions: doubles of four million metres resolve 1e-9 m."""
    coordinates = grids.coordinates(fifesim.fife_site(CELL))
    rows = [float(4334220 - (Fraction(i) + Fraction(1, 2)) * 10 / 3) for i in range(4500)]
    columns = [float(704970 + (Fraction(i) + Fraction(1, 2)) * 10 / 3) for i in range(4500)]
    np.testing.assert_allclose(coordinates["y"], rows, rtol=0, atol=2e-9)
    np.testing.assert_allclose(coordinates["x"], columns, rtol=0, atol=2e-9)


CORNER = Affine(30, 0, 705000, 0, -30, 4334000)


def box(crs, affine=CORNER):
    return GeoBox((4, 5), affine, crs)


@pytest.mark.parametrize(
    "grid, message",
    [
        (box("EPSG:4326", Affine(0.1, 0, -96, 0, -0.1, 39)), "geographic CRS .EPSG:4326.*reproject"),
        (box(None), "no CRS.*grid_at"),
        (box("EPSG:2277"), "must be in metres.*US survey foot"),
        (box("EPSG:26914", Affine(30, 0, 705000, 0, 30, 4334000)), "north up"),
        (box("EPSG:26914", Affine(30, 1, 705000, 1, -30, 4334000)), "not rotated"),
    ],
)
def test_grid_whose_distances_are_no_metres_is_refused(grid, message):
    with pytest.raises(ValueError, match=message):
        grids.check_grid(grid)


def test_something_else_than_a_grid_is_refused():
    with pytest.raises(TypeError, match=r"got tuple: see fifesim\.fife_site"):
        grids.check_grid((4, 5))
    with pytest.raises(ValueError, match="holds no cell of 30 x 30 m"):
        fifesim.grid_at("EPSG:26914", 0, 0, 20, 100, 30)


GRIDS = [
    fifesim.fife_site(CELL, window=((7, 60), (1, 80))),
    fifesim.fife_site(30),
    fifesim.grid_at("EPSG:32614", 704968.3, 4334211.7, 500.0, 700.0, 7.1),
    GeoBox((4, 5), Affine(20, 0, 705000, 0, -30, 4334000), "EPSG:26914"),
    fifesim.fife_site(CELL, window=((7, 8), (1, 80))),
    fifesim.fife_site(CELL, window=((7, 8), (3, 4))),
    GeoBox((4, 5), Affine(30, 0, -90, 0, -30, 60), "EPSG:26914"),
]


@pytest.mark.parametrize("grid", GRIDS, ids=lambda grid: f"{grid.shape.y}x{grid.shape.x}")
def test_raster_keeps_its_grid(grid):
    raster = ramp(grid)
    check_place(raster, grid.crs)
    found = grids.geobox(raster)
    assert grids.same_grid(found, grid)
    np.testing.assert_allclose(found.affine, grid.affine, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(grids.place(raster, found)["x"], raster["x"])
    np.testing.assert_array_equal(grids.place(raster, found)["y"], raster["y"])


def test_grid_is_right_after_slicing_and_coarsening():
    """The GeoTransform that xarray carries on is stale then."""
    grid = fifesim.fife_site(CELL, window=((0, 90), (0, 90)))
    raster = ramp(grid)
    assert grids.same_grid(grids.geobox(raster[9:18, 27:]), grid[9:18, 27:90])
    coarse = raster.coarsen(y=9, x=9).mean()
    assert grids.same_grid(grids.geobox(coarse), fifesim.fife_site(30, window=((0, 10), (0, 10))))


def test_grid_of_a_raster_made_with_rioxarray():
    x, y = 705000 + 30 * (np.arange(5) + 0.5), 4334000 - 30 * (np.arange(4) + 0.5)
    raster = xr.DataArray(np.zeros((4, 5)), coords={"y": y, "x": x}, dims=("y", "x")).rio.write_crs("EPSG:26714")
    assert grids.same_grid(grids.geobox(raster), box("EPSG:26714"))


@pytest.mark.parametrize(
    "change, message",
    [
        (lambda raster: raster.drop_vars("spatial_ref"), "no CRS.*write_crs"),
        (lambda raster: raster.rename(x="lon"), r"dimensions y and x, got \('y', 'lon'\)"),
        (lambda raster: raster.isel(x=[0, 1, 3]), "x is not evenly spaced"),
        (lambda raster: raster[::-1], "north up"),
    ],
)
def test_raster_without_a_usable_grid_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        grids.geobox(change(ramp(box("EPSG:26914"))))


def test_place_leaves_other_coordinates_and_the_input():
    grid = fifesim.fife_site(30, window=((0, 4), (0, 5)))
    raster = ramp(grid).assign_coords(sza=28.5, band_name=("y", list("abcd")))
    copy = raster.copy(deep=True)
    moved = grids.place(raster, fifesim.fife_site(30, window=((1, 5), (0, 5))))
    assert float(moved["sza"]) == 28.5 and "band_name" in moved.coords
    xr.testing.assert_identical(raster, copy)


def test_lattice_counts_from_the_origin_of_the_crs():
    """Rows count southward: a northing of 4334220 m is 1300266 cells north of it."""
    assert grids.lattice_position(fifesim.fife_site(CELL)) == (-1300266, 211491)
    assert grids.lattice_position(fifesim.fife_site(CELL, window=((10, 20), (7, 9)))) == (-1300256, 211498)
    assert grids.lattice_position(GRIDS[-1]) == (-2, -3)


def test_grids_are_compared_with_a_tolerance():
    grid = box("EPSG:26914")
    assert grids.same_grid(grid, box("EPSG:26914", Affine(30, 0, 705000.01, 0, -30, 4334000)))
    assert not grids.same_grid(grid, box("EPSG:26914", Affine(30, 0, 705000.1, 0, -30, 4334000)))
    assert not grids.same_grid(grid, box("EPSG:32614"))
    assert not grids.same_grid(grid, grid[:3, :])


def test_offset_of_two_grids_is_in_whole_cells():
    grid = box("EPSG:26914")
    assert grids.lattice_offset(grid, grid[1:, 2:]) == (1, 2)
    assert grids.lattice_offset(grid[1:, 2:], grid) == (-1, -2)
    for other in (box("EPSG:32614"), box("EPSG:26914", Affine(30, 0, 705010, 0, -30, 4334000)), fifesim.fife_site(20)):
        with pytest.raises(ValueError, match=r"different lattices.*resample one to the other$"):
            grids.lattice_offset(grid, other)


def test_coarser_grid_shares_the_corner():
    scene = fifesim.fife_site(CELL, window=((1, 100), (1, 60)))
    coarse = grids.aligned_grid(scene, 30)
    assert tuple(coarse.shape) == (11, 6)
    assert (coarse.affine.c, coarse.affine.f) == (scene.affine.c, scene.affine.f)
    assert grids.cell_size(grids.aligned_grid(scene, (20, 40))) == (20.0, 40.0)
    with pytest.raises(ValueError, match="no pixel of 500 x 500 m fits"):
        grids.aligned_grid(scene, 500)


@pytest.mark.parametrize("cell", [10.0, 12.0, 20.0, 30 / 9, 60.0])
def test_position_moves_by_as_many_cells_as_the_window(cell):
    """At 20 m the site's corner lies half a cell off the lattice, where rounding to even would move by two or none."""
    whole = sites.fife_site(cell)
    first = grids.lattice_position(whole)
    for shift in range(1, 6):
        moved = grids.lattice_position(whole[shift:, shift:])
        assert moved == (first[0] + shift, first[1] + shift)


def test_raster_with_heights_beside_its_crs_lies_on_the_map():
    grid = box("EPSG:26914")
    raster = ramp(grid).rio.write_crs("EPSG:26914+5703")
    assert grids.same_grid(grids.geobox(raster), grid)


@pytest.mark.parametrize(
    ("width", "height", "cell"),
    [(0.0, 90.0, 30.0), (90.0, -90.0, 30.0), (90.0, 90.0, 0.0), (90.0, 90.0, 91.0), (float("nan"), 90.0, 30.0)],
)
def test_grid_without_a_cell_is_refused(width, height, cell):
    with pytest.raises(ValueError, match=r"holds no cell of .* use a larger width and height"):
        fifesim.grid_at("EPSG:26914", 705000.0, 4334000.0, width, height, cell)


@pytest.mark.parametrize(("width", "cell"), [(1e12, 30.0), (90.0, 1e-9), (1e300, 1e-300), (float("inf"), 30.0)])
def test_grid_of_more_cells_than_a_file_counts_is_refused(width, cell):
    with pytest.raises(ValueError, match="holds over 2147483647 cells"):
        fifesim.grid_at("EPSG:26914", 705000.0, 4334000.0, width, 90.0, cell)


def test_a_part_of_one_cell_or_row_lies_where_it_was_cut(lai):
    whole = grids.geobox(lai)
    for rows, columns in ((slice(5, 6), slice(7, 8)), (slice(5, 6), slice(3, 9)), (slice(2, 7), slice(7, 8))):
        assert grids.same_grid(grids.geobox(lai[rows, columns]), whole[rows, columns])
    plain = lai[5:6].drop_vars("spatial_ref").rio.write_crs(26914)
    with pytest.raises(ValueError, match=r"regular grid: one row tells no cell, .*write_transform"):
        grids.geobox(plain)
    assert fifesim.surface_reflectance(lai[5:6, 7:8], bands=["TM3"]).shape == (1, 1, 1)


def test_a_raster_without_cells_is_refused(lai):
    for empty in (lai[:0], lai[:, :0]):
        with pytest.raises(ValueError, match="the raster has no cells, "):
            grids.geobox(empty)


def test_array_that_is_placed_stays_as_it_is():
    array = xr.DataArray(
        np.zeros((2, 3, 4)), dims=("band", "y", "x"), coords={"band": ["a", "b"]}, attrs={"units": "1"}
    )
    grid = grids.grid_at("EPSG:26914", 704970.0, 4334220.0, 40.0, 30.0, 10.0)
    placed = grids.place(array, grid)
    assert not array.encoding and set(array.coords) == {"band"}
    placed.attrs["units"] = "m"
    placed.coords["spatial_ref"].attrs["GeoTransform"] = ""
    assert array.attrs == {"units": "1"} and grids.geobox(grids.place(array, grid)) == grid
    assert grids.place(array, grid).sel(band="b").shape == (3, 4)


def test_netcdf_coordinates_have_no_fill_value(lai, tmp_path):
    """CF section 2.5.1 forbids it; xarray gives one to all floating point variables."""
    for number, raster in enumerate((lai, lai.isel(x=slice(3, 9)), lai * 2, lai.chunk(x=20))):
        path = tmp_path / f"{number}.nc"
        raster.rename("lai").to_netcdf(path)
        with netCDF4.Dataset(path) as found:
            assert not any("_FillValue" in found[axis].ncattrs() for axis in ("x", "y"))
            assert "_FillValue" in found["lai"].ncattrs()


def test_grid_of_a_placed_raster_is_read_anew_where_its_coordinates_change():
    """A raster keeps its grid through copies; a window, shifted coordinates or another transform have their own."""
    grid = fifesim.grid_at("EPSG:26914", 705000, 4334000, 300, 200, 10)
    placed = grids.place(xr.DataArray(np.zeros((20, 30)), dims=("y", "x")), grid)
    assert grids.geobox(placed) == grids.geobox(placed.copy()) == grids.geobox(placed.drop_encoding()) == grid
    assert grids.geobox(placed.isel(x=slice(3, None))).affine.c == 705030
    assert grids.geobox(placed.assign_coords(x=placed.x + 7)).affine.c == 705007
    other = placed.copy(deep=True).rio.write_crs("EPSG:32614")
    assert grids.geobox(other).crs.epsg == 32614


def test_threads_may_place_rasters_on_many_grids():
    """More grids than are kept at a time."""
    values = xr.DataArray(np.zeros((2, 2)), dims=("y", "x"))
    known = [fifesim.grid_at("EPSG:26914", 705000 + 10 * k, 4334000, 20, 20, 10) for k in range(300)]
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(lambda grid: grids.geobox(grids.place(values, grid)), known))
    assert found == known
