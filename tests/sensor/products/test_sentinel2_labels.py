"""Sentinel-2 products as images: numbers by hand before and after baseline 04.00, labels, and what is missing."""

import numpy as np
import products
import pytest
import rasterio
from lazy import check_place, no_compute

import fifesim
from fifesim.atmosphere import engines

BASELINES = {"03.01": 0.0, "04.00": -1000.0}


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """By level and baseline: a folder, and what lies in its files."""
    root = tmp_path_factory.mktemp("sentinel2")
    return {(level, baseline): products.sentinel2(root, level, baseline) for level in (1, 2) for baseline in BASELINES}


def by_hand(files, names, size, offset):
    dn = np.array([files[name, size] for name in names]).astype(float)
    return np.where((dn == 0) | (dn == 65535), np.nan, (dn + offset) / 10000)


@pytest.mark.parametrize("baseline", BASELINES)
def test_a_scene_goes_through_to_a_file(folders, baseline, tmp_path):
    """Level-1C, the surface, NDVI and a GeoTIFF, each by hand to what 32 bits hold, as with Landsat."""
    path, files = folders[1, baseline]
    toa = by_hand(files, ["B4", "B8"], 10, BASELINES[baseline])
    air = fifesim.Atmosphere(visibility=40.0)
    scene = fifesim.open_sentinel2(path, 10, bands=["B04", "B08"])
    surface = scene.fifesim.to_surface(air)
    responses = tuple(band.response for band in fifesim.instrument("MSI").select(["MSI4", "MSI8"]))
    vza, vaa = (np.mean([products.MEAN_VIEWS[band][k] for band in ("3", "7")]) for k in (0, 1))
    terms = engines.band_terms(air, responses, 57.820574357679, vza, vaa - 172.840206897213)
    expected = products.surface_by_hand(toa, terms)
    np.testing.assert_allclose(surface, expected, rtol=0, atol=2e-7)
    red, nir = expected
    ndvi = surface.fifesim.ndvi()
    np.testing.assert_allclose(ndvi, (nir - red) / (nir + red), rtol=0, atol=1e-6)
    with rasterio.open(ndvi.fifesim.to_geotiff(tmp_path / "ndvi.tif")) as source:
        np.testing.assert_array_equal(source.read(1), ndvi)
        assert source.crs.to_string() == products.UTM
        assert (source.transform.c, source.transform.f) == products.CORNER


def test_labels_are_those_of_the_packages_own_images(folders):
    path, _ = folders[1, "04.00"]
    with no_compute():
        scene = fifesim.open_sentinel2(path / "MTD_MSIL1C.xml")
    check_place(scene, products.UTM)
    msi = fifesim.instrument("MSI")
    bands = msi.select(scene["band"].values)
    np.testing.assert_array_equal(scene["wavelength"], [band.wavelength for band in bands])
    np.testing.assert_array_equal(scene["solar_irradiance"], [1959.66, 1823.24, 1512.06, 1041.63])
    assert (scene.attrs["instrument"], scene.dtype) == ("MSI", np.float32)
    assert scene["time"].values == np.datetime64("2022-10-05T11:56:49.581767")
    assert float(scene["earth_sun_distance"]) ** -2 == pytest.approx(float(products.U))
    assert (float(scene["sza"]), float(scene["saa"])) == (57.820574357679, 172.840206897213)
    vza, vaa = np.mean([products.MEAN_VIEWS[number] for number in ("1", "2", "3", "7")], axis=0)
    np.testing.assert_allclose([scene["vza"], scene["vaa"]], [vza, vaa], rtol=0, atol=1e-3)
    assert "S2A_MSIL1C" in scene.attrs["history"] and "baseline 04.00" in scene.attrs["history"]


@pytest.mark.parametrize("size", [20, 60])
def test_level_2a_opens_at_each_size(folders, size):
    path, files = folders[2, "04.00"]
    scene = fifesim.open_sentinel2(path, size, bands=["MSI4", "MSI8A"], quality=True)
    np.testing.assert_allclose(scene, by_hand(files, ["B4", "B8A"], size, -1000), rtol=0, atol=5e-8)
    np.testing.assert_array_equal(scene["quality"], files["SCL", size])
    assert "vegetation" in scene["quality"].attrs["comment"]


@pytest.mark.parametrize("chunks", ["auto", None, {"y": 5, "x": 7}])
def test_pixels_of_10_m_have_the_class_of_those_of_20(folders, chunks):
    path, files = folders[2, "04.00"]
    scene = fifesim.open_sentinel2(path, 10, chunks=chunks)
    np.testing.assert_array_equal(scene["quality"], files["SCL", 20].repeat(2, axis=0).repeat(2, axis=1))
    land = scene.where(scene["quality"].isin([4, 5]))
    assert 0 < int(np.isfinite(land[0]).sum()) < 144


@pytest.mark.parametrize(("size", "times"), [(10, 6), (20, 3), (60, 1)])
def test_level_1c_has_masks_of_clouds_since_04_00(folders, size, times):
    path, files = folders[1, "04.00"]
    opaque, cirrus, snow = files["masks"].astype(int)
    expected = (opaque + 2 * cirrus + 4 * snow).repeat(times, axis=0).repeat(times, axis=1)
    quality = fifesim.open_sentinel2(path, size)["quality"]
    np.testing.assert_array_equal(quality, expected)
    assert quality.dtype == np.uint8 and "cirrus" in quality.attrs["comment"]
    assert "quality" not in fifesim.open_sentinel2(folders[1, "03.01"][0], size).coords


@pytest.mark.parametrize("chunks", [None, {"y": 5, "x": 7}])
@pytest.mark.parametrize("angles", ["centre", "pixel"])
def test_any_chunks_give_the_same(folders, chunks, angles):
    path, _ = folders[2, "03.01"]
    options = {"angles": angles, "bands": ["MSI4", "MSI8"]}
    expected = fifesim.open_sentinel2(path, 10, **options).compute()
    found = fifesim.open_sentinel2(path, 10, chunks=chunks, **options)
    assert (found.chunks is None) == (chunks is None)
    assert found.compute().identical(expected)


def test_angles_by_pixel_lie_between_the_nodes(tmp_path):
    """A tile of 5.4 km, which is more than an interval of the grid."""
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


def test_a_band_at_another_size_says_where_it_is(folders):
    path, _ = folders[1, "04.00"]
    assert fifesim.open_sentinel2(path, 60)["band"].values.tolist() == ["MSI1", "MSI9"]
    assert fifesim.open_sentinel2(path, 60, bands="B10")["band"].values.tolist() == ["MSI10"]
    with pytest.raises(ValueError, match="has no MSI11 of 10 m: it has it at 20 m, give resolution="):
        fifesim.open_sentinel2(path, 10, bands=["B04", "B11"])


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"resolution": 30}, "resolution must be 10, 20 or 60 m, got 30"),
        ({"bands": "B13"}, r"unknown band of MSI '\w+13'"),
        ({"angles": "tile"}, "angles must be 'centre' or 'pixel', got 'tile'"),
    ],
)
def test_what_is_not_there_is_refused(folders, options, said):
    with pytest.raises(ValueError, match=said):
        fifesim.open_sentinel2(folders[1, "04.00"][0], **options)


def test_missing_files_are_named(tmp_path):
    first, second = (products.sentinel2(tmp_path, level)[0] for level in (1, 2))
    for path, name, said in (
        (second, "*_SCL_20m.jp2", r"SCL_20m\.jp2 is missing in .*quality=False"),
        (first, "MSK_CLASSI_B00.jp2", r"MSK_CLASSI_B00\.jp2 is missing in .*quality=False"),
        (second, "*_B04_10m.jp2", r"B04_10m\.jp2 is missing in "),
        (second, "MTD_TL.xml", r"MTD_TL\.xml is missing in the product"),
    ):
        (file,) = path.rglob(name)
        file.unlink()
        with pytest.raises(ValueError, match=said):
            fifesim.open_sentinel2(path, 10, quality="quality" in said)
    assert "quality" not in fifesim.open_sentinel2(first, quality=False).coords


def test_a_band_whose_view_is_not_known_is_refused(tmp_path):
    path, _ = products.sentinel2(tmp_path, 1)
    (tile,) = path.rglob("MTD_TL.xml")
    text = tile.read_text(encoding="utf-8")
    tile.write_text(text.replace(str(products.MEAN_VIEWS["1"][0]), "NaN"), encoding="utf-8")
    with pytest.raises(ValueError, match="no mean view of these bands: give angles='pixel'"):
        fifesim.open_sentinel2(path, 10, bands="B02")
    both = fifesim.open_sentinel2(path, 10, bands=["B02", "B03"])
    assert float(both["vza"]) == pytest.approx(products.MEAN_VIEWS["2"][0], abs=1e-9)


def test_another_spacecraft_takes_the_responses_that_are_given(tmp_path):
    path, _ = products.sentinel2(tmp_path, 1, "05.11", spacecraft="Sentinel-2C")
    said = "is of Sentinel-2C, whose responses fifesim does not have: give instrument='MSI-C'"
    with pytest.raises(ValueError, match=said):
        fifesim.open_sentinel2(path, 10)
    assert fifesim.open_sentinel2(path, 10, instrument="MSI-B").attrs["instrument"] == "MSI-B"


def test_a_whole_level_2a_scene_is_what_landsat_5_would_have_seen(tmp_path):
    """Without a word on bands and sizes: 20 m holds a band beside each of TM's."""
    path, _ = products.sentinel2(tmp_path, 2, "04.00")
    scene = fifesim.open_sentinel2(path, quality=False)
    assert scene["band"].size == 10 and scene.odc.geobox.affine.a == 20
    scene = scene.where(scene.notnull().all("band"), 0.2).clip(0.02, 0.6)
    tm = scene.fifesim.as_seen_by("TM", atmosphere=fifesim.Atmosphere(visibility=30))
    assert tm["band"].values.tolist() == ["TM1", "TM2", "TM3", "TM4", "TM5", "TM7"]
    assert float(tm["sza"]) == float(scene["sza"]) and (tm > 0).any()
