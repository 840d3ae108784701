"""Grids: location, coordinates and CRS, how rasters carry them, and invalid grids."""

import json
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from itertools import product

import netCDF4
import numpy as np
import odc.geo.xr  # noqa: F401  registers .odc
import pyproj
import pytest
import xarray as xr
from affine import Affine
from lazy import check_place
from odc.geo.geobox import GeoBox
from odc.geo.xr import xr_coords

import fifesim
from fifesim.grids import grid as grids

CELL = 30 / 9


def ramp(grid):
    """A raster on a grid in which all cells differ."""
    values = np.arange(grid.shape.y * grid.shape.x, dtype=float).reshape(tuple(grid.shape))
    return grids.place(xr.DataArray(values, dims=("y", "x")), grid)


@pytest.mark.parametrize("cell", [CELL, 30 / 7, 1.1])
def test_window_coordinates_are_identical_to_the_whole_grid(cell):
    """xarray aligns exactly: a difference of 1e-10 m makes the sum of two rasters empty."""
    whole = grids.coordinates(fifesim.fife_site(cell, window=((0, 900), (0, 900))))
    part = grids.coordinates(fifesim.fife_site(cell, window=((123, 456), (789, 899))))
    np.testing.assert_array_equal(part["y"], whole["y"][123:456])
    np.testing.assert_array_equal(part["x"], whole["x"][789:899])


def test_coordinates_are_cell_centres():
    """Reference values are exact fractions; doubles of four million metres resolve 1e-9 m."""
    coordinates = grids.coordinates(fifesim.fife_site(CELL))
    rows = [float(4334220 - (Fraction(i) + Fraction(1, 2)) * 10 / 3) for i in range(4500)]
    columns = [float(704970 + (Fraction(i) + Fraction(1, 2)) * 10 / 3) for i in range(4500)]
    np.testing.assert_allclose(coordinates["y"], rows, rtol=0, atol=2e-9)
    np.testing.assert_allclose(coordinates["x"], columns, rtol=0, atol=2e-9)


CORNER = Affine(30, 0, 705000, 0, -30, 4334000)


def box(crs, affine=CORNER):
    return GeoBox((4, 5), affine, crs)


def test_grids_not_in_metres_are_rejected():
    turned = Affine(30, 0, 705000, 0, 30, 4334000), Affine(30, 1, 705000, 1, -30, 4334000)
    refused = {
        "geographic CRS .EPSG:4326.*reproject": box("EPSG:4326", Affine(0.1, 0, -96, 0, -0.1, 39)),
        "no CRS.*grid_at": box(None),
        "must be in metres.*US survey foot": box("EPSG:2277"),
        "north up": box("EPSG:26914", turned[0]),
        "not rotated": box("EPSG:26914", turned[1]),
        r"got tuple: see fifesim\.fife_site": (4, 5),
    }
    for message, grid in refused.items():
        with pytest.raises((TypeError, ValueError), match=message):
            grids.check_grid(grid)


def test_sizes_with_no_or_too_many_cells_are_rejected():
    none, many = r"holds no cell of .* use a larger width and height", "holds over 2147483647 cells"
    sizes = {
        none: [(0.0, 90.0, 30.0), (90.0, -90.0, 30.0), (90.0, 90.0, 0.0), (20.0, 90.0, 30.0), (np.nan, 90.0, 30.0)],
        many: [(1e12, 90.0, 30.0), (90.0, 3e8, 0.1), (90.0, 90.0, 1e-9), (1e300, 90.0, 1e-300), (np.inf, 90.0, 30.0)],
    }
    for message, each in sizes.items():
        for size in each:
            with pytest.raises(ValueError, match=message):
                fifesim.grid_at("EPSG:26914", 705000.0, 4334000.0, *size)


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


def test_grid_follows_slices_means_and_changed_coordinates(lai, site):
    """The GeoTransform that xarray keeps is stale after these operations."""
    assert grids.geobox(lai) == grids.geobox(lai.copy()) == grids.geobox(lai.drop_encoding()) == site
    for cells in (np.s_[9:18, 27:], np.s_[5:6, 7:8], np.s_[5:6, 3:9], np.s_[2:7, 7:8]):
        assert grids.same_grid(grids.geobox(lai[cells]), site[cells])
    assert fifesim.surface_reflectance(lai[5:6, 7:8], bands=["TM3"]).shape == (1, 1, 1)
    coarse = lai.coarsen(y=9, x=9).mean()
    assert grids.same_grid(grids.geobox(coarse), fifesim.fife_site(30, window=((10, 15), (20, 26))))
    assert grids.geobox(lai.assign_coords(x=lai.x + 7)).affine.c == pytest.approx(site.affine.c + 7, abs=1e-6)
    assert grids.geobox(lai.copy(deep=True).rio.write_crs("EPSG:32614")).crs.epsg == 32614


def test_rasters_without_a_usable_grid_are_rejected():
    raster, to_metres = ramp(box("EPSG:26914")), r"\.rio\.write_crs\(4326\)\.rio\.reproject"
    refused = {
        rf"rename\(latitude='y', longitude='x'\){to_metres}": raster.rename(y="latitude", x="longitude"),
        rf"rename\(lat='y', lon='x'\){to_metres}": raster.rename(y="lat", x="lon"),
        r"type \.rename\(northing='y', easting='x'\)$": raster.rename(y="northing", x="easting"),
        r"got \('row', 'sample'\): rename or select": raster.rename(y="row", x="sample"),
        "no CRS.*write_crs": raster.drop_vars("spatial_ref"),
        r"dimensions y and x, got \('y', 'lon'\)": raster.rename(x="lon"),
        "x is not evenly spaced": raster.isel(x=[0, 1, 3]),
        "north up": raster[::-1],
        "the raster has no cells, ": raster[:, :0],
        "regular grid: one row tells no cell": raster[:1].drop_vars("spatial_ref").rio.write_crs(32614),
    }
    for message, each in refused.items():
        with pytest.raises(ValueError, match=message):
            grids.geobox(each)
    with pytest.raises(TypeError, match=r"a raster is an xarray\.DataArray, got ndarray"):
        grids.check_axes(np.ones((2, 3)))


def test_grid_of_external_rasters():
    """Rasters made with rioxarray, and rasters whose CRS includes heights."""
    x, y = 705000 + 30 * (np.arange(5) + 0.5), 4334000 - 30 * (np.arange(4) + 0.5)
    raster = xr.DataArray(np.zeros((4, 5)), coords={"y": y, "x": x}, dims=("y", "x"))
    assert grids.same_grid(grids.geobox(raster.rio.write_crs("EPSG:26714")), box("EPSG:26714"))
    assert grids.same_grid(grids.geobox(raster.rio.write_crs("EPSG:26914+5703")), box("EPSG:26914"))


def test_place_keeps_other_coordinates_and_the_input():
    grid = fifesim.fife_site(30, window=((0, 4), (0, 5)))
    raster = ramp(grid).assign_coords(sza=28.5, band_name=("y", list("abcd")))
    copy = raster.copy(deep=True)
    moved = grids.place(raster, fifesim.fife_site(30, window=((1, 5), (0, 5))))
    assert float(moved["sza"]) == 28.5 and "band_name" in moved.coords
    # The result shares no metadata with the grid or the input.
    moved.attrs["units"] = "m"
    moved.coords["spatial_ref"].attrs["GeoTransform"] = ""
    xr.testing.assert_identical(raster, copy)
    assert grids.geobox(grids.place(raster, grid)) == grid


def test_lattice_counts_from_the_origin_of_the_crs():
    """
    Rows count southward: a northing of 4334220 m lies 1300266 cells north of the origin.

    At 20 m the site corner is half a cell off the lattice, where rounding to even would shift by two cells or none.
    """
    assert grids.lattice_position(fifesim.fife_site(CELL)) == (-1300266, 211491)
    assert grids.lattice_position(GRIDS[-1]) == (-2, -3)
    for cell in (10.0, 12.0, 20.0, 30 / 9, 60.0):
        whole = fifesim.fife_site(cell)
        row, column = grids.lattice_position(whole)
        for shift in range(1, 6):
            assert grids.lattice_position(whole[shift:, shift + 1 :]) == (row + shift, column + shift + 1)


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
    shifted, match = box("EPSG:26914", Affine(30, 0, 705010, 0, -30, 4334000)), r"\.rio\.reproject_match\(other\)"
    for other, cure in (
        (box("EPSG:32614"), f"in EPSG:26914 and .* in EPSG:32614: bring one onto the other with {match}"),
        (shifted, f": bring one onto the other with {match}"),
        (
            fifesim.fife_site(20),
            rf"the finer one with \.fifesim\.aggregate\(30\), or one onto the other with {match}",
        ),
    ):
        with pytest.raises(ValueError, match=rf"different lattices.*{cure}$"):
            grids.lattice_offset(grid, other)


def test_coarser_grid_shares_the_corner():
    scene = fifesim.fife_site(CELL, window=((1, 100), (1, 60)))
    coarse = grids.aligned_grid(scene, 30)
    assert tuple(coarse.shape) == (11, 6)
    assert (coarse.affine.c, coarse.affine.f) == (scene.affine.c, scene.affine.f)
    assert grids.cell_size(grids.aligned_grid(scene, (20, 40))) == (20.0, 40.0)


def test_netcdf_coordinates_have_no_fill_value(lai, tmp_path):
    """CF section 2.5.1 forbids a fill value; xarray adds one to all floating-point variables."""
    for number, raster in enumerate((lai, lai.isel(x=slice(3, 9)), lai * 2, lai.chunk(x=20))):
        path = tmp_path / f"{number}.nc"
        raster.rename("lai").to_netcdf(path)
        with netCDF4.Dataset(path) as found:
            assert not any("_FillValue" in found[axis].ncattrs() for axis in ("x", "y"))
            assert "_FillValue" in found["lai"].ncattrs()


def test_threads_may_place_rasters_on_many_grids():
    """The number of grids exceeds the size of the cache."""
    values = xr.DataArray(np.zeros((2, 2)), dims=("y", "x"))
    known = [fifesim.grid_at("EPSG:26914", 705000 + 10 * k, 4334000, 20, 20, 10) for k in range(300)]
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(lambda grid: grids.geobox(grids.place(values, grid)), known))
    assert found == known


def test_rows_ordered_from_the_south_are_flipped(lai):
    turned = lai.isel(y=slice(None, None, -1))
    xr.testing.assert_identical(grids.north_up(turned), lai)
    assert grids.north_up(lai) is lai
    np.testing.assert_array_equal(turned.fifesim.surface_reflectance(), lai.fifesim.surface_reflectance())


@pytest.mark.parametrize("seed", range(20))
def test_carried_grid_equals_the_grid_of_a_placed_raster(seed):
    """Origins are no multiples of the cell size, and cell sizes have no exact binary value."""
    draw = np.random.default_rng(seed)
    cell = draw.choice([10 / 3, 30.0, 0.7, draw.uniform(0.5, 50)], 2)
    west, north = 708000 + cell[1] * draw.integers(0, 900), 4331000 - draw.uniform(0, 5000)
    rows, columns = draw.integers(1, 300, 2)
    grid = grids.grid_at("EPSG:26914", west, north, columns * cell[1] + 1e-6, rows * cell[0] + 1e-6, tuple(cell))
    for each in (grid, grid.pad(1)):
        raster = grids.place(xr.DataArray(np.zeros(each.shape), dims=("y", "x")), each)
        found, expected = grids.as_carried(each), grids.geobox(raster)
        assert found.shape == expected.shape and found.crs == expected.crs
        assert tuple(found.affine) == tuple(expected.affine)


TM34 = ["TM3", "TM4"]


def without_crs(raster):
    """Result of `xr.where`: the same values and coordinates, but without the CRS."""
    out = xr.where(np.isfinite(raster), raster.drop_vars("spatial_ref"), np.nan)
    assert out.odc.crs is None
    return out


def test_raster_without_a_crs_takes_it_from_a_raster_on_the_same_cells(lai, site):
    found = grids.with_crs_of(without_crs(lai), lai)
    assert grids.same_grid(grids.geobox(found), site)
    np.testing.assert_array_equal(found, lai)
    assert grids.with_crs_of(lai, without_crs(lai)) is lai
    emptied = xr.where(lai > 1.5, 0.1, 0.3)  # the coordinate remains, but its attributes are lost
    assert "spatial_ref" in emptied.coords and grids.same_grid(grids.geobox(grids.with_crs_of(emptied, lai)), site)
    bare = without_crs(lai)
    for other in (bare.assign_coords(x=bare["x"] + 1), bare.isel(x=slice(5)), bare.drop_vars(["x", "y"])):
        assert grids.with_crs_of(other, lai) is other
        with pytest.raises(ValueError, match=r"no CRS.*xr\.where drops it"):
            lai.fifesim.surface_reflectance(bands=TM34, canopy=fifesim.Canopy(background=other * 0.01))


GRID = fifesim.fife_site(cell=10, window=((0, 60), (0, 60)))
WINDOW = fifesim.fife_site(cell=10, window=((10, 40), (10, 40)))


def test_consistent_transform_gives_the_exact_cell_size():
    third = xr.DataArray([0.0, 0.0], dims="x", coords={"x": [1.0, 2.0], "spatial_ref": 0})
    third["spatial_ref"].attrs["GeoTransform"] = f"0 {10 / 3!r} 0 0 0 {-10 / 3!r}"
    assert grids.exact_cell(third, 3.333333, -3.333333) == (10 / 3, -10 / 3)
    assert grids.exact_cell(third, 3.4, -3.4) == (3.4, -3.4)


def with_coordinates(raster, axis, change):
    return raster.assign_coords({axis: change(raster[axis].values)})


UNEVEN = {
    "gap": lambda raster, axis: raster.isel({axis: [*range(20), *range(30, 60)]}),
    "overlap": lambda raster, axis: raster.isel({axis: [*range(30), *range(25, 60)]}),
    "shuffled": lambda raster, axis: raster.isel({axis: [0, *np.random.default_rng(0).permutation(58) + 1, 59]}),
    "missing": lambda raster, axis: with_coordinates(raster, axis, lambda x: np.where(np.arange(60) == 5, np.nan, x)),
    "changing": lambda raster, axis: with_coordinates(
        raster, axis, lambda x: x + 15 * np.sin(np.linspace(0, np.pi, 60))
    ),
}
SOURCES = {
    "open_lai": lambda raster: fifesim.open_lai(raster.rename("lai"), WINDOW),
    "fine_dem": lambda raster: fifesim.fine_dem(300 + raster, WINDOW),
    "source_dem": lambda raster: fifesim.terrain.source_dem(300 + raster, WINDOW, margin=0.0),
    "moisture": lambda raster: fifesim.landscape(WINDOW, moisture=raster / 10),
    "cover": lambda raster: fifesim.landscape(
        WINDOW, cover=raster.astype(int), classes=[fifesim.CoverClass(str(i), lai=1.0, code=i) for i in range(10)]
    ),
}


@pytest.mark.parametrize("source", SOURCES)
def test_sources_with_unevenly_spaced_coordinates_are_refused(source):
    """odc-geo derives the grid from the first and last coordinates, which would shift the cells between them."""
    raster = fifesim.lai_scene(GRID, seed=7).drop_attrs(deep=False).rename(None)
    SOURCES[source](raster)
    for change, axis in product(UNEVEN.values(), ("x", "y")):
        with pytest.raises(ValueError, match=rf"{axis} is not evenly spaced.*\.interp"):
            SOURCES[source](change(raster, axis))


def test_coordinates_in_single_precision_are_evenly_spaced():
    """Single precision resolves 0.5 m in a northing of 4e6 m, which matters for cells of 1 m but not of 10 m."""
    raster = fifesim.lai_scene(GRID, seed=7)
    single = with_coordinates(raster, "y", lambda values: values.astype(np.float32))
    assert grids.regular_geobox(single).shape == GRID.shape
    fine = with_coordinates(raster, "y", lambda values: (values[0] - 1.3 * np.arange(60)).astype(np.float32))
    with pytest.raises(ValueError, match="y is not evenly spaced"):
        grids.regular_geobox(fine)


def test_zarr_group_states_its_crs_and_transform():
    """The README files of the GeoZarr conventions list the identifiers."""
    found = grids.geozarr_attributes(fifesim.grid_at("EPSG:32735", 600000, 7200000, 900, 600, (20, 30)))
    assert found["proj:code"] == "EPSG:32735" and "proj:wkt2" not in found
    assert found["spatial:transform"] == [30.0, 0.0, 600000.0, 0.0, -20.0, 7200000.0]
    assert (found["spatial:shape"], found["spatial:dimensions"]) == ([30, 30], ["y", "x"])
    assert found["spatial:bbox"] == [600000.0, 7199400.0, 600900.0, 7200000.0]
    assert json.loads(json.dumps(found)) == found
    assert {each["name"]: each["uuid"] for each in found["zarr_conventions"]} == {
        "proj": "f17cb550-5864-4468-aeb7-f3180cfb622f",
        "spatial": "689b58e2-cf7b-45e0-9fff-9cfc0883d6b4",
    }


def test_crs_without_a_code_is_written_as_wkt():
    own = pyproj.CRS.from_proj4("+proj=laea +lat_0=39 +lon_0=-96.5 +datum=WGS84 +units=m")
    (name, text), *others = grids.crs_fields(own).items()
    assert name == "proj:wkt2" and not others
    assert pyproj.CRS.from_wkt(text).equals(own)


def test_coordinate_of_the_crs_equals_that_of_odc_geo():
    for grid in (fifesim.fife_site(10 / 3), fifesim.grid_at("EPSG:32633", 390000.1, 5820000.7, 300, 200, (5.1, 2.3))):
        found, expected = grids.coordinates(grid)["spatial_ref"], xr_coords(grids.on_lattice(grid))["spatial_ref"]
        assert found.attrs == expected.attrs and list(found.attrs) == list(expected.attrs)
        assert found.dtype == expected.dtype and found.values == expected.values


def test_changed_attributes_of_a_coordinate_stay_with_their_raster(lai):
    grid = grids.geobox(lai)
    one = grids.place(lai, grid)
    one["x"].attrs["units"], one["spatial_ref"].attrs["crs_wkt"] = "km", "another"
    other = grids.place(lai, grid)
    assert other["x"].attrs["units"] == "m" and other["spatial_ref"].attrs["crs_wkt"] != "another"
