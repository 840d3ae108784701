"""Metadata of Sentinel-2 products and of their tiles."""

import re
from xml.etree import ElementTree

import numpy as np
import products
import pytest

from fifesim.sensor.products import sentinel2
from fifesim.sensor.products.sentinel2 import sentinel2_metadata_file, sentinel2_product, sentinel2_tile

L1C, TILE = products.product_xml(1, "04.00"), products.tile_xml(1)


def written(folder, text, name="MTD_MSIL1C.xml"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def tile(folder, text):
    return written(folder, text, "MTD_TL.xml")


# ------------------------------------------------------------------------------------------- files


def test_the_file_is_found_in_its_folder(tmp_path):
    with pytest.raises(ValueError, match=r"has no MTD_MSIL1C.xml nor MTD_MSIL2A.xml: give the .SAFE folder"):
        sentinel2_metadata_file(tmp_path)
    path = written(tmp_path, "<a/>", "MTD_MSIL2A.xml")
    assert sentinel2_metadata_file(tmp_path) == sentinel2_metadata_file(path) == path
    written(tmp_path, "<a/>")
    with pytest.raises(ValueError, match="has both"):
        sentinel2_metadata_file(tmp_path)
    with pytest.raises(ValueError, match="there is no file or folder"):
        sentinel2_metadata_file(tmp_path / "none.SAFE")
    with pytest.raises(ValueError, match=r"S2A.zip is no .SAFE folder .*unpack"):
        sentinel2_metadata_file(written(tmp_path, "", "S2A.zip"))


def test_other_layouts_are_named(tmp_path):
    for folder, names in {
        "tile": ["metadata.xml", "B01.jp2", "B8A.jp2", "tileInfo.json"],
        "product": ["productInfo.json", "metadata.xml"],
        "sizes": ["R10m/B02.jp2", "R20m/B05.jp2", "qi/CLD_20m.jp2"],
        "geotiff": ["granule_metadata.xml", "B04.tif", "SCL.tif"],
    }.items():
        for name in names:
            (tmp_path / folder / name).parent.mkdir(exist_ok=True, parents=True)
            (tmp_path / folder / name).write_text("")
        said = r"layout of the AWS buckets .*dataspace\.copernicus\.eu\), unpack it"
        for path in (tmp_path / folder, tmp_path / folder / names[0]):
            with pytest.raises(ValueError, match=said) as error:
                sentinel2_metadata_file(path)
            assert "2016" not in str(error.value)
    (tmp_path / "old").mkdir()
    written(tmp_path / "old", "", "S2A_OPER_MTD_SAFL1C_PDMC_20151206T093912_R090_V20151206T043239.xml")
    with pytest.raises(ValueError, match="form of before December 2016, so take the reprocessed product"):
        sentinel2_metadata_file(tmp_path / "old")


def test_values_of_elements():
    xml = ElementTree.fromstring("<a><b>1</b><b> 1 </b><c>1</c><c>2</c><d k='x'>3</d><d k='y'>4</d><e>inf</e></a>")
    assert sentinel2.text_of(xml, "b") == "1" and sentinel2.number_of(xml, "b") == 1.0
    assert sentinel2.numbers_by_band(xml, "d", "k") == {"x": 3.0, "y": 4.0}
    for path, said in (("c", "c stands 2 times with different values, 1, 2"), ("e", "must be a number"), ("f", "no f")):
        with pytest.raises(ValueError, match=said):
            sentinel2.number_of(xml, path)
    with pytest.raises(ValueError, match="d of None stands twice"):
        sentinel2.numbers_by_band(xml, "d", "other")


# ------------------------------------------------------------------------------------------- product


@pytest.mark.parametrize("level", [1, 2])
@pytest.mark.parametrize(("baseline", "offset"), [("03.01", 0.0), ("04.00", -0.1), ("05.09", -0.1)])
def test_scale_is_that_of_the_baseline(tmp_path, level, baseline, offset):
    product = sentinel2_product(written(tmp_path, products.product_xml(level, baseline)))
    assert (product.level, product.baseline, product.instrument) == (level, baseline, "MSI")
    bands = [band for bands in product.bands.values() for band in bands]
    assert {(band.gain, band.offset, band.largest) for band in bands} == {(1e-4, offset, 65535)}


def test_bands_lie_at_their_sizes(tmp_path):
    product = sentinel2_product(written(tmp_path, L1C))
    names = {size: [band.name for band in bands] for size, bands in product.bands.items()}
    assert names[10] == ["MSI2", "MSI3", "MSI4", "MSI8"]
    assert names[20] == ["MSI5", "MSI6", "MSI7", "MSI8A", "MSI11", "MSI12"]
    assert names[60] == ["MSI1", "MSI9", "MSI10"]
    red, granule = product.bands[10][2], "GRANULE/L1C_T46RER_A032448_20210908T043714"
    assert red.file == f"{granule}/IMG_DATA/T46RER_20210908T042701_B04.jp2" and red.solar_irradiance == 1512.06
    assert product.tile == f"{granule}/MTD_TL.xml" and product.classes == {}
    # U is the inverse square of the distance, beyond the mean distance in September.
    assert product.earth_sun_distance**-2 == pytest.approx(float(products.U), rel=1e-14)
    assert 1.007 < product.earth_sun_distance < 1.009
    second = sentinel2_product(written(tmp_path, products.product_xml(2, "04.00")))
    assert [len(second.bands[size]) for size in (10, 20, 60)] == [4, 10, 11] and sorted(second.classes) == [20, 60]
    assert second.classes[20].endswith("R20m/T29UNU_20221005T115411_SCL_20m.jp2")


def test_offsets_are_by_band(tmp_path):
    bands = sentinel2_product(written(tmp_path, L1C.replace('band_id="3">-1000', 'band_id="3">-900'))).bands[10]
    assert [round(band.offset, 12) for band in bands] == [-0.1, -0.1, -0.09, -0.1]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (products.product_xml(1, "04.00", granules=2), "holds 2 granules: products of one tile are read"),
        (products.product_xml(1, "04.00", offset=None), "04.00 has offsets, and the metadata have no RADIO_ADD"),
        (products.product_xml(2, "05.00", offset=None), "05.00 has offsets, and the metadata have no BOA_ADD"),
        (L1C.replace('band_id="3"', 'band_id="30"'), "no RADIO_ADD_OFFSET of B04"),
        (L1C.replace("IMAGE_FILE>", "IMAGE_FILE_2A>"), "names no IMAGE_FILE: .*05.00"),
        (L1C.replace("<IMAGE_FILE>GRANULE/", "<IMAGE_FILE>../x/"), "product's GRANULE folder"),
        (L1C.replace(">10000<", ">many<"), "QUANTIFICATION_VALUE must be a number, got 'many'"),
        (L1C.replace(">10000<", ">0<"), "QUANTIFICATION_VALUE must be above 0"),
        (L1C.replace("<U>", "<V>").replace("</U>", "</V>"), "the metadata have no U: is"),
        (re.sub("<U>.*</U>", "<U>0</U>", L1C), "U must be above 0, got 0"),
        (re.sub("<U>.*</U>", "<U>-1.03</U>", L1C), "U must be above 0, got -1.03"),
        (L1C.replace("INDEX>0<", "INDEX>9<"), "no data is 9"),
        (L1C.replace("Level-1C_User", "Level-1B_User"), "MTD_MSIL1C.xml: it is 'Level-1B_User_Product': Level-1C"),
        (L1C.replace(">10000<", ">1000<"), r"QUANTIFICATION_VALUE = 1000, .* to 64.534 .* must begin in"),
        (L1C.replace(">10000<", ">1e-300<"), "QUANTIFICATION_VALUE = 1e-300, "),
        (L1C.replace('band_id="3">-1000', 'band_id="3">-10000'), r"RADIO_ADD_OFFSET = -10000 of B04 .* from -0.9999"),
        (L1C.replace('band_id="3">-1000', 'band_id="3">1000'), r"RADIO_ADD_OFFSET = 1000 of B04 .* from 0.1001"),
        (L1C.replace("INDEX>65535<", "INDEX>1300<"), r"SATURATED = 1300 .* to 0.0299"),
        (products.product_xml(2, "04.00").replace(">10000<", ">1000<"), "BOA_QUANTIFICATION_VALUE = 1000, "),
        (re.sub("<U>.*</U>", "<U>1.1</U>", L1C), r"U .* must be in \[0.956, 1.045\], got 1.1"),
        (L1C.replace("<U>", "<U>1.0</U><U>"), r"U stands 2 times with different values, 0.98\d+, 1.0: .*fetch"),
        (L1C.replace('OFFSET band_id="4"', 'OFFSET band_id="3"'), "RADIO_ADD_OFFSET of 3 stands twice"),
        (L1C.replace("TEXT>SATURATED", "TEXT>NODATA"), "SPECIAL_VALUE_TEXT NODATA stands twice"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><a/>', "declares a document type"),
    ],
)  # fmt: skip
def test_what_is_wrong_in_a_product_is_said_in_a_line(tmp_path, text, said):
    with pytest.raises(ValueError, match=said) as error:
        sentinel2_product(written(tmp_path, text))
    assert len(str(error.value)) < 500 and "\n" not in str(error.value)


def test_another_spacecraft_has_no_instrument(tmp_path):
    for name, found in (("Sentinel-2C", None), ("Sentinel-2B", "MSI-B")):
        product = sentinel2_product(written(tmp_path, products.product_xml(1, "05.11", spacecraft=name)))
        assert (product.spacecraft, product.instrument) == (name, found)


# ------------------------------------------------------------------------------------------- tile


def test_tile_has_time_sun_and_views(tmp_path):
    found = sentinel2_tile(tile(tmp_path, TILE))
    assert found.time == np.datetime64("2022-10-05T11:56:49.581767")
    assert (found.sza, found.saa, found.views) == (57.820574357679, 172.840206897213, products.MEAN_VIEWS)
    assert (found.corner, found.step) == ((499980.0, 5900040.0), 5000.0)
    np.testing.assert_allclose(found.sun, products.sun_grid(), rtol=1e-5)
    assert found.view_grids["3"].shape == (2, 2, 23, 23) and np.isnan(found.view_grids["3"][:, :, :, 20:]).all()


def test_a_mean_sun_of_nan_is_that_of_the_grid(tmp_path):
    text = TILE.replace("57.820574357679", "NaN").replace("172.840206897213", "NaN")
    zenith, azimuth = products.sun_grid()
    found = sentinel2_tile(tile(tmp_path, text))
    np.testing.assert_allclose([found.sza, found.saa], [zenith.mean(), azimuth.mean()], rtol=0, atol=0.01)
    with pytest.raises(ValueError, match="Mean_Sun_Angle and Sun_Angles_Grid are NaN"):
        sentinel2_tile(tile(tmp_path, text.replace(products._values(zenith), products._values(zenith * np.nan))))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (TILE[len(TILE) // 2 :], "", "is not valid XML"),
        ("2022-10-05T11:56:49.581767Z", "today", "SENSING_TIME must be a date and time such as .*'today'"),
        ("<VALUES>58.38", "<VALUES>58.38 much", "a grid of Zenith is no table"),
        ("VALUES>", "VALUE>", "not two rows and columns"),
        ("57.820574357679", "1.009", "Mean_Sun_Angle of zenith 1.009 and .* contradicts .*, whose mean is 57.8"),
        ("172.840206897213", "352.8", "contradicts Sun_Angles_Grid"),
        ("2022-10-05T", "9999-10-05T", "launch of the satellite, 2015-06-23, and today"),
        ("2022-10-05T", "2014-10-05T", "launch of the satellite, 2015-06-23, and today"),
        ("2022-10-05T", "2022-07-05T", "2022-07-05T11:56 UTC and 52.75 N, -8.19 E, the sun had a zenith angle of 31.0"),
        ("EPSG:32629", "EPSG:4326", "HORIZONTAL_CS_CODE must be a UTM zone such as EPSG:32629, got 'EPSG:4326'"),
    ],
)
def test_what_is_wrong_in_a_tile_is_refused(tmp_path, old, new, said):
    assert old in TILE
    with pytest.raises(ValueError, match=f"MTD_TL.xml.*{said}"):
        sentinel2_tile(tile(tmp_path, TILE.replace(old, new)))


def test_no_image_is_older_than_its_satellite(tmp_path):
    path = tile(tmp_path, TILE.replace("2022-10-05T", "2016-10-05T"))
    assert sentinel2_tile(path).time == np.datetime64("2016-10-05T11:56:49.581767")
    with pytest.raises(ValueError, match="launch of the satellite, 2017-03-07"):
        sentinel2_tile(path, "Sentinel-2B")
