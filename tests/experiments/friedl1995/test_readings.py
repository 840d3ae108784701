"""Readings of Table 1."""

import pytest

from fifesim.experiments.friedl1995.case import ALIGNED, NATIVE, READINGS, beside, reading_of
from fifesim.sensor.description.instruments import instrument, read_instrument

PAPER = instrument("TM", "paper")
OTHER = [name for name, reading in READINGS.items() if reading.other_response]


def test_blur_is_that_measured_in_flight():
    """Half of the modulation passes at half of the frequency that the field of view is a half period of."""
    for name, metres in (("blur-40.8", 40.8), ("blur-48.6", 48.6)):
        spread = READINGS[name].instrument(PAPER).line_spread
        assert float(spread.mtf(1 / (2 * metres))) == pytest.approx(0.5, abs=1e-4)
    assert READINGS["narrow"].instrument(PAPER).line_spread.width == pytest.approx(7 / 9 * 30.32, abs=0.005)


@pytest.mark.parametrize("name", OTHER)
def test_instrument_file_of_a_reading_is_that_instrument(name, tmp_path):
    reading, tm = READINGS[name], PAPER
    (tmp_path / "own.toml").write_text(reading.instrument_file(tm.altitude), encoding="utf-8")
    read, made = read_instrument(tmp_path / "own.toml"), reading.instrument(tm)
    assert read.lsf == made.lsf != tm.lsf
    assert read.bands == made.bands and read.bits == made.bits and read.ground_interval == made.ground_interval
    # Its source is no longer the paper.
    assert read.sources["lsf"] == name and name in read.references


def test_other_readings_leave_the_instrument_as_it_is():
    tm = instrument("TM")
    assert all(reading.instrument(tm) is tm for name, reading in READINGS.items() if name not in OTHER)


def test_aligned_reading_stands_beside_every_other():
    assert all(beside(reading) == [reading, ALIGNED] for reading in READINGS.values() if reading != ALIGNED)
    assert beside(ALIGNED) == [ALIGNED, NATIVE]


@pytest.mark.parametrize(
    ("name", "sensor", "said"),
    [
        ("blurred", "TM", "must be one of native, aligned, narrow"),
        ("narrow", "OLI", "for OLI use native, aligned, offset"),
    ],
)
def test_reading_that_there_is_not_is_refused(name, sensor, said):
    with pytest.raises(ValueError, match=said):
        reading_of(name, sensor)


def test_words_of_a_reading_are_those_of_the_instrument():
    assert all(each.in_words(43e-6 * 705000, 30.0) == each.text for each in READINGS.values())
    assert "every 21.900 m" in NATIVE.in_words(21.9, 20.0) and "the 20 m blocks" in NATIVE.in_words(21.9, 20.0)
