"""Green is seen with red and near infrared where it lies on the same grid."""

import pytest

from fifesim.base.bands import GREEN
from fifesim.sensor.description.fields import false_colour_bands
from fifesim.sensor.description.instruments import instrument, instrument_names


@pytest.mark.parametrize("name", instrument_names())
def test_bands_share_a_grid(name):
    own = instrument(name)
    *green, red, near_infrared = false_colour_bands(own)
    assert (red, near_infrared) == tuple(own.red_and_near_infrared())
    for band in green:
        assert GREEN.low <= band.wavelength <= GREEN.high
        assert own.pixel(band) == own.pixel(red) == own.pixel(near_infrared)


@pytest.mark.parametrize(("name", "green"), [("TM", "TM2"), ("OLI", "OLI3"), ("MSI", "MSI3")])
def test_green_of_well_known_sensors(name, green):
    assert false_colour_bands(instrument(name))[0].name == green
