"""STAC items and collections are valid and agree with the files."""

import hashlib
import json

import numpy as np
import pytest
import rasterio
from rasterio.warp import transform, transform_bounds

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
    image = ProjectionExtension.ext(found.assets["image"])
    assert (image.code, image.shape) == ("EPSG:26914", [20, 30])
    assert image.transform == [30.0, 0.0, 704970.0, 0.0, -30.0, 4334220.0]
    view = ViewExtension.ext(found)
    with rasterio.open(small_run / "image.tif") as source:
        tags = source.tags()
    assert view.incidence_angle == 20.0
    assert view.sun_elevation == pytest.approx(90 - float(tags["sza"]), abs=1e-8)
    assert view.sun_azimuth == pytest.approx(float(tags["saa"]), abs=1e-8)
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


def test_bands_of_the_eo_extension_match_the_core_bands(item, pystac):
    """Version 1.1.0 of the extension has eo:bands, which odc-stac uses to find names; version 2 does not."""
    from pystac.extensions.eo import EOExtension

    found = pystac.Item.from_dict(item)
    for name, fields in (("image", ["name", "center_wavelength", "solar_illumination"]), ("truth", ["name"])):
        core, extension = item["assets"][name]["bands"], item["assets"][name]["eo:bands"]
        for field in fields:
            core_field = field if field == "name" else f"eo:{field}"
            assert [band[field] for band in extension] == [band[core_field] for band in core]
        assert [band.name for band in EOExtension.ext(found.assets[name]).bands] == [band["name"] for band in core]
    assert [band.common_name for band in EOExtension.ext(found.assets["image"]).bands] == ["green", "red", "nir"]
    allowed = {"name", "common_name", "description", "center_wavelength", "full_width_half_max", "solar_illumination"}
    assert all(set(band) <= allowed for asset in item["assets"].values() for band in asset.get("eo:bands", []))


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
