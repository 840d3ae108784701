"""Products of simulated scenes: readers return the scene, its angles, masks and truth, and wrong scenes are refused."""

import json
import os
import re
import tarfile
from fnmatch import fnmatchcase
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
import rasterio
import xarray as xr

import fifesim
from fifesim.base.geometry import Geometry, angle_between, sun_geometry
from fifesim.grids import cf, directions
from fifesim.grids import grid as grids
from fifesim.output import simulated_product
from fifesim.sensor.instrument_labels import coordinates_of_bands
from fifesim.sensor.products.landsat_labels import read_groups

DATA = Path(__file__).parents[1] / "data"
TIMES = {
    "L4TM": "1988-06-06T16:35:00",
    "TM": "1987-06-06T16:35:00",
    "ETM+": "2001-06-06T16:35:00",
    "OLI": "2020-06-06T16:35:12.345",
    "OLI2": "2022-06-06T16:35:00",
    "MSI": "2021-06-06T17:10:09.876",
    "MSI-B": "2021-06-06T17:10:00",
}
LANDSAT = ("L4TM", "TM", "ETM+", "OLI", "OLI2")
TM_BANDS = ["TM1", "TM2", "TM3", "TM4", "TM5", "TM7"]
FINE = ["MSI2", "MSI3", "MSI4", "MSI8"]
NORTH, SOUTH = ("EPSG:32614", 4334220.0), ("EPSG:32756", 6252000.0)


def bands_of(name, size):
    """Bands of an instrument with pixels of a size, except cirrus."""
    description = fifesim.instrument(name)
    return [band for band in description.bands if description.pixel(band) == size and band.name != "MSI10"]


def scene(name, size=30, side=240, place=NORTH, view=(3.0, 100.0), bands=None, by_pixel=False, seed=1):
    """Reflectance at the top of the atmosphere with a pixel of no data, on a square of a side in metres."""
    crs, north = place
    grid = fifesim.grid_at(crs, 704940, north, side, side, cell=size)
    wanted = [band for band in bands_of(name, size) if bands is None or band.name in bands]
    values = np.random.default_rng([seed, size]).uniform(0.02, 0.15, (len(wanted), *grid.shape))
    values[:, 0, 0] = np.nan
    time = TIMES[name] if place is NORTH else "2020-01-21T23:50:00"
    sun = sun_geometry(time, *((39.1, -96.6) if place is NORTH else (-33.8, 155.2)))
    geometry = Geometry(sun.sza, sun.saa, *view, earth_sun_distance=sun.earth_sun_distance)
    array = xr.DataArray(values, dims=("band", "y", "x"), coords=coordinates_of_bands(wanted))
    array = grids.place(array.rename("toa_reflectance"), grid)
    if by_pixel:
        # Directions to a sun and a sensor that stand over one place each, and a sensor track across the scene.
        across = xr.DataArray((array.x.values - array.x.values.mean()) / 786e3, dims="x", coords={"x": array.x})
        down = xr.DataArray((array.y.values - array.y.values.mean()) / 786e3, dims="y", coords={"y": array.y})
        tangent = np.tan(np.radians(view[0])) + across + 0 * down
        angles = {
            "sza": sun.sza + 10 * down + 5 * across,
            "saa": sun.saa + 20 * across + 10 * down,
            "vza": np.degrees(np.arctan(abs(tangent))),
            "vaa": view[1] + 180 * (tangent < 0),
        }
        for key, angle in angles.items():
            array = array.assign_coords({key: (("y", "x"), angle.transpose("y", "x").values, cf.attributes(key))})
        array = array.assign_coords(earth_sun_distance=sun.earth_sun_distance)
    else:
        array = directions.with_geometry(array, geometry)
    array = array.assign_coords(time=np.datetime64(time, "ns"))
    return cf.label(array, "toa_reflectance", history="made", instrument=name)


def counts(name, **options):
    """Image of digital numbers from `sense`, the last pixel of which is saturated in the third band."""
    toa = scene(name, **options)
    image = toa.fifesim.sense(name, onto=grids.geobox(toa), scaling="product" if name[0] in "OM" else "detector")
    numbers = np.random.default_rng(3).integers(20, 200, toa.shape) * (15 if image.dtype == np.uint16 else 1)
    image = image.copy(data=np.where(np.isnan(toa.values), 0, numbers).astype(image.dtype))
    image.data[2, -1, -1] = image.attrs["saturated"]
    return image


def step_of(name):
    """Reflectance of one digital number by band, without the cosine of the solar zenith, by the format's documents."""
    description = fifesim.instrument(name)
    if name.startswith("MSI"):
        return {band.name: 1e-4 for band in description.bands}
    if name.startswith("OLI"):
        return {band.name: 2e-5 for band in description.bands}
    # TM and ETM+: the range of radiance in 255 steps; a distance of the sun of up to 1.0167 astronomical units.
    return {
        band.name: np.pi * 1.0167**2 * (band.full_scale_radiance - band.min_radiance) / 255 / band.solar_irradiance
        for band in description.bands
    }


def check(again, given, name):
    """Compare an opened product with the scene: within half a digital number, no data where there are none."""
    given = given.sel(band=again.band)
    np.testing.assert_array_equal(np.isnan(again), np.isnan(given))
    mu_s = 1.0 if name.startswith("MSI") else np.cos(np.radians(given["sza"]))
    difference = abs(again - given) * mu_s
    for band, step in step_of(name).items():
        if band in again.band:
            assert difference.sel(band=band).max() <= 0.5 * step * (1 + 1e-3)
    assert again.time.values == given.time.values
    np.testing.assert_array_equal(again.x, given.x)


def separation(one, other, kind):
    """Largest angle between directions of two scenes. [degree]"""
    pairs = [np.broadcast_arrays(*(scene[f"{kind}{angle}a"].values for angle in "za")) for scene in (one, other)]
    return np.nanmax(angle_between(*pairs[0], *pairs[1]))


@pytest.mark.parametrize("name", LANDSAT)
def test_landsat_product_opens_as_the_scene(tmp_path, name):
    given = scene(name, view=(0.0, 0.0))
    product = given.fifesim.to_landsat_l1(tmp_path)
    again = fifesim.open_landsat(product)
    check(again, given, name)
    assert separation(again, given, "s") < 1e-6 and separation(again, given, "v") < 1e-6
    assert fifesim.open_landsat(next(product.glob("*_MTL.xml"))).equals(again)
    assert [path.name for path in tmp_path.iterdir()] == [product.name]


@pytest.mark.parametrize("name", ["TM", "OLI"])
def test_landsat_product_keeps_angles_by_pixel(tmp_path, name):
    given = scene(name, by_pixel=True, view=(0.05, 100.0), side=6000)
    again = fifesim.open_landsat(given.fifesim.to_landsat_l1(tmp_path), angles="pixel")
    check(again, given, name)
    # Azimuths near nadir have no meaning of their own: directions are compared.
    assert separation(again, given, "s") < 0.01 and separation(again, given, "v") < 0.01
    with pytest.raises(ValueError, match="off nadir"):
        fifesim.open_landsat(next(tmp_path.iterdir()))


@pytest.mark.parametrize("name", ["MSI", "MSI-B"])
@pytest.mark.parametrize("size", [10, 20, 60])
def test_sentinel2_product_opens_as_the_scene(tmp_path, name, size):
    given = scene(name, size)
    again = fifesim.open_sentinel2(given.fifesim.to_sentinel2_l1c(tmp_path), size)
    check(again, given, name)
    assert separation(again, given, "s") < 1e-6 and separation(again, given, "v") < 1e-6
    assert again.earth_sun_distance == pytest.approx(given.earth_sun_distance.item(), abs=1e-9)


@pytest.mark.parametrize("side", [6000, 48000])
def test_sentinel2_product_keeps_angles_by_pixel(tmp_path, side):
    """A scene of two nodes along a side, and one of eleven."""
    given = scene("MSI", 60, by_pixel=True, side=side)
    again = fifesim.open_sentinel2(given.fifesim.to_sentinel2_l1c(tmp_path), 60, angles="pixel")
    check(again, given, "MSI")
    assert separation(again, given, "s") < 0.01 and separation(again, given, "v") < 0.01


def test_all_bands_of_sense_are_written(tmp_path):
    """Trees of `sense` with all pixel sizes, of MSI and of OLI with its panchromatic and cirrus bands."""
    grid = fifesim.grid_at("EPSG:32614", 704940, 4334220, 600, 480, cell=5)
    lai = fifesim.lai_scene(grid, seed=7)
    for name, sizes in (("MSI", (10, 20, 60)), ("OLI", (30, 15))):
        rho = lai.fifesim.surface_reflectance(name, time=f"{TIMES[name]}Z")
        tree = rho.fifesim.to_toa().fifesim.sense(name)
        write = tree.fifesim.to_sentinel2_l1c if name == "MSI" else tree.fifesim.to_landsat_l1
        product = write(tmp_path, truth=xr.Dataset({"lai": lai}))
        for size in sizes:
            given = tree[f"{size}m"].dn.fifesim.to_reflectance()
            names = given.band.values.tolist()
            opener = fifesim.open_sentinel2 if name == "MSI" else fifesim.open_landsat
            again = opener(product, *([size] if name == "MSI" else []), bands=names)
            check(again, given, name)
        assert fifesim.open_image(product / "truth" / "lai.tif").equals(lai)


@pytest.mark.parametrize("name", ["TM", "ETM+"])
def test_digital_numbers_of_the_detector_stay(tmp_path, name):
    image = counts(name)
    product = image.fifesim.to_landsat_l1(tmp_path)
    for band in image.band.values:
        with rasterio.open(next(product.glob(f"*_B{band[-1]}.TIF"))) as source:
            np.testing.assert_array_equal(source.read(1), image.sel(band=band))
            assert source.nodata == 0 and source.tags()["TIFFTAG_IMAGEDESCRIPTION"].startswith("Simulated scene")


def test_landsat_product_south_of_the_equator_has_negative_northings(tmp_path):
    """As in products of USGS, which use the northern zone everywhere."""
    given = scene("OLI", place=SOUTH, view=(0.0, 0.0))
    product = given.fifesim.to_landsat_l1(tmp_path)
    with rasterio.open(next(product.glob("*_B4.TIF"))) as source:
        assert source.crs.to_epsg() == 32656 and source.bounds.top == 6252000 - 1e7
    group = read_groups(next(product.glob("*_MTL.txt")))["PROJECTION_ATTRIBUTES"]
    assert (group["UTM_ZONE"], group["CORNER_UL_PROJECTION_Y_PRODUCT"]) == ("56", "-3748015.000")
    # A degree of the meridian has 110.9 km at 34 degrees south, and the zone's scale here is 1.0001.
    assert float(group["CORNER_UL_LAT_PRODUCT"]) == pytest.approx(-33.85, abs=0.03)
    again = fifesim.open_landsat(product)
    check(again, grids.place(given, grids.geobox(again)), "OLI")


def masks(image):
    """True cloud over the second row, half cloud in one pixel, and shadow over the third row."""
    cloud = grids.place(xr.DataArray(np.zeros(image.shape[1:]), dims=("y", "x")), grids.geobox(image))
    shadow = cloud.copy()
    cloud[1], cloud[4, 4], cloud[4, 5], shadow[2] = 1.0, 0.5, 0.49, 1.0
    return xr.Dataset({"cloud": cloud, "shadow": shadow > 0})


def test_landsat_quality_bands(tmp_path):
    """Values as in real products: 21824 clear, 22280 cloud, 23888 shadow, 1 fill (USGS, Quality Assessment bands)."""
    for name, clear, cloud, shadow in (("OLI", 21824, 22280, 23888), ("TM", 5440, 5896, 7504)):
        image = counts(name)
        product = image.fifesim.to_landsat_l1(tmp_path, truth=masks(image))
        with rasterio.open(next(product.glob("*QA_PIXEL.TIF"))) as source:
            quality = source.read(1)
        with rasterio.open(next(product.glob("*QA_RADSAT.TIF"))) as source:
            saturated = source.read(1)
        assert (quality[0, 0], quality[0, 1], quality[1, 3], quality[4, 4]) == (1, clear, cloud, cloud)
        assert (quality[2, 3], quality[4, 5]) == (shadow, clear)
        assert (saturated[-1, -1], np.count_nonzero(saturated)) == (1 << 2, 1)
        again = fifesim.open_landsat(product, angles="pixel")
        assert np.isnan(again).sum() == again.sizes["band"] + 1 and np.isnan(again[2, -1, -1])
        group = read_groups(next(product.glob("*_MTL.txt")))["IMAGE_ATTRIBUTES"]
        assert (group["SATURATION_BAND_3"], group["SATURATION_BAND_2"]) == ("Y", "N")
        assert float(group["CLOUD_COVER"]) == pytest.approx(100 * 9 / 63, abs=0.005)


def test_sentinel2_masks(tmp_path):
    image = counts("MSI", size=10)
    truth = masks(image)
    truth["cloud"][6:12, 6:12] = np.arange(6) > 2
    product = image.fifesim.to_sentinel2_l1c(tmp_path, truth=truth)
    quality = fifesim.open_sentinel2(product).quality.values
    # Half of the second pixel of 60 m along both axes; one row of six is less than half.
    assert (quality[6:12, 6:12] == 1).all() and quality.sum() == 36
    with rasterio.open(next(product.glob("GRANULE/*/QI_DATA/MSK_QUALIT_B04.jp2"))) as source:
        layers = source.read()
    assert (layers.shape[0], layers[5].sum(), layers[5, 0, 0], layers[7].sum(), layers[7, -1, -1]) == (8, 1, 1, 1, 1)
    with rasterio.open(next(product.glob("GRANULE/*/QI_DATA/MSK_DETFOO_B04.jp2"))) as source:
        assert set(np.unique(source.read(1))) == {0, 7}
    with rasterio.open(next(product.glob("GRANULE/*/IMG_DATA/*_TCI.jp2"))) as source:
        red = source.read(1)
    # 255 is a reflectance of 0.3558.
    expected = np.rint(image.fifesim.to_reflectance().sel(band="MSI4").values * 255 / 0.3558).clip(1, 255)
    expected[0, 0], expected[-1, -1] = 0, 255
    np.testing.assert_array_equal(red, expected)


@pytest.mark.parametrize("name", ["OLI", "MSI"])
def test_every_file_with_room_states_the_simulation(tmp_path, name):
    given = scene(name, 30 if name == "OLI" else 10)
    write = given.fifesim.to_landsat_l1 if name == "OLI" else given.fifesim.to_sentinel2_l1c
    product = write(tmp_path)
    assert re.search("SIM", product.name)
    texts = [path for path in product.rglob("*") if path.suffix in (".txt", ".xml", ".json")]
    assert len(texts) == 4
    for path in texts:
        assert "Simulated scene made by fifesim" in path.read_text(encoding="utf-8")
    described = json.loads((product / "truth" / "scene.json").read_text())
    assert described["image"]["instrument"] == name and described["bands"] == given.band.values.tolist()
    assert described["coordinates"]["sza"] == given.sza.item()


def broken(monkeypatch):
    """Make the last step of writing fail."""

    def fail(*given):
        raise OSError("no space left")

    monkeypatch.setattr(simulated_product, "write_truth", fail)


@pytest.mark.parametrize("write", ["to_landsat_l1", "to_sentinel2_l1c"])
def test_product_appears_when_it_is_complete(tmp_path, monkeypatch, write):
    name, size = ("OLI", 30) if write == "to_landsat_l1" else ("MSI", 10)
    folder = tmp_path / "new" / "folder"
    product = getattr(scene(name, size).fifesim, write)(folder)
    files = {path: path.read_bytes() for path in product.rglob("*") if path.is_file()}
    other = getattr(scene(name, size, seed=2).fifesim, write)
    with pytest.raises(FileExistsError, match="overwrite=True"):
        other(folder)
    with monkeypatch.context() as patch:
        broken(patch)
        with pytest.raises(OSError, match="no space"):
            other(folder, overwrite=True)
    assert {path: path.read_bytes() for path in product.rglob("*") if path.is_file()} == files
    assert [path.name for path in folder.iterdir()] == [product.name]
    assert other(folder, overwrite=True) == product
    assert {path: path.read_bytes() for path in product.rglob("*") if path.is_file()} != files
    (product / "SIMULATED.txt").unlink()
    with pytest.raises(FileExistsError, match=r"no SIMULATED\.txt"):
        other(folder, overwrite=True)


def no_utm(array):
    return grids.place(array, fifesim.grid_at("EPSG:26914", 704940, 4334220, 240, 240, cell=30))


def at(array, time):
    return array.assign_coords(time=np.datetime64(time, "ns"))


# Scene, change, and words of the error.
REFUSED = {
    "cells of 20 m": ("TM", lambda array: scene("TM", 30).isel(y=[0, 1]).pipe(finer), ["20 x 20 m", "30 m", "sense"]),
    "a band is missing": ("TM", lambda array: array.isel(band=slice(1, None)), ["no TM1", "bands="]),
    "before the launch": (
        "OLI",
        lambda array: at(array, "1987-06-06T16:35"),
        ["1987-06-06", "from 2013-02-11", "time="],
    ),
    "after the last image": ("TM", lambda array: at(array, "2013-06-06T16:35"), ["2013-06-06", "2011-11-18"]),
    "of the future": ("OLI", lambda array: at(array, "2090-06-06T16:35"), ["2090-06-06", "from 2013-02-11"]),
    "no time": ("TM", lambda array: array.drop_vars("time"), ["no time", "time='2021"]),
    "several dates": ("TM", lambda array: array.drop_vars("time").expand_dims(time=2), ["one date", "isel(time=0)"]),
    "no sun": ("TM", lambda array: array.drop_vars("sza"), ["no sza"]),
    "the sun of another time": ("TM", lambda array: array.assign_coords(sza=40.0), ["sza 40.00", "at most 1 degree"]),
    "another distance of the sun": ("TM", lambda array: array.assign_coords(earth_sun_distance=1.0), ["1.0", "within"]),
    "too bright": ("TM", lambda array: array.where(array.x < array.x[4], 1.5), ["1.5", "sense", "hold"]),
    "too dark": ("OLI", lambda array: array.where(array.x < array.x[4], -0.2), ["-0.2", "hold"]),
    "another CRS": ("TM", no_utm, ["EPSG:26914", "WGS 84 / UTM", "grid_at"]),
    "another instrument": (
        "TM",
        lambda array: array.assign_attrs(instrument="AVHRR"),
        ["AVHRR", "L4TM, TM", "to_geotiff"],
    ),
    "surface reflectance": (
        "TM",
        lambda array: array.assign_attrs(standard_name="surface_bidirectional_reflectance"),
        ["surface"],
    ),
    "a side of 230 m": ("MSI", lambda array: array.isel(y=slice(23)), ["multiples of 60 m", "230 x 240 m"]),
    "angles that vary at random": (
        "MSI",
        lambda array: array.assign_coords(
            sza=(("y", "x"), array.sza.values + np.random.default_rng(1).uniform(-0.5, 0.5, array.shape[1:]))
        ),
        ["smooth over 5000 m"],
    ),
}


def finer(array):
    """Cells of 20 m."""
    grid = fifesim.grid_at("EPSG:32614", 704940, 4334220, 160, 40, cell=20)
    return grids.place(array, grid)


@pytest.mark.parametrize("title", REFUSED)
def test_wrong_scenes_are_refused(tmp_path, title):
    name, change, words = REFUSED[title]
    given = change(scene(name, 10 if name == "MSI" else 30))
    write = given.fifesim.to_sentinel2_l1c if name == "MSI" else given.fifesim.to_landsat_l1
    with pytest.raises(ValueError) as caught:
        write(tmp_path)
    for word in words:
        assert word in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_truth_on_another_grid_does_not_become_a_mask(tmp_path):
    image, other = scene("OLI"), masks(scene("OLI", side=300))
    with pytest.raises(ValueError, match=r"truth\['cloud'\].*grid of the image.*aggregate"):
        image.fifesim.to_landsat_l1(tmp_path, truth=other)
    with pytest.raises(ValueError, match="names no file: rename it"):
        image.fifesim.to_landsat_l1(tmp_path, truth=xr.Dataset({"a/b": other["cloud"]}))
    assert list(tmp_path.iterdir()) == []


# Keys of metadata.


def paths_of(element, above=""):
    """Paths of the elements of XML, without namespaces."""
    found = {f"{above}{element.tag.rpartition('}')[2]}"}
    return found.union(*(paths_of(each, f"{min(found)}/") for each in element))


def landsat_keys(path):
    return {f"{group}/{key}" for group, values in read_groups(path).items() for key in values}


@pytest.fixture(scope="module")
def real(tmp_path_factory):
    """Metadata of real products."""
    folder = tmp_path_factory.mktemp("real")
    with tarfile.open(DATA / "real_products" / "metadata.tar.xz") as archive:
        archive.extractall(folder, filter="data")
    return folder


REAL = {
    "LC08": "landsat/LC08_L1TP_090084_20160121_20200907_02_T1/*_MTL.txt",
    "LE07": "landsat/LE07_L1TP_107068_20220310_20220405_02_T1/*_MTL.txt",
    "LT04": "landsat/LT04_L1TP_143021_19890818_20200916_02_T1/*_MTL.xml",
    "product": "sentinel2/S2A_MSIL1C_20240101T102431_N0510*/MTD_MSIL1C.xml",
    "tile": "sentinel2/S2A_MSIL1C_20210908T042701_N0301*/MTD_TL.xml",
}


def test_metadata_have_the_keys_of_real_products(tmp_path, real):
    """``data/product_keys.csv`` lists the other keys with the reasons; each row is needed."""
    table = pd.read_csv(DATA / "product_keys.csv", comment="#")
    used = set()
    grid = fifesim.grid_at("EPSG:32614", 704940, 4334220, 600, 480, cell=15)
    lai = fifesim.lai_scene(grid, seed=7)
    trees = {}
    for name in ("OLI", "ETM+", "L4TM"):
        rho = lai.fifesim.surface_reflectance(name, time=f"{TIMES[name]}Z")
        trees[name] = rho.fifesim.to_toa().fifesim.sense(name)
    written = {
        kind: landsat_keys(next(trees[name].fifesim.to_landsat_l1(tmp_path).glob("*_MTL.txt")))
        for kind, name in (("LC08", "OLI"), ("LE07", "ETM+"), ("LT04", "L4TM"))
    }
    product = scene("MSI", 10).fifesim.to_sentinel2_l1c(tmp_path)
    for kind, path in (("product", product / "MTD_MSIL1C.xml"), ("tile", next(product.glob("GRANULE/*/MTD_TL.xml")))):
        written[kind] = paths_of(ElementTree.parse(path).getroot())
    for kind, pattern in REAL.items():
        (path,) = real.glob(pattern)
        keys = landsat_keys(path) if kind[0] == "L" else paths_of(ElementTree.parse(path).getroot())
        assert len(keys) > 40
        for key in keys - written[kind]:
            reasons = [row.key for row in table.itertuples() if fnmatchcase(key, row.key)]
            assert reasons, f"{kind}: nothing states why {key} is not written"
            used.update(reasons)
    assert set(table.key) == used and table.reason.str.len().min() > 10


# Other readers.


@pytest.mark.filterwarnings("ignore:Dataset has no geotransform")
def test_gdal_opens_both_products(tmp_path):
    """GDAL's SENTINEL2 driver on the metadata, and the bands of Landsat."""
    given = scene("MSI", 10)
    product = given.fifesim.to_sentinel2_l1c(tmp_path)
    with rasterio.open(product / "MTD_MSIL1C.xml") as source:
        (ten,) = [name for name in source.subdatasets if ":10m:" in name]
        assert source.tags()["PROCESSING_BASELINE"] == "99.99" and "N9999" in source.tags()["PRODUCT_URI"]
    with rasterio.open(ten) as source:
        names = [f"MSI{description.partition(',')[0][1:]}" for description in source.descriptions]
        dn, grid = source.read().astype(float), (source.crs.to_epsg(), tuple(source.bounds))
        assert source.tags(1)["RADIO_ADD_OFFSET"] == "-1000"
    assert grid == (32614, (704940, 4333980, 705180, 4334220)) and sorted(names) == sorted(FINE)
    found = np.where(dn == 0, np.nan, (dn - 1000) / 10000)
    np.testing.assert_allclose(found, given.sel(band=names), rtol=0, atol=0.5e-4 * (1 + 1e-6))
    given = scene("OLI")
    product = given.fifesim.to_landsat_l1(tmp_path)
    with rasterio.open(next(product.glob("*_B5.TIF"))) as source:
        dn = source.read(1, masked=True).astype(float).filled(np.nan)
        assert (source.crs.to_epsg(), source.res) == (32614, (30, 30))
    expected = given.sel(band="OLI5") * np.cos(np.radians(given.sza))
    np.testing.assert_allclose(2e-5 * dn - 0.1, expected, rtol=0, atol=1e-5 * (1 + 1e-6))


def test_satpy_opens_both_products(tmp_path):
    satpy = pytest.importorskip("satpy")
    pytest.importorskip("geotiepoints")
    given = scene("MSI", 10)
    product = given.fifesim.to_sentinel2_l1c(tmp_path)
    files = [*product.glob("GRANULE/*/IMG_DATA/*_B*.jp2"), *product.glob("**/MTD_*.xml")]
    found = satpy.Scene(reader="msi_safe", filenames=[str(path) for path in files])
    found.load(["B04", "solar_zenith_angle"])
    np.testing.assert_allclose(found["B04"] / 100, given.sel(band="MSI4"), rtol=0, atol=0.5e-4 * (1 + 1e-3))
    np.testing.assert_allclose(found["solar_zenith_angle"], given.sza.item(), rtol=0, atol=0.01)
    assert found["B04"].attrs["area"].crs.to_epsg() == 32614
    assert found["B04"].attrs["area"].area_extent == (704940, 4333980, 705180, 4334220)
    given = scene("OLI")
    product = given.fifesim.to_landsat_l1(tmp_path)
    files = [*product.glob("*.TIF"), *product.glob("*_MTL.xml")]
    found = satpy.Scene(reader="oli_tirs_l1_tif", filenames=[str(path) for path in files])
    found.load(["B5", "solar_zenith_angle"])
    # satpy does not divide Landsat's reflectance by the cosine of the solar zenith.
    expected = given.sel(band="OLI5") * np.cos(np.radians(given.sza.item()))
    np.testing.assert_allclose(found["B5"] / 100, expected, rtol=0, atol=1e-5 * (1 + 1e-2))
    assert found["B5"].attrs["area"].area_extent == (704940, 4333980, 705180, 4334220)
    assert found["B5"].attrs["area"].crs.to_epsg() == 32614


def test_eoreader_opens_both_products(tmp_path):
    reader = pytest.importorskip("eoreader.reader").Reader()
    bands = pytest.importorskip("eoreader.bands")
    for name in ("MSI", "OLI", "ETM+", "TM"):
        given = scene(name, 10 if name == "MSI" else 30)
        write = given.fifesim.to_sentinel2_l1c if name == "MSI" else given.fifesim.to_landsat_l1
        product = reader.open(write(tmp_path), remove_tmp=True)
        red = product.load(bands.RED)[bands.RED].squeeze()
        band, step = given.band.values[{"MSI": 2, "OLI": 3}.get(name, 2)], step_of(name)
        # EOReader does not divide Landsat's reflectance by the cosine of the solar zenith.
        mu_s = 1.0 if name == "MSI" else np.cos(np.radians(given.sza.item()))
        np.testing.assert_allclose(red, given.sel(band=band) * mu_s, rtol=0, atol=0.5 * step[band] * (1 + 1e-3))
        assert red.rio.crs.to_epsg() == 32614 and red.rio.bounds() == (704940, 4333980, 705180, 4334220)
        azimuth, zenith = product.get_mean_sun_angles()
        assert angle_between(zenith, azimuth, given.sza.item(), given.saa.item()) < 0.01
        assert pd.Timestamp(product.datetime) == pd.Timestamp(TIMES[name]).floor("s")


def test_earlier_product_is_restored_if_the_new_one_cannot_be_moved(tmp_path, monkeypatch):
    with simulated_product.product_folder(tmp_path, "product") as new:
        (new / "first").touch()
    move = os.replace

    def failing(source, target):
        if Path(target) == tmp_path / "product" and (Path(source) / "second").exists():
            raise OSError("no space")
        move(source, target)

    monkeypatch.setattr(os, "replace", failing)
    with (
        pytest.raises(OSError, match="no space"),
        simulated_product.product_folder(tmp_path, "product", overwrite=True) as new,
    ):
        (new / "second").touch()
    assert [path.name for path in tmp_path.iterdir()] == ["product"]
    assert sorted(path.name for path in (tmp_path / "product").iterdir()) == ["SIMULATED.txt", "first"]
