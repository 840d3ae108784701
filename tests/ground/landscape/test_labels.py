"""Tests of landscapes: variables and fields, maps of cover, same bits in windows and chunks, and errors."""

import numpy as np
import pyproj
import pytest
import rioxarray
import xarray as xr
from elevations import write
from lazy import ODD_CHUNKS, check_place, no_compute
from odc.geo.geobox import GeoBox
from scipy import stats

import fifesim
from fifesim.grids import cf
from fifesim.grids import grid as grids
from fifesim.ground.landscape.autoregression import field_seed, streaming_field
from fifesim.ground.landscape.classes import CoverClass, Field, class_table
from fifesim.ground.landscape.cover import Patches, patch_classes
from fifesim.ground.landscape.distribution import quantile_map, quantile_table
from fifesim.ground.landscape.field_labels import drawn_field
from fifesim.ground.landscape.labels import classes_of, cover_map, drawn_cover

DRAWN = {
    "soil": Field(sd=0.04, arp=0.2),
    "brown": Field(mean=0.2, sd=0.1, arp=0.1),
    "crown_cover": Field(mean=0.7, sd=0.15),
}
THREE_CLASSES = {
    "bare": fifesim.CoverClass(lai=0.0, canopy=fifesim.Canopy(background=0.2)),
    "grass": fifesim.CoverClass(lai="burned-grazed", arp=0.24),
    "wood": fifesim.CoverClass(lai=stats.gamma(9, scale=0.4)),
}
PATCHES = Patches("voronoi", 30)
WINDOW = (slice(6, 35), slice(7, 51))


@pytest.fixture(scope="module")
def make(site):
    """Function that makes the landscape of this file, or variants of it."""

    def made(grid=site, **changes):
        options = {"cover": PATCHES, "classes": THREE_CLASSES, "arp": 0.1, "seed": 7}
        return fifesim.landscape(grid, **options | DRAWN | changes)

    return made


@pytest.fixture(scope="module")
def land(make):
    return make()


@pytest.fixture(scope="module")
def patched(site):
    return fifesim.landscape(site, cover=PATCHES, classes=THREE_CLASSES, arp=0.1, seed=7)


def test_properties_are_mapped_from_fields_of_their_own_noise(site, land):
    made = {name: drawn_field(name, each, site, seed=7) for name, each in DRAWN.items()}
    place = *grids.lattice_position(site), tuple(site.shape)
    scores = {name: streaming_field(field_seed(7, name), DRAWN[name].arp, *place) for name in ("soil", "brown")}
    np.testing.assert_array_equal(made["soil"], scores["soil"] * DRAWN["soil"].sd)
    brown = quantile_map(scores["brown"], quantile_table(DRAWN["brown"].distribution("brown")))
    np.testing.assert_array_equal(made["brown"], brown)
    assert made["soil"].name == "soil" and made["soil"].attrs["arp"] == 0.2 and made["brown"].attrs["site"] == "FIFE"
    for name, each in made.items():
        np.testing.assert_array_equal(land[name], each)


def test_leaf_area_of_each_class_equals_a_scene_of_this_class(site, land, patched):
    """The white noise is common to all classes; other properties do not change leaf area."""
    for code, name, arp in ((2, "burned-grazed", 0.24), (3, THREE_CLASSES["wood"].lai, 0.1)):
        alone = fifesim.lai_scene(site, name, arp=arp, seed=7)
        of_class = (patched.cover == code).values
        assert 400 < of_class.sum() < 2000
        np.testing.assert_array_equal(patched.lai.values[of_class], alone.values[of_class])
    assert (patched.lai.values[patched.cover.values == 1] == 0).all()
    xr.testing.assert_equal(land[["lai", "cover"]], patched)


def test_landscapes_have_the_same_bits_in_windows_and_chunks(site, land, make):
    with no_compute():
        lazy, lazy_part = make(chunks={"y": 21, "x": 17}), make(site[WINDOW], chunks=13)
    assert all(each.chunks is not None for each in lazy.data_vars.values())
    found, part = lazy.compute(), make(site[WINDOW])
    for name in land:
        xr.testing.assert_identical(found[name], land[name])
        np.testing.assert_array_equal(part[name], land[name][WINDOW], err_msg=name)
        np.testing.assert_array_equal(lazy_part[name], land[name][WINDOW], err_msg=name)


def test_numbers_and_rasters_replace_fields(make, land):
    numbers = make(soil=-0.02, moisture=0.3, crown_cover=1)
    for name, value in (("soil", -0.02), ("moisture", 0.3), ("crown_cover", 1.0)):
        assert numbers[name].ndim == 0 and numbers[name] == value
    np.testing.assert_array_equal(numbers["brown"], land["brown"])
    halved = (land["soil"] * 0.5).assign_attrs(units="1")
    rasters = make(soil=halved, moisture=land["brown"].rename("moisture"))
    np.testing.assert_array_equal(rasters["soil"], halved)
    np.testing.assert_array_equal(rasters["moisture"], land["brown"])
    assert rasters["moisture"].attrs["long_name"] == "moisture of the soil"
    constant = make(brown=Field(mean=0.2), soil=Field())
    assert (float(constant["brown"]), float(constant["soil"])) == (0.2, 0.0)


TABLE = class_table([CoverClass("grass", code=10), CoverClass("wood", code=20), CoverClass("water", code=80)])
CODES = (10, 20, 80)


@pytest.fixture
def codes(site):
    return np.random.default_rng(3).choice(CODES, site.shape).astype(np.uint8)


def test_drawn_cover_has_the_codes_of_its_patches(site):
    cover = drawn_cover(site, Patches("voronoi", 40), TABLE, 7)
    place = [grids.coordinates(site)[axis].values for axis in ("y", "x")]
    numbers = patch_classes(Patches("voronoi", 40), (1 / 3,) * 3, 7, *place)
    np.testing.assert_array_equal(cover, np.array(CODES)[numbers])
    check_place(cover, site.crs)
    assert cover.dtype == np.int16 and cover.name == "cover" and cf.attributes("cover").items() <= cover.attrs.items()
    assert cover.attrs["flag_meanings"] == "grass wood water" and cover.attrs["flag_values"].tolist() == list(CODES)
    assert [(each.name, each.code) for each in classes_of(cover)] == [(each.name, each.code) for each in TABLE]
    with pytest.raises(ValueError, match="the classes of the cover are unknown"):
        classes_of(cover.drop_attrs())


def test_cover_map_on_the_same_grid_is_read_unchanged(tmp_path, site, codes):
    path = write(tmp_path / "cover.tif", codes, site.affine)
    opened = rioxarray.open_rasterio(path)
    for raster in (path, opened, opened.chunk({"x": 13}), opened[:, ::-1], opened.astype(float)):
        np.testing.assert_array_equal(cover_map(raster, site, TABLE), codes)
        with no_compute():
            lazy = cover_map(raster, site, TABLE, ODD_CHUNKS)
        check_place(lazy, site.crs)
        np.testing.assert_array_equal(lazy.compute(), codes)


def test_cover_map_is_resampled_by_nearest_or_most_frequent_class(tmp_path, site, codes):
    """Nearest class for smaller cells, most frequent class for larger cells."""
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


def test_reprojected_cells_have_the_class_with_the_largest_area(tmp_path, site, codes):
    """Compare with the areas of the classes, from 400 points of each cell transformed by pyproj."""
    path = write(tmp_path / "cover.tif", codes, site.affine)
    degrees = rioxarray.open_rasterio(path, masked=True).rio.reproject("EPSG:4326")[0]
    found = cover_map(degrees, site, TABLE).values
    along = 20
    rows, columns = (np.mgrid[: 45 * along, : 54 * along] + 0.5) / along
    to_degrees = pyproj.Transformer.from_crs(site.crs.proj, 4326, always_xy=True)
    columns, rows = ~degrees.rio.transform() * np.array(to_degrees.transform(*(site.affine * (columns, rows))))
    rows, columns = (
        np.clip(np.floor(each).astype(int), 0, n - 1) for each, n in zip((rows, columns), degrees.shape, strict=True)
    )
    points = degrees.values[rows, columns].reshape(45, along, 54, along)
    areas = np.stack([(points == code).mean(axis=(1, 3)) for code in CODES])
    first, second = np.sort(areas, axis=0)[:0:-1]
    # Five samples place a boundary within 0.1 of a cell along each axis, which moves two areas in opposite directions.
    clear = first - second > 0.4
    assert clear.sum() > 1300
    np.testing.assert_array_equal(found[clear], np.array(CODES)[areas.argmax(axis=0)][clear])


def test_missing_cover_stays_missing(tmp_path, site, codes):
    holes = codes.astype(float)
    holes[2:5, 7] = np.nan
    for given in (holes, np.where(np.isnan(holes), 255, holes).astype(np.uint8)):
        raster = rioxarray.open_rasterio(write(tmp_path / "cover.tif", given, site.affine))
        if given.dtype == np.uint8:
            raster = raster.assign_attrs(_FillValue=255)
        np.testing.assert_array_equal(cover_map(raster, site, TABLE), np.where(np.isnan(holes), -1, holes))


def test_landscape_has_labels_and_georeferencing(site, patched):
    assert list(patched.data_vars) == ["lai", "cover"]
    for name, variable in patched.data_vars.items():
        check_place(variable, site.crs)
        assert cf.attributes(name).items() <= variable.attrs.items()
    assert patched.cover.dtype == np.int16
    assert patched.lai.attrs["lai_distribution"] == "by class" and patched.lai.attrs["rng_seed"] == "7"
    assert [each.name for each in classes_of(patched.cover)] == list(THREE_CLASSES)


def test_default_landscape_is_learned_and_follows_the_hills(site):
    found, konza = fifesim.landscape(site, seed=7), fifesim.ground.Landscape.read("konza")
    hills = fifesim.flint_hills(konza.around(site), seed=7)
    np.testing.assert_array_equal(found.lai, konza.simulate(site, hills, seed=7).lai)
    assert found.attrs["site"] == "FIFE"
    level = fifesim.landscape(site, learned=konza, dem=hills * 0 + 400.0, seed=7)
    assert float(abs(level.lai - found.lai).mean()) > 0.1


def test_pastures_hold_three_treatments():
    grid = fifesim.fife_site(30)
    patched = fifesim.landscape(grid, cover="pastures", seed=1)
    assert patched.attrs["site"] == patched.lai.attrs["site"] == "FIFE"
    assert np.unique(patched.cover).tolist() == [1, 2, 3]
    means = [float(patched.lai.where(patched.cover == code).mean()) for code in (1, 2, 3)]
    expected = [fifesim.ground.lai_distribution(name).mean() for name in fifesim.ground.treatments()]
    np.testing.assert_allclose(means, expected, rtol=0.03)


def test_single_class_covers_the_landscape(site, lai):
    patched = fifesim.landscape(site, classes=fifesim.CoverClass("grass", lai="burned-grazed"), seed=7)
    assert (patched.cover == 1).all()
    np.testing.assert_array_equal(patched.lai, lai)


def test_map_of_leaf_area_replaces_the_leaf_area_of_classes(tmp_path, site, lai, make, land):
    path = write(tmp_path / "lai.tif", lai.values, site.affine)
    for given in (path, lai):
        mapped = make(lai=given)
        np.testing.assert_array_equal(mapped.lai, lai)
        np.testing.assert_array_equal(mapped.brown, land.brown)
    assert list(fifesim.landscape(site, lai=lai)) == ["lai"]


def test_map_of_cover_determines_leaf_area(tmp_path, site, patched):
    codes = np.where(patched.cover.values == 2, 255, patched.cover.values)
    path = write(tmp_path / "map.tif", codes, site.affine, nodata=255)
    of_map = fifesim.landscape(site, cover=path, classes=THREE_CLASSES, arp=0.1, seed=7)
    known = codes != 255
    np.testing.assert_array_equal(of_map.lai.values[known], patched.lai.values[known])
    assert np.isnan(of_map.lai.values[~known]).all() and (of_map.cover.values[~known] == -1).all()


def test_classes_are_read_from_the_attributes_of_the_cover(site, patched):
    again = fifesim.landscape(site, cover=patched.cover, arp=0.1, seed=7)
    xr.testing.assert_equal(again, patched)


def test_vertical_part_of_the_grids_crs_is_dropped(site):
    """All variables must have the same CRS."""
    above = GeoBox(site.shape, site.affine, pyproj.CRS("EPSG:26914+5703").to_wkt())
    made = [fifesim.landscape(grid, soil=Field(sd=0.03), brown=0.2, seed=7) for grid in (above, site)]
    xr.testing.assert_equal(*made)
