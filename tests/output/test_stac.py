"""Other programs open the files and the STAC item of a run at the right location and with the right values."""

import hashlib
import json

import numpy as np
import pytest
import rasterio
import xarray as xr
from rasterio.warp import transform, transform_bounds

import fifesim
from fifesim.output import stac
from fifesim.scenario.scenario import parse_scenario


@pytest.fixture(scope="module")
def item(small_run):
    return json.loads((small_run / "item.json").read_text(encoding="utf-8"))


@pytest.fixture
def pystac():
    return pytest.importorskip("pystac")


def test_an_item_is_valid(item, pystac):
    """Validation uses the core schemas bundled with pystac; extension schemas are online only."""
    pytest.importorskip("jsonschema")
    assert {asset["href"][2:] for asset in item["assets"].values()} == {
        "image.tif", "image.qml", "truth.tif", "truth.qml", "scene.zarr", "quicklook.png", "report.html",
        "scenario.toml",
    }  # fmt: skip
    core = pystac.Item.from_dict(item | {"stac_extensions": []})
    (schema,) = core.validate()
    assert schema.endswith("item.json")


def test_extensions_of_an_item_are_readable_and_declared(item, small_run, pystac):
    from pystac.extensions.projection import ProjectionExtension
    from pystac.extensions.view import ViewExtension

    found = pystac.Item.from_dict(item)
    image, view = ProjectionExtension.ext(found.assets["image"]), ViewExtension.ext(found)
    assert (image.code, image.shape) == ("EPSG:26914", [20, 30])
    assert image.transform == [30.0, 0.0, 704970.0, 0.0, -30.0, 4334220.0]
    sun = fifesim.open_image(small_run / "image.tif")
    angles = view.incidence_angle, view.sun_elevation, view.sun_azimuth
    assert angles == pytest.approx((20.0, 90 - float(sun.sza), float(sun.saa)), abs=1e-8)
    # Azimuth from the nadir point of the sensor, which lies in the east, to the scene.
    assert view.azimuth == 280.0
    names = {"proj": "projection"} | {name: name for name in ("eo", "raster", "processing", "file")}
    for prefix, name in names.items():
        assert f'"{prefix}:' in json.dumps(item) and any(f"/{name}/v" in each for each in item["stac_extensions"])
    assert found.properties["instruments"] == ["tm"] and found.datetime.isoformat() == "1987-06-06T16:35:00+00:00"


def test_size_and_checksum_of_each_file_are_in_the_item(item, small_run):
    """A multihash: 12 for SHA-256, and its length of 32 bytes."""
    for asset in item["assets"].values():
        path = small_run / asset["href"]
        if path.is_file():
            content = path.read_bytes()
            assert asset["file:size"] == len(content)
            assert asset["file:checksum"] == f"1220{hashlib.sha256(content).hexdigest()}"
        else:
            assert asset["file:size"] == sum(each.stat().st_size for each in path.rglob("*") if each.is_file())


def test_off_nadir_is_the_angle_at_the_satellite(item):
    """Law of sines for pixel, satellite 705 km above the ground, and centre of the Earth."""
    earth, angle = 6371.0, np.radians(item["properties"]["view:off_nadir"])
    at_pixel = np.pi - np.radians(20.0)
    assert np.sin(angle) / earth == pytest.approx(np.sin(at_pixel) / (earth + 705), rel=1e-9)
    assert angle < np.radians(20.0)


def test_bands_of_the_item_match_the_file(item, small_run):
    bands = item["assets"]["image"]["bands"]
    with rasterio.open(small_run / "image.tif") as image:
        assert [band["name"] for band in bands] == list(image.descriptions)
        assert [band["raster:scale"] for band in bands] == list(image.scales)
        assert [band["raster:offset"] for band in bands] == list(image.offsets)
        assert {(band["data_type"], band["nodata"]) for band in bands} == {("uint8", 0)}
    assert [band["eo:common_name"] for band in bands] == ["green", "red", "nir"]
    assert bands[2]["eo:solar_illumination"] == 1031.0
    assert {band["nodata"] for band in item["assets"]["truth"]["bands"]} == {"nan"}
    # Version 1.1.0 of the extension has eo:bands, which odc-stac uses to find names; version 2 does not.
    for band, old in zip(bands, item["assets"]["image"]["eo:bands"], strict=True):
        assert old.items() >= {"name": band["name"], "center_wavelength": band["eo:center_wavelength"]}.items()
        assert old["solar_illumination"] == band["eo:solar_illumination"]


def test_footprint_encloses_the_pixels(item):
    """Quarter points of the edges, transformed by GDAL, agree to 0.1 m, counterclockwise from the southwest."""
    (ring,) = item["geometry"]["coordinates"]
    west, south, east, north = 704970, 4333620, 705870, 4334220
    share = np.arange(4) / 4
    x = np.concatenate([west + share * 900, np.full(4, east), east - share * 900, np.full(4, west)])
    y = np.concatenate([np.full(4, south), south + share * 600, np.full(4, north), north - share * 600])
    assert ring[0] == ring[-1] and len(ring) == 17
    expected = np.transpose(transform("EPSG:26914", "EPSG:4326", x, y))
    np.testing.assert_allclose(ring[:-1], expected, rtol=0, atol=1e-6)
    bounds = transform_bounds("EPSG:26914", "EPSG:4326", west, south, east, north)
    np.testing.assert_allclose(item["bbox"], bounds, rtol=0, atol=1e-6)


def test_scenario_without_a_date_has_a_date_range(small_run, pystac):
    given = {"sza": 30.0, "saa": 120.0}
    place = {"grid": {"crs": "EPSG:32735", "west": 601020, "north": 7220040, "width": 900, "height": 600}}
    scenario = parse_scenario(place | {"geometry": given, "terrain": {"dem": "flat"}, "atmosphere": {"altitude": 1.2}})
    found = pystac.Item.from_dict(stac.item(scenario.complete(), small_run, "no date"))
    assert found.datetime is None
    assert found.properties["start_datetime"] < found.properties["end_datetime"]
    found.stac_extensions = []
    assert found.validate()


def test_collection_is_valid_and_links_to_its_items(item, tmp_path, pystac):
    moved = item | {"id": "moved", "bbox": [-96.0, 39.0, -95.9, 39.1]}
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    stac.write_collection(tmp_path, "trial", "Two scenes.", {"a/item.json": item, "b/item.json": moved})
    found = pystac.Collection.from_file(str(tmp_path / "collection.json"))
    assert found.validate()[0].endswith("collection.json")
    assert {each.id for each in found.get_items()} == {item["id"], "moved"}
    assert all(each.get_collection().id == "trial" for each in found.get_items())
    west, south, east, north = found.extent.spatial.bboxes[0]
    assert (west, south, east, north) == (item["bbox"][0], 39.0, -95.9, item["bbox"][3])
    assert [str(each.date()) for each in found.extent.temporal.intervals[0]] == ["1987-06-06", "1987-06-06"]


def test_band_has_the_common_name_with_the_nearest_centre():
    """Band 5 of OLI and bands 8 and 9 of MSI all lie in the range of the common name nir."""
    coords = {"wavelength": [0.865, 0.842, 0.945], "solar_irradiance": [951.0, 1037.0, 817.0]}
    found = [stac._spectral(coords, number) for number in (1, 2, 3)]
    assert [band["eo:common_name"] for band in found] == ["nir08", "nir", "nir09"]
    assert [band["eo:solar_illumination"] for band in found] == coords["solar_irradiance"]


# Corner and size of the run in the scenario [m].
WEST, NORTH, PIXEL, ROWS, COLUMNS = 704970.0, 4334220.0, 30.0, 20, 30


@pytest.mark.parametrize("name", ["image.tif", "truth.tif"])
def test_files_are_valid_cloud_optimised_geotiffs(small_run, name):
    cogeo = pytest.importorskip("rio_cogeo")
    valid, errors, warnings = cogeo.cog_validate(small_run / name, strict=True)
    assert valid, (errors, warnings)


def test_odc_stac_loads_the_item(small_run, pystac):
    stac = pytest.importorskip("odc.stac")
    item = pystac.Item.from_file(str(small_run / "item.json"))
    found = stac.load([item]).isel(time=0)
    np.testing.assert_allclose(found["x"], WEST + 30 * (np.arange(30) + 0.5), rtol=0, atol=1e-3)
    np.testing.assert_allclose(found["y"], NORTH - 30 * (np.arange(20) + 0.5), rtol=0, atol=1e-3)
    assert found.rio.crs.to_epsg() == 26914
    assert found["time"].values == np.datetime64("1987-06-06T16:35:00")
    image, truth = (fifesim.open_image(small_run / name) for name in ("image.tif", "truth.tif"))
    for name in ("TM2", "TM3", "TM4"):
        np.testing.assert_array_equal(found[name], image.sel(band=name))
        assert (found[name].dtype, found[name].attrs["nodata"]) == ("uint8", 0)
    for name in ("lai", "fpar"):
        np.testing.assert_array_equal(found[name], truth.sel(band=name))
        assert np.isnan(found[name].attrs["nodata"])
    for names in ({"image.2": "TM3"}, {"red": "TM3", "nir": "TM4"}):
        chosen = stac.load([item], bands=list(names)).isel(time=0)
        for name, band in names.items():
            np.testing.assert_array_equal(chosen[name], found[band])


def test_gdal_opens_the_cells_with_their_crs(small_run):
    """The wheels of rasterio include the Zarr driver; a cell is a ninth of a pixel wide."""
    with rasterio.Env() as env:
        if "Zarr" not in env.drivers():
            pytest.skip("this GDAL has no driver for Zarr")
    cells = xr.open_zarr(small_run / "scene.zarr", decode_coords="all")
    for name in ("lai", "surface_reflectance"):
        with rasterio.open(f'ZARR:"{small_run}/scene.zarr":/{name}') as source:
            assert source.crs.to_epsg() == 26914 and np.isnan(source.nodata)
            np.testing.assert_allclose(source.bounds, (WEST, NORTH - 600, WEST + 900, NORTH), rtol=0, atol=1e-6)
            np.testing.assert_array_equal(source.read().squeeze(), cells[name])
