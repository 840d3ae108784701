"""Instruments by name and from files of one's own, and what is said of mistakes in them."""

import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

from fifesim.base import files
from fifesim.sensor.description.instrument_file import Instrument
from fifesim.sensor.description.instruments import instrument

TM_FILE = files.path("instruments/tm.toml")


def test_names_are_found_in_any_case_and_instruments_pass_through():
    tm = instrument("tm")
    assert tm is instrument("TM") is instrument(tm)
    with pytest.raises(ValueError, match=r"unknown instrument 'TN': did you mean TM\b.*\? There are .*TM"):
        instrument("TN")
    # A suffix tells a file from a name.
    with pytest.raises(ValueError, match=r"unknown instrument '\.toml'"):
        instrument(".toml")
    with pytest.raises(FileNotFoundError, match=r"there is no instrument file .*nowhere\.toml"):
        instrument("nowhere.toml")


def test_a_path_that_ends_in_toml_is_read_and_read_again_when_it_changed(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(TM_FILE.read_text(encoding="utf-8"), encoding="utf-8")
    assert instrument(str(path)) == instrument(path) == instrument("TM")
    assert instrument(str(path)) is instrument(str(path))
    path.write_text(TM_FILE.read_text(encoding="utf-8").replace("bits = 8 ", "bits = 11 "), encoding="utf-8")
    assert instrument(str(path)).bits == 11


def test_a_file_of_ones_own_is_read(changed):
    mine = changed("altitude = 705000.0", "altitude = 3000", "swath = 185000.0", "")
    assert isinstance(mine, Instrument)
    np.testing.assert_allclose(mine.ground_interval, 0.129, rtol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("bits = 8 ", "bitz = 8 ", "mine.toml: .*bits is missing; unknown key bitz, did you mean 'bits'"),
        ("bits = 8 ", "bits = 8.5 ", "mine.toml: bits = 8.5: must be a whole number"),
        ("bits = 8 ", "bits = 32 ", "mine.toml: bits = 32: .*16"),
        ("= 705000.0", "= '705 km'", "mine.toml: altitude = '705 km': .*number"),
        ("= 705000.0", "= -705000.0", "mine.toml: altitude = -705000.0: must be above 0"),
        ('"cosine"', '"sinc"', "mine.toml: lsf.kind = 'sinc': it must be one of 'cosine', 'boxcar'"),
        ('kind = "cosine"', "", "mine.toml: the key lsf.kind is missing"),
        ("count = 9", "count = 0", "mine.toml: lsf.count = 0: must be above 0"),
        ('kind = "cosine"', 'kind = "boxcar"', "mine.toml: unknown key lsf.step; unknown key lsf.count"),
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


def test_a_file_that_would_wait_or_break_is_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe.toml")
    (tmp_path / "deep.toml").write_text("x = " + "[" * 5000)
    for name, said in (("pipe.toml", "is a pipe: name a file"), ("deep.toml", "nests its tables too deeply")):
        with pytest.raises(ValueError, match=said):
            instrument(tmp_path / name)


def test_what_is_said_of_a_value_is_short_and_prints(changed):
    with pytest.raises(ValueError, match=r"bits = '\\x1baaa.*must be a whole number") as caught:
        changed("bits = 8 ", f'bits = "\\u001b{"a" * 5000}" ')
    assert len(str(caught.value)) <= 400 and str(caught.value).isprintable()


def test_tables_of_a_file_are_found_from_wherever_it_was_named(tmp_path, monkeypatch):
    """A relative path means another file once Python is elsewhere."""
    text = files.path("instruments/avhrr9.toml").read_text(encoding="utf-8")
    (tmp_path / "mine.toml").write_text(text.replace("avhrr_response.csv", "own.csv"), encoding="utf-8")
    shutil.copy(files.path("avhrr_response.csv"), tmp_path / "own.csv")
    monkeypatch.chdir(tmp_path)
    mine = instrument("mine.toml")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir("elsewhere")
    assert [band.response for band in mine.bands] == [band.response for band in instrument("AVHRR9").bands]


def test_an_instrument_called_as_its_file_is_found_without_reading_the_others():
    """To read all takes ten times as long; by an alias it is the same one."""
    code = "import fifesim.sensor.description.instruments as i; tm = i.instrument('Tm'); count = i._listed.cache_info()"
    code += ".currsize; assert count == 1, count; assert i.instrument('Landsat 5') is tm"
    subprocess.run([sys.executable, "-c", code], check=True)
