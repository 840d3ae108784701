"""Metadata of Sentinel-2 products."""

import re

import products
import pytest

from fifesim.sensor.products.sentinel2 import sentinel2_product


def written(folder, text, name="MTD_MSIL1C.xml"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("level", [1, 2])
@pytest.mark.parametrize(("baseline", "offset"), [("03.01", 0.0), ("04.00", -0.1), ("05.09", -0.1)])
def test_scale_is_that_of_the_baseline(tmp_path, level, baseline, offset):
    product = sentinel2_product(written(tmp_path, products.product_xml(level, baseline)))
    assert (product.level, product.baseline, product.instrument) == (level, baseline, "MSI")
    bands = [band for bands in product.bands.values() for band in bands]
    assert {(band.gain, band.offset, band.largest) for band in bands} == {(1e-4, offset, 65535)}


def test_bands_lie_at_their_sizes(tmp_path):
    product = sentinel2_product(written(tmp_path, products.product_xml(1, "04.00")))
    names = {size: [band.name for band in bands] for size, bands in product.bands.items()}
    assert names[10] == ["MSI2", "MSI3", "MSI4", "MSI8"]
    assert names[20] == ["MSI5", "MSI6", "MSI7", "MSI8A", "MSI11", "MSI12"]
    assert names[60] == ["MSI1", "MSI9", "MSI10"]
    red = product.bands[10][2]
    assert red.file == "GRANULE/L1C_T46RER_A032448_20210908T043714/IMG_DATA/T46RER_20210908T042701_B04.jp2"
    assert red.solar_irradiance == 1512.06
    assert product.tile == "GRANULE/L1C_T46RER_A032448_20210908T043714/MTD_TL.xml"
    assert product.classes == {}


def test_level_2a_has_most_bands_at_each_size(tmp_path):
    product = sentinel2_product(written(tmp_path, products.product_xml(2, "04.00")))
    assert [len(product.bands[size]) for size in (10, 20, 60)] == [4, 10, 11]
    assert sorted(product.classes) == [20, 60]
    assert product.classes[20].endswith("R20m/T29UNU_20221005T115411_SCL_20m.jp2")


def test_u_is_the_inverse_square_of_the_distance(tmp_path):
    product = sentinel2_product(written(tmp_path, products.product_xml(1, "04.00")))
    assert product.earth_sun_distance**-2 == pytest.approx(float(products.U), rel=1e-14)
    # Beyond the mean distance in September.
    assert 1.007 < product.earth_sun_distance < 1.009


def test_offsets_are_by_band(tmp_path):
    text = products.product_xml(1, "04.00").replace('band_id="3">-1000', 'band_id="3">-900')
    bands = sentinel2_product(written(tmp_path, text)).bands[10]
    assert [round(band.offset, 12) for band in bands] == [-0.1, -0.1, -0.09, -0.1]


L1C = products.product_xml(1, "04.00")


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
        (L1C.replace('OFFSET band_id="4"', 'OFFSET band_id="3"'), "RADIO_ADD_OFFSET stands twice for 3"),
        (L1C.replace("TEXT>SATURATED", "TEXT>NODATA"), "SPECIAL_VALUE_TEXT stands twice for NODATA"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><a/>', "declares a document type"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_a_line(tmp_path, text, said):
    with pytest.raises(ValueError, match=said) as error:
        sentinel2_product(written(tmp_path, text))
    assert len(str(error.value)) < 500 and "\n" not in str(error.value)


def test_another_spacecraft_has_no_instrument(tmp_path):
    product = sentinel2_product(written(tmp_path, products.product_xml(1, "05.11", spacecraft="Sentinel-2C")))
    assert (product.spacecraft, product.instrument) == ("Sentinel-2C", None)
    product = sentinel2_product(written(tmp_path, products.product_xml(1, "05.11", spacecraft="Sentinel-2B")))
    assert product.instrument == "MSI-B"
