"""Colours, time, sun and view as a GIS reads them from the file."""

import numpy as np
import pytest
import rasterio
from rasterio.enums import ColorInterp

import fifesim


@pytest.fixture(scope="module")
def toa(lai_values):
    return fifesim.surface_reflectance(lai_values, bands=["TM2", "TM3", "TM4", "TM1", "TM7"]).fifesim.to_toa()


def written(raster, path):
    with rasterio.open(fifesim.to_geotiff(raster, path)) as source:
        return source.colorinterp, source.tags(), source.tags(ns="IMAGERY"), source.photometric


@pytest.mark.parametrize("bands", [["TM2", "TM3", "TM4"], ["TM3", "TM2", "TM1"], ["TM4"], ["TM7"], ["TM7", "TM1"]])
@pytest.mark.parametrize("dtype", ["uint8", "float64"])
def test_bands_have_the_colour_of_their_wavelength(toa, tmp_path, bands, dtype):
    """TM2, TM3 and TM4 are green, red and near infrared, wherever they stand."""
    image = toa.sel(band=bands)
    image = image.fifesim.sense("TM") if dtype == "uint8" else image
    near = ColorInterp.nir if hasattr(ColorInterp, "nir") else ColorInterp.undefined
    known = {"TM1": ColorInterp.blue, "TM2": ColorInterp.green, "TM3": ColorInterp.red, "TM4": near}
    expected = [known.get(name, ColorInterp.undefined) for name in bands]
    expected = [ColorInterp.gray] if bands == ["TM7"] else expected
    assert list(written(image, tmp_path / "image.tif")[0]) == expected


def test_time_sun_and_view_are_tags(toa, tmp_path):
    image = toa.fifesim.sense("TM").assign_coords(time=np.datetime64("1987-06-06T16:35:00.25", "ns"))
    _, tags, imagery, _ = written(image, tmp_path / "image.tif")
    assert tags["TIFFTAG_DATETIME"] == "1987:06:06 16:35:00"
    assert imagery["ACQUISITIONDATETIME"] == "1987-06-06 16:35:00"
    assert float(tags["SUN_ELEVATION"]) == pytest.approx(90 - float(image.sza), abs=1e-6)
    assert float(tags["SUN_AZIMUTH"]) == pytest.approx(float(image.saa), abs=1e-6)
    assert (tags["VIEW_ZENITH"], float(tags["sza"])) == ("0", float(image.sza))


def test_without_a_time_there_is_none(toa, tmp_path):
    _, tags, imagery, _ = written(toa.isel(band=0), tmp_path / "toa.tif")
    assert "TIFFTAG_DATETIME" not in tags and "ACQUISITIONDATETIME" not in imagery
