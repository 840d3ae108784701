"""Bands by the names that agencies and catalogues give them."""

import pytest

from fifesim.sensor.description.fields import band_called
from fifesim.sensor.description.instruments import instrument


@pytest.mark.parametrize(
    ("sensor", "name", "band"),
    [
        ("Sentinel-2", "B04", "MSI4"),
        ("Sentinel-2", "B8A", "MSI8A"),
        ("Sentinel-2", "B08", "MSI8"),
        ("Sentinel-2", "nir", "MSI8"),
        ("Sentinel-2", "nir08", "MSI8A"),
        ("Sentinel-2", "nir09", "MSI9"),
        ("Sentinel-2", "rededge071", "MSI5"),
        ("Sentinel-2", "rededge3", "MSI7"),
        ("Sentinel-2", "coastal", "MSI1"),
        ("Sentinel-2", "swir16", "MSI11"),
        ("Landsat 8", "SR_B4", "OLI4"),
        ("Landsat 8", "red", "OLI4"),
        ("Landsat 8", "cirrus", "OLI9"),
        ("Landsat 8", "swir1", "OLI6"),
        ("Landsat 8", "swir2", "OLI7"),
        ("landsat_5", "blue", "TM1"),
        ("Landsat-5", 7, "TM7"),
        ("Landsat 7", "swir22", "ETM7"),
        ("Terra", "sur_refl_b01", "MODIS1"),
        ("SPOT-1", "green", "XS1"),
        ("NOAA-9", "nir", "AVHRR2"),
    ],
)
def test_names_that_people_have(sensor, name, band):
    assert band_called(name, instrument(sensor)).name == band


@pytest.mark.parametrize("name", ["nir1", "NIR_2", "re1", "tir1", "pan1", "vis06", "wvp2"])
def test_a_number_behind_another_word_is_no_band(name):
    assert all(band_called(name, instrument(each)) is None for each in ("OLI", "MSI", "MODIS", "TM"))


@pytest.mark.parametrize("name", ["B6", "QA_PIXEL", "pan", "cirrus", "", "TM33"])
def test_what_the_thematic_mapper_has_not(name):
    assert band_called(name, instrument("TM")) is None
