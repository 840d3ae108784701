"""Metadata of Sentinel-2 products."""

import re

import numpy as np
import products
import pytest

from fifesim.sensor.products.sentinel2_metadata import metadata_file, sentinel2_product, sentinel2_tile


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
        (L1C.replace("Level-1C_User", "Level-1B_User"), "is 'Level-1B_User_Product': Level-1C"),
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


def test_tile_has_time_sun_and_views(tmp_path):
    tile = sentinel2_tile(written(tmp_path, products.tile_xml(1), "MTD_TL.xml"))
    assert tile.time == np.datetime64("2022-10-05T11:56:49.581767")
    assert (tile.sza, tile.saa) == (57.820574357679, 172.840206897213)
    assert tile.views == products.MEAN_VIEWS
    assert (tile.corner, tile.step) == ((499980.0, 5900040.0), 5000.0)
    np.testing.assert_allclose(tile.sun, products.sun_grid(), rtol=1e-5)
    assert tile.view_grids["3"].shape == (2, 2, 23, 23)
    assert np.isnan(tile.view_grids["3"][:, :, :, 20:]).all()


def test_a_tile_that_is_cut_short_is_refused(tmp_path):
    text = products.tile_xml(1)
    with pytest.raises(ValueError, match=r"MTD_TL.xml is not valid XML"):
        sentinel2_tile(written(tmp_path, text[: len(text) // 2], "MTD_TL.xml"))
    with pytest.raises(ValueError, match=r"SENSING_TIME must be a date and time such as .*'today'"):
        sentinel2_tile(written(tmp_path, text.replace("2022-10-05T11:56:49.581767Z", "today"), "MTD_TL.xml"))
    with pytest.raises(ValueError, match="a grid of Zenith is no table"):
        sentinel2_tile(written(tmp_path, text.replace("<VALUES>58.38", "<VALUES>58.38 much", 1), "MTD_TL.xml"))
    with pytest.raises(ValueError, match="not two rows and columns"):
        sentinel2_tile(written(tmp_path, text.replace("VALUES>", "VALUE>"), "MTD_TL.xml"))


def test_the_file_is_found_in_its_folder(tmp_path):
    with pytest.raises(ValueError, match=r"has no MTD_MSIL1C.xml nor MTD_MSIL2A.xml: give the .SAFE folder"):
        metadata_file(tmp_path)
    path = written(tmp_path, "<a/>", "MTD_MSIL2A.xml")
    assert metadata_file(tmp_path) == metadata_file(path) == path
    written(tmp_path, "<a/>")
    with pytest.raises(ValueError, match="has both"):
        metadata_file(tmp_path)
    with pytest.raises(ValueError, match="there is no file or folder"):
        metadata_file(tmp_path / "none.SAFE")
    (tmp_path / "S2A.zip").write_text("")
    with pytest.raises(ValueError, match=r"S2A.zip is no .SAFE folder .*unpack"):
        metadata_file(tmp_path / "S2A.zip")
