"""What a mosaic names, and what in one is refused before GDAL sees it."""

import pytest

from fifesim.grids import opening

# ruff: noqa: E501
ATTACKS = {
    "subClass": '<VRTDataset subClass="VRTWarpedDataset"/>',
    "raw": '<VRTDataset><VRTRasterBand subClass="VRTRawRasterBand"><SourceFilename>a.tif</SourceFilename></VRTRasterBand></VRTDataset>',
    "python": '<VRTDataset><VRTRasterBand subClass="VRTDerivedRasterBand"><PixelFunctionLanguage>Python</PixelFunctionLanguage></VRTRasterBand></VRTDataset>',
    "other case": "<VRTDataset><sourcefilename>a.tif</sourcefilename></VRTDataset>",
    "options": '<VRTDataset><OpenOptions><OOI key="a">b</OOI></OpenOptions></VRTDataset>',
    "overviews": '<VRTDataset><Metadata domain="OVERVIEWS"><MDI key="overview_file">/etc/a</MDI></Metadata></VRTDataset>',
    "entity": '<!DOCTYPE a [<!ENTITY b "c">]><VRTDataset><SourceFilename>&b;</SourceFilename></VRTDataset>',
    "inline": "<VRTDataset><SourceFilename>&lt;VRTDataset/&gt;</SourceFilename></VRTDataset>",
    "blanks": "<VRTDataset><SourceFilename> a.tif</SourceFilename></VRTDataset>",
    "address": "<VRTDataset><SourceFilename>http://localhost/a.tif</SourceFilename></VRTDataset>",
    "twice": '<VRTDataset><SourceFilename relativeToVRT="1" relativetovrt="0">a.tif</SourceFilename></VRTDataset>',
    "neither": '<VRTDataset><SourceFilename relativeToVRT="yes">a.tif</SourceFilename></VRTDataset>',
    "missing": '<VRTDataset><SourceFilename relativeToVRT="1">b.tif</SourceFilename></VRTDataset>',
    "broken": "<VRTDataset><",
}  # fmt: skip


@pytest.mark.parametrize("text", ATTACKS.values(), ids=ATTACKS)
def test_what_may_lead_elsewhere_is_refused(tmp_path, text):
    (tmp_path / "a.tif").touch()
    (tmp_path / "a.vrt").write_text(text)
    assert opening.is_mosaic(tmp_path / "a.vrt")
    with pytest.raises(ValueError, match=r"^(with|of|whose) "):
        opening.mosaic_sources(tmp_path / "a.vrt")


def test_files_are_named_once(tmp_path):
    (tmp_path / "a.tif").touch()
    one = '<SimpleSource><SourceFilename relativeToVRT="1">a.tif</SourceFilename></SimpleSource>'
    (tmp_path / "a.vrt").write_text(f'<VRTDataset><VRTRasterBand band="1">{one}{one}</VRTRasterBand></VRTDataset>')
    assert opening.mosaic_sources(tmp_path / "a.vrt") == [str(tmp_path / "a.tif")]


def test_descriptions_are_known_by_their_first_character(tmp_path):
    for text, expected in (("\n <GDAL_WMS/>", True), ('{"type":"Feature"}', True), ("ncols 3", False), ("", False)):
        (tmp_path / "a").write_text(text)
        assert opening.is_description(tmp_path / "a") == expected
