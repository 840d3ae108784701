"""Landsat scenes by their metadata: numbers, and contradictions in them."""

import numpy as np
import products
import pytest

from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.products.landsat import _centre, landsat_scene, read_scene, view_of_roll


def test_scale_sun_and_time_are_those_of_the_metadata():
    scene = landsat_scene(products.landsat_groups(products.TM))
    assert (scene.instrument, scene.level, scene.view) == ("TM", 1, (0.0, 0.0))
    assert [band.name for band in scene.bands] == ["TM1", "TM2", "TM3", "TM4", "TM5", "TM7"]
    band = scene.bands[2]
    assert (band.gain, band.offset, band.largest, band.flag) == (2.1735e-3, -0.004609, 255, 0b1000000100)
    assert scene.bands[-1].flag == 0b1001000000
    assert scene.sza == pytest.approx(69.50031513, abs=1e-9)
    assert (scene.saa, scene.earth_sun_distance) == (165.60131631, 0.9936974)
    assert scene.time == np.datetime64("2011-03-12T19:54:32.695056")
    # The names of Level 1 stand twice, those of the product itself count.
    assert scene.quality == "LT05_L1TP_058014_20110312_20200823_02_T1_QA_PIXEL.TIF"
    assert scene.angles["vza"] == "LT05_L1TP_058014_20110312_20200823_02_T1_VZA.TIF"


def test_level_2_has_a_scale_of_its_own_beside_that_of_level_1():
    """The same keys stand in both groups."""
    scene = landsat_scene(products.landsat_groups(products.OLI, level=2))
    assert scene.level == 2
    assert {(band.gain, band.offset, band.largest) for band in scene.bands} == {(2.75e-5, -0.2, 65535)}
    assert [band.name for band in scene.bands] == [f"OLI{number}" for number in range(1, 8)]
    assert scene.bands[0].file.endswith("_SR_B1.TIF")
    assert [band.flag for band in scene.bands] == [1, 2, 4, 8, 16, 32, 64]


def test_panchromatic_and_cirrus_have_their_flags():
    flags = {band.name: band.flag for band in landsat_scene(products.landsat_groups(products.OLI)).bands}
    assert (flags["OLI8"], flags["OLI9"]) == (0, 256)


COUNTS = [("MIN", "1"), ("MAX", "65535")]


def test_a_band_that_no_landsat_has_is_no_mistake_of_arithmetic():
    """The instrument's list of bands refuses it by name."""
    groups = products.landsat_groups(products.OLI)
    scales = groups["LEVEL1_RADIOMETRIC_RESCALING"]
    for number in ("0", "12", "99"):
        groups["PRODUCT_CONTENTS"][f"FILE_NAME_BAND_{number}"] = f"B{number}.TIF"
        groups["LEVEL1_MIN_MAX_PIXEL_VALUE"] |= {f"QUANTIZE_CAL_{key}_BAND_{number}": value for key, value in COUNTS}
        scales |= {f"REFLECTANCE_MULT_BAND_{number}": "2e-5", f"REFLECTANCE_ADD_BAND_{number}": "-0.1"}
        for kind in ("RADIANCE", "REFLECTANCE"):
            limits = {f"{kind}_MAXIMUM_BAND_{number}": "1.2107", f"{kind}_MINIMUM_BAND_{number}": "-0.09998"}
            groups[f"LEVEL1_MIN_MAX_{kind}"] |= limits
    flags = {band.name: band.flag for band in landsat_scene(groups).bands}
    assert (flags["OLI0"], flags["OLI12"], flags["OLI99"]) == (0, 0, 0)


def test_solar_irradiance_is_that_behind_the_two_scales():
    """Of OLI, whose description has it from another scene; to the digits of the metadata."""
    bands = landsat_scene(products.landsat_groups(products.OLI)).bands
    own = {band.name: band.solar_irradiance for band in instrument("OLI").bands}
    found = {band.name: band.solar_irradiance for band in bands}
    assert found.keys() == own.keys()
    np.testing.assert_allclose(list(found.values()), [own[name] for name in found], rtol=1e-4)


def test_without_the_scales_of_level_1_the_irradiance_is_not_said():
    groups = products.landsat_groups(products.OLI, level=2)
    del groups["LEVEL1_MIN_MAX_RADIANCE"]
    assert {band.solar_irradiance for band in landsat_scene(groups).bands} == {None}


@pytest.mark.parametrize(
    ("spacecraft", "sensor", "name"),
    [
        ("LANDSAT_4", "TM", "L4TM"),
        ("LANDSAT_7", "ETM", "ETM+"),
        ("LANDSAT_8", "OLI", "OLI"),
        ("LANDSAT_9", "OLI_TIRS", "OLI2"),
    ],
)
def test_spacecraft_and_sensor_name_the_instrument(spacecraft, sensor, name):
    groups = products.landsat_groups(products.OLI if "OLI" in sensor else products.TM)
    # Landsat 9 flies since 2021; a year later the sun and its distance are much the same.
    image = groups["IMAGE_ATTRIBUTES"]
    image |= {"SPACECRAFT_ID": spacecraft, "SENSOR_ID": sensor}
    image["DATE_ACQUIRED"] = image["DATE_ACQUIRED"].replace("2020", "2021")
    if sensor == "ETM":
        groups["PRODUCT_CONTENTS"]["FILE_NAME_BAND_6_VCID_1"] = "LE07_B6_VCID_1.TIF"
    scene = landsat_scene(groups)
    assert scene.instrument == name
    assert {band.name for band in scene.bands} <= {band.name for band in instrument(name).bands}


def changed(group, **values):
    groups = products.landsat_groups(products.TM)
    groups[group] = {key: value for key, value in (groups[group] | values).items() if value is not None}
    return groups


@pytest.mark.parametrize(
    ("groups", "said"),
    [
        (changed("IMAGE_ATTRIBUTES", SENSOR_ID="RBV"), "LANDSAT_5 RBV: those of LANDSAT_1 MSS, LANDSAT_2 MSS"),
        (changed("IMAGE_ATTRIBUTES", SPACECRAFT_ID="LANDSAT_1"), "LANDSAT_1 TM"),
        (changed("IMAGE_ATTRIBUTES", SUN_ELEVATION=None), "no SUN_ELEVATION: is the file whole"),
        (changed("IMAGE_ATTRIBUTES", SUN_ELEVATION="nan"), "SUN_ELEVATION must be a number, got 'nan'"),
        (
            changed("IMAGE_ATTRIBUTES", SCENE_CENTER_TIME="noon"),
            "SCENE_CENTER_TIME must be a date and time such as 1987-06-06T16:35:00Z, got '2011-03-12Tnoon'",
        ),
        (changed("PRODUCT_CONTENTS", PROCESSING_LEVEL="L3"), "PROCESSING_LEVEL is 'L3'"),
        (
            changed("PRODUCT_CONTENTS", FILE_NAME_BAND_3="../../etc/passwd"),
            "a file beside the metadata, got '../../etc",
        ),
        (changed("LEVEL1_MIN_MAX_RADIANCE", RADIANCE_MAXIMUM_BAND_1="-9"), "band 1: the smallest"),
    ],
)
def test_what_is_wrong_is_said_in_a_line(groups, said):
    with pytest.raises(ValueError) as error:
        landsat_scene(groups)
    assert said in str(error.value) and len(str(error.value)) < 500 and "\n" not in str(error.value)


def test_a_group_that_is_missing_is_named():
    groups = products.landsat_groups(products.TM)
    del groups["LEVEL1_RADIOMETRIC_RESCALING"]
    with pytest.raises(ValueError, match="no group LEVEL1_RADIOMETRIC_RESCALING"):
        landsat_scene(groups)


SCALE = "LEVEL1_RADIOMETRIC_RESCALING"
CORNERS = {
    f"CORNER_{corner}_{axis}_PRODUCT": value
    for corner, place in {
        "UL": ("66.64", "-132.63"),
        "UR": ("66.61", "-127.2"),
        "LL": ("64.71", "-132.3"),
        "LR": ("64.69", "-127.2"),
    }.items()
    for axis, value in zip(("LAT", "LON"), place, strict=True)
}


@pytest.mark.parametrize(
    ("groups", "said"),
    [
        (
            changed(SCALE, REFLECTANCE_MULT_BAND_3="0"),
            "REFLECTANCE_MULT_BAND_3 = 0 and .* states -0.002436 to 0.549637",
        ),
        (changed(SCALE, REFLECTANCE_MULT_BAND_3="-2.1735e-3"), "values from -0.0067825 to -0.558851"),
        (changed(SCALE, REFLECTANCE_MULT_BAND_3="2.1735"), "values from 2.16889 to 554.238"),
        # A tenth of a percent, which the rounding of metadata does not reach.
        (changed(SCALE, REFLECTANCE_MULT_BAND_3="2.1757e-3"), "states -0.002436 to 0.549637"),
        (changed(SCALE, REFLECTANCE_ADD_BAND_3="0.004609"), "REFLECTANCE_ADD_BAND_3 = 0.004609"),
        (
            changed(SCALE, RADIANCE_MULT_BAND_3="10.44", RADIANCE_ADD_BAND_3="-2.21398"),
            "RADIANCE_MULT_BAND_3 = 10.44 .* W m-2 sr-1 um-1, and the same file states -1.17 to 264",
        ),
        (changed("LEVEL1_MIN_MAX_PIXEL_VALUE", QUANTIZE_CAL_MAX_BAND_3="0"), "counts from 1 to 0, which must rise"),
        (
            changed("LEVEL1_MIN_MAX_PIXEL_VALUE", QUANTIZE_CAL_MAX_BAND_3="255.5"),
            "must be whole numbers, got 1 and 255.5",
        ),
        (changed("IMAGE_ATTRIBUTES", SUN_ELEVATION="0.3578"), r"SUN_ELEVATION = 0.3578 must be in degrees: .* radians"),
        (changed("IMAGE_ATTRIBUTES", SUN_ELEVATION="91"), r"must be in \[-90, 90\] .* got 91 and"),
        (
            changed("IMAGE_ATTRIBUTES", SUN_ELEVATION="-3"),
            r"must be in \(0, 90\] degrees, got -3: .*take one of the day",
        ),
        (changed("IMAGE_ATTRIBUTES", DATE_ACQUIRED="9999-03-12"), "launch of the satellite, 1984-03-01, and today"),
        (changed("IMAGE_ATTRIBUTES", DATE_ACQUIRED="1984-02-29"), "launch of the satellite, 1984-03-01, and today"),
        (
            changed("IMAGE_ATTRIBUTES", DATE_ACQUIRED="2011-07-12"),
            "does not belong to the date 2011-07-12, which has 1.0166",
        ),
        (changed("IMAGE_ATTRIBUTES", EARTH_SUN_DISTANCE="1.4"), "EARTH_SUN_DISTANCE = 1.4 does not belong to the date"),
    ],
)
def test_contradictions_are_refused(groups, said):
    with pytest.raises(ValueError, match=said):
        landsat_scene(groups)


def test_reflectance_is_bounded_where_the_metadata_state_no_range():
    groups = products.landsat_groups(products.TM)
    del groups["LEVEL1_MIN_MAX_REFLECTANCE"]
    landsat_scene(groups)
    groups[SCALE]["REFLECTANCE_MULT_BAND_3"] = "2.1735"
    with pytest.raises(ValueError, match=r"reflectance must begin in \[-0.25, 0.1\] and end in \[0.1, 10\]"):
        landsat_scene(groups)


@pytest.mark.parametrize(
    "values", [{"SUN_ELEVATION": "0.3578"}, {"SUN_AZIMUTH": "2.89"}, {"DATE_ACQUIRED": "2011-02-27"}]
)
def test_the_sun_is_that_of_time_and_corners(values):
    """Corners near those of the scene, within a degree."""
    groups = products.landsat_groups(products.TM)
    groups["PROJECTION_ATTRIBUTES"] = CORNERS
    assert landsat_scene(groups).saa == 165.60131631
    groups["IMAGE_ATTRIBUTES"] |= values | {
        "EARTH_SUN_DISTANCE": "0.9936974" if "DATE_ACQUIRED" not in values else "0.9905"
    }
    with pytest.raises(ValueError, match=r"the sun had a zenith angle of .* fetch them again"):
        landsat_scene(groups)


def test_the_middle_of_corners_on_both_sides_of_the_antimeridian():
    keys = [f"CORNER_{corner}_{axis}_PRODUCT" for axis in ("LAT", "LON") for corner in ("UL", "UR", "LL", "LR")]
    values = ("52", "52", "50", "50", "179", "-178", "179", "-178")
    latitude, longitude = _centre({"PROJECTION_ATTRIBUTES": dict(zip(keys, values, strict=True))})
    assert (latitude, longitude) == (pytest.approx(51.0, abs=0.02), pytest.approx(-179.5))


@pytest.mark.parametrize(
    ("spacecraft", "numbers", "instrument_name"), [("LANDSAT_2", "4567", "MSS2"), ("LANDSAT_5", "1234", "MSS5")]
)
def test_the_scanner_of_1972_is_read(spacecraft, numbers, instrument_name):
    kind = dict(products.TM, thermal=[], bands=dict(zip(numbers, products.TM["bands"].values(), strict=False)))
    groups = products.landsat_groups(kind)
    groups["IMAGE_ATTRIBUTES"] |= {"SPACECRAFT_ID": spacecraft, "SENSOR_ID": "MSS"}
    groups["IMAGE_ATTRIBUTES"]["DATE_ACQUIRED"] = "1986-03-12"
    scene = landsat_scene(groups)
    assert scene.instrument == instrument_name
    assert [band.name for band in scene.bands] == [band.name for band in instrument(instrument_name).bands]
    # Bit n - 1 of QA_RADSAT stands for band n, and bit 9 for a dropped pixel.
    assert [band.flag for band in scene.bands] == [(1 << int(number) - 1) | (1 << 9) for number in numbers]


def test_the_view_of_a_roll_needs_its_row():
    groups = products.landsat_groups(products.OLI)
    image = groups["IMAGE_ATTRIBUTES"]
    image |= {"NADIR_OFFNADIR": "OFFNADIR", "ROLL_ANGLE": "-11.696"}
    assert landsat_scene(groups).view is None
    image["WRS_ROW"] = "036"
    assert landsat_scene(groups).view == view_of_roll(-11.696, 36)
    # Rows of scenes beyond the poleward end of the orbit.
    image["WRS_ROW"] = "880"
    assert landsat_scene(groups).view is None
    image |= {"WRS_ROW": "36", "ROLL_ANGLE": "-45"}
    with pytest.raises(ValueError, match=r"ROLL_ANGLE must be in \[-20, 20\] degrees, got -45"):
        landsat_scene(groups)


def test_errors_begin_with_the_name_of_the_file(tmp_path):
    path = tmp_path / "LT05_MTL.txt"
    path.write_text(products.mtl(changed(SCALE, REFLECTANCE_MULT_BAND_3="0")))
    with pytest.raises(ValueError, match=r"LT05_MTL\.txt: REFLECTANCE_MULT_BAND_3 = 0"):
        read_scene(tmp_path)
