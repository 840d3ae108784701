"""Metadata files of Sentinel-2 products."""

from xml.etree import ElementTree

import pytest

from fifesim.sensor.products import sentinel2 as files
from fifesim.sensor.products.sentinel2 import sentinel2_metadata_file


def written(folder, text, name="MTD_MSIL1C.xml"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


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
    (tmp_path / "S2A.zip").write_text("")
    with pytest.raises(ValueError, match=r"S2A.zip is no .SAFE folder .*unpack"):
        sentinel2_metadata_file(tmp_path / "S2A.zip")


@pytest.mark.parametrize(
    "names",
    [
        ["metadata.xml", "B01.jp2", "B8A.jp2", "tileInfo.json"],
        ["productInfo.json", "metadata.xml"],
        ["R10m/B02.jp2", "R20m/B05.jp2", "qi/CLD_20m.jp2"],
        ["granule_metadata.xml", "B04.tif", "SCL.tif"],
    ],
)
def test_the_layout_of_the_aws_buckets_is_named(tmp_path, names):
    for name in names:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("")
    first = tmp_path / names[0]
    for path in (tmp_path, first):
        with pytest.raises(
            ValueError, match=r"layout of the AWS buckets .*dataspace\.copernicus\.eu\), unpack it"
        ) as error:
            sentinel2_metadata_file(path)
        assert "2016" not in str(error.value)


def test_the_form_of_before_december_2016_is_named(tmp_path):
    (tmp_path / "S2A_OPER_MTD_SAFL1C_PDMC_20151206T093912_R090_V20151206T043239.xml").write_text("")
    with pytest.raises(ValueError, match="form of before December 2016, so take the reprocessed product"):
        sentinel2_metadata_file(tmp_path)


XML = ElementTree.fromstring("<a><b>1</b><b> 1 </b><c>1</c><c>2</c><d k='x'>3</d><d k='y'>4</d><e>inf</e></a>")


def test_values_of_elements():
    assert files.text_of(XML, "b") == "1" and files.number_of(XML, "b") == 1.0
    assert files.numbers_by_band(XML, "d", "k") == {"x": 3.0, "y": 4.0}
    for path, said in (("c", "c stands 2 times with different values, 1, 2"), ("e", "must be a number"), ("f", "no f")):
        with pytest.raises(ValueError, match=said):
            files.number_of(XML, path)
    with pytest.raises(ValueError, match="d stands twice for None"):
        files.numbers_by_band(XML, "d", "other")
