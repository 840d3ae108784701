"""The instrument that a raster carries."""

import dataclasses

import pytest
import xarray as xr

from fifesim.sensor.description.instruments import instrument, instrument_names
from fifesim.sensor.instrument_labels import attributes_of, carried_instrument, given_instrument


def raster(**attrs):
    return xr.DataArray(0.1, name="mine", attrs=attrs)


def responses(description):
    return [band.response for band in description.bands]


@pytest.mark.parametrize("name", instrument_names())
def test_an_instrument_of_ones_own_comes_back_whole(name):
    own = dataclasses.replace(instrument(name), name="MINE")
    again = carried_instrument(raster(**attributes_of(own)))
    assert responses(again) == responses(own)
    assert [again.line_spreads(band) for band in again.bands] == [own.line_spreads(band) for band in own.bands]
    srf = own.bands[0].srf
    assert dataclasses.replace(again, bands=tuple(dataclasses.replace(b, srf=srf) for b in again.bands)) == (
        dataclasses.replace(own, bands=tuple(dataclasses.replace(b, srf=srf) for b in own.bands))
    )


def test_one_of_fifesims_is_a_name():
    assert attributes_of(instrument("TM")) == {"instrument": "TM"}
    assert carried_instrument(raster(instrument="TM")) is instrument("TM")
    assert carried_instrument(raster(instrument="landsat 5")) is instrument("TM"), "an alias"
    assert carried_instrument(raster()) is None
    other = dataclasses.replace(instrument("TM"), bits=10)
    assert carried_instrument(raster(**attributes_of(other))).bits == 10, "another instrument of the same name"


def test_given_wins_over_carried(lai):
    assert given_instrument("MSI", raster(instrument="TM")).name == "MSI"
    assert given_instrument(None, raster(instrument="OLI")).name == "OLI"
    assert given_instrument(None, lai).name == "TM"


def test_what_nobody_says_is_asked_for():
    with pytest.raises(ValueError, match="the instrument of mine is unknown: give instrument=, one of AVHRR"):
        given_instrument(None, raster())
    with pytest.raises(ValueError, match="for an instrument 'MINE', which fifesim does not have: give instrument="):
        carried_instrument(raster(instrument="MINE"))
    with pytest.raises(ValueError, match="instrument_description is no instrument"):
        carried_instrument(raster(instrument="MINE", instrument_description='{"name": "MINE"}'))
