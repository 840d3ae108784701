"""Landsat products: metadata files, inconsistencies, off-nadir views, and images."""

import re
import shutil

import numpy as np
import products
import pytest
from lazy import check_place, no_compute
from mistakes import mistakes

import fifesim
from fifesim.grids import cf
from fifesim.sensor.products.landsat_labels import _centre, landsat_metadata_file, landsat_scene, read_groups
from fifesim.sensor.response.scan import view_of_roll

TM, OLI = products.TM, products.OLI


def image(**values):
    return {"IMAGE_ATTRIBUTES": values}


# ------------------------------------------------------------------------------------------- metadata


@pytest.mark.parametrize(("stage", "content", "said"), mistakes("landsat file", name="sensor_mistakes"), ids=str)
def test_invalid_metadata_files_raise(tmp_path, stage, content, said):
    path = tmp_path / f"LT05_MTL.{content[0]}"
    path.write_text(content[1])
    with pytest.raises(ValueError, match=said):
        read_groups(path)


def test_metadata_file_is_found_in_upper_or_lower_case(tmp_path):
    """Where a product has several forms, the first is read."""
    expected, *_ = (tmp_path / f"LT05_MTL.{form}" for form in ("txt", "json", "xml"))
    for name in ("LT05_MTL.xml", "LT05_MTL.json", "LT05_MTL.txt", "LT05_ANG.txt"):
        (tmp_path / name).write_text("")
    assert landsat_metadata_file(tmp_path) == landsat_metadata_file(expected) == expected
    for name in ("LT05_a_MTL.TXT", "LT05_a_mtl.Json", "LT05_a_MTL.XML"):
        (tmp_path / name).mkdir()
        (tmp_path / name / name).write_text("")
        assert landsat_metadata_file(tmp_path / name) == tmp_path / name / name


def test_folder_without_exactly_one_product_raises(tmp_path):
    (tmp_path / "empty").mkdir()
    for name in ("LT05_a_MTL.txt", "LT05_b_MTL.txt", "scene.tar"):
        (tmp_path / name).write_text("")
    for path, said in (
        (tmp_path / "empty", r"has no \*_MTL.txt, .json or .xml: give the folder"),
        (tmp_path / "scene.tar", r"scene.tar is no metadata of a Landsat product: .*unpacked"),
        (tmp_path, r"holds 2 products: give the file of one, LT05_a_MTL.txt, LT05_b_MTL.txt"),
    ):
        with pytest.raises(ValueError, match=said):
            landsat_metadata_file(path)


def test_saturation_flags_are_band_bits():
    """Bit n - 1 for band n, and bit 9 for dropped pixels of TM and MSS; the panchromatic band has no flag."""
    aside = {"FILE_NAME_BAND_0": "B0.TIF", "FILE_NAME_BAND_99": "B99.TIF"}
    scene = landsat_scene(products.landsat_groups(OLI, {"PRODUCT_CONTENTS": aside}))
    flags = {band.name: band.flag for band in scene.bands}
    assert [flags[f"OLI{number}"] for number in (1, 7, 8, 9)] == [1, 64, 0, 256] and len(flags) == 9
    # Without stated limits of reflectance, of another instrument.
    without = {"LEVEL1_MIN_MAX_REFLECTANCE": None, "PRODUCT_CONTENTS": {"FILE_NAME_BAND_6": None}}
    other = image(SENSOR_ID="MSS", SPACECRAFT_ID="LANDSAT_2")
    for changes, instrument, letters in (({}, "TM", "TM"), (other, "MSS2", "MSS")):
        scene = landsat_scene(products.landsat_groups(TM, without | changes))
        flags = {f"{letters}{number}": (1 << number - 1) | (1 << 9) for number in (1, 2, 3, 4, 5, 7)}
        assert {band.name: band.flag for band in scene.bands} == flags and scene.instrument == instrument


def corners(latitudes, longitudes):
    """Corners UL, UR, LL, LR."""
    places = zip(("UL", "UR", "LL", "LR"), latitudes.split(), longitudes.split(), strict=True)
    keys = "CORNER_{}_LAT_PRODUCT", "CORNER_{}_LON_PRODUCT"
    values = {key.format(corner): value for corner, *place in places for key, value in zip(keys, place, strict=True)}
    return {"PROJECTION_ATTRIBUTES": values}


# Within 1 degree of the real scene.
PLACE = corners("66.64 66.61 64.71 64.69", "-132.63 -127.2 -132.3 -127.2")


@pytest.mark.parametrize(
    ("stage", "changes", "said"), mistakes("landsat", "landsat placed", name="sensor_mistakes"), ids=str
)
def test_invalid_metadata_raises_a_one_line_message(stage, changes, said):
    groups = products.landsat_groups(TM, changes | (PLACE if stage == "landsat placed" else {}))
    with pytest.raises(ValueError, match=said) as error:
        landsat_scene(groups)
    assert len(str(error.value)) < 500 and "\n" not in str(error.value)


def test_sun_agrees_with_time_and_corners():
    assert landsat_scene(products.landsat_groups(TM, PLACE)).saa == 165.60131631
    found = _centre(corners("52 52 50 50", "179 -178 179 -178"))
    assert found == (pytest.approx(51.0, abs=0.02), pytest.approx(-179.5))


@pytest.mark.parametrize(
    ("roll", "row", "azimuth"),
    [
        # Descending: right is west, so the sensor is east of the scene. Ascending: the opposite.
        (-10.0, 60, 90.0),
        (10.0, 60, 270.0),
        (10.0, 184, 90.0),
        # At the turning points the track heads west: left is south.
        (10.0, 122, 0.0),
        (10.0, 246, 0.0),
        (-10.0, 122, 180.0),
    ],
)
def test_sensor_is_on_the_side_opposite_to_the_roll(roll, row, azimuth):
    vza, vaa = view_of_roll(roll, row)
    assert abs((vaa - azimuth + 180) % 360 - 180) < 13
    assert vza == pytest.approx(np.degrees(np.arcsin(np.sin(np.radians(10.0)) * (6371 + 705) / 6371)), abs=1e-6)
    assert view_of_roll(0.0, row)[0] == pytest.approx(0.0, abs=1e-12)


# ------------------------------------------------------------------------------------------- images


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Product folder and the values of its files, by instrument."""
    found = {}
    for name, kind in (("TM", TM), ("OLI", OLI)):
        folder = tmp_path_factory.mktemp(name)
        found[name] = folder, products.landsat(folder, kind)
    return found


def by_hand(name, files, sza):
    """Red and near-infrared reflectance by the handbook formula, in double precision."""
    numbers = {"TM": ("3", "4"), "OLI": ("4", "5")}[name]
    scale, out = products.landsat_groups({"TM": TM, "OLI": OLI}[name])["LEVEL1_RADIOMETRIC_RESCALING"], []
    for number in numbers:
        gain, offset = (float(scale[f"REFLECTANCE_{part}_BAND_{number}"]) for part in ("MULT", "ADD"))
        rho = (gain * files[number].astype(float) + offset) / np.cos(np.radians(sza))
        saturated = files["saturated"] & (1 << (int(number) - 1)) != 0
        rho[(files[number] == 0) | (files[number] == np.iinfo(files[number].dtype).max) | saturated] = np.nan
        out.append(rho)
    return np.array(out), [f"{name}{number}" for number in numbers]


def test_scene_has_the_values_and_labels_of_a_fifesim_image(folders):
    """Reflectance is rounded to 32 bits."""
    folder, files = folders["TM"]
    with no_compute():
        scene = fifesim.open_landsat(folder)
    check_place(scene, "EPSG:32609")
    assert (scene.name, scene.dtype, scene.attrs["instrument"]) == ("toa_reflectance", np.float32, "TM")
    assert cf.attributes("toa_reflectance").items() <= scene.attrs.items() and TM["product"] in scene.attrs["history"]
    assert scene["time"].values == np.datetime64("2011-03-12T19:54:32.695056")
    np.testing.assert_array_equal(scene["wavelength"], [band.wavelength for band in fifesim.instrument("TM").bands])
    # Band 3 of Landsat 5 by hand: pi 0.9936974^2 (264 + 1.17) / (0.549637 + 0.002436).
    assert float(scene["solar_irradiance"][2]) == pytest.approx(1490.0, abs=0.1)
    np.testing.assert_array_equal(scene["quality"], files["quality"])
    expected, bands = by_hand("TM", files, 69.50031513)
    np.testing.assert_allclose(scene.sel(band=bands), expected, rtol=1e-7, atol=1e-9)


def test_angles_by_pixel_use_the_solar_zenith_of_each_pixel(folders):
    folder, files = folders["OLI"]
    scene = fifesim.open_landsat(folder, angles="pixel")
    expected, bands = by_hand("OLI", files, np.where(files["SZA"] == 0, np.nan, files["SZA"] / 100.0))
    np.testing.assert_allclose(scene.sel(band=bands), expected, rtol=0, atol=1e-6)
    for name in ("sza", "saa", "vza"):
        known = np.where(files["quality"] == 1, np.nan, files[name.upper()] / 100.0)
        np.testing.assert_array_equal(scene[name], known)
    # West of the track the stored azimuth is negative.
    assert float(scene["vaa"][0, -1]) == 285.0
    assert scene["sza"].attrs["units"] == "degree"
    for angles in ("centre", "pixel"):
        found, whole = (fifesim.open_landsat(folder, angles=angles, chunks=each) for each in ({"y": 5, "x": 7}, None))
        assert found.chunks is not None and whole.chunks is None and found.compute().identical(whole)


def test_panchromatic_band_is_opened_by_name(folders):
    folder, _ = folders["OLI"]
    assert "OLI8" not in fifesim.open_landsat(folder)["band"].values
    pan = fifesim.open_landsat(folder, bands="OLI8")
    assert pan.shape == (1, 23, 35) and "quality" not in pan.coords
    assert float(pan["x"][1] - pan["x"][0]) == 15.0
    with pytest.raises(ValueError, match=r"^LC08_\w+_B4\.TIF and LC08_\w+_B8\.TIF have different grids"):
        fifesim.open_landsat(folder, bands=["OLI8", "OLI4"])
    assert "OLI9" in fifesim.open_landsat(folder, bands=["OLI9"])["band"].values


@pytest.mark.parametrize(
    ("missing", "options", "said"),
    [
        ("none", {"bands": "TM6"}, "TM6 is thermal, and reflectance is read"),
        ("none", {"bands": "TM8"}, "unknown band of TM 'TM8'"),
        ("none", {"angles": "mean"}, "angles must be 'centre' or 'pixel', got 'mean'"),
        ("_B[357]", {}, r"B3\.TIF is missing in .*bands=\['TM1', 'TM2', 'TM4'\]"),
        ("_VZA", {"angles": "pixel", "bands": "TM1"}, r"VZA\.TIF is missing in .*angles='centre'"),
        ("_QA_", {}, r"QA_PIXEL\.TIF is missing in .*quality=False"),
    ],
)
def test_invalid_option_or_missing_file_raises(folders, tmp_path, missing, options, said):
    copy = shutil.copytree(folders["TM"][0], tmp_path, dirs_exist_ok=True)
    for path in copy.glob("*.TIF"):
        if re.search(missing, path.name):
            path.unlink()
    with pytest.raises(ValueError, match=said):
        fifesim.open_landsat(copy, **options)
    remedied = fifesim.open_landsat(copy, quality=False, bands=["TM1", "TM4"])
    assert "quality" not in remedied.coords
    # Pixels without data and the flagged pixel of TM4, which is kept without quality.
    assert np.isnan(remedied).sum(["y", "x"]).values.tolist() == [2, 2]


def test_off_nadir_view_needs_roll_and_row_or_angles_by_pixel(tmp_path):
    """Row 880 has scenes beyond the poleward end of the orbit."""
    rolled = {"NADIR_OFFNADIR": "OFFNADIR", "ROLL_ANGLE": "-14.2"}
    assert landsat_scene(products.landsat_groups(TM, image(WRS_ROW="880", **rolled))).view is None
    products.landsat(tmp_path / "without", OLI, image(**rolled))
    with pytest.raises(ValueError, match=r"was acquired off nadir, .*use angles='pixel'"):
        fifesim.open_landsat(tmp_path / "without")
    assert fifesim.open_landsat(tmp_path / "without", angles="pixel")["vza"].ndim == 2
    products.landsat(tmp_path / "given", OLI, image(WRS_ROW="036", **rolled))
    scene = fifesim.open_landsat(tmp_path / "given")
    # Descending and looking right: the sensor is in the east.
    assert float(scene["vza"]) == pytest.approx(15.8, abs=0.1) and 90 < float(scene["vaa"]) < 110


def test_irradiance_is_checked_or_taken_from_the_instrument(tmp_path):
    """The irradiance must agree with the instrument of the product; a given other instrument is not compared."""
    group, said = "LEVEL1_MIN_MAX_RADIANCE", r"LC08_.*: the scale of OLI4 .*RADIANCE_MAXIMUM.* means a solar irradiance"
    products.landsat(tmp_path / "wrong", OLI, {group: {"RADIANCE_MAXIMUM_BAND_4": "622768.8"}})
    with pytest.raises(ValueError, match=said):
        fifesim.open_landsat(tmp_path / "wrong")
    assert fifesim.open_landsat(tmp_path / "wrong", instrument="OLI2").sizes["band"] == 7
    products.landsat(tmp_path / "without", OLI, {group: None})
    assert float(fifesim.open_landsat(tmp_path / "without", bands="OLI4")["solar_irradiance"][0]) == 1569.35
