"""Deviations in words."""

from fifesim.experiments.verification.deviations import HEADING, Deviation, by_stage, deviation_line, deviation_summary

WITHIN = Deviation("terrain", "slope of planes", 1e-12, 1e-9, "degree", "plane")
BEYOND = Deviation("canopy", "reciprocity", 0.2, 0.1, "1", "theory")


def test_numbers_stand_below_their_headings():
    for word, text in (("compared", "slope of planes"), ("with", "plane")):
        assert deviation_line(WITHIN).rindex(text) == HEADING.index(word)
    assert "EXCEEDED" in deviation_line(BEYOND) and "EXCEEDED" not in deviation_line(WITHIN)


def test_summary_names_what_is_beyond():
    assert deviation_summary([WITHIN, WITHIN]) == "2 checks, all within their bounds"
    assert deviation_summary([WITHIN, BEYOND]) == "2 checks, 1 beyond their bounds: canopy: reciprocity"


def test_every_stage_has_one_heading():
    sensor = Deviation("sensor", "counts", 0.0, 0.5, "count", "table")
    lines = list(by_stage([BEYOND, WITHIN, sensor]))
    assert [text.strip() for text in lines if text.startswith("\n")] == ["Ground", "Sensor"]
    assert lines[1:3] == [deviation_line(BEYOND), deviation_line(WITHIN)] and lines[4:] == [deviation_line(sensor)]
