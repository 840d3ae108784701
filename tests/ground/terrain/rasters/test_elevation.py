"""Elevation models of any resolution on the fine grid, and around it."""

import warnings

import numpy as np
import pyproj
import pytest
import xarray as xr
from affine import Affine
from elevations import AMPLITUDE, CRS, NORTH, WEST, grid, model, surface, tilted, truth, write
from lazy import check_place, no_compute

import fifesim
from fifesim.grids import cf
from fifesim.ground.terrain.elevation_labels import _mean_slope


def slopes(values, cell):
    down, across = np.gradient(values, cell)
    return np.hypot(down, across)[1:-1, 1:-1]


def test_band_limited_surface_is_recovered(path):
    dem = fifesim.fine_dem(path, grid())
    np.testing.assert_allclose(dem, truth(dem), rtol=0, atol=1e-3 * AMPLITUDE)
    check_place(dem, CRS)
    assert cf.attributes("dem").items() <= dem.attrs.items()
    assert dem.attrs["source_resolution"] == pytest.approx(30)
    assert "hills.tif" in dem.attrs["history"]


def test_slope_is_free_of_the_source_cells(path):
    """Within 0.1 % of the slope of the surface itself, rms, and 0.6 % at worst of a largest slope of 0.36."""
    dem = fifesim.fine_dem(path, grid())
    error = slopes(dem.values, 30 / 9) - slopes(truth(dem), 30 / 9)
    assert np.sqrt(np.mean(error**2)) < 4e-4
    assert np.abs(error).max() < 2.2e-3


@pytest.mark.parametrize("cell", [30 / 9, 7.0, 45.0])
@pytest.mark.parametrize("margin", [0.0, 600.0])
def test_plane_stays_a_plane(tmp_path, cell, margin):
    """Also up to the outer edge of the outermost cells of the source, and for sources finer than the grid."""
    where = write(tmp_path / "plane.tif", *model(tilted, margin=margin))
    dem = fifesim.fine_dem(where, grid(cell))
    np.testing.assert_allclose(dem, truth(dem, tilted), rtol=0, atol=1e-8)
    np.testing.assert_allclose(slopes(dem.values, cell), np.hypot(0.1, 0.05), rtol=0, atol=1e-9)


def test_source_in_degrees(tmp_path):
    """A lattice in degrees of the same surface; positions go by PROJ's own operation."""
    to_degrees = pyproj.Transformer.from_crs(CRS, "EPSG:4269", always_xy=True)
    back = pyproj.Transformer.from_crs("EPSG:4269", CRS, always_xy=True)
    west, north = to_degrees.transform(WEST - 600, NORTH + 600)
    affine = Affine(3e-4, 0, west, 0, -2.4e-4, north)
    values, _ = model(lambda x, y: surface(*back.transform(x, y)), affine=affine, shape=(90, 90))
    dem = fifesim.fine_dem(write(tmp_path / "degrees.tif", values, affine, "EPSG:4269"), grid())
    np.testing.assert_allclose(dem, truth(dem), rtol=0, atol=1e-3 * AMPLITUDE)
    assert dem.attrs["source_resolution"] == pytest.approx((3e-4 * 86500 + 2.4e-4 * 111000) / 2, rel=0.01)


@pytest.mark.parametrize("chunks", [{"y": 100, "x": 77}, {"y": 31, "x": 270}, "auto"])
def test_chunks_and_windows_change_no_bit(path, chunks):
    whole = fifesim.fine_dem(path, grid())
    with no_compute():
        lazy = fifesim.fine_dem(path, grid(), chunks=chunks)
    assert lazy.chunks is not None
    xr.testing.assert_identical(lazy.compute(), whole)
    part = fifesim.fine_dem(path, grid()[37:150, 11:112])
    xr.testing.assert_equal(part, whole[37:150, 11:112])


def test_source_around_the_grid(path):
    """On cells of about the source's size that the grid's corner is a corner of; the model reaches 600 m."""
    dem, reach = fifesim.source_dem(path, grid(), 450.0)
    assert dem.odc.geobox.affine == Affine(30, 0, WEST - 450, 0, -30, NORTH + 450)
    assert dem.shape == (60, 60)
    np.testing.assert_allclose(dem, truth(dem), rtol=0, atol=1e-6)
    assert reach == {"north": 450, "east": 450, "south": 450, "west": 450}
    check_place(dem, CRS)
    assert dem.attrs["source_resolution"] == pytest.approx(30)


@pytest.mark.parametrize("chunks", ["auto", {"y": 31, "x": 27}])
def test_lazy_source_is_the_same_with_and_without_holes(tmp_path, chunks):
    values, affine = model()
    values[:, :15], values[3, 40] = np.nan, np.nan
    for crs in (CRS, "EPSG:32614"):
        where = write(tmp_path / "cut.tif", values, affine, crs)
        for fill in (None, 60.0):
            whole, reach = fifesim.source_dem(where, grid(), 6000.0, fill=fill)
            with no_compute():
                lazy, same_reach = fifesim.source_dem(where, grid(), 6000.0, fill=fill, chunks=chunks)
            assert lazy.chunks is not None and reach == same_reach
            xr.testing.assert_identical(lazy.compute(), whole)


def test_source_reaches_as_far_as_its_data(tmp_path):
    values, affine = model()
    values[:, :15], values[3, 40] = np.nan, np.nan
    dem, reach = fifesim.source_dem(write(tmp_path / "cut.tif", values, affine), grid(), 6000.0)
    assert reach == {"north": 480, "east": 600, "south": 600, "west": 150}
    assert dem.odc.geobox.affine == Affine(30, 0, WEST - 150, 0, -30, NORTH + 600)
    assert dem.shape == (70, 55)
    assert int(dem.isnull().sum()) == 1
    with pytest.raises(ValueError, match="does not reach the grid"):
        fifesim.source_dem(tmp_path / "cut.tif", grid(west=WEST + 90000), 100.0)
    with pytest.raises(ValueError, match="margin must be 0 m or more"):
        fifesim.source_dem(tmp_path / "cut.tif", grid(), -1.0)


FINE = fifesim.fife_site(10, window=((120, 180), (120, 180)))


def hills(cell=30):
    return fifesim.flint_hills(fifesim.fife_site(cell, window=((0, 100), (0, 100))), seed=7)


@pytest.mark.parametrize("fill", [-9999.0, -32768.0, 32767.0, 9999.0, -3.4e38])
@pytest.mark.parametrize("form", ["file", "array", "lazy"])
def test_undeclared_fill_values_next_to_the_grid_are_refused(tmp_path, fill, form):
    """The spline would carry them into the grid: 210 to 650 m instead of 338 to 412 m."""
    dem = hills()
    dem[40:60, 61:] = fill
    path = write(tmp_path / "dem.tif", dem.values, dem.odc.geobox.affine, nodata=None)
    given = {"file": path, "array": dem, "lazy": dem.chunk(x=50)}[form]
    with pytest.raises(ValueError, match=rf"elevations such as {fill:.0f} m.*-a_nodata, \.rio\.write_nodata"):
        fifesim.fine_dem(given, FINE).compute()
    with pytest.raises(ValueError, match=f"elevations such as {fill:.0f} m"):
        fifesim.source_dem(given, FINE, margin=500.0)
    if form != "lazy":
        declared = dem.rio.write_nodata(fill)
        expected = fifesim.fine_dem(dem.where(dem > 0).where(dem < 9000), FINE)
        np.testing.assert_array_equal(fifesim.fine_dem(declared, FINE), expected)


@pytest.mark.parametrize("cell", [10, 30])
def test_feet_without_a_unit_are_a_warning_by_their_slope(cell):
    dem = hills(cell)
    grid = fifesim.fife_site(10, window=((20, 80), (20, 80)))
    steep = 300 + 12 * (dem - 300)
    with pytest.warns(
        UserWarning, match="mean slope of dem is .* degrees at 30 m.*feet or decimetres.*vertical_units='m'"
    ):
        fifesim.fine_dem(steep.rename("dem"), grid)
    with warnings.catch_warnings(action="error", category=UserWarning):
        fifesim.fine_dem(dem, grid)
        fifesim.fine_dem(steep, grid, vertical_units="m")


def test_mean_slope_is_that_of_a_plane_at_30_m():
    """Roughness below 30 m is averaged away."""
    rows, columns = np.mgrid[:90, :120]
    rough = 10 * (rows * np.tan(np.radians(25)) + 0.5 * ((rows + columns) % 2))
    assert _mean_slope(rough, (10.0, 10.0)) == pytest.approx(25, abs=0.1)
    assert np.isnan(_mean_slope(rough[:3], (10.0, 10.0)))


def test_voids_of_zero_are_a_warning():
    dem = hills()
    dem[48:50, 48:50] = 0.0
    with pytest.warns(UserWarning, match=r"elevations of exactly 0 m beside others.*-a_nodata 0"):
        fifesim.fine_dem(dem, FINE)
    with warnings.catch_warnings(action="error", category=UserWarning):
        fifesim.fine_dem(hills() - float(hills()[48, 48]), FINE)
