"""Styles for QGIS: the bands, values and colours that they name."""

from xml.etree import ElementTree

import numpy as np
import pytest

import fifesim
from fifesim.output.colours import dark_and_bright
from fifesim.output.maps import write_style


def style(raster, path):
    return ElementTree.parse(write_style(fifesim.to_geotiff(raster, path))).getroot().find("pipe/rasterrenderer")


@pytest.fixture(scope="module")
def image(travelled):
    return fifesim.open_image(travelled / "image.tif")


def limits(renderer, colour):
    found = renderer.find(f"{colour}ContrastEnhancement" if colour else "contrastEnhancement")
    assert found.find("algorithm").text == "StretchToMinimumMaximum"
    return [float(found.find(name).text) for name in ("minValue", "maxValue")]


def test_an_image_is_shown_in_false_colour_in_the_unit_that_qgis_counts_in(image, tmp_path):
    """QGIS multiplies digital numbers by the scale of their band before it stretches them."""
    renderer = style(image, tmp_path / "image.tif")
    assert renderer.get("type") == "multibandcolor"
    assert [renderer.get(f"{colour}Band") for colour in ("red", "green", "blue")] == ["3", "2", "1"]
    for colour, band in (("red", "TM4"), ("green", "TM3"), ("blue", "TM2")):
        expected = dark_and_bright(fifesim.to_radiance(image).sel(band=band))
        np.testing.assert_allclose(limits(renderer, colour), expected, rtol=1e-5)


@pytest.mark.parametrize(
    ("bands", "numbers"), [(["TM3", "TM4"], "2 1 1"), (["TM4", "TM2", "TM3"], "1 3 2"), (["TM2", "TM3"], None)]
)
def test_bands_are_found_by_their_wavelengths(image, tmp_path, bands, numbers):
    renderer = style(image.sel(band=bands), tmp_path / "image.tif")
    if numbers is None:
        assert (renderer.get("type"), renderer.get("grayBand")) == ("singlebandgray", "1")
        return
    assert " ".join(renderer.get(f"{colour}Band") for colour in ("red", "green", "blue")) == numbers


def test_without_near_infrared_colours_are_natural(lai, tmp_path):
    rho = fifesim.surface_reflectance(lai, bands=["TM1", "TM2", "TM3"])
    renderer = style(rho, tmp_path / "rho.tif")
    assert [renderer.get(f"{colour}Band") for colour in ("red", "green", "blue")] == ["3", "2", "1"]


def ramp(renderer):
    return [(float(item.get("value")), item.get("color")) for item in renderer.iter("item")]


def test_leaf_area_and_ndvi_have_ramps_of_their_own(image, travelled, tmp_path):
    truth = fifesim.open_image(travelled / "truth.tif")
    shown = ramp(style(truth, tmp_path / "truth.tif"))
    assert shown[0] == (0.0, "#ffffe5")
    assert shown[-1][0] == pytest.approx(float(np.percentile(truth.sel(band="lai"), 99)), rel=1e-5)
    assert [value for value, _ in shown] == sorted(value for value, _ in shown)
    ndvi = ramp(style(image.fifesim.ndvi(), tmp_path / "ndvi.tif"))
    assert (ndvi[0], ndvi[-1]) == ((0.0, "#440154"), (1.0, "#fde725"))


def test_no_data_is_not_stretched(image, tmp_path):
    holed = image.sel(band=["TM4"]).copy()
    holed[:, :, :15] = 0
    renderer = style(holed, tmp_path / "holed.tif")
    expected = np.percentile(fifesim.to_radiance(image).sel(band="TM4")[:, 15:], (1, 99))
    np.testing.assert_allclose(limits(renderer, ""), expected, rtol=1e-5)


def test_a_uniform_band_still_has_two_limits(image, tmp_path):
    low, high = limits(style(image.sel(band=["TM4"]).where(False, 7).astype("uint8"), tmp_path / "flat.tif"), "")
    assert low < high


def test_a_style_of_ones_own_stays(image, tmp_path):
    path = fifesim.to_geotiff(image, tmp_path / "image.tif")
    (tmp_path / "image.qml").write_text("mine")
    with pytest.raises(FileExistsError, match="overwrite=True"):
        write_style(path)
    assert (tmp_path / "image.qml").read_text() == "mine"
    assert "multibandcolor" in write_style(path, overwrite=True).read_text(encoding="utf-8")
