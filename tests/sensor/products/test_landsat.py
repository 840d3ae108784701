"""Landsat scenes by their metadata, in the three forms of USGS: numbers, contradictions, and the view of a roll."""

import numpy as np
import products
import pytest

from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.products.landsat import (
    _centre,
    landsat_metadata_file,
    landsat_scene,
    read_groups,
    read_scene,
    view_of_roll,
)
from fifesim.sensor.response.scan import Track, place_beside, view_components, view_from_scan

FORMS = pytest.mark.parametrize("form", ["txt", "json", "xml"])
SCALE = "LEVEL1_RADIOMETRIC_RESCALING"


def written(folder, groups, form="txt", root="LANDSAT_METADATA_FILE", name="LT05_L1TP_058014_20110312_20200823_02_T1"):
    path = folder / f"{name}_MTL.{form}"
    path.write_text(products.mtl(groups, form, root))
    return path


def changed(group, kind=products.TM, **values):
    groups = products.landsat_groups(kind)
    groups[group] = {key: value for key, value in (groups[group] | values).items() if value is not None}
    return groups


def image(**values):
    return changed("IMAGE_ATTRIBUTES", **values)


# ------------------------------------------------------------------------------------------- files


@FORMS
def test_three_forms_say_the_same_and_other_collections_are_refused(tmp_path, form):
    for kind in (products.TM, products.OLI):
        groups = products.landsat_groups(kind)
        assert read_groups(written(tmp_path, groups, form)) == groups
    with pytest.raises(ValueError, match="is of Collection 1 or older: take"):
        read_groups(written(tmp_path, groups, form, root="L1_METADATA_FILE"))
    groups["PRODUCT_CONTENTS"]["COLLECTION_NUMBER"] = "03"
    with pytest.raises(ValueError, match="is of collection '03': Collection 2 is read"):
        read_groups(written(tmp_path, groups, form))


@pytest.mark.parametrize(
    ("form", "text", "said"),
    [
        ("txt", "", "begins with None"),
        ("txt", "GROUP = SOMETHING\n  A = 1\nEND_GROUP = SOMETHING\n", "begins with 'SOMETHING'"),
        ("json", "[1, 2]", "begins with None"),
        ("json", "{", "not valid JSON"),
        ("json", '{"LANDSAT_METADATA_FILE": 3}', "of collection None"),
        ("json", '{"LANDSAT_METADATA_FILE": {}, "LANDSAT_METADATA_FILE": {}}', "holds 2 objects"),
        ("xml", "<a>", "not valid XML"),
    ],
)
def test_files_that_are_no_metadata_are_refused(tmp_path, form, text, said):
    path = tmp_path / f"LT05_MTL.{form}"
    path.write_text(text)
    with pytest.raises(ValueError, match=said):
        read_groups(path)


def test_the_file_is_found_in_its_folder_in_upper_or_lower_case(tmp_path):
    expected = written(tmp_path, products.landsat_groups(products.TM))
    for form in ("json", "xml"):
        written(tmp_path, products.landsat_groups(products.TM), form)
    (tmp_path / "LT05_ANG.txt").write_text("")
    assert landsat_metadata_file(tmp_path) == landsat_metadata_file(expected) == expected
    for name in ("LT05_a_MTL.TXT", "LT05_a_mtl.Json", "LT05_a_MTL.XML"):
        (tmp_path / name).mkdir()
        (tmp_path / name / name).write_text("")
        assert landsat_metadata_file(tmp_path / name) == tmp_path / name / name
        (tmp_path / name / "lt05_a_mtl.xml").write_text("")
        assert landsat_metadata_file(tmp_path / name).stem.lower() == "lt05_a_mtl"


def test_not_one_product_is_an_error(tmp_path):
    with pytest.raises(ValueError, match=r"there is no file or folder .*none"):
        landsat_metadata_file(tmp_path / "none")
    with pytest.raises(ValueError, match=r"has no \*_MTL.txt, .json or .xml: give the folder"):
        landsat_metadata_file(tmp_path)
    (tmp_path / "scene.tar").write_text("")
    with pytest.raises(ValueError, match=r"scene.tar is no metadata of a Landsat product: .*unpacked"):
        landsat_metadata_file(tmp_path / "scene.tar")
    for name in ("LT05_a", "LT05_b"):
        written(tmp_path, {}, name=name)
    with pytest.raises(ValueError, match=r"holds 2 products: give the file of one, LT05_a_MTL.txt, LT05_b_MTL.txt"):
        landsat_metadata_file(tmp_path)


KEY, GROUP, END = "REFLECTANCE_MULT_BAND_3", "IMAGE_ATTRIBUTES", "END_GROUP = LANDSAT_METADATA_FILE"
REPEATED = {
    "txt": (f"    {KEY} =", f"    {KEY} = 0.5\n    {KEY} ="),
    "json": (f'"{KEY}"', f'"{KEY}": "0.5", "{KEY}"'),
    "xml": (f"<{KEY}>", f"<{KEY}>0</{KEY}><{KEY}>"),
}
GROUPS = {
    "txt": (END, f"GROUP = {GROUP}\nEND_GROUP = {GROUP}\n{END}"),
    "json": (f'"{GROUP}"', f'"{GROUP}": {{"SPACECRAFT_ID": "LANDSAT_4"}}, "{GROUP}"'),
    "xml": (f"<{GROUP}>", f"<{GROUP}></{GROUP}><{GROUP}>"),
}


@FORMS
def test_repeated_keys_and_groups_are_refused(tmp_path, form):
    for change, said in (
        (REPEATED, rf"MTL.*: the LEVEL1_RADIOMETRIC_RESCALING key {KEY} stands twice: .*fetch"),
        (GROUPS, f"the group {GROUP} stands twice"),
    ):
        path = written(tmp_path, products.landsat_groups(products.TM), form)
        path.write_text(path.read_text().replace(*change[form]))
        with pytest.raises(ValueError, match=said):
            read_groups(path)


# ------------------------------------------------------------------------------------------- numbers


def test_scale_sun_and_time_are_those_of_the_metadata():
    scene = landsat_scene(products.landsat_groups(products.TM))
    assert (scene.instrument, scene.level, scene.view) == ("TM", 1, (0.0, 0.0))
    assert [band.name for band in scene.bands] == ["TM1", "TM2", "TM3", "TM4", "TM5", "TM7"]
    band = scene.bands[2]
    assert (band.gain, band.offset, band.largest, band.flag) == (2.1735e-3, -0.004609, 255, 0b1000000100)
    assert scene.bands[-1].flag == 0b1001000000
    assert (scene.sza, scene.saa) == (pytest.approx(69.50031513, abs=1e-9), 165.60131631)
    assert (scene.earth_sun_distance, scene.time) == (0.9936974, np.datetime64("2011-03-12T19:54:32.695056"))
    # The names of Level 1 stand twice, those of the product itself count.
    assert scene.quality == "LT05_L1TP_058014_20110312_20200823_02_T1_QA_PIXEL.TIF"
    assert scene.angles["vza"] == "LT05_L1TP_058014_20110312_20200823_02_T1_VZA.TIF"


def test_level_2_has_a_scale_of_its_own_beside_that_of_level_1():
    """The same keys stand in both groups. Without the scales of level 1 the irradiance is not known."""
    groups = products.landsat_groups(products.OLI, level=2)
    scene = landsat_scene(groups)
    assert scene.level == 2 and scene.bands[0].file.endswith("_SR_B1.TIF")
    assert {(band.gain, band.offset, band.largest) for band in scene.bands} == {(2.75e-5, -0.2, 65535)}
    assert [band.name for band in scene.bands] == [f"OLI{number}" for number in range(1, 8)]
    assert [band.flag for band in scene.bands] == [1, 2, 4, 8, 16, 32, 64]
    del groups["LEVEL1_MIN_MAX_RADIANCE"]
    assert {band.solar_irradiance for band in landsat_scene(groups).bands} == {None}


def test_flags_of_all_bands_and_of_those_that_no_landsat_has():
    """The instrument's list of bands refuses a band that no Landsat has; here it has no flag."""
    groups = products.landsat_groups(products.OLI)
    for number in ("0", "12", "99"):
        groups["PRODUCT_CONTENTS"][f"FILE_NAME_BAND_{number}"] = f"B{number}.TIF"
        for group, values in {
            "LEVEL1_MIN_MAX_PIXEL_VALUE": {"QUANTIZE_CAL_MIN": "1", "QUANTIZE_CAL_MAX": "65535"},
            SCALE: {"REFLECTANCE_MULT": "2e-5", "REFLECTANCE_ADD": "-0.1"},
            "LEVEL1_MIN_MAX_RADIANCE": {"RADIANCE_MAXIMUM": "1.2107", "RADIANCE_MINIMUM": "-0.09998"},
            "LEVEL1_MIN_MAX_REFLECTANCE": {"REFLECTANCE_MAXIMUM": "1.2107", "REFLECTANCE_MINIMUM": "-0.09998"},
        }.items():
            groups[group] |= {f"{key}_BAND_{number}": value for key, value in values.items()}
    flags = {band.name: band.flag for band in landsat_scene(groups).bands}
    assert [flags[name] for name in ("OLI8", "OLI9", "OLI0", "OLI12", "OLI99")] == [0, 256, 0, 0, 0]


def test_solar_irradiance_is_that_behind_the_two_scales():
    """Of OLI, whose description has it from another scene; to the digits of the metadata."""
    bands = landsat_scene(products.landsat_groups(products.OLI)).bands
    own = {band.name: band.solar_irradiance for band in instrument("OLI").bands}
    found = {band.name: band.solar_irradiance for band in bands}
    assert found == pytest.approx(own, rel=1e-4)


@pytest.mark.parametrize(
    ("spacecraft", "sensor", "name", "numbers", "year"),
    [
        ("LANDSAT_4", "TM", "L4TM", "", "2011"),
        ("LANDSAT_7", "ETM", "ETM+", "", "2011"),
        ("LANDSAT_8", "OLI", "OLI", "", "2020"),
        ("LANDSAT_9", "OLI_TIRS", "OLI2", "", "2021"),
        ("LANDSAT_2", "MSS", "MSS2", "4567", "1986"),
        ("LANDSAT_5", "MSS", "MSS5", "1234", "1986"),
    ],
)
def test_spacecraft_and_sensor_name_the_instrument(spacecraft, sensor, name, numbers, year):
    """In another year the sun and its distance are much the same. Bit n - 1 stands for band n of MSS, 9 for dropped."""
    kind = products.OLI if "OLI" in sensor else products.TM
    if numbers:
        kind = dict(kind, thermal=[], bands=dict(zip(numbers, kind["bands"].values(), strict=False)))
    groups = products.landsat_groups(kind)
    date = year + groups["IMAGE_ATTRIBUTES"]["DATE_ACQUIRED"][4:]
    groups["IMAGE_ATTRIBUTES"] |= {"SPACECRAFT_ID": spacecraft, "SENSOR_ID": sensor, "DATE_ACQUIRED": date}
    if sensor == "ETM":
        groups["PRODUCT_CONTENTS"]["FILE_NAME_BAND_6_VCID_1"] = "LE07_B6_VCID_1.TIF"
    scene = landsat_scene(groups)
    assert scene.instrument == name
    assert {band.name for band in scene.bands} <= {band.name for band in instrument(name).bands}
    if numbers:
        assert len(scene.bands) == 4
        assert [band.flag for band in scene.bands] == [(1 << int(number) - 1) | (1 << 9) for number in numbers]


# ------------------------------------------------------------------------------------------- contradictions


def scale(**values):
    return changed(SCALE, **{f"{key}_BAND_3": value for key, value in values.items()})


@pytest.mark.parametrize(
    ("groups", "said"),
    [
        (image(SENSOR_ID="RBV"), "LANDSAT_5 RBV: those of LANDSAT_1 MSS, LANDSAT_2 MSS"),
        (image(SPACECRAFT_ID="LANDSAT_1"), "LANDSAT_1 TM"),
        (image(SUN_ELEVATION=None), "no SUN_ELEVATION: is the file whole"),
        (image(SUN_ELEVATION="nan"), "SUN_ELEVATION must be a number, got 'nan'"),
        (image(SCENE_CENTER_TIME="noon"), "TIME must be a date and time such as 1987-.*, got '2011-03-12Tnoon'"),
        (changed("PRODUCT_CONTENTS", PROCESSING_LEVEL="L3"), "PROCESSING_LEVEL is 'L3'"),
        (
            changed("PRODUCT_CONTENTS", FILE_NAME_BAND_3="../../etc/pw"),
            r"a file beside the metadata, got '\.\./\.\./etc",
        ),
        (changed("LEVEL1_MIN_MAX_RADIANCE", RADIANCE_MAXIMUM_BAND_1="-9"), "band 1: the smallest"),
        ({k: v for k, v in image().items() if k != SCALE}, "no group LEVEL1_RADIOMETRIC_RESCALING"),
        (scale(REFLECTANCE_MULT="0"), "REFLECTANCE_MULT_BAND_3 = 0 and .* states -0.002436 to 0.549637"),
        (scale(REFLECTANCE_MULT="-2.1735e-3"), "values from -0.0067825 to -0.558851"),
        (scale(REFLECTANCE_MULT="2.1735"), "values from 2.16889 to 554.238"),
        # A tenth of a percent, which the rounding of metadata does not reach.
        (scale(REFLECTANCE_MULT="2.1757e-3"), "states -0.002436 to 0.549637"),
        (scale(REFLECTANCE_ADD="0.004609"), "REFLECTANCE_ADD_BAND_3 = 0.004609"),
        (
            scale(RADIANCE_MULT="10.44", RADIANCE_ADD="-2.21398"),
            "RADIANCE_MULT_BAND_3 = 10.44 .* W m-2 sr-1 um-1, and the same file states -1.17 to 264",
        ),
        (changed("LEVEL1_MIN_MAX_PIXEL_VALUE", QUANTIZE_CAL_MAX_BAND_3="0"), "counts from 1 to 0, which must rise"),
        (changed("LEVEL1_MIN_MAX_PIXEL_VALUE", QUANTIZE_CAL_MAX_BAND_3="2.5"), "must be whole numbers, got 1 and 2.5"),
        (image(SUN_ELEVATION="0.3578"), r"SUN_ELEVATION = 0.3578 must be in degrees: .* radians"),
        (image(SUN_ELEVATION="91"), r"must be in \[-90, 90\] .* got 91 and"),
        (image(SUN_ELEVATION="-3"), r"must be in \(0, 90\] degrees, got -3: .*take one of the day"),
        (image(DATE_ACQUIRED="9999-03-12"), "launch of the satellite, 1984-03-01, and today"),
        (image(DATE_ACQUIRED="1984-02-29"), "launch of the satellite, 1984-03-01, and today"),
        (image(DATE_ACQUIRED="2011-07-12"), "does not belong to the date 2011-07-12, which has 1.0166"),
        (image(EARTH_SUN_DISTANCE="1.4"), "EARTH_SUN_DISTANCE = 1.4 does not belong to the date"),
    ],
)
def test_what_is_wrong_is_said_in_a_line(groups, said):
    with pytest.raises(ValueError, match=said) as error:
        landsat_scene(groups)
    assert len(str(error.value)) < 500 and "\n" not in str(error.value)


def test_reflectance_is_bounded_where_the_metadata_state_no_range():
    groups = products.landsat_groups(products.TM)
    del groups["LEVEL1_MIN_MAX_REFLECTANCE"]
    landsat_scene(groups)
    groups[SCALE]["REFLECTANCE_MULT_BAND_3"] = "2.1735"
    with pytest.raises(ValueError, match=r"reflectance must begin in \[-0.25, 0.1\] and end in \[0.1, 10\]"):
        landsat_scene(groups)


def corners(latitudes, longitudes):
    """Corners UL, UR, LL, LR."""
    places = zip(("UL", "UR", "LL", "LR"), latitudes.split(), longitudes.split(), strict=True)
    return {
        f"CORNER_{corner}_{axis}_PRODUCT": value
        for corner, latitude, longitude in places
        for axis, value in (("LAT", latitude), ("LON", longitude))
    }


@pytest.mark.parametrize(
    "values",
    [
        {"SUN_ELEVATION": "0.3578"},
        {"SUN_AZIMUTH": "2.89"},
        {"DATE_ACQUIRED": "2011-02-27", "EARTH_SUN_DISTANCE": "0.9905"},
    ],
)
def test_the_sun_is_that_of_time_and_corners(values):
    """Corners near those of the scene, within a degree."""
    groups = products.landsat_groups(products.TM)
    groups["PROJECTION_ATTRIBUTES"] = corners("66.64 66.61 64.71 64.69", "-132.63 -127.2 -132.3 -127.2")
    assert landsat_scene(groups).saa == 165.60131631
    groups["IMAGE_ATTRIBUTES"] |= values
    with pytest.raises(ValueError, match=r"the sun had a zenith angle of .* fetch them again"):
        landsat_scene(groups)


def test_the_middle_of_corners_on_both_sides_of_the_antimeridian():
    found = _centre({"PROJECTION_ATTRIBUTES": corners("52 52 50 50", "179 -178 179 -178")})
    assert found == (pytest.approx(51.0, abs=0.02), pytest.approx(-179.5))


# ------------------------------------------------------------------------------------------- view off nadir


def test_the_view_of_a_roll_needs_its_row():
    """Row 880 is of scenes beyond the poleward end of the orbit."""
    groups = products.landsat_groups(products.OLI)
    roll = {"NADIR_OFFNADIR": "OFFNADIR", "ROLL_ANGLE": "-11.696"}
    for row, view in ((None, None), ("036", view_of_roll(-11.696, 36)), ("880", None)):
        groups["IMAGE_ATTRIBUTES"] |= roll | ({} if row is None else {"WRS_ROW": row})
        assert landsat_scene(groups).view == view
    groups["IMAGE_ATTRIBUTES"] |= {"WRS_ROW": "36", "ROLL_ANGLE": "-45"}
    with pytest.raises(ValueError, match=r"ROLL_ANGLE must be in \[-20, 20\] degrees, got -45"):
        landsat_scene(groups)


@pytest.mark.parametrize(
    ("roll", "row", "azimuth"),
    [
        # On the way south, the right is in the west: the sensor stands east of the scene.
        (-10.0, 60, 90.0),
        (10.0, 60, 270.0),
        # On the way north, the other way round.
        (-10.0, 184, 270.0),
        (10.0, 184, 90.0),
        # At the turning points it flies west: its left is in the south.
        (10.0, 122, 0.0),
        (10.0, 246, 0.0),
        (-10.0, 122, 180.0),
    ],
)
def test_the_sensor_stands_on_the_side_that_it_looks_away_from(roll, row, azimuth):
    vza, vaa = view_of_roll(roll, row)
    assert abs((vaa - azimuth + 180) % 360 - 180) < 13
    assert vza == pytest.approx(np.degrees(np.arcsin(np.sin(np.radians(10.0)) * (6371 + 705) / 6371)), abs=1e-6)
    assert view_of_roll(0.0, row)[0] == pytest.approx(0.0, abs=1e-12)


def centre_of(path, row):
    """
    Nominal centre of a scene on the Worldwide Reference System 2, geocentric [degree].

    Path 1 crosses the equator southward at 64.60 W. 233 paths divide the equator, and are flown in 16 days.
    """
    turn = 360 * (row - 60) / 248
    i, u = np.radians(98.2), np.radians(turn)
    longitude = -64.60 - (path - 1) * 360 / 233 + np.degrees(np.arctan(np.cos(i) * np.tan(u))) - turn * 16 / 233
    return -np.degrees(np.arcsin(np.sin(i) * np.sin(u))), longitude


def test_a_real_scene_lies_where_its_roll_looks():
    """Middle of the corners of LC08_L2SP_017036_20130419_20200913_02_T2, whose ROLL_ANGLE is -11.696."""
    latitude, longitude = centre_of(17, 36)
    track = Track.from_inclination(latitude, longitude, 98.2, 705e3)
    # The middle of the corners, 34.61 N geodetic.
    _, across = place_beside(track, 34.43, -82.89)
    # The pass may lie 5 km from its path, which is 0.05 degrees. The other side of the track has the other sign.
    assert float(across) == pytest.approx(float(view_from_scan(11.696, 705e3)[1]), abs=0.05)
    vza, vaa = view_of_roll(-11.696, 36)
    assert vza == pytest.approx(13.0, abs=0.1)
    # Toward the nearest point of the track.
    east, north = view_components(track, 34.43, -82.89, 705e3)
    assert vaa == pytest.approx(float(np.degrees(np.arctan2(east, north))), abs=1.0)


def test_errors_begin_with_the_name_of_the_file(tmp_path):
    written(tmp_path, scale(REFLECTANCE_MULT="0"), name="LT05")
    with pytest.raises(ValueError, match=r"LT05_MTL\.txt: REFLECTANCE_MULT_BAND_3 = 0"):
        read_scene(tmp_path)
