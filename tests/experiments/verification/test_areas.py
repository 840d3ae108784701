"""`fifesim verify` passes on a sound installation and names broken physics."""

import numpy as np
import pytest
from typer.testing import CliRunner

import fifesim
from fifesim.analysis import scaling
from fifesim.cli import app
from fifesim.experiments.verification import areas, canopy, deviations
from fifesim.experiments.verification.deviations import Deviation, by_stage, deviation_line, largest, rms_percent
from fifesim.ground.terrain import spline


def run():
    return CliRunner().invoke(app, ["verify"])


@pytest.fixture
def only(monkeypatch):
    """A function that leaves only one area to check."""
    return lambda area: monkeypatch.setattr(areas, "AREAS", {area: areas.AREAS[area]})


@pytest.mark.slow
def test_installation_is_within_all_bounds():
    result = run()
    *lines, last = result.stdout.splitlines()
    assert result.exit_code == 0, last
    checks = [line for line in lines[1:] if line and line not in deviations.AREA_STAGES.values()]
    assert last == f"{len(checks)} checks, all within their bounds"
    assert all(any(line.startswith(area) for line in lines) for area in areas.AREAS)
    assert any("6SV1.1" in line for line in lines) and any("prosail" in line for line in lines)


@pytest.mark.parametrize(
    "area, owner, name, wrong, said",
    [
        ("terrain", spline, "spline_grid", np.nan, "terrain: wave of six cells"),
        ("analysis", scaling, "ndvi_hessian", 1.01, "analysis: second derivatives of NDVI"),
    ],
)
def test_broken_physics_is_named_with_exit_code_1(monkeypatch, only, area, owner, name, wrong, said):
    only(area)
    right = getattr(owner, name)
    monkeypatch.setattr(owner, name, lambda *given, **options: wrong * np.asarray(right(*given, **options)))
    result = run()
    assert result.exit_code == 1
    last = result.stdout.splitlines()[-1]
    assert "beyond their bounds" in last and said in last
    assert sum("EXCEEDED" in line for line in result.stdout.splitlines()) == last.count(f"{area}: ")


def test_missing_table_is_one_line_with_exit_code_1(monkeypatch):
    def missing(name):
        raise FileNotFoundError(f"the data file {name!r} is missing from this installation: reinstall fifesim")

    monkeypatch.setattr(areas, "AREAS", {"canopy": (canopy._other_sail,)})
    monkeypatch.setattr(canopy.files, "table", missing)
    result = run()
    assert result.exit_code == 1
    assert result.stderr.strip().splitlines() == [
        "fifesim: the data file 'verification/sail.csv' is missing from this installation: reinstall fifesim"
    ]


def test_python_function_returns_the_printed_deviations(only):
    only("sensor")
    found = fifesim.verify()
    assert [each.what for each in found] == [each.what for each in areas.deviations()]
    assert all(each.area == "sensor" and each.within for each in found)
    assert len(run().stdout.splitlines()) == len(found) + 4


WITHIN = Deviation("terrain", "slope of planes", 1e-12, 1e-9, "degree", "plane")
BEYOND = Deviation("canopy", "reciprocity", 0.2, 0.1, "1", "theory")


def test_columns_are_aligned_and_the_summary_names_exceeded_bounds():
    for word, text in (("compared", "slope of planes"), ("with", "plane")):
        assert deviation_line(WITHIN).rindex(text) == deviations.HEADING.index(word)
    assert "EXCEEDED" in deviation_line(BEYOND) and "EXCEEDED" not in deviation_line(WITHIN)
    assert deviations.deviation_summary([WITHIN, WITHIN]) == "2 checks, all within their bounds"
    said = "2 checks, 1 beyond their bounds: canopy: reciprocity"
    assert deviations.deviation_summary([WITHIN, BEYOND]) == said


def test_every_stage_has_one_heading():
    sensor = Deviation("sensor", "counts", 0.0, 0.5, "count", "table")
    lines = list(by_stage([BEYOND, WITHIN, sensor]))
    assert [text.strip() for text in lines if text.startswith("\n")] == ["Ground", "Sensor"]
    assert lines[1:3] == [deviation_line(BEYOND), deviation_line(WITHIN)] and lines[4:] == [deviation_line(sensor)]


def test_largest_and_rms_deviation_and_nan_exceeds_every_bound():
    assert np.isnan(largest([1.0, np.nan], 1.0))
    assert not Deviation("canopy", "anything", np.nan, 1.0, "1", "theory").within
    assert Deviation("canopy", "anything", 1.0, 1.0, "1", "theory").within
    assert largest([1.0, 4.0], [2.0, 2.0]) == 2.0 and largest([1.0, 4.0], [2.0, 4.0], relative=True) == 0.5
    assert rms_percent([1.03, 0.96], 1.0) == pytest.approx(np.sqrt((9 + 16) / 2), rel=1e-12)
