"""Sentinel-2 products: metadata of products and tiles, inconsistencies, and images."""

import re

import numpy as np
import products
import pytest
from lazy import check_place, no_compute
from mistakes import mistakes

import fifesim
from fifesim.sensor.products.sentinel2_labels import sentinel2_metadata_file, sentinel2_product, sentinel2_tile

L1C, TILE = products.PRODUCTS[1], products.TILE


def written(folder, text, name="MTD_MSIL1C.xml"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


# ------------------------------------------------------------------------------------------- metadata


def test_metadata_file_is_found_in_its_folder(tmp_path):
    path = written(tmp_path, "<a/>", "MTD_MSIL2A.xml")
    assert sentinel2_metadata_file(tmp_path) == sentinel2_metadata_file(path) == path
    written(tmp_path, "<a/>")
    (tmp_path / "empty").mkdir()
    for path, said in (
        (tmp_path, "has both"),
        (tmp_path / "empty", r"has no MTD_MSIL1C.xml nor MTD_MSIL2A.xml: give the .SAFE folder"),
        (written(tmp_path, "", "S2A.zip"), r"S2A.zip is no .SAFE folder .*unpack"),
    ):
        with pytest.raises(ValueError, match=said):
            sentinel2_metadata_file(path)


AWS = r"layout of the AWS .*dataspace\.copernicus\.eu\), unpack it"
OLD = "S2A_OPER_MTD_SAFL1C_PDMC_20151206T093912_R090_V20151206T043239.xml"


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (["metadata.xml", "B01.jp2", "B8A.jp2", "tileInfo.json"], AWS),
        (["granule_metadata.xml", "B04.tif", "SCL.tif"], AWS),
        ([OLD], "form of before December 2016"),
    ],
)
def test_other_layouts_raise(tmp_path, names, said):
    for name in names:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("")
    for path in (tmp_path,) if names == [OLD] else (tmp_path, tmp_path / names[0]):
        with pytest.raises(ValueError, match=said):
            sentinel2_metadata_file(path)


PARTS = mistakes("sentinel2", "sentinel2 level 2", "sentinel2 tile", name="sensor_mistakes")


@pytest.mark.parametrize(("part", "changes", "said"), PARTS, ids=str)
def test_invalid_metadata_raises_a_one_line_message(tmp_path, part, changes, said):
    text = {"sentinel2": L1C, "sentinel2 level 2": products.PRODUCTS[2], "sentinel2 tile": TILE}[part]
    for old, new in zip(changes[::2], changes[1::2], strict=True):
        assert old in text
        text = text.replace(old, new)
    tile = part == "sentinel2 tile"
    path = written(tmp_path, text, "MTD_TL.xml" if tile else "MTD_MSIL1C.xml")
    with pytest.raises(ValueError, match=f"MTD_TL.xml.*{said}" if tile else said) as error:
        (sentinel2_tile if tile else sentinel2_product)(path)
    assert len(str(error.value)) < 500 and "\n" not in str(error.value)


def test_offsets_may_differ_by_band(tmp_path):
    bands = sentinel2_product(written(tmp_path, L1C.replace('band_id="3">-1000', 'band_id="3">-900'))).bands[10]
    assert [round(band.offset, 12) for band in bands] == [-0.1, -0.1, -0.09, -0.1]


def test_missing_mean_sun_is_computed_from_the_grid(tmp_path):
    text = TILE.replace("57.820574357679", "NaN").replace("172.840206897213", "NaN")
    found = sentinel2_tile(written(tmp_path, text, "MTD_TL.xml"))
    middle = 58.38 - 11 * (0.0448 + 0.006), 171.9 + 11 * 0.0865
    np.testing.assert_allclose([found.sza, found.saa], middle, rtol=0, atol=0.01)
    missing = re.sub(r"(?<=[ >])5[78][.\d]*", "NaN", text)
    with pytest.raises(ValueError, match="Mean_Sun_Angle and Sun_Angles_Grid are NaN"):
        sentinel2_tile(written(tmp_path, missing, "MTD_TL.xml"))


# ------------------------------------------------------------------------------------------- images


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Product folder and the values of its files, by level."""
    root = tmp_path_factory.mktemp("sentinel2")
    return {level: products.sentinel2(root, level) for level in (1, 2)}


def test_scene_has_the_labels_of_a_fifesim_image(folders):
    path, _ = folders[1]
    with no_compute():
        scene = fifesim.open_sentinel2(path / "MTD_MSIL1C.xml")
    check_place(scene, products.UTM)
    bands = fifesim.instrument("MSI").select(["MSI2", "MSI3", "MSI4", "MSI8"])
    assert scene["band"].values.tolist() == [band.name for band in bands]
    np.testing.assert_array_equal(scene["wavelength"], [band.wavelength for band in bands])
    assert (scene.name, scene.dtype, scene.attrs["instrument"]) == ("toa_reflectance", np.float32, "MSI")
    assert "S2A_MSIL1C" in scene.attrs["history"] and "baseline 04.00" in scene.attrs["history"]
    assert fifesim.open_sentinel2(path, 60)["band"].values.tolist() == ["MSI1", "MSI9"]
    assert fifesim.open_sentinel2(path, 60, bands="B10")["band"].values.tolist() == ["MSI10"]


@pytest.mark.parametrize("chunks", ["auto", None, {"y": 5, "x": 7}])
def test_level_2a_opens_at_each_size(folders, chunks):
    """At 10 m, the classes of 20 m are repeated."""
    path, files = folders[2]
    for size, own, times in ((60, 60, 1), (20, 20, 1), (10, 20, 2)):
        names = ["B4", "B8"] if size == 10 else ["B4", "B8A"]
        scene = fifesim.open_sentinel2(path, size, bands=names, quality=True, chunks=chunks)
        dn = np.array([files[name, size] for name in names]).astype(float)
        expected = np.where((dn == 0) | (dn == 65535), np.nan, (dn - 1000) / 10000)
        np.testing.assert_allclose(scene, expected, rtol=0, atol=5e-8)
        np.testing.assert_array_equal(scene["quality"], files["SCL", own].repeat(times, axis=0).repeat(times, axis=1))
        assert scene.name == "surface_reflectance" and (scene.chunks is None) == (chunks is None)


def test_level_1c_has_cloud_masks_since_04_00(folders):
    path, files = folders[1]
    opaque, cirrus, snow = files["masks"].astype(int)
    for size, times in ((10, 6), (20, 3), (60, 1)):
        expected = (opaque + 2 * cirrus + 4 * snow).repeat(times, axis=0).repeat(times, axis=1)
        quality = fifesim.open_sentinel2(path, size)["quality"]
        np.testing.assert_array_equal(quality, expected)
        assert quality.dtype == np.uint8 and "cirrus" in quality.attrs["comment"]


def test_angles_by_pixel_are_interpolated_between_nodes(tmp_path):
    """The tile of 5.4 km is larger than one interval of the grid; the angles do not depend on chunks."""
    path, _ = products.sentinel2(tmp_path, 1, width=5400)
    with pytest.raises(ValueError, match=r"no grids of the view of these bands: .*angles='centre'"):
        fifesim.open_sentinel2(path, 60, bands=["MSI1"], angles="pixel")
    scene = fifesim.open_sentinel2(path, 10, bands=["MSI4"], angles="pixel")
    lazy = fifesim.open_sentinel2(path, 10, bands=["MSI4"], angles="pixel", chunks={"y": 250, "x": 190})
    assert lazy.compute().identical(scene.compute())
    scene = scene.isel(y=slice(None, None, 49), x=slice(None, None, 49))
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
    with pytest.raises(ValueError, match=said):
        fifesim.open_sentinel2(folders[1][0], **options)


def test_missing_files_or_changed_metadata_raise(tmp_path):
    """An instrument may be given."""
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
    product, (tile,) = first / "MTD_MSIL1C.xml", first.rglob("MTD_TL.xml")
    no_responses = "is of Sentinel-2C, whose responses fifesim does not have: give instrument='MSI-C'"
    for file, old, new, said in (
        (tile, "9.15788418738189", "NaN", "no mean view of these bands: give angles='pixel'"),
        (product, "1959.66", "195.966", r"the scale of MSI2 .* means a solar irradiance of 195"),
        (product, "Sentinel-2A", "Sentinel-2C", no_responses),
    ):
        file.write_text(file.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
        with pytest.raises(ValueError, match=said):
            fifesim.open_sentinel2(first, 10, bands="B02", quality=False)
    both = fifesim.open_sentinel2(first, 10, bands=["B02", "B03"], instrument="MSI-B", quality=False)
    assert both.attrs["instrument"] == "MSI-B"
    assert float(both["vza"]) == pytest.approx(9.18042027119417, abs=1e-9)
