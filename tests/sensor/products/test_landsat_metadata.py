"""Metadata of Landsat products, in USGS's three forms."""

import numpy as np
import products
import pytest

from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.products.landsat_metadata import landsat_scene, metadata_file, read_groups


def written(folder, groups, form="txt", root="LANDSAT_METADATA_FILE", name="LT05_L1TP_058014_20110312_20200823_02_T1"):
    path = folder / f"{name}_MTL.{form}"
    path.write_text(products.mtl(groups, form, root))
    return path


@pytest.mark.parametrize("form", ["txt", "json", "xml"])
@pytest.mark.parametrize("kind", [products.TM, products.OLI], ids=["TM", "OLI"])
def test_three_forms_say_the_same(tmp_path, kind, form):
    groups = products.landsat_groups(kind)
    assert read_groups(written(tmp_path, groups, form)) == groups


def test_scale_sun_and_time_are_those_of_the_metadata():
    scene = landsat_scene(products.landsat_groups(products.TM))
    assert (scene.instrument, scene.level, scene.off_nadir) == ("TM", 1, False)
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


def test_a_band_that_no_landsat_has_is_no_mistake_of_arithmetic():
    """The instrument's list of bands refuses it by name."""
    groups = products.landsat_groups(products.OLI)
    scales = groups["LEVEL1_RADIOMETRIC_RESCALING"]
    for number in ("0", "12", "99"):
        groups["PRODUCT_CONTENTS"][f"FILE_NAME_BAND_{number}"] = f"B{number}.TIF"
        groups["LEVEL1_MIN_MAX_PIXEL_VALUE"][f"QUANTIZE_CAL_MAX_BAND_{number}"] = "65535"
        scales |= {f"REFLECTANCE_MULT_BAND_{number}": "2e-5", f"REFLECTANCE_ADD_BAND_{number}": "-0.1"}
        for kind in ("RADIANCE", "REFLECTANCE"):
            limits = {f"{kind}_MAXIMUM_BAND_{number}": "1", f"{kind}_MINIMUM_BAND_{number}": "0"}
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
    groups["IMAGE_ATTRIBUTES"] |= {"SPACECRAFT_ID": spacecraft, "SENSOR_ID": sensor}
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
        (changed("IMAGE_ATTRIBUTES", SENSOR_ID="MSS"), "LANDSAT_5 MSS: those of LANDSAT_4 TM, LANDSAT_5 TM"),
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


@pytest.mark.parametrize("form", ["txt", "json", "xml"])
def test_other_collections_are_refused(tmp_path, form):
    groups = products.landsat_groups(products.TM)
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
        ("xml", "<a>", "not valid XML"),
    ],
)
def test_files_that_are_no_metadata_are_refused(tmp_path, form, text, said):
    path = tmp_path / f"LT05_MTL.{form}"
    path.write_text(text)
    with pytest.raises(ValueError, match=said):
        read_groups(path)


def test_the_file_is_found_in_its_folder(tmp_path):
    groups = products.landsat_groups(products.TM)
    expected = written(tmp_path, groups)
    for form in ("json", "xml"):
        written(tmp_path, groups, form)
    (tmp_path / "LT05_ANG.txt").write_text("")
    assert metadata_file(tmp_path) == metadata_file(expected) == expected


def test_not_one_product_is_an_error(tmp_path):
    with pytest.raises(ValueError, match=r"there is no file or folder .*none"):
        metadata_file(tmp_path / "none")
    with pytest.raises(ValueError, match=r"has no \*_MTL.txt, .json or .xml: give the folder"):
        metadata_file(tmp_path)
    (tmp_path / "scene.tar").write_text("")
    with pytest.raises(ValueError, match=r"scene.tar is no metadata of a Landsat product: .*unpacked"):
        metadata_file(tmp_path / "scene.tar")
    for name in ("LT05_a", "LT05_b"):
        written(tmp_path, {}, name=name)
    with pytest.raises(ValueError, match=r"holds 2 products: give the file of one, LT05_a_MTL.txt, LT05_b_MTL.txt"):
        metadata_file(tmp_path)
