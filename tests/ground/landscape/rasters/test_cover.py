"""Cover on labelled rasters: drawn, and a user's own map in its classes."""

import logging

import numpy as np
import pyproj
import pytest
import rioxarray
import xarray as xr
from affine import Affine
from elevations import write
from lazy import ODD_CHUNKS, check_place, no_compute

import fifesim
from fifesim.grids import cf
from fifesim.grids import grid as grids
from fifesim.ground.landscape.classes import CoverClass, class_table
from fifesim.ground.landscape.cover import Patches, patch_classes
from fifesim.ground.landscape.labels import classes_of, cover_map, drawn_cover

TABLE = class_table([CoverClass("grass", code=10), CoverClass("wood", code=20), CoverClass("water", code=80)])
CODES = (10, 20, 80)


@pytest.fixture
def codes(site):
    return np.random.default_rng(3).choice(CODES, site.shape).astype(np.uint8)


def test_drawn_cover_is_the_patches_by_their_codes(site):
    cover = drawn_cover(site, Patches("voronoi", 40), TABLE, 7)
    place = [grids.coordinates(site)[axis].values for axis in ("y", "x")]
    numbers = patch_classes(Patches("voronoi", 40), (1 / 3,) * 3, 7, *place)
    np.testing.assert_array_equal(cover, np.array(CODES)[numbers])
    check_place(cover, site.crs)
    assert cover.dtype == np.int16 and cover.name == "cover" and cf.attributes("cover").items() <= cover.attrs.items()
    assert cover.attrs["flag_meanings"] == "grass wood water" and cover.attrs["flag_values"].tolist() == list(CODES)
    assert [(each.name, each.code) for each in classes_of(cover)] == [(each.name, each.code) for each in TABLE]


@pytest.mark.parametrize("chunks", [ODD_CHUNKS, "auto"], ids=str)
def test_drawn_cover_has_the_same_bits_in_chunks(site, chunks):
    with no_compute():
        lazy = drawn_cover(site, Patches("levels", 40), TABLE, 7, chunks)
    xr.testing.assert_identical(lazy.compute(), drawn_cover(site, Patches("levels", 40), TABLE, 7))
    assert lazy.dtype == np.int16


def test_map_on_the_same_cells_is_read_as_it_is(tmp_path, site, codes):
    path = write(tmp_path / "cover.tif", codes, site.affine)
    cover = cover_map(path, site, TABLE)
    np.testing.assert_array_equal(cover, codes)
    check_place(cover, site.crs)
    assert cover.attrs["history"] == "landscape: cover of cover.tif"
    opened = rioxarray.open_rasterio(path)
    for raster in (opened, opened.chunk({"x": 13}), opened[:, ::-1], opened.astype(float)):
        np.testing.assert_array_equal(cover_map(raster, site, TABLE), codes)
    for chunks in (ODD_CHUNKS, "auto"):
        for source in (path, opened):
            with no_compute():
                lazy = cover_map(source, site, TABLE, chunks)
            np.testing.assert_array_equal(lazy.compute(), codes)


def test_smaller_cells_have_the_nearest_class_and_larger_ones_the_most_frequent(tmp_path, site, codes):
    a = site.affine
    path = write(tmp_path / "cover.tif", codes, a)
    finer = fifesim.grid_at(site.crs, a.c, a.f, 54 * a.a, 45 * a.a, a.a / 3)
    np.testing.assert_array_equal(cover_map(path, finer, TABLE), np.kron(codes, np.ones((3, 3))))
    larger = fifesim.grid_at(site.crs, a.c, a.f, 54 * a.a, 45 * a.a, 3 * a.a)
    blocks = codes.reshape(15, 3, 18, 3).swapaxes(1, 2).reshape(15, 18, 9)
    counts = np.stack([np.sum(blocks == code, axis=-1) for code in CODES])
    ordered = np.sort(counts, axis=0)
    clear = ordered[-1] > ordered[-2]
    most = np.array(CODES)[counts.argmax(axis=0)]
    assert clear.sum() > 150
    for source in (path, rioxarray.open_rasterio(path)):
        found = cover_map(source, larger, TABLE).values
        np.testing.assert_array_equal(found[clear], most[clear])
        assert set(np.unique(found)) <= set(CODES)


def test_map_in_another_projection_keeps_its_classes(tmp_path, site, codes):
    """Classes in between, which means of their codes would be, are none of the table."""
    path = write(tmp_path / "cover.tif", codes, site.affine)
    turned = rioxarray.open_rasterio(path).rio.reproject("EPSG:4326")
    assert (turned == turned.rio.nodata).any()
    cover = cover_map(turned, site, TABLE)
    assert (cover.values == codes).mean() > 0.5
    assert set(np.unique(cover)) <= {-1, *CODES}


def test_cells_have_the_class_with_the_largest_area(tmp_path, site, codes, caplog):
    """Compared with the areas of the classes, from 400 points of each cell carried to the map by pyproj."""
    path = write(tmp_path / "cover.tif", codes, site.affine)
    turned = rioxarray.open_rasterio(path, masked=True).rio.reproject("EPSG:4326")[0]
    with caplog.at_level(logging.WARNING):
        found = cover_map(turned, site, TABLE).values
    assert caplog.messages == []
    along = 20
    rows, columns = (np.mgrid[: 45 * along, : 54 * along] + 0.5) / along
    to_degrees = pyproj.Transformer.from_crs(site.crs.proj, 4326, always_xy=True)
    columns, rows = ~turned.rio.transform() * np.array(to_degrees.transform(*(site.affine * (columns, rows))))
    rows, columns = (
        np.clip(np.floor(each).astype(int), 0, n - 1) for each, n in zip((rows, columns), turned.shape, strict=True)
    )
    points = turned.values[rows, columns].reshape(45, along, 54, along)
    areas = np.stack([(points == code).mean(axis=(1, 3)) for code in CODES])
    first, second = np.sort(areas, axis=0)[:0:-1]
    # Five samples place a boundary within 0.1 of a cell along each axis, which moves two areas in opposite directions.
    clear = first - second > 0.4
    assert clear.sum() > 1300
    np.testing.assert_array_equal(found[clear], np.array(CODES)[areas.argmax(axis=0)][clear])


def test_reprojected_map_that_declares_another_nodata_value_is_refused(tmp_path, site, codes):
    """rioxarray's `reproject(nodata=0)` may fill with 0 and keep the `_FillValue` of its input."""
    path = write(tmp_path / "cover.tif", codes, site.affine)
    turned = rioxarray.open_rasterio(path).rio.reproject("EPSG:4326")
    filled = turned.where(turned != turned.rio.nodata, 0).assign_attrs(turned.attrs)
    with pytest.raises(ValueError, match="codes without a class: 0, in"):
        cover_map(filled, site, TABLE)


def test_missing_stays_missing(tmp_path, site, codes):
    holes = codes.astype(float)
    holes[2:5, 7] = np.nan
    for given in (holes, np.where(np.isnan(holes), 255, holes).astype(np.uint8)):
        raster = rioxarray.open_rasterio(write(tmp_path / "cover.tif", given, site.affine))
        if given.dtype == np.uint8:
            raster = raster.assign_attrs(_FillValue=255)
        np.testing.assert_array_equal(cover_map(raster, site, TABLE), np.where(np.isnan(holes), -1, holes))


def test_code_without_a_class_is_named_when_it_computes(tmp_path, site, codes):
    codes[0, :3], codes[9, 9] = 50, 60
    path = write(tmp_path / "cover.tif", codes, site.affine)
    message = r"codes without a class: 50, 60, in 4 of 2430 cells\. Classes are 10, 20, 80"
    with pytest.raises(ValueError, match=message):
        cover_map(path, site, TABLE)
    with no_compute():
        lazy = cover_map(path, site, TABLE, chunks=100)
    with pytest.raises(ValueError, match=message):
        lazy.compute()


def test_map_that_is_of_no_use_is_refused(tmp_path, site, codes):
    with pytest.raises(ValueError, match="allow_remote=True"):
        cover_map("/vsicurl/https://example.org/cover.tif", site, TABLE)
    with pytest.raises(ValueError, match=r"missing\.tif"):
        cover_map(tmp_path / "missing.tif", site, TABLE)
    elsewhere = write(tmp_path / "far.tif", codes, site.affine * Affine.translation(5000, 0))
    with pytest.raises(ValueError, match=r"far\.tif does not overlap the grid"):
        cover_map(elsewhere, site, TABLE)
    empty = write(tmp_path / "none.tif", np.full(site.shape, np.nan), site.affine)
    with pytest.raises(ValueError, match=r"none\.tif has no data on the grid"):
        cover_map(empty, site, TABLE)
    two = rioxarray.open_rasterio(write(tmp_path / "cover.tif", codes, site.affine))
    with pytest.raises(ValueError, match="select one layer"):
        cover_map(xr.concat([two, two], "band"), site, TABLE)


def test_cover_that_says_no_classes_is_refused(site):
    with pytest.raises(ValueError, match="the classes of the cover are unknown"):
        classes_of(drawn_cover(site, Patches("voronoi", 40), TABLE, 7).drop_attrs())
