"""Instrument descriptions: Table 1 of the paper, sources, bands, gain states and ground sizes."""

import dataclasses

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

import fifesim
from fifesim.base.bands import GREEN
from fifesim.sensor.description.fields import Count, Name, Number, Positive, Share, band_called, false_colour_bands
from fifesim.sensor.description.instrument_file import Gain, Noise
from fifesim.sensor.description.instruments import instrument, instrument_names

LOW = instrument("ETM+").select("ETM3")[0].with_gain("low")
POINT = {"radiance": 22.0, "snr": 230.0}
PRODUCT = "[product]\ngain = 2e-5\noffset = -0.1\nbits = 16\nsun_corrected = false\n\n[lsf]"


def test_tm_agrees_with_table_1():
    """Footprint by hand: 9 x 4.778 urad x 705 km and 43 urad x 705 km."""
    tm, paper = instrument("TM"), instrument("TM", "paper")
    red, near_infrared = tm.select(["TM3", "TM4"])
    assert (red.full_scale_radiance, near_infrared.full_scale_radiance) == (204.3, 206.2)
    assert (red.min_radiance, near_infrared.min_radiance) == (-1.2, -1.5)
    assert (tm.bits, tm.altitude, tm.interval, tm.gsd) == (8, 705_000.0, 0.000043, 30.0)
    for lsf in (tm.paper_lsf, paper.lsf):
        assert (lsf.count, lsf.step, lsf.kind) == (9, 0.000004778, "cosine")
    np.testing.assert_allclose(paper.line_spread.width, 30.31641, rtol=1e-12)
    np.testing.assert_allclose(paper.line_spread.half_width, 15.158205, rtol=1e-12)
    np.testing.assert_allclose(paper.ground_interval, 30.315, rtol=1e-12)
    # MTF of the cosine at 0.5 cycles per interval, by hand.
    np.testing.assert_allclose(paper.line_spread.mtf(0.5 / 30.315), 0.6928, atol=1e-3)
    assert repr(tm) == (
        "Instrument TM: Landsat-5 Thematic Mapper, 30 m pixels from 705 km, 8 bits\n"
        "  bands TM1, TM2, TM3, TM4, TM5, TM7"
    )
    said = repr(red)
    assert said.startswith("InstrumentBand(name='TM3', srf=") and "None" not in said and len(said) < 240


def test_bands_are_selected_in_order_and_once():
    tm = instrument("TM")
    assert [band.name for band in tm.select(["TM4", "tm3"])] == ["TM4", "TM3"]
    assert [band.name for band in tm.select(["red", "nir", "B5"])] == ["TM3", "TM4", "TM5"]
    assert tm.select("TM3") == (tm.bands[2],) and tm.select() == tm.bands
    with pytest.raises(dataclasses.FrozenInstanceError):
        tm.altitude = 1.0


def test_band_values_override_instrument_values():
    """By hand: 86 urad and 60 urad from 705 km are 60.63 m and 42.3 m."""
    tm = instrument("TM")
    green, red = tm.select(["TM2", "TM3"])
    assert "Friedl" in tm.source("min_radiance", red) and "Markham" in tm.source("min_radiance", green)
    sources = tm.sources | {"ifov": "Friedl1995", "detectors": "Friedl1995"}
    own = dataclasses.replace(tm.bands[5], gsd=120.0, interval=86e-6, ifov=60e-6, detectors=4)
    mixed = dataclasses.replace(tm, bands=(*tm.bands[:5], own), sources=sources)
    assert mixed.pixel(own) == 120.0 and mixed.pixel(tm.bands[0]) == 30.0
    assert mixed.ground_intervals(own) == pytest.approx((60.63, 60.63), rel=1e-12)
    assert mixed.ground_fields(own) == pytest.approx((42.3, 42.3), rel=1e-12)
    assert tuple(mixed.ground_fields(tm.bands[0])) == (None, None)


def test_intervals_along_and_across_and_product_scale_are_read(changed):
    interval = "interval = 43.0e-6", "interval = { along = 40.0e-6, across = 44.0e-6 }"
    mine = changed(*interval, "[lsf]", PRODUCT, "\n[sources]", '\n[sources]\nproduct = "Chander2009"')
    along, across = mine.ground_intervals(mine.bands[0])
    assert (along, across) == pytest.approx((28.2, 31.02), rel=1e-12)
    assert mine.ground_interval == across
    product = mine.product
    assert (product.gain, product.offset, product.bits, product.sun_corrected) == (2e-5, -0.1, 16, False)


def test_with_gain_swaps_gain_states():
    (own,) = instrument("ETM+").select("ETM3")
    low = own.with_gain("low")
    assert own.with_gain("high") is own
    assert (low.gain, set(low.gains)) == ("low", {"high"})
    assert low.full_scale_radiance == own.gains["low"].full_scale_radiance > own.full_scale_radiance
    assert low.with_gain("high") == own


def test_noise_from_snr_equals_noise_from_nedl():
    """Half of the variance is shot noise: at 1/4 of the radiance, 1/8 + 1/2 of the variance remains."""
    by_ratio, by_radiance = Noise(radiance=80.0, snr=160.0, shot=0.5), Noise(radiance=80.0, nedl=0.5, shot=0.5)
    assert by_ratio.equivalent_radiance == by_radiance.equivalent_radiance == 0.5
    for noise in (by_ratio, by_radiance):
        model = noise.model(6, "columns")
        assert (model.detectors, model.along) == (6, "columns")
        found = model.noise_equivalent_radiance([80.0, 20.0])
        np.testing.assert_allclose(found, [0.5, 0.5 * np.sqrt(0.625)], rtol=1e-12)
    constant = Noise(radiance=80.0, snr=160.0, shot=0.0).model(1, "rows")
    assert (constant.shot, constant.thermal) == (0.0, 0.5)


# ------------------------------------------------------------------------------------------- fields and names


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
def test_fields_accept_only_valid_values(field, right, wrong):
    adapter = TypeAdapter(field)
    assert [adapter.validate_python(value) for value in right] == list(right)
    for value in wrong:
        with pytest.raises(ValidationError):
            adapter.validate_python(value)


def test_unknown_band_names_give_none():
    """Numbers after another word and missing bands have no match; VIIRS numbers two kinds of bands."""
    for name in ("nir1", "NIR_2", "re1", "tir1", "pan1", "vis06", "wvp2"):
        assert all(band_called(name, instrument(each)) is None for each in ("OLI", "MSI", "MODIS", "TM")), name
    for name in ("B6", "QA_PIXEL", "pan", "cirrus", "", "TM33"):
        assert band_called(name, instrument("TM")) is None, name
    viirs = instrument("VIIRS")
    called = [band_called(name, viirs).name for name in ("M03", "i3", "red", "M11", 11)]
    assert called == ["M3", "I3", "M5", "M11", "M11"]
    assert band_called("B3", viirs) is None and band_called("Landsat-5", viirs) is None
    assert band_called(7, instrument("TM")).name == "TM7"


@pytest.mark.parametrize("name", instrument_names())
def test_false_colour_bands_share_a_grid(name):
    own = instrument(name)
    *green, red, near_infrared = false_colour_bands(own)
    assert (red, near_infrared) == tuple(own.red_and_near_infrared())
    for band in green:
        assert GREEN.low <= band.wavelength <= GREEN.high
        assert own.pixel(band) == own.pixel(red) == own.pixel(near_infrared)
    known = {"TM": "TM2", "OLI": "OLI3", "MSI": "MSI3"}
    assert name not in known or green[0].name == known[name]


# ------------------------------------------------------------------------------------------- errors

TM = instrument("TM")
FIELDS = ("name", "title", "altitude", "gsd", "interval", "bits", "lsf", "bands", "sources", "references", "ifov")


def made(without="", **changes):
    """Instrument made in Python from the fields of TM."""
    fields = {name: getattr(TM, name) for name in FIELDS if name != without}
    return fifesim.Instrument(**(fields | changes))


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: TM.select(["TM3", "tm3"]), "bands of TM must be at least one, each once, got TM3, tm3"),
        (lambda: TM.select([]), "bands of TM must be at least one, each once, got none"),
        (lambda: TM.select(["TM3", "TM6"]), "unknown band of TM 'TM6': did you mean .* TM1, TM2, TM3, TM4, TM5"),
        (lambda: TM.select([3]), "band of TM: the name must be text, got 3"),
        (
            dataclasses.replace(TM, bands=TM.select(["TM1", "TM3"])).red_and_near_infrared,
            "TM has no near infrared band, 0.75 to 1 um: say which .* meant: TM1, TM3",
        ),
        (lambda: LOW.with_gain("medium"), "ETM3 has no gain state 'medium': it has low, high"),
        (lambda: TM.with_gain("high"), "no band of TM has a gain state 'high'"),
        (lambda: TM.with_gain({"TM3": "high"}), "TM3 has no gain state 'high': it has nominal"),
        (lambda: Gain(1.0, 1.0), "must be above min_radiance, got 1 and 1 W"),
        (lambda: dataclasses.replace(LOW, limits=(0.69, 0.63)), "limits: the first must be below the second"),
        (lambda: Noise(**POINT, high_radiance=150.0), "belong together"),
        (lambda: Noise(**POINT, high_radiance=20.0, high_snr=300.0), "must be above radiance = 22, got 20"),
        (lambda: Noise(**POINT, high_radiance=22.0, high_snr=300.0), "must be above radiance = 22, got 22"),
        (lambda: Noise(**POINT, high_radiance=150.0, high_snr=950.0, shot=0.5), "shot_share belongs to one"),
        (lambda: Noise(**POINT, high_radiance=150.0, high_snr=2000.0), "negative variance of shot"),
        (lambda: made(altitude=-1.0), "^Instrument: altitude = -1.0: must be above 0"),
        (lambda: made(bits=40), "^Instrument: bits = 40: must be at most 16"),
        (lambda: made(altitdue=1.0), "^Instrument: unknown argument altitdue, did you mean 'altitude'"),
        (lambda: made(references={}), "^Instrument: sources.altitude: must be one of"),
        (lambda: made("gsd"), "^Instrument: the argument gsd is missing$"),
        (lambda: dataclasses.replace(TM, gsd="wide"), "^Instrument: gsd = 'wide': must be a number$"),
    ],
)
def test_invalid_descriptions_raise(call, said):
    """Instruments, unlike their parts, raise errors that do not mention pydantic."""
    with pytest.raises((ValueError, TypeError), match=said) as caught:
        call()
    if said.startswith("^"):
        assert "pydantic" not in str(caught.value) and len(str(caught.value)) <= 500


def test_instrument_can_be_made_in_python():
    assert made(altitude=800e3).altitude == 800e3
