"""Sentinel-2 products: metadata of products and tiles, inconsistencies, and images before and after 04.00."""

import re

import numpy as np
import products
import pytest
from lazy import check_place, no_compute

import fifesim
from fifesim.sensor.products.sentinel2_labels import sentinel2_metadata_file, sentinel2_product, sentinel2_tile

L1C, TILE = products.product_xml(1), products.tile_xml()


def written(folder, text, name="MTD_MSIL1C.xml"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def tile(folder, text):
    return written(folder, text, "MTD_TL.xml")


# ------------------------------------------------------------------------------------------- files


def test_metadata_file_is_found_in_its_folder(tmp_path):
    path = written(tmp_path, "<a/>", "MTD_MSIL2A.xml")
    assert sentinel2_metadata_file(tmp_path) == sentinel2_metadata_file(path) == path
    written(tmp_path, "<a/>")
    (tmp_path / "empty").mkdir()
    for path, said in (
        (tmp_path, "has both"),
        (tmp_path / "empty", r"has no MTD_MSIL1C.xml nor MTD_MSIL2A.xml: give the .SAFE folder"),
        (tmp_path / "none.SAFE", "there is no file or folder"),
        (written(tmp_path, "", "S2A.zip"), r"S2A.zip is no .SAFE folder .*unpack"),
    ):
        with pytest.raises(ValueError, match=said):
            sentinel2_metadata_file(path)


@pytest.mark.parametrize(
    "names",
    [
        ["metadata.xml", "B01.jp2", "B8A.jp2", "tileInfo.json"],
        ["R10m/B02.jp2", "R20m/B05.jp2"],
        ["granule_metadata.xml", "B04.tif", "SCL.tif"],
        ["S2A_OPER_MTD_SAFL1C_PDMC_20151206T093912_R090_V20151206T043239.xml"],
    ],
)
def test_other_layouts_raise(tmp_path, names):
    for name in names:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("")
    old = "OPER" in names[0]
    said = "form of before December 2016" if old else r"layout of the AWS .*dataspace\.copernicus\.eu\), unpack it"
    for path in (tmp_path,) if old else (tmp_path, tmp_path / names[0]):
        with pytest.raises(ValueError, match=said) as error:
            sentinel2_metadata_file(path)
        assert ("2016" in str(error.value)) == old


# ------------------------------------------------------------------------------------------- product


def test_offsets_may_differ_by_band(tmp_path):
    bands = sentinel2_product(written(tmp_path, L1C.replace('band_id="3">-1000', 'band_id="3">-900'))).bands[10]
    assert [round(band.offset, 12) for band in bands] == [-0.1, -0.1, -0.09, -0.1]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (L1C.replace("<Granule_List>", "<Granule_List><Granule/>"), "holds 2 granules: products of one tile are read"),
        (L1C.replace("RADIO_ADD_OFFSET", "OFFSET"), "04.00 has offsets, and the metadata have no RADIO_ADD"),
        (L1C.replace('band_id="3"', 'band_id="30"'), "no RADIO_ADD_OFFSET of B04"),
        (L1C.replace("IMAGE_FILE>", "IMAGE_FILE_2A>"), "names no IMAGE_FILE: .*05.00"),
        (L1C.replace("<IMAGE_FILE>GRANULE/", "<IMAGE_FILE>../x/"), "product's GRANULE folder"),
        (L1C.replace(">10000<", ">many<"), "QUANTIFICATION_VALUE must be a number, got 'many'"),
        (L1C.replace(">10000<", ">0<"), "QUANTIFICATION_VALUE must be above 0"),
        (L1C.replace("<U>", "<V>").replace("</U>", "</V>"), "the metadata have no U: is"),
        (re.sub("<U>.*</U>", "<U>0</U>", L1C), r"U .* must be in .*, got 0"),
        (L1C.replace("INDEX>0<", "INDEX>9<"), "no data is 9"),
        (L1C.replace("Level-1C_User", "Level-1B_User"), "MTD_MSIL1C.xml: it is 'Level-1B_User_Product': Level-1C"),
        (L1C.replace(">10000<", ">1000<"), r"QUANTIFICATION_VALUE = 1000, .* to 64.534 .* must begin in"),
        (L1C.replace('band_id="3">-1000', 'band_id="3">-10000'), r"RADIO_ADD_OFFSET = -10000 of B04 .* from -0.9999"),
        (L1C.replace('band_id="3">-1000', 'band_id="3">1000'), r"RADIO_ADD_OFFSET = 1000 of B04 .* from 0.1001"),
        (L1C.replace("INDEX>65535<", "INDEX>1300<"), r"SATURATED = 1300 .* to 0.0299"),
        (products.product_xml(2).replace(">10000<", ">1000<"), "BOA_QUANTIFICATION_VALUE = 1000, "),
        (re.sub("<U>.*</U>", "<U>1.1</U>", L1C), r"U .* must be in \[0.956, 1.045\], got 1.1"),
        (L1C.replace("<U>", "<U>1.0</U><U>"), r"U stands 2 times with different values, 0.98\d+, 1.0: .*fetch"),
        (L1C.replace('OFFSET band_id="4"', 'OFFSET band_id="3"'), "RADIO_ADD_OFFSET of 3 stands twice"),
        (L1C.replace("TEXT>SATURATED", "TEXT>NODATA"), "SPECIAL_VALUE_TEXT NODATA stands twice"),
    ],
)  # fmt: skip
def test_invalid_product_metadata_raises_a_one_line_message(tmp_path, text, said):
    with pytest.raises(ValueError, match=said) as error:
        sentinel2_product(written(tmp_path, text))
    assert len(str(error.value)) < 500 and "\n" not in str(error.value)


# ------------------------------------------------------------------------------------------- tile


def test_missing_mean_sun_is_computed_from_the_grid(tmp_path):
    zenith, azimuth = products.sun_grid()
    text = TILE.replace("57.820574357679", "NaN").replace("172.840206897213", "NaN")
    found = sentinel2_tile(tile(tmp_path, text))
    np.testing.assert_allclose([found.sza, found.saa], [zenith.mean(), azimuth.mean()], rtol=0, atol=0.01)
    with pytest.raises(ValueError, match="Mean_Sun_Angle and Sun_Angles_Grid are NaN"):
        sentinel2_tile(tile(tmp_path, text.replace(products.grids_xml(zenith), products.grids_xml(zenith * np.nan))))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (TILE[len(TILE) // 2 :], "", "is not valid XML"),
        ("2022-10-05T11:56:49.581767Z", "today", "SENSING_TIME must be a date and time such as .*'today'"),
        ("<VALUES>58.38", "<VALUES>58.38 much", "a grid of Zenith is no table"),
        ("VALUES>", "VALUE>", "not two rows and columns"),
        ("57.820574357679", "1.009", "Mean_Sun_Angle of zenith 1.009 and .* contradicts .*, whose mean is 57.8"),
        ("172.840206897213", "352.8", "contradicts Sun_Angles_Grid"),
        ("2022-10-05T", "2014-10-05T", "launch of the satellite, 2015-06-23, and today"),
        ("2022-10-05T", "2022-07-05T", "2022-07-05T11:56 UTC and 52.75 N, -8.19 E, the sun had a zenith angle of 31.0"),
        ("EPSG:32629", "EPSG:4326", "HORIZONTAL_CS_CODE must be a UTM zone such as EPSG:32629, got 'EPSG:4326'"),
    ],
)
def test_invalid_tile_metadata_raises(tmp_path, old, new, said):
    assert old in TILE
    with pytest.raises(ValueError, match=f"MTD_TL.xml.*{said}"):
        sentinel2_tile(tile(tmp_path, TILE.replace(old, new)))


# ------------------------------------------------------------------------------------------- images


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Product folder and the values of its files, by level and baseline."""
    root = tmp_path_factory.mktemp("sentinel2")
    return {
        (level, baseline): products.sentinel2(root, level, baseline)
        for level in (1, 2)
        for baseline in ("03.01", "04.00")
    }


def by_hand(files, names, size):
    dn = np.array([files[name, size] for name in names]).astype(float)
    return np.where((dn == 0) | (dn == 65535), np.nan, (dn - 1000) / 10000)


def test_scene_has_the_labels_of_a_fifesim_image(folders):
    path, _ = folders[1, "04.00"]
    with no_compute():
        scene = fifesim.open_sentinel2(path / "MTD_MSIL1C.xml")
    check_place(scene, products.UTM)
    bands = fifesim.instrument("MSI").select(["MSI2", "MSI3", "MSI4", "MSI8"])
    assert scene["band"].values.tolist() == [band.name for band in bands]
    np.testing.assert_array_equal(scene["wavelength"], [band.wavelength for band in bands])
    assert (scene.name, scene.dtype, scene.attrs["instrument"]) == ("toa_reflectance", np.float32, "MSI")
    assert "S2A_MSIL1C" in scene.attrs["history"] and "baseline 04.00" in scene.attrs["history"]


@pytest.mark.parametrize("chunks", ["auto", None, {"y": 5, "x": 7}])
def test_level_2a_opens_at_each_size(folders, chunks):
    """At 10 m, the classes of 20 m are repeated."""
    path, files = folders[2, "04.00"]
    for size, own, times in ((60, 60, 1), (20, 20, 1), (10, 20, 2)):
        names = ["B4", "B8"] if size == 10 else ["B4", "B8A"]
        scene = fifesim.open_sentinel2(path, size, bands=names, quality=True, chunks=chunks)
        np.testing.assert_allclose(scene, by_hand(files, names, size), rtol=0, atol=5e-8)
        np.testing.assert_array_equal(scene["quality"], files["SCL", own].repeat(times, axis=0).repeat(times, axis=1))
        assert scene.name == "surface_reflectance" and "vegetation" in scene["quality"].attrs["comment"]
    land = scene.where(scene["quality"].isin([4, 5]))
    assert 0 < int(np.isfinite(land[0]).sum()) < 144


def test_level_1c_has_cloud_masks_since_04_00(folders):
    path, files = folders[1, "04.00"]
    opaque, cirrus, snow = files["masks"].astype(int)
    for size, times in ((10, 6), (20, 3), (60, 1)):
        expected = (opaque + 2 * cirrus + 4 * snow).repeat(times, axis=0).repeat(times, axis=1)
        quality = fifesim.open_sentinel2(path, size)["quality"]
        np.testing.assert_array_equal(quality, expected)
        assert quality.dtype == np.uint8 and "cirrus" in quality.attrs["comment"]
    assert "quality" not in fifesim.open_sentinel2(folders[1, "03.01"][0]).coords


@pytest.mark.parametrize("chunks", [None, {"y": 5, "x": 7}])
@pytest.mark.parametrize("angles", ["centre", "pixel"])
def test_scene_does_not_depend_on_chunks(folders, chunks, angles):
    path, _ = folders[2, "03.01"]
    options = {"angles": angles, "bands": ["MSI4", "MSI8"]}
    expected = fifesim.open_sentinel2(path, 10, **options).compute()
    found = fifesim.open_sentinel2(path, 10, chunks=chunks, **options)
    assert (found.chunks is None) == (chunks is None)
    assert found.compute().identical(expected)


def test_angles_by_pixel_are_interpolated_between_nodes(tmp_path):
    """The tile of 5.4 km is larger than one interval of the grid."""
    path, _ = products.sentinel2(tmp_path, 1, width=5400)
    with pytest.raises(ValueError, match=r"no grids of the view of these bands: .*angles='centre'"):
        fifesim.open_sentinel2(path, 60, bands=["MSI1"], angles="pixel")
    scene = fifesim.open_sentinel2(path, 10, bands=["MSI4"], angles="pixel").isel(
        y=slice(None, None, 49), x=slice(None, None, 49)
    )
    rows, columns = ((np.arange(0, 540, 49) + 0.5) * 10 / 5000 for _ in range(2))
    zenith = 58.38 - 0.0448 * rows[:, None] - 0.006 * columns
    np.testing.assert_allclose(scene["sza"], zenith, rtol=0, atol=2e-4)
    np.testing.assert_allclose(scene["saa"], np.broadcast_to(171.9 + 0.0865 * columns, zenith.shape), rtol=0, atol=5e-4)
    view = 5.5 + 0.3 * columns + 0.1 * rows[:, None]
    np.testing.assert_allclose(scene["vza"], view, rtol=0, atol=2e-4)
    np.testing.assert_allclose(scene["vaa"], 281.4, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"resolution": 30}, "resolution must be 10, 20 or 60, got 30"),
        ({"bands": "B13"}, r"unknown band of MSI '\w+13'"),
        ({"angles": "tile"}, "angles must be 'centre' or 'pixel', got 'tile'"),
        ({"bands": ["B04", "B11"]}, "has no MSI11 of 10 m: it has it at 20 m, give resolution="),
    ],
)
def test_invalid_options_raise(folders, options, said):
    path, _ = folders[1, "04.00"]
    with pytest.raises(ValueError, match=said):
        fifesim.open_sentinel2(path, **options)
    assert fifesim.open_sentinel2(path, 60)["band"].values.tolist() == ["MSI1", "MSI9"]
    assert fifesim.open_sentinel2(path, 60, bands="B10")["band"].values.tolist() == ["MSI10"]


def test_missing_file_raises_with_its_name(tmp_path):
    first, second = (products.sentinel2(tmp_path, level)[0] for level in (1, 2))
    for path, name, said in (
        (second, "*_SCL_20m.jp2", r"SCL_20m\.jp2 is missing in .*quality=False"),
        (first, "MSK_CLASSI_B00.jp2", r"MSK_CLASSI_B00\.jp2 is missing in .*quality=False"),
        (second, "*_B04_10m.jp2", r"B04_10m\.jp2 is missing in "),
        (second, "MTD_TL.xml", r"MTD_TL\.xml is missing in the product: is it unpacked whole"),
    ):
        (file,) = path.rglob(name)
        file.unlink()
        with pytest.raises(ValueError, match=said):
            fifesim.open_sentinel2(path, 10, quality="quality" in said)
    assert "quality" not in fifesim.open_sentinel2(first, quality=False).coords


def test_changed_metadata_raise_and_an_instrument_may_be_given(tmp_path):
    path, _ = products.sentinel2(tmp_path)
    product, (tile,) = path / "MTD_MSIL1C.xml", path.rglob("MTD_TL.xml")
    no_responses = "is of Sentinel-2C, whose responses fifesim does not have: give instrument='MSI-C'"
    for file, old, new, said in (
        (tile, str(products.MEAN_VIEWS["1"][0]), "NaN", "no mean view of these bands: give angles='pixel'"),
        (product, "1959.66", "195.966", r"the scale of MSI2 .* means a solar irradiance of 195"),
        (product, "Sentinel-2A", "Sentinel-2C", no_responses),
    ):
        file.write_text(file.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
        with pytest.raises(ValueError, match=said):
            fifesim.open_sentinel2(path, 10, bands="B02")
    both = fifesim.open_sentinel2(path, 10, bands=["B02", "B03"], instrument="MSI-B")
    assert both.attrs["instrument"] == "MSI-B"
    assert float(both["vza"]) == pytest.approx(products.MEAN_VIEWS["2"][0], abs=1e-9)
