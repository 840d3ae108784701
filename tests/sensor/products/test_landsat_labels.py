"""Landsat products: metadata in the three USGS formats, inconsistencies, off-nadir views, and images."""

import re
import shutil

import numpy as np
import products
import pytest
from lazy import check_place, no_compute

import fifesim
from fifesim.atmosphere import engines
from fifesim.grids import cf
from fifesim.sensor.products.landsat_labels import _centre, landsat_metadata_file, landsat_scene, read_groups
from fifesim.sensor.response.scan import Track, place_beside, view_components, view_from_scan, view_of_roll

KINDS = {"TM": products.TM, "OLI": products.OLI}
SCALE, RANGE = "LEVEL1_RADIOMETRIC_RESCALING", "LEVEL1_MIN_MAX_REFLECTANCE"
TM_PRODUCT = products.TM["product"]


def written(folder, groups, form="txt", name=TM_PRODUCT):
    path = folder / f"{name}_MTL.{form}"
    path.write_text(products.mtl(groups, form))
    return path


def changed(group, kind=products.TM, **values):
    """Metadata with other values in a group; None removes a key."""
    groups = products.landsat_groups(kind)
    groups[group] = {key: value for key, value in (groups[group] | values).items() if value is not None}
    return groups


def image(**values):
    return changed("IMAGE_ATTRIBUTES", **values)


def without(group, groups):
    return {key: values for key, values in groups.items() if key != group}


# ------------------------------------------------------------------------------------------- files

KEY = "REFLECTANCE_MULT_BAND_3"
REPEATED = {
    "txt": (f"{KEY} =", f"{KEY} = 0.5\n    {KEY} ="),
    "json": (f'"{KEY}"', f'"{KEY}": "0.5", "{KEY}"'),
    "xml": (f"<{KEY}>", f"<{KEY}>0</{KEY}><{KEY}>"),
}


@pytest.mark.parametrize("form", REPEATED)
def test_three_formats_are_equivalent_and_repeated_keys_raise(tmp_path, form):
    path = written(tmp_path, image(), form)
    assert read_groups(path) == image()
    path.write_text(path.read_text().replace(*REPEATED[form]))
    with pytest.raises(ValueError, match=rf"MTL.*: the {SCALE} key {KEY} stands twice: .*fetch"):
        read_groups(path)


@pytest.mark.parametrize(
    ("form", "text", "said"),
    [
        ("txt", "GROUP = SOMETHING\n  A = 1\nEND_GROUP = SOMETHING\n", "begins with 'SOMETHING'"),
        ("json", "{", "not valid JSON"),
        ("json", '{"LANDSAT_METADATA_FILE": 3}', "of collection None"),
        ("json", '{"LANDSAT_METADATA_FILE": {}, "LANDSAT_METADATA_FILE": {}}', "holds 2 objects"),
        ("xml", "<L1_METADATA_FILE/>", "is of Collection 1 or older: take"),
        ("xml", products.mtl({"PRODUCT_CONTENTS": {"COLLECTION_NUMBER": "03"}}, "xml"), "'03': Collection 2 is read"),
    ],
)
def test_invalid_metadata_files_raise(tmp_path, form, text, said):
    path = tmp_path / f"LT05_MTL.{form}"
    path.write_text(text)
    with pytest.raises(ValueError, match=said):
        read_groups(path)


def test_metadata_file_is_found_in_upper_or_lower_case(tmp_path):
    expected, *_ = (written(tmp_path, products.landsat_groups(products.TM), form) for form in ("txt", "json", "xml"))
    (tmp_path / "LT05_ANG.txt").write_text("")
    assert landsat_metadata_file(tmp_path) == landsat_metadata_file(expected) == expected
    for name in ("LT05_a_MTL.TXT", "LT05_a_mtl.Json", "LT05_a_MTL.XML"):
        (tmp_path / name).mkdir()
        (tmp_path / name / name).write_text("")
        assert landsat_metadata_file(tmp_path / name) == tmp_path / name / name
        (tmp_path / name / "lt05_a_mtl.xml").write_text("")
        assert landsat_metadata_file(tmp_path / name).stem.lower() == "lt05_a_mtl"


def test_folder_without_exactly_one_product_raises(tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "scene.tar").write_text("")
    for name in ("LT05_a", "LT05_b"):
        written(tmp_path, {}, name=name)
    for path, said in (
        (tmp_path / "none", r"there is no file or folder .*none"),
        (tmp_path / "empty", r"has no \*_MTL.txt, .json or .xml: give the folder"),
        (tmp_path / "scene.tar", r"scene.tar is no metadata of a Landsat product: .*unpacked"),
        (tmp_path, r"holds 2 products: give the file of one, LT05_a_MTL.txt, LT05_b_MTL.txt"),
    ):
        with pytest.raises(ValueError, match=said):
            landsat_metadata_file(path)


# ------------------------------------------------------------------------------------------- scenes


def test_saturation_flags_are_band_bits():
    """Bit n - 1 for band n, and bit 9 for dropped pixels of TM and MSS; the panchromatic band has no flag."""
    aside = {"FILE_NAME_BAND_0": "B0.TIF", "FILE_NAME_BAND_99": "B99.TIF"}
    flags = {band.name: band.flag for band in landsat_scene(changed("PRODUCT_CONTENTS", products.OLI, **aside)).bands}
    assert [flags[f"OLI{number}"] for number in (1, 7, 8, 9)] == [1, 64, 0, 256] and len(flags) == 9
    # Without stated limits of reflectance, of another instrument.
    groups = without(RANGE, image())
    del groups["PRODUCT_CONTENTS"]["FILE_NAME_BAND_6"]
    for sensor, instrument, names in (("TM", "TM", "TM"), ("MSS", "MSS2", "MSS")):
        groups["IMAGE_ATTRIBUTES"]["SENSOR_ID"] = sensor
        scene = landsat_scene(groups)
        assert scene.instrument == instrument
        flags = {f"{names}{number}": (1 << number - 1) | (1 << 9) for number in (1, 2, 3, 4, 5, 7)}
        assert {band.name: band.flag for band in scene.bands} == flags
        groups["IMAGE_ATTRIBUTES"]["SPACECRAFT_ID"] = "LANDSAT_2"


def scale(**values):
    return changed(SCALE, **{f"{key}_BAND_3": value for key, value in values.items()})


@pytest.mark.parametrize(
    ("groups", "said"),
    [
        (image(SENSOR_ID="RBV"), "LANDSAT_5 RBV: those of LANDSAT_1 MSS, LANDSAT_2 MSS"),
        (image(SUN_ELEVATION=None), "no SUN_ELEVATION: is the file whole"),
        (image(SCENE_CENTER_TIME="noon"), "TIME must be a date and time such as 1987-.*, got '2011-03-12Tnoon'"),
        (changed("PRODUCT_CONTENTS", PROCESSING_LEVEL="L3"), "PROCESSING_LEVEL is 'L3'"),
        (changed("PRODUCT_CONTENTS", FILE_NAME_BAND_3="../../etc/pw"), r"beside the metadata, got '\.\./\.\./etc"),
        (changed("LEVEL1_MIN_MAX_RADIANCE", RADIANCE_MAXIMUM_BAND_1="-9"), "band 1: the smallest"),
        (without(SCALE, image()), "no group LEVEL1_RADIOMETRIC_RESCALING"),
        (scale(REFLECTANCE_MULT="0"), "REFLECTANCE_MULT_BAND_3 = 0 and .* states -0.002436 to 0.549637"),
        (scale(REFLECTANCE_ADD="0.004609"), "REFLECTANCE_ADD_BAND_3 = 0.004609"),
        (
            scale(RADIANCE_MULT="10.44", RADIANCE_ADD="-2.21398"),
            r"_BAND_3 = 10.44 .* um-1, .* file states -1.17 to 264",
        ),
        (without(RANGE, scale(REFLECTANCE_MULT="2.1735")), r"begin in \[-0.25, 0.1\] and end in \[0.1, 10\]"),
        (changed("LEVEL1_MIN_MAX_PIXEL_VALUE", QUANTIZE_CAL_MAX_BAND_3="0"), "counts from 1 to 0, which must rise"),
        (changed("LEVEL1_MIN_MAX_PIXEL_VALUE", QUANTIZE_CAL_MAX_BAND_3="2.5"), "must be whole numbers, got 1 and 2.5"),
        (image(SUN_ELEVATION="0.3578"), r"SUN_ELEVATION = 0.3578 must be in degrees: .* radians"),
        (image(SUN_ELEVATION="91"), r"SUN_ELEVATION must be in \[-90, 90\] degrees, got 91: "),
        (image(SUN_ELEVATION="-3"), r"must be in \(0, 90\] degrees, got -3: .*take one of the day"),
        (image(DATE_ACQUIRED="1984-02-29"), "launch of the satellite, 1984-03-01, and today"),
        (image(EARTH_SUN_DISTANCE="1.4"), "EARTH_SUN_DISTANCE = 1.4 does not belong to the date"),
        (image(NADIR_OFFNADIR="OFFNADIR", WRS_ROW="36", ROLL_ANGLE="-45"), r"ROLL_ANGLE must be in \[-20, 20\] .* -45"),
    ],
)
def test_invalid_metadata_raises_a_one_line_message(groups, said):
    with pytest.raises(ValueError, match=said) as error:
        landsat_scene(groups)
    assert len(str(error.value)) < 500 and "\n" not in str(error.value)


def corners(latitudes, longitudes):
    """Corners UL, UR, LL, LR."""
    places = zip(("UL", "UR", "LL", "LR"), latitudes.split(), longitudes.split(), strict=True)
    keys = "CORNER_{}_LAT_PRODUCT", "CORNER_{}_LON_PRODUCT"
    return {key.format(corner): value for corner, *place in places for key, value in zip(keys, place, strict=True)}


def test_sun_must_agree_with_time_and_corners():
    """The corners are within 1 degree of the real scene, or on both sides of the antimeridian."""
    place = {"PROJECTION_ATTRIBUTES": corners("66.64 66.61 64.71 64.69", "-132.63 -127.2 -132.3 -127.2")}
    assert landsat_scene(image() | place).saa == 165.60131631
    for values in (
        {"SUN_ELEVATION": "0.3578"},
        {"SUN_AZIMUTH": "2.89"},
        {"DATE_ACQUIRED": "2011-02-27", "EARTH_SUN_DISTANCE": "0.9905"},
    ):
        with pytest.raises(ValueError, match=r"the sun had a zenith angle of .* fetch them again"):
            landsat_scene(image(**values) | place)
    found = _centre({"PROJECTION_ATTRIBUTES": corners("52 52 50 50", "179 -178 179 -178")})
    assert found == (pytest.approx(51.0, abs=0.02), pytest.approx(-179.5))


# ------------------------------------------------------------------------------------------- view off nadir


@pytest.mark.parametrize(
    ("roll", "row", "azimuth"),
    [
        # Descending: right is west, so the sensor is east of the scene.
        (-10.0, 60, 90.0),
        (10.0, 60, 270.0),
        # Ascending: the opposite.
        (-10.0, 184, 270.0),
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


def centre_of(path, row):
    """
    Nominal centre of a scene on the Worldwide Reference System 2, geocentric [degree].

    Path 1 crosses the equator southward at 64.60 W. The equator has 233 paths, which take 16 days.
    """
    turn = 360 * (row - 60) / 248
    i, u = np.radians(98.2), np.radians(turn)
    longitude = -64.60 - (path - 1) * 360 / 233 + np.degrees(np.arctan(np.cos(i) * np.tan(u))) - turn * 16 / 233
    return -np.degrees(np.arcsin(np.sin(i) * np.sin(u))), longitude


def test_real_scene_agrees_with_its_roll_angle():
    """Centre of the corners of LC08_L2SP_017036_20130419_20200913_02_T2, with a ROLL_ANGLE of -11.696 degrees."""
    track = Track.from_inclination(*centre_of(17, 36), 98.2, 705e3)
    # Centre of the corners, 34.61 N geodetic.
    _, across = place_beside(track, 34.43, -82.89)
    # The pass may be 5 km from the nominal path, i.e. 0.05 degrees.
    assert float(across) == pytest.approx(float(view_from_scan(11.696, 705e3)[1]), abs=0.05)
    vza, vaa = view_of_roll(-11.696, 36)
    assert vza == pytest.approx(13.0, abs=0.1)
    # Toward the nearest point of the track.
    east, north = view_components(track, 34.43, -82.89, 705e3)
    assert vaa == pytest.approx(float(np.degrees(np.arctan2(east, north))), abs=1.0)


# ------------------------------------------------------------------------------------------- images


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Product folder and the values of its files, by instrument."""
    found = {}
    for name, kind in KINDS.items():
        folder = tmp_path_factory.mktemp(name)
        found[name] = folder, products.landsat(folder, kind)
    return found


@pytest.fixture
def copy(folders, tmp_path):
    return shutil.copytree(folders["TM"][0], tmp_path, dirs_exist_ok=True)


def by_hand(name, files, sza=None):
    """Red and near-infrared reflectance by the handbook formula, in double precision."""
    numbers = {"TM": ("3", "4"), "OLI": ("4", "5")}[name]
    groups = products.landsat_groups(KINDS[name])
    sza = 90 - float(groups["IMAGE_ATTRIBUTES"]["SUN_ELEVATION"]) if sza is None else sza
    out = []
    for number in numbers:
        gain, offset = (float(groups[SCALE][f"REFLECTANCE_{part}_BAND_{number}"]) for part in ("MULT", "ADD"))
        rho = (gain * files[number].astype(float) + offset) / np.cos(np.radians(sza))
        saturated = files["saturated"] & (1 << (int(number) - 1)) != 0
        rho[(files[number] == 0) | (files[number] == np.iinfo(files[number].dtype).max) | saturated] = np.nan
        out.append(rho)
    return np.array(out), [f"{name}{number}" for number in numbers]


@pytest.mark.parametrize(
    ("name", "time", "sun"),
    [
        ("TM", "2011-03-12T19:54:32.695056", (69.50031513, 0.0, 165.60131631)),
        ("OLI", "2020-12-04T19:02:11.194486", (71.19277015, 0.0, 164.91405951)),
    ],
)
def test_scene_is_corrected_and_written_to_a_file(folders, name, time, sun, tmp_path):
    """
    Level 1, surface reflectance and GeoTIFF compared with hand-computed values.

    Reflectance is rounded to 32 bits twice (relative 6e-8), at the top of the atmosphere and at the ground. The first
    error is divided by the transmittance, at least 0.5: 2e-7 in total for reflectances below 1.
    """
    folder, files = folders[name]
    toa, bands = by_hand(name, files)
    air = fifesim.Atmosphere(visibility=30.0)
    surface = fifesim.open_landsat(folder / f"{KINDS[name]['product']}_MTL.txt", bands=bands).fifesim.to_surface(air)
    responses = tuple(band.response for band in fifesim.instrument(name).select(bands))
    expected = products.surface_by_hand(toa, engines.band_terms(air, responses, *sun))
    np.testing.assert_allclose(surface, expected, rtol=0, atol=2e-7)
    again = fifesim.open_image(surface.fifesim.to_geotiff(tmp_path / "surface.tif"))
    np.testing.assert_array_equal(again, surface)
    assert again["time"].values == np.datetime64(time)


def test_scene_has_the_labels_of_a_fifesim_image(folders):
    folder, files = folders["TM"]
    with no_compute():
        scene = fifesim.open_landsat(folder)
    check_place(scene, "EPSG:32609")
    assert (scene.name, scene.dtype, scene.attrs["instrument"]) == ("toa_reflectance", np.float32, "TM")
    assert cf.attributes("toa_reflectance").items() <= scene.attrs.items() and TM_PRODUCT in scene.attrs["history"]
    bands = fifesim.instrument("TM").bands
    np.testing.assert_array_equal(scene["wavelength"], [band.wavelength for band in bands])
    # Band 3 of Landsat 5 by hand: pi 0.9936974^2 (264 + 1.17) / (0.549637 + 0.002436).
    assert float(scene["solar_irradiance"][2]) == pytest.approx(1490.0, abs=0.1)
    np.testing.assert_array_equal(scene["quality"], files["quality"])


@pytest.mark.parametrize("chunks", [None, {"y": 5, "x": 7}])
@pytest.mark.parametrize("angles", ["centre", "pixel"])
def test_scene_does_not_depend_on_chunks(folders, chunks, angles):
    folder, _ = folders["OLI"]
    expected = fifesim.open_landsat(folder, angles=angles).compute()
    found = fifesim.open_landsat(folder, angles=angles, chunks=chunks)
    assert (found.chunks is None) == (chunks is None)
    assert found.compute().identical(expected)


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
        ("", {"bands": "TM6"}, "TM6 is thermal, and reflectance is read"),
        ("", {"bands": "TM8"}, "unknown band of TM 'TM8'"),
        ("", {"angles": "mean"}, "angles must be 'centre' or 'pixel', got 'mean'"),
        ("", {"instrument": "TM5"}, "unknown instrument 'TM5'"),
        ("_B[357]", {}, r"B3\.TIF is missing in .*bands=\['TM1', 'TM2', 'TM4'\]"),
        ("_VZA", {"angles": "pixel", "bands": "TM1"}, r"VZA\.TIF is missing in .*angles='centre'"),
        ("_QA_", {}, r"QA_PIXEL\.TIF is missing in .*quality=False"),
    ],
)
def test_invalid_option_or_missing_file_raises(copy, missing, options, said):
    for path in copy.glob("*.TIF"):
        if missing and re.search(missing, path.name):
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
    assert landsat_scene(image(WRS_ROW="880", **rolled)).view is None
    without, given = tmp_path / "without", tmp_path / "with"
    products.landsat(without, products.OLI, groups=changed("IMAGE_ATTRIBUTES", products.OLI, **rolled))
    with pytest.raises(ValueError, match=r"was acquired off nadir, .*use angles='pixel'"):
        fifesim.open_landsat(without)
    assert fifesim.open_landsat(without, angles="pixel")["vza"].ndim == 2
    products.landsat(given, products.OLI, groups=changed("IMAGE_ATTRIBUTES", products.OLI, WRS_ROW="036", **rolled))
    scene = fifesim.open_landsat(given)
    # Descending and looking right: the sensor is in the east.
    assert float(scene["vza"]) == pytest.approx(15.8, abs=0.1) and 90 < float(scene["vaa"]) < 110


def test_irradiance_is_checked_or_taken_from_the_instrument(tmp_path):
    """The irradiance must agree with the instrument of the product; a given other instrument is not compared."""
    group, wrong, level2 = "LEVEL1_MIN_MAX_RADIANCE", tmp_path / "wrong", tmp_path / "level2"
    products.landsat(wrong, products.OLI, groups=changed(group, products.OLI, RADIANCE_MAXIMUM_BAND_4="622768.8"))
    with pytest.raises(
        ValueError, match=r"LC08_.*: the scale of OLI4 .*RADIANCE_MAXIMUM.* means a solar irradiance of"
    ):
        fifesim.open_landsat(wrong)
    assert fifesim.open_landsat(wrong, instrument="OLI2").sizes["band"] == 7
    products.landsat(level2, products.OLI, 2, groups=without(group, products.landsat_groups(products.OLI, 2)))
    assert float(fifesim.open_landsat(level2, bands="OLI4")["solar_irradiance"][0]) == 1569.35
