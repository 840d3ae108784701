"""An instrument: the paper's Table 1, sources, bands, and what it sees on the ground."""

import dataclasses
import pickle

import numpy as np
import pytest

from fifesim.sensor.description.instruments import instrument, instrument_names


def test_tm_is_table_1():
    tm = instrument("TM")
    red, near_infrared = tm.select(["TM3", "TM4"])
    assert (red.full_scale_radiance, near_infrared.full_scale_radiance) == (204.3, 206.2)
    assert (red.min_radiance, near_infrared.min_radiance) == (-1.2, -1.5)
    assert tm.bits == 8
    assert tm.altitude == 705_000.0
    assert tm.interval == 0.000043
    for lsf in (tm.paper_lsf, instrument("TM", "paper").lsf):
        assert (lsf.count, lsf.step, lsf.kind) == (9, 0.000004778, "cosine")


def test_footprint_of_tm_on_the_ground():
    """By hand: 9 x 4.778 urad x 705 km and 43 urad x 705 km."""
    tm = instrument("TM", "paper")
    np.testing.assert_allclose(tm.line_spread.width, 30.31641, rtol=1e-12)
    np.testing.assert_allclose(tm.line_spread.half_width, 15.158205, rtol=1e-12)
    np.testing.assert_allclose(tm.ground_interval, 30.315, rtol=1e-12)
    assert tm.gsd == 30.0


@pytest.mark.parametrize("name", instrument_names())
def test_every_number_of_every_band_is_present_and_has_a_source(name):
    item = instrument(name)
    for number in ("altitude", "gsd", "interval", "bits", "lsf"):
        assert item.source(number)
    for band in item.bands:
        # The products of OLI reach down to a reflectance of -0.1, those of others less far; MSS begins above the dark.
        above = 0.04 * band.full_scale_radiance if name.startswith("MSS") else 0.0
        assert -above <= -band.min_radiance < 0.09 * band.full_scale_radiance
        assert band.solar_irradiance > band.full_scale_radiance
        for number in ("srf", "full_scale_radiance", "min_radiance", "solar_irradiance"):
            assert len(item.source(number, band)) > 20


def test_bands_of_tm():
    assert [band.name for band in instrument("TM").bands] == ["TM1", "TM2", "TM3", "TM4", "TM5", "TM7"]


def test_a_band_names_its_own_source_first():
    tm = instrument("TM")
    green, red = tm.select(["TM2", "TM3"])
    assert "Friedl" in tm.source("min_radiance", red)
    assert "Markham" in tm.source("min_radiance", green)


def test_bands_come_in_the_order_asked_for():
    tm = instrument("TM")
    assert [band.name for band in tm.select(["TM4", "tm3"])] == ["TM4", "TM3"]
    assert [band.name for band in tm.select(["red", "nir", "B5"])] == ["TM3", "TM4", "TM5"]
    assert tm.select("TM3") == (tm.bands[2],)
    assert tm.select() == tm.bands


def test_instruments_are_frozen_hashable_and_picklable():
    tm = instrument("TM")
    with pytest.raises(dataclasses.FrozenInstanceError):
        tm.altitude = 1.0
    assert pickle.loads(pickle.dumps(tm)) == tm
    assert {tm: 1}[tm] == 1


def test_unknown_gain_states_are_named():
    with pytest.raises(ValueError, match="no band of TM has a gain state 'high'"):
        instrument("TM").with_gain("high")
    with pytest.raises(ValueError, match="TM3 has no gain state 'high': it has nominal"):
        instrument("TM").with_gain({"TM3": "high"})


def test_what_a_band_gives_stands_before_what_its_instrument_gives():
    """By hand: 86 urad and 60 urad from 705 km are 60.63 m and 42.3 m."""
    tm = instrument("TM")
    sources = tm.sources | {"ifov": "Friedl1995", "detectors": "Friedl1995"}
    own = dataclasses.replace(tm.bands[5], gsd=120.0, interval=86e-6, ifov=60e-6, detectors=4)
    mixed = dataclasses.replace(tm, bands=(*tm.bands[:5], own), sources=sources)
    assert mixed.pixel(own) == 120.0 and mixed.pixel(tm.bands[0]) == 30.0
    assert mixed.ground_intervals(own) == pytest.approx((60.63, 60.63), rel=1e-12)
    assert mixed.ground_fields(own) == pytest.approx((42.3, 42.3), rel=1e-12)
    assert tuple(mixed.ground_fields(tm.bands[0])) == (None, None)


def test_largest_angle_is_that_of_the_scan_or_none():
    tm = instrument("TM")
    assert tm.max_angle == tm.scan.max_angle == 7.47
    assert dataclasses.replace(tm, scan=None).max_angle == np.inf


def test_bands_are_asked_for_once():
    with pytest.raises(ValueError, match="bands of TM must be at least one, each once, got TM3, tm3"):
        instrument("TM").select(["TM3", "tm3"])
    with pytest.raises(ValueError, match="at least one, each once, got none"):
        instrument("TM").select([])


def test_instrument_is_told_in_two_lines():
    assert repr(instrument("TM")) == (
        "Instrument TM: Landsat-5 Thematic Mapper, 30 m pixels from 705 km, 8 bits\n"
        "  bands TM1, TM2, TM3, TM4, TM5, TM7"
    )


def test_red_and_near_infrared_are_found_by_wavelength():
    assert [band.name for band in instrument("OLI").red_and_near_infrared()] == ["OLI4", "OLI5"]
    blue = dataclasses.replace(instrument("TM"), bands=instrument("TM").select(["TM1", "TM3"]))
    with pytest.raises(ValueError, match=r"TM has no near infrared band, 0.75 to 1 um: say which .* meant: TM1, TM3"):
        blue.red_and_near_infrared()
