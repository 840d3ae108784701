"""Elevation models of any resolution, CRS and orientation on the fine grid."""

import re
import warnings

import numpy as np
import pyproj
import pytest
import rasterio
import rioxarray
import xarray as xr
from affine import Affine
from lazy import check_place, no_compute

import fifesim
from fifesim.rasters import cf, projection

# The corner of the largest square of the Kings Creek model, where real terrain would be.
WEST, NORTH = 708120.0, 4331070.0
CRS = "EPSG:26914"


def surface(x, y):
    """Band-limited hills: waves of 160 to 900 m, six cells of 30 m and more along each axis. [m]"""
    u, v = x - WEST, y - NORTH
    waves = [(160, 30, 2.0), (240, 110, 4.0), (500, 200, 12.0), (900, 75, 20.0)]
    angles = [(2 * np.pi / length, np.radians(angle), size) for length, angle, size in waves]
    return 400 + sum(size * np.sin(k * (u * np.cos(a) + v * np.sin(a)) + size) for k, a, size in angles)


AMPLITUDE = 38.0


def plane(x, y):
    return 400 + 0.1 * (x - WEST) - 0.05 * (y - NORTH)


def model(function=surface, cell=30.0, margin=600.0, size=900.0, affine=None, shape=None):
    """A lattice of point values of a function that reaches past the grid, and its transform."""
    affine = affine or Affine(cell, 0, WEST - margin, 0, -cell, NORTH + margin)
    shape = shape or (int((size + 2 * margin) / cell),) * 2
    columns, rows = np.meshgrid(np.arange(shape[1]) + 0.5, np.arange(shape[0]) + 0.5)
    return function(*(affine * (columns, rows))), affine


def write(path, values, affine, crs=CRS, unit=None, nodata=-9999.0, **tags):
    values = np.where(np.isnan(values), nodata, values)
    profile = {"driver": "GTiff", "width": values.shape[1], "height": values.shape[0], "count": 1, "dtype": "float64"}
    with rasterio.open(path, "w", crs=crs, transform=affine, nodata=nodata, **profile) as file:
        file.write(values, 1)
        if unit:
            file.units = (unit,)
    return path


def grid(cell=30 / 9, size=900.0, crs=CRS, west=WEST, north=NORTH):
    return fifesim.grid_at(crs, west, north, size, size, cell)


def truth(dem, function=surface):
    return function(dem["x"].values[None, :], dem["y"].values[:, None])


@pytest.fixture
def path(tmp_path):
    return write(tmp_path / "hills.tif", *model())


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
    where = write(tmp_path / "plane.tif", *model(plane, margin=margin))
    dem = fifesim.fine_dem(where, grid(cell))
    np.testing.assert_allclose(dem, truth(dem, plane), rtol=0, atol=1e-8)
    np.testing.assert_allclose(slopes(dem.values, cell), np.hypot(0.1, 0.05), rtol=0, atol=1e-9)


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


def test_change_of_datum_has_a_known_accuracy(path):
    """
    NAD27 against NAD83: identity of degrees would be 30 m off, the operation is good to 11 m and agrees with itself.

    On slopes of 0.36 at most, 1 cm of height is 3 cm of place.
    """
    old = fifesim.grid_at("EPSG:26714", WEST + 30, NORTH - 210, 500, 500, 10.0)
    dem = fifesim.fine_dem(path, old)
    pipeline, _ = projection.operation("EPSG:26714", CRS, projection.degrees(old))
    x, y = projection.carry(pipeline, "EPSG:26714", CRS, *np.meshgrid(dem["x"], dem["y"]))
    np.testing.assert_allclose(dem, surface(x, y), rtol=0, atol=1e-3 * AMPLITUDE)


@pytest.mark.parametrize(
    "affine",
    [
        Affine(30, 0, WEST - 600, 0, 30, NORTH - 1500),
        Affine(-30, 0, WEST + 1500, 0, -30, NORTH + 600),
        Affine.translation(WEST - 900, NORTH + 900) @ Affine.rotation(0) @ Affine(30, 2, 0, 1, -30, 0),
    ],
    ids=["south-up", "west-right", "rotated"],
)
def test_orientation_of_the_source_does_not_matter(tmp_path, affine):
    values, _ = model(affine=affine, shape=(100, 100) if affine.b else (70, 70))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        dem = fifesim.fine_dem(write(tmp_path / "turned.tif", values, affine), grid())
    np.testing.assert_allclose(dem, truth(dem), rtol=0, atol=1.5e-3 * AMPLITUDE)


def test_cells_of_the_grid_need_not_be_square(path):
    square = fifesim.grid_at(CRS, WEST, NORTH, 900, 900, 5.0)
    tall = type(square)((90, 180), Affine(5.0, 0, WEST, 0, -10.0, NORTH), CRS)
    dem = fifesim.fine_dem(path, tall)
    np.testing.assert_allclose(dem, truth(dem), rtol=0, atol=1e-3 * AMPLITUDE)


@pytest.mark.parametrize("chunks", [{"y": 100, "x": 77}, {"y": 31, "x": 270}, "auto"])
def test_chunks_and_windows_change_no_bit(path, chunks):
    whole = fifesim.fine_dem(path, grid())
    with no_compute():
        lazy = fifesim.fine_dem(path, grid(), chunks=chunks)
    assert lazy.chunks is not None
    xr.testing.assert_identical(lazy.compute(), whole)
    part = fifesim.fine_dem(path, grid()[37:150, 11:112])
    xr.testing.assert_equal(part, whole[37:150, 11:112])


def test_arrays_give_what_their_file_gives(path):
    """Read masked or not, in chunks or not, with the rows of either order."""
    whole = fifesim.fine_dem(path, grid())
    for options in ({}, {"masked": True}, {"masked": True, "chunks": {"y": 23, "x": 31}}):
        raster = rioxarray.open_rasterio(path, **options)
        before = raster.copy(deep=True)
        with no_compute():
            dem = fifesim.fine_dem(raster, grid())
        assert (dem.chunks is not None) == ("chunks" in options)
        np.testing.assert_allclose(dem, whole, rtol=0, atol=1e-9)
        xr.testing.assert_identical(raster, before)
        upside_down = raster.sortby("y").squeeze("band")
        np.testing.assert_allclose(fifesim.fine_dem(upside_down, grid()), whole, rtol=0, atol=1e-6)


def test_lazy_array_gives_the_same_bits_in_any_chunks(path):
    raster = rioxarray.open_rasterio(path, masked=True)
    whole = fifesim.fine_dem(raster, grid())
    for chunks in ({"y": 100, "x": 77}, "auto"):
        lazy = fifesim.fine_dem(raster.chunk({"y": 17, "x": 40}), grid(), chunks=chunks)
        np.testing.assert_array_equal(lazy.compute(), whole)


def test_model_that_ends_inside_the_grid_is_refused_by_how_much(path):
    beyond = grid(west=WEST + 700, north=NORTH - 900)
    with pytest.raises(ValueError, match="lacks up to") as error:
        fifesim.fine_dem(path, beyond)
    found = dict((side, float(metres)) for metres, side in re.findall(r"(\d+) m in the (\w+)", str(error.value)))
    assert found == {"south": pytest.approx(300, abs=20), "east": pytest.approx(100, abs=20)}
    with pytest.raises(ValueError, match="holds no elevation on the grid"):
        fifesim.fine_dem(path, grid(west=WEST + 90000))


def with_hole(tmp_path, tall=3, wide=4):
    values, affine = model()
    values[30 : 30 + tall, 28 : 28 + wide] = np.nan
    return write(tmp_path / "hole.tif", values, affine)


def test_hole_is_refused_by_its_place_and_size(tmp_path):
    where = with_hole(tmp_path)
    with pytest.raises(ValueError, match=r"a hole of (\d+) x (\d+) m at (\d+) E (\d+) N: fill=(\d+)") as error:
        fifesim.fine_dem(where, grid())
    tall, wide, east, north, fill = map(
        float, re.findall(r"a hole of (\d+) x (\d+) m at (\d+) E (\d+) N: fill=(\d+)", str(error.value))[0]
    )
    assert (tall, wide) == (pytest.approx(90, abs=16), pytest.approx(120, abs=16))
    assert east == pytest.approx(WEST - 600 + 30 * 30, abs=20)
    assert north == pytest.approx(NORTH + 600 - 31.5 * 30, abs=20)
    dem = fifesim.fine_dem(where, grid(), fill=fill)
    np.testing.assert_allclose(dem, truth(dem), rtol=0, atol=0.1 * AMPLITUDE)


def test_filled_hole_is_the_same_in_any_chunks(tmp_path):
    where = with_hole(tmp_path)
    whole = fifesim.fine_dem(where, grid(), fill=90)
    np.testing.assert_array_equal(fifesim.fine_dem(where, grid(), fill=90, chunks=100).compute(), whole)


def test_hole_too_large_to_fill_is_refused(tmp_path):
    with pytest.raises(ValueError, match="a hole of"):
        fifesim.fine_dem(with_hole(tmp_path, 12, 12), grid(), fill=60)


def test_lazy_array_tells_of_its_hole_when_computed(tmp_path):
    raster = rioxarray.open_rasterio(with_hole(tmp_path), masked=True, chunks={"y": 20, "x": 20})
    dem = fifesim.fine_dem(raster, grid())
    with pytest.raises(ValueError, match="a hole of"):
        dem.compute()


@pytest.mark.parametrize("fill", [True, 0, -3])
def test_fill_is_a_distance(path, fill):
    with pytest.raises(ValueError, match="fill is a distance"):
        fifesim.fine_dem(path, grid(), fill=fill)


@pytest.mark.parametrize("unit", ["ft", "US survey foot", "fathom"])
def test_other_units_are_refused_unless_given(tmp_path, unit):
    values, affine = model()
    where = write(tmp_path / "feet.tif", values / 0.3048, affine, unit=unit)
    with pytest.raises(ValueError, match=rf"in '{unit}', not in metres: give their units.*vertical_units"):
        fifesim.fine_dem(where, grid())
    dem = fifesim.fine_dem(where, grid(), vertical_units="ft")
    np.testing.assert_allclose(dem, truth(dem), rtol=0, atol=1e-3 * AMPLITUDE)


def test_units_of_a_compound_reference_system(tmp_path):
    """NAD83 / UTM 14N with NAVD88 heights in US survey feet, and in metres."""
    values, affine = model()
    feet = write(tmp_path / "feet.tif", values / (1200 / 3937), affine, "EPSG:26914+6360")
    with pytest.raises(ValueError, match="US survey foot"):
        fifesim.fine_dem(feet, grid())
    metres = write(tmp_path / "metres.tif", values, affine, "EPSG:26914+5703")
    same = fifesim.fine_dem(metres, grid())
    np.testing.assert_allclose(fifesim.fine_dem(feet, grid(), vertical_units="us-ft"), same, rtol=0, atol=1e-9)


def test_units_of_an_array(path):
    raster = rioxarray.open_rasterio(path, masked=True).assign_attrs(units="ft")
    with pytest.raises(ValueError, match="in 'ft'"):
        fifesim.fine_dem(raster, grid())


def test_missing_reference_system_is_refused(tmp_path):
    values, affine = model()
    where = write(tmp_path / "nowhere.tif", values, affine, crs=None)
    for raster in (where, rioxarray.open_rasterio(where)):
        with pytest.raises(ValueError, match="has no CRS: give it one"):
            fifesim.fine_dem(raster, grid())


def test_what_is_no_model_is_refused(tmp_path, path):
    with pytest.raises(ValueError, match="cannot read"):
        fifesim.fine_dem(tmp_path / "missing.tif", grid())
    with pytest.raises(TypeError, match=r"a path or an xarray\.DataArray"):
        fifesim.fine_dem(np.zeros((3, 3)), grid())
    bands = xr.concat([rioxarray.open_rasterio(path)] * 2, "band")
    with pytest.raises(ValueError, match="has one band"):
        fifesim.fine_dem(bands, grid())


def test_terraces_of_whole_numbers_are_warned_of(tmp_path, path):
    def gentle(x, y):
        return np.rint(plane(x, y) / 10)

    with pytest.warns(UserWarning, match="vertical resolution of 1 m"):
        fifesim.fine_dem(write(tmp_path / "steps.tif", *model(gentle)), grid())
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        fifesim.fine_dem(path, grid())


def test_source_around_the_grid(path):
    """On cells of about the source's size that the grid's corner is a corner of; the model reaches 600 m."""
    dem, reach = fifesim.source_dem(path, grid(), 450.0)
    assert dem.odc.geobox.affine == Affine(30, 0, WEST - 450, 0, -30, NORTH + 450)
    assert dem.shape == (60, 60)
    np.testing.assert_allclose(dem, truth(dem), rtol=0, atol=1e-6)
    assert reach == {"north": 450, "east": 450, "south": 450, "west": 450}
    check_place(dem, CRS)
    assert dem.attrs["source_resolution"] == pytest.approx(30)


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
