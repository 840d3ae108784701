"""Descriptions of instruments: the paper's Table 1, sources, and mistakes in a file."""

import dataclasses
import pickle
import tomllib

import numpy as np
import pytest

from fifesim import datasets
from fifesim.bands import solar_irradiance
from fifesim.sensor.instruments import Instrument, instrument, instrument_names, read_instrument

TM_FILE = datasets.path("instruments/tm.toml")


@pytest.fixture
def changed(tmp_path):
    """Reads the TM file after one replacement in its text."""

    def read(old, new):
        text = TM_FILE.read_text(encoding="utf-8")
        assert old in text
        path = tmp_path / "mine.toml"
        path.write_text(text.replace(old, new, 1), encoding="utf-8")
        return read_instrument(path)

    return read


def test_tm_is_table_1():
    tm = instrument("TM")
    red, near_infrared = tm.select(["TM3", "TM4"])
    assert (red.full_scale_radiance, near_infrared.full_scale_radiance) == (204.3, 206.2)
    assert (red.min_radiance, near_infrared.min_radiance) == (-1.2, -1.5)
    assert tm.bits == 8
    assert tm.altitude == 705_000.0
    assert tm.interval == 0.000043
    assert (tm.lsf.count, tm.lsf.step, tm.lsf.kind) == (9, 0.000004778, "cosine")


def test_footprint_of_tm_on_the_ground():
    """By hand: 9 x 4.778 urad x 705 km and 43 urad x 705 km."""
    tm = instrument("TM")
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
        assert 0 <= -band.min_radiance < 0.05 * band.full_scale_radiance
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


# Nominal limits of the reflective TM bands [um].
NOMINAL = {
    "TM1": (0.45, 0.52),
    "TM2": (0.52, 0.60),
    "TM3": (0.63, 0.69),
    "TM4": (0.76, 0.90),
    "TM5": (1.55, 1.75),
    "TM7": (2.08, 2.35),
}


@pytest.mark.parametrize("name", NOMINAL)
def test_response_lies_in_the_nominal_band(name):
    """Half of the maximum is reached within 0.04 um of the nominal limits, as built (TM5 is the furthest off)."""
    (band,) = instrument("TM").select(name)
    low, high = NOMINAL[name]
    assert band.response.name == name
    assert abs(band.wavelength - (low + high) / 2) < 0.15 * (high - low)
    half = [w for w, r in zip(band.response.wavelength, band.response.response, strict=True) if r > 0.5]
    np.testing.assert_allclose([half[0], half[-1]], [low, high], atol=0.04)


@pytest.mark.parametrize("name", NOMINAL)
def test_solar_irradiance_agrees_with_another_spectrum(name):
    """The agency integrates another solar spectrum than ASTM G173; spectra differ by up to 4 % in TM7."""
    (band,) = instrument("TM").select(name)
    np.testing.assert_allclose(band.solar_irradiance, solar_irradiance(band.response), rtol=0.05)


def test_bands_come_in_the_order_asked_for():
    tm = instrument("TM")
    assert [band.name for band in tm.select(["TM4", "tm3"])] == ["TM4", "TM3"]
    assert tm.select("TM3") == (tm.bands[2],)
    assert tm.select() == tm.bands


def test_names_are_found_in_any_case_and_instruments_pass_through():
    tm = instrument("tm")
    assert tm is instrument("TM")
    assert instrument(tm) is tm
    assert "TM" in instrument_names()


def test_unknown_names_list_the_nearest_and_all():
    with pytest.raises(ValueError, match=r"unknown instrument 'TN': did you mean TM\? There are .*TM"):
        instrument("TN")
    with pytest.raises(ValueError, match=r"unknown band of TM 'TM6': did you mean .* TM1, TM2, TM3, TM4, TM5"):
        instrument("TM").select(["TM3", "TM6"])
    with pytest.raises(TypeError, match="band of TM: the name must be text, got 3"):
        instrument("TM").select([3])


def test_instruments_are_frozen_hashable_and_picklable():
    tm = instrument("TM")
    with pytest.raises(dataclasses.FrozenInstanceError):
        tm.altitude = 1.0
    assert pickle.loads(pickle.dumps(tm)) == tm
    assert {tm: 1}[tm] == 1


def test_a_file_of_ones_own_is_read(changed):
    mine = changed("altitude = 705000.0", "altitude = 3000")
    assert isinstance(mine, Instrument)
    np.testing.assert_allclose(mine.ground_interval, 0.129, rtol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("bits = 8 ", "bitz = 8 ", "mine.toml: .*bits is missing; unknown key bitz"),
        ("bits = 8 ", "bits = 8.5 ", "mine.toml: bits = 8.5: .*integer"),
        ("bits = 8 ", "bits = 32 ", "mine.toml: bits = 32: .*16"),
        ("= 705000.0", "= '705 km'", "mine.toml: altitude = '705 km': .*number"),
        ("= 705000.0", "= -705000.0", "mine.toml: altitude = -705000.0: .*greater than 0"),
        ('"cosine"', '"sinc"', "lsf.kind = 'sinc': .*'cosine'"),
        ("= -1.5  ", "= 300.0  ", "bands.4: full_scale_radiance must be above min_radiance, got 206.2 and 300"),
        ("= 83.44", "= nan", "bands.6.solar_irradiance = nan: .*finite"),
        ('altitude = "Friedl1995"', 'altitude = "nobody"', "sources.altitude: must be one of .* got 'nobody'"),
        ('solar_irradiance = "Chander2009"', "", "sources.solar_irradiance: must be one of"),
        ('name = "TM2"', 'name = "TM1"', "each name may occur once"),
        ("gsd = 30.0", "gsd = ", "mine.toml is not valid TOML"),
    ],
)
def test_mistakes_in_a_file_name_the_key_and_the_value(changed, old, new, message):
    with pytest.raises(ValueError, match=message):
        changed(old, new)


def test_every_file_is_listed_under_the_name_it_gives():
    for path in TM_FILE.parent.glob("*.toml"):
        content = tomllib.loads(path.read_text(encoding="utf-8"))
        assert content["name"] in instrument_names()
