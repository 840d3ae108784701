"""Fields and names of instrument files, and the messages about mistakes in them."""

from dataclasses import replace
from typing import NamedTuple

import pytest
from pydantic import TypeAdapter, ValidationError

import fifesim
from fifesim.base.bands import GREEN
from fifesim.sensor.description.fields import (
    AlongAcross,
    Angles,
    Count,
    Name,
    Number,
    Positive,
    Share,
    band_called,
    by_axes,
    false_colour_bands,
    lookup,
)
from fifesim.sensor.description.instruments import instrument, instrument_names
from fifesim.sensor.description.spatial_response import BoxcarResponse, TwoAxesResponse


@pytest.mark.parametrize(
    ("field", "right", "wrong"),
    [
        (Number, (-1.5, 0, 3), ("1.5", True, float("nan"), float("inf"))),
        (Positive, (1e-9, 2), (0, -1.0, "1", float("inf"))),
        (Count, (1, 16), (0, 1.0, "1", True)),
        (Share, (0.5, 1e-3), (0.0, 1.0, 30.0)),
        (Name, ("TM", "B 3", "röd"), ("", 5, "B\x1b[31m", "B\n", "B" * 201)),
    ],
)
def test_a_field_takes_its_own_kind_alone(field, right, wrong):
    adapter = TypeAdapter(field)
    assert [adapter.validate_python(value) for value in right] == list(right)
    for value in wrong:
        with pytest.raises(ValidationError):
            adapter.validate_python(value)


def test_values_stand_along_and_across():
    wide, narrow = BoxcarResponse("boxcar", width=2e-3), BoxcarResponse("boxcar", width=1e-3)
    assert by_axes(Angles(along=1.3e-3, across=0.95e-3)) == AlongAcross(1.3e-3, 0.95e-3)
    assert by_axes(TwoAxesResponse(along=wide, across=narrow)) == AlongAcross(wide, narrow)
    assert by_axes(wide) == AlongAcross(wide, wide)
    assert by_axes(None) == AlongAcross(None, None)


class Named(NamedTuple):
    name: str


KNOWN = {"tm": Named("TM"), "landsat5tm": Named("TM"), "oli": Named("OLI"), "hrv": Named("HRV")}


def test_any_case_finds_a_name_and_nearest_names_come_first_and_each_once():
    for name in ("TM", "tm", "landsat-5 tm", "LANDSAT 5_TM"):
        assert lookup(name, KNOWN, "instrument") == Named("TM")
    with pytest.raises(ValueError, match=r"^unknown instrument 'OIL': did you mean OLI\? There are TM, OLI, HRV$"):
        lookup("OIL", KNOWN, "instrument")
    with pytest.raises(ValueError, match=r"^unknown instrument 'zzzz': There are TM, OLI, HRV$"):
        lookup("zzzz", KNOWN, "instrument")
    with pytest.raises(TypeError, match="instrument: the name must be text, got None"):
        lookup(None, KNOWN, "instrument")


def test_names_of_no_band_have_none():
    """Numbers behind another word, and what the instrument lacks; VIIRS counts two kinds of bands."""
    for name in ("nir1", "NIR_2", "re1", "tir1", "pan1", "vis06", "wvp2"):
        assert all(band_called(name, instrument(each)) is None for each in ("OLI", "MSI", "MODIS", "TM")), name
    for name in ("B6", "QA_PIXEL", "pan", "cirrus", "", "TM33"):
        assert band_called(name, instrument("TM")) is None, name
    viirs = instrument("VIIRS")
    assert [band_called(name, viirs).name for name in ("M03", "i3", "red", "M11", 11)] == [
        "M3",
        "I3",
        "M5",
        "M11",
        "M11",
    ]
    assert band_called("B3", viirs) is None and band_called("Landsat-5", viirs) is None
    assert band_called(7, instrument("TM")).name == "TM7"


@pytest.mark.parametrize("name", instrument_names())
def test_false_colours_share_a_grid(name):
    own = instrument(name)
    *green, red, near_infrared = false_colour_bands(own)
    assert (red, near_infrared) == tuple(own.red_and_near_infrared())
    for band in green:
        assert GREEN.low <= band.wavelength <= GREEN.high
        assert own.pixel(band) == own.pixel(red) == own.pixel(near_infrared)
    known = {"TM": "TM2", "OLI": "OLI3", "MSI": "MSI3"}
    assert name not in known or green[0].name == known[name]


def _numbers(**changes):
    tm = instrument("TM")
    names = ("name", "title", "altitude", "gsd", "interval", "bits", "lsf", "bands", "sources", "references", "ifov")
    return {name: getattr(tm, name) for name in names} | changes


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"altitude": -1.0}, "Instrument: altitude = -1.0: must be above 0"),
        ({"bits": 40}, "Instrument: bits = 40: must be at most 16"),
        ({"altitdue": 1.0}, "Instrument: unknown argument altitdue, did you mean 'altitude'"),
        ({"references": {}}, "Instrument: sources.altitude: must be one of"),
    ],
)
def test_an_instrument_made_in_python_refuses_in_own_words(changes, said):
    with pytest.raises(ValueError) as caught:
        fifesim.Instrument(**_numbers(**changes))
    assert str(caught.value).startswith(said)
    assert "pydantic" not in str(caught.value) and len(str(caught.value)) <= 500


def test_an_instrument_made_in_python_needs_its_arguments_and_is_made_of_right_ones():
    assert fifesim.Instrument(**_numbers(altitude=800e3)).altitude == 800e3
    numbers = _numbers()
    del numbers["gsd"]
    with pytest.raises(ValueError, match=r"^Instrument: the argument gsd is missing$"):
        fifesim.Instrument(**numbers)
    with pytest.raises(ValueError, match=r"^Instrument: gsd = 'wide': must be a number$"):
        replace(instrument("TM"), gsd="wide")
