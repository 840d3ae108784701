"""Elevation models of any unit, orientation and coordinate reference system."""

import tracemalloc
import warnings

import numpy as np
import pytest
import rasterio
import rioxarray
import xarray as xr
from affine import Affine
from elevations import AMPLITUDE, CRS, NORTH, WEST, grid, model, surface, truth, write
from lazy import no_compute

import fifesim
from fifesim.grids import projection
from fifesim.ground.terrain import source_labels as sources
from fifesim.ground.terrain.elevation_labels import source_dem
from fifesim.ground.terrain.source_labels import open_source


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
    with pytest.raises(TypeError, match=r"path_or_raster must be the path of a file, or an xarray\.DataArray"):
        fifesim.fine_dem(np.zeros((3, 3)), grid())
    bands = xr.concat([rioxarray.open_rasterio(path)] * 2, "band")
    with pytest.raises(ValueError, match="has one band"):
        fifesim.fine_dem(bands, grid())


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


def test_window_of_a_source_may_reach_beyond_it(path):
    """NaN there, from a file as from a window of its cells."""
    source, values = open_source(path), model()[0]
    rows, columns = values.shape
    np.testing.assert_array_equal(source.read(0, 0, rows, columns), values)
    window = source.read(-3, columns - 2, 8, 9)
    np.testing.assert_array_equal(window[3:, :2], values[:5, -2:])
    assert np.isnan(window[:3]).all() and np.isnan(window[:, 2:]).all()
    assert np.isnan(source.read(rows + 5, 0, 3, 3)).all()


@pytest.fixture(scope="module")
def continent(tmp_path_factory):
    """A file of 20,000 x 20,000 cells (1.6 GB) of which it holds those around the grid, and the first of these."""
    where = tmp_path_factory.mktemp("continent") / "continent.tif"
    values, affine = model(margin=1500.0)
    first, count = 9984, 20_000
    affine = affine @ Affine.translation(-first, -first)
    profile = {"driver": "GTiff", "width": count, "height": count, "count": 1, "dtype": "float32", "nodata": -9999.0}
    with rasterio.open(where, "w", crs=CRS, transform=affine, tiled=True, sparse_ok=True, **profile) as file:
        file.write(values.astype("f4"), 1, window=rasterio.windows.Window(first, first, *values.shape[::-1]))
    return where, first + 1500 // 30


@pytest.mark.parametrize("margin", [None, 900.0])
def test_no_more_of_a_file_is_read_than_lies_near_the_grid(continent, monkeypatch, margin):
    """
    Tiles of 504 fine cells are 56 of the model's, a spline looks 37 around, the look for terraces 237; with a margin
    of 30, tiles are 504 of the model's.
    """
    (where, first), read = continent, []
    windows = sources._file_window

    def noted(file, rows, columns):
        read.append((rows, columns))
        return windows(file, rows, columns)

    monkeypatch.setattr(sources, "_file_window", noted)
    if margin is None:
        dem = fifesim.fine_dem(where, grid(), chunks="auto").compute()
        np.testing.assert_allclose(dem, truth(dem), rtol=0, atol=1e-3 * AMPLITUDE)
    else:
        source_dem(where, grid(), margin)
    around = max(56 + 37, 237) if margin is None else 30 + 504 + 37
    outline = [(min(part.start for part in axis), max(part.stop for part in axis)) for axis in zip(*read, strict=True)]
    assert all(first - around < start < first and first + 30 < stop < first + 30 + around for start, stop in outline)


@pytest.mark.parametrize("opened", [str, rioxarray.open_rasterio], ids=["path", "opened, not read"])
def test_large_model_is_never_held_whole(continent, opened):
    raster = opened(continent[0])
    tracemalloc.start()
    try:
        dem = fifesim.fine_dem(raster, grid(), chunks="auto").compute()
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    np.testing.assert_allclose(dem, truth(dem), rtol=0, atol=1e-3 * AMPLITUDE)
    assert peak < 60e6
