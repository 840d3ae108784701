"""Grids: location, coordinates and CRS, the FIFE site, coordinate operations, and how rasters carry grids."""

import warnings
from fractions import Fraction

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
from fifesim.grids import projection
from fifesim.grids.sites import is_fife, made_on_site, on_fife_site

CELL = 30 / 9
FIFE = (-96.63, 38.98, -96.45, 39.13)


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


def test_site_is_15_km_wide_and_coordinates_are_cell_centres():
    """Reference values are exact fractions; doubles of four million metres resolve 1e-9 m."""
    grid = fifesim.fife_site(CELL)
    assert tuple(grid.shape) == (4500, 4500) and grid.crs.epsg == 26914
    np.testing.assert_allclose(grid.boundingbox.bbox, (704970, 4319220, 719970, 4334220), rtol=0, atol=1e-6)
    coordinates = grids.coordinates(grid)
    rows = [float(4334220 - (Fraction(i) + Fraction(1, 2)) * 10 / 3) for i in range(4500)]
    columns = [float(704970 + (Fraction(i) + Fraction(1, 2)) * 10 / 3) for i in range(4500)]
    np.testing.assert_allclose(coordinates["y"], rows, rtol=0, atol=2e-9)
    np.testing.assert_allclose(coordinates["x"], columns, rtol=0, atol=2e-9)
    own = fifesim.fife_site(30, datum="NAD27")
    assert own.crs.epsg == 26714 and (own.affine.c, own.affine.f) == (705000.0, 4334000.0)


def test_scenes_on_the_site_are_marked():
    """A square of 300 m is shifted from the middle of the site."""
    inside, beyond = [(0, 0), (7450, 7450)], [(7600, 0), (-7600, 0), (0, 7600), (0, -7600)]
    for east, north in inside + beyond:
        grid = fifesim.grid_at("EPSG:26914", 712470 + east - 150, 4326720 + north + 150, 300, 300, 30)
        lai, known = fifesim.lai_scene(grid), (east, north) in inside
        assert is_fife(lai) == is_fife(fifesim.flint_hills(grid)) == known
        assert made_on_site(grid) == ({"site": "FIFE"} if known else {})
    # Arithmetic propagates attributes, and coordinates may be changed.
    lai = fifesim.lai_scene(fifesim.fife_site(30, datum="NAD27")[:2, :2])
    assert is_fife(lai) and not is_fife(lai.assign_coords(x=lai.x + 500e3))
    assert on_fife_site(fifesim.grid_at("EPSG:5070", -50000.0, 1788000.0, 300.0, 300.0, 30))


CORNER = Affine(30, 0, 705000, 0, -30, 4334000)


def box(crs, affine=CORNER):
    return GeoBox((4, 5), affine, crs)


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
    reference, expected = raster["spatial_ref"], xr_coords(grids.on_lattice(grid))["spatial_ref"]
    assert reference.attrs == expected.attrs and reference.dtype == expected.dtype


def test_carried_grid_equals_the_grid_of_a_placed_raster():
    """Origins are no multiples of the cell size, and cell sizes have no exact binary value."""
    for seed in range(20):
        draw = np.random.default_rng(seed)
        cell = draw.choice([10 / 3, 30.0, 0.7, draw.uniform(0.5, 50)], 2)
        west, north = 708000 + cell[1] * draw.integers(0, 900), 4331000 - draw.uniform(0, 5000)
        rows, columns = draw.integers(1, 300, 2)
        grid = grids.grid_at("EPSG:26914", west, north, columns * cell[1] + 1e-6, rows * cell[0] + 1e-6, tuple(cell))
        for each in (grid, grid.pad(1)):
            raster = grids.place(xr.DataArray(np.zeros(each.shape), dims=("y", "x")), each)
            assert grids.as_carried(each) == grids.geobox(raster)


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
    turned = lai.isel(y=slice(None, None, -1))
    xr.testing.assert_identical(grids.north_up(turned), lai)
    np.testing.assert_array_equal(turned.fifesim.surface_reflectance(), lai.fifesim.surface_reflectance())


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
    moved.attrs["units"] = moved["x"].attrs["units"] = "km"
    moved.coords["spatial_ref"].attrs["GeoTransform"] = ""
    xr.testing.assert_identical(raster, copy)
    again = grids.place(raster, grid)
    assert grids.geobox(again) == grid and again["x"].attrs["units"] == "m"


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


def test_grids_are_compared_with_a_tolerance_and_offsets_are_in_whole_cells():
    grid = box("EPSG:26914")
    assert grids.same_grid(grid, box("EPSG:26914", Affine(30, 0, 705000.01, 0, -30, 4334000)))
    for other in (box("EPSG:26914", Affine(30, 0, 705000.1, 0, -30, 4334000)), box("EPSG:32614"), grid[:3, :]):
        assert not grids.same_grid(grid, other)
    assert grids.lattice_offset(grid, grid[1:, 2:]) == (1, 2)
    assert grids.lattice_offset(grid[1:, 2:], grid) == (-1, -2)


def test_coarser_grid_shares_the_corner():
    scene = fifesim.fife_site(CELL, window=((1, 100), (1, 60)))
    coarse = grids.aligned_grid(scene, 30)
    assert tuple(coarse.shape) == (11, 6)
    assert (coarse.affine.c, coarse.affine.f) == (scene.affine.c, scene.affine.f)
    assert grids.cell_size(grids.aligned_grid(scene, (20, 40))) == (20.0, 40.0)


def test_netcdf_coordinates_have_no_fill_value(lai, tmp_path):
    """CF section 2.5.1 forbids a fill value; xarray adds one to all floating-point variables."""
    for raster in (lai, lai.isel(x=slice(3, 9)), lai * 2, lai.chunk(x=20)):
        raster.rename("lai").to_netcdf(tmp_path / "lai.nc")
        with netCDF4.Dataset(tmp_path / "lai.nc") as found:
            assert {name for name in found.variables if "_FillValue" in found[name].ncattrs()} == {"lai"}


def test_raster_without_a_crs_takes_it_from_a_raster_on_the_same_cells(lai, site):
    """The function `xarray.where` drops the coordinate of the CRS, or its attributes."""
    bare = xr.where(np.isfinite(lai), lai.drop_vars("spatial_ref"), np.nan)
    for lost in (bare, xr.where(lai > 1.5, 0.1, 0.3)):
        assert lost.odc.crs is None
        assert grids.same_grid(grids.geobox(grids.with_crs_of(lost, lai)), site)
    np.testing.assert_array_equal(grids.with_crs_of(bare, lai), lai)
    assert grids.with_crs_of(lai, bare) is lai
    for other in (bare.assign_coords(x=bare["x"] + 1), bare.isel(x=slice(5)), bare.drop_vars(["x", "y"])):
        assert grids.with_crs_of(other, lai) is other


def test_coordinates_in_single_precision_are_evenly_spaced(lai):
    """Single precision resolves 0.5 m in a northing of 4e6 m, which matters for cells of 1 m but not of 10 m."""
    coarse, fine = (lai.y.values[0] - cell * np.arange(lai.sizes["y"]) for cell in (10.0, 1.3))
    assert grids.regular_geobox(lai.assign_coords(y=coarse.astype(np.float32))).shape == lai.shape
    with pytest.raises(ValueError, match="y is not evenly spaced"):
        grids.regular_geobox(lai.assign_coords(y=fine.astype(np.float32)))


def test_zarr_group_states_its_crs_and_transform():
    """A CRS without a code is written as WKT."""
    found = grids.geozarr_attributes(fifesim.grid_at("EPSG:32735", 600000, 7200000, 900, 600, (20, 30)))
    assert found["proj:code"] == "EPSG:32735" and "proj:wkt2" not in found
    assert found["spatial:transform"] == [30.0, 0.0, 600000.0, 0.0, -20.0, 7200000.0]
    assert (found["spatial:shape"], found["spatial:dimensions"]) == ([30, 30], ["y", "x"])
    assert found["spatial:bbox"] == [600000.0, 7199400.0, 600900.0, 7200000.0]
    own = pyproj.CRS.from_proj4("+proj=laea +lat_0=39 +lon_0=-96.5 +datum=WGS84 +units=m")
    (name, text), *others = grids.crs_fields(own).items()
    assert name == "proj:wkt2" and not others and pyproj.CRS.from_wkt(text).equals(own)


def test_nad27_is_transformed_to_nad83_with_known_accuracy():
    """
    By the NADCON grids, the corner of FIFE is at 704968 E 4334211 N.

    Two Helmert operations to WGS 84 (EPSG:1173, accurate to metres) replace the grids and differ by at most 2 m there.
    """
    pipeline = projection.operation("EPSG:26714", "EPSG:26914", FIFE)
    east, north = pyproj.Transformer.from_pipeline(pipeline).transform(705000.0, 4334000.0)
    assert np.hypot(east - 704968, north - 4334211) < 2.0
    back = projection.operation("EPSG:26914", "EPSG:26714", FIFE)
    again = pyproj.Transformer.from_pipeline(back).transform(east, north)
    np.testing.assert_allclose(again, (705000.0, 4334000.0), rtol=0, atol=1e-3)


@pytest.mark.parametrize("crs", ["EPSG:3031", "EPSG:3413", "EPSG:5041", "EPSG:5042", "EPSG:32661", "EPSG:26914"])
def test_points_are_transformed_easting_first(crs):
    """Both axes of a polar CRS may point north or south, and some give northing first."""
    latitude = -72.0 if crs in ("EPSG:3031", "EPSG:5042") else 72.0
    pipeline = projection.operation(crs, "EPSG:4326")
    expected = pyproj.Transformer.from_crs(4326, crs, always_xy=True).transform(-95.0, latitude)
    back = projection.carry(pipeline, crs, "EPSG:4326", *expected)
    np.testing.assert_allclose(back, (-95.0, latitude), rtol=0, atol=1e-5)


@pytest.mark.parametrize(
    ("crs", "latitude"), [("EPSG:3031", -72.0), ("EPSG:3413", 71.0), ("EPSG:5041", 85.0), ("EPSG:32636", 40.0)]
)
def test_convergence_is_where_true_north_is(crs, latitude):
    """The reference is a small step northward in grid coordinates."""
    to_plane = pyproj.Transformer.from_crs(4326, crs, always_xy=True)
    (west, north), (x, y) = to_plane.transform(30.0, latitude), to_plane.transform(30.0, latitude + 1e-4)
    grid = grids.grid_at(crs, west - 50, north + 50, 100, 100, 10)
    east_of_grid_north = np.degrees(np.arctan2(x - west, y - north))
    assert projection.convergence(grid) == pytest.approx(-east_of_grid_north, abs=0.01)


def test_heights_of_a_crs_are_dropped():
    assert projection.horizontal("EPSG:26914+5703") == projection.horizontal("EPSG:26914") == "EPSG:26914"
    assert projection.horizontal(pyproj.CRS("EPSG:7415").to_wkt()) == "EPSG:28992"
    assert projection.operation("EPSG:26914", pyproj.CRS("EPSG:26914").to_wkt()) is None


def test_scale_error_above_one_percent_gives_one_warning_per_location():
    """Web Mercator stretches by the secant of the latitude: 1 % at 8 degrees from the equator. UTM zones are within."""
    mercator = {"crs": "EPSG:3857", "west": 28.2e5 * 1.113, "width": 300.0, "height": 300.0, "cell": 30.0}
    with pytest.warns(UserWarning, match=r"of EPSG:3857 is 1.02 near .* 30 m is 29.\d m on the ground.*EPSG:32735"):
        grid = fifesim.grid_at(north=-1.2e6, **mercator)
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        grids.check_grid(grid)
        fifesim.grid_at(north=-0.5e6, **mercator)
        for cell in (10 / 3, 30 / 9, 2.5, 25):
            fifesim.fife_site(cell)
        fifesim.fife_site(29, window=((0, 10), (0, 10)))
