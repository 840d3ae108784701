"""Conclusions on the report page follow from its numbers."""

import re

import pandas as pd
import pytest
from matplotlib.figure import Figure
from mistakes import mistakes
from typer.testing import CliRunner

from fifesim.cli import app
from fifesim.experiments.friedl1995 import effects, report
from fifesim.experiments.friedl1995 import report as reproduction
from fifesim.experiments.friedl1995 import table as friedl1995_table
from fifesim.experiments.friedl1995.case import PASSAGES, case_of
from fifesim.scenario.scenario import read_scenario


def row(name, r2, slope, growth, *, dem="flat", lowest=0.45):
    """One row of the table of readings."""
    found = {f"r2 {treatment} {arp:g}": 0.6 for treatment in report.treatments() for arp in report.ARPS}
    found["r2 burned-ungrazed 0.05"] = lowest
    found |= {"name": name, "dem": dem, "lai_r2_rms": r2, "lai_slope_rms": slope, "lai_slope_rest": slope / 5}
    return found | {"lai_slope_factor": 1 + slope, "growth": growth, "paper_growth": 1.26, "lai_slope_largest": slope}


@pytest.fixture
def readings():
    return pd.DataFrame(
        [
            row("native", 0.05, 0.07, 1.27),
            row("aligned", 0.36, 0.2, 1.1),
            row("offset", 0.06, 0.1, 1.3),
            row("blur-40.8", 0.15, 0.78, 1.0),
            row("blur-48.6", 0.08, 0.89, 1.05),
            row("native", 0.08, 0.47, 1.6, dem="flint-hills", lowest=0.25),
            row("aligned", 0.30, 0.3, 1.4, dem="flint-hills", lowest=0.5),
        ]
    )


SENSITIVITY = pd.DataFrame({"lai_slope": [0.01, -0.06], "r2_largest": [0.01, 0.02]})


@pytest.fixture
def on_blur(readings, sentence):
    def told():
        found = report.conclusions({"readings": readings, "sensitivity": SENSITIVITY})
        return sentence("on_blur", found["blurred"], found["drifting"], found["slope_step"])

    return told


def test_slopes_distinguish_blur_from_drift(on_blur):
    text = on_blur()
    assert "by 0.08 for blur-48.6 and by 0.05 for drift" in text
    assert "slopes are 1.89 times the published ones" in text and "more than 6 %" in text
    assert "1.26 in the paper, 1.27 with drift and 1.05 with blur. The slopes, not R², therefore" in text


def test_blur_with_the_published_slopes_is_not_distinguished_from_drift(readings, on_blur):
    readings.loc[readings["name"] == "blur-48.6", "lai_slope_rms"] = 0.09
    assert on_blur().endswith("These differences do not distinguish blur from drift.")


def test_displacement_is_distinguished_if_r2_differs(readings, sentence):
    def told():
        found = report.conclusions({"readings": readings, "sensitivity": SENSITIVITY})
        return sentence("on_displacement", found["displaced"], found["drifting"], found["alike"])

    assert told().endswith("Table 2 does not distinguish the two.")
    readings.loc[readings["name"] == "offset", "lai_r2_rms"] = 0.12
    assert "distinguish the two" not in told()


def test_relief_is_reported_for_the_row_that_it_lowers_most(readings, sentence):
    found = report.on_relief(readings)
    assert (found["treatment"], found["arp"], found["dem"]) == ("burned-ungrazed", "0.05", "flint-hills")
    assert found["level"]["native"][found["most"]] == 0.45 and found["hills"]["native"][found["most"]] == 0.25
    assert "had no relief of this kind" in sentence("on_relief", found["worse"], report._ALIKE)
    # For a case on hills, the comparison is flat ground.
    turned = pd.concat([readings.iloc[5:], readings.iloc[:5]], ignore_index=True)
    again = report.on_relief(turned)
    assert again["hills"]["native"]["lai_r2_rms"] == 0.08 and again["level"]["native"]["lai_r2_rms"] == 0.05


def test_wording_follows_the_effect_of_relief_and_blur(readings, on_blur, sentence):
    readings.loc[5, "lai_r2_rms"] = 0.055
    assert "too small to be distinguished" in sentence("on_relief", report.on_relief(readings)["worse"], report._ALIKE)
    readings.loc[5, "lai_r2_rms"] = 0.01
    assert "nearer to the published values" in sentence("on_relief", report.on_relief(readings)["worse"], report._ALIKE)
    readings.loc[readings["name"] == "blur-48.6", "growth"] = 1.27
    assert on_blur().endswith("is evidence against blur.")
    few = readings[~readings["name"].str.startswith("blur")]
    assert report.conclusions({"readings": few, "sensitivity": SENSITIVITY})["blurred"] is None


TABLES = {"table2.csv", "readings.csv", "sizes.csv", "sensitivity.csv"}


@pytest.fixture
def quick(monkeypatch, tmp_path):
    """The command on scenes of 10 x 10 pixels."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(reproduction, "_DPI", 40)

    def call(*arguments):
        return CliRunner().invoke(app, ["reproduce", "--cells", "90", "--realisations", "1", *map(str, arguments)])

    return call


@pytest.fixture
def prepared(quick, monkeypatch, effect_tables, small):
    """The command with tables computed in advance; `asked` lists the requested cases."""
    asked = []

    def ready(case, *arguments, **options):
        asked.append(case)
        names = {"native": small, "aligned": small.isel(reading=[1, 0])}
        return names[case.reading.name]

    monkeypatch.setattr(reproduction, "reproduce_case", ready)
    for name, table in effect_tables.items():
        name = "effects_of_numbers" if name == "sensitivity" else name
        monkeypatch.setattr(effects, name, lambda *arguments, table=table, **options: table)
    quick.asked = asked
    return quick


def test_command_writes_tables_figures_scenarios_and_page(prepared, tmp_path):
    result = prepared("-o", "out")
    assert result.exit_code == 0, result.output
    names = {path.name for path in (tmp_path / "out").iterdir()}
    pictures = set(reproduction.pictures_of(case_of()).values())
    assert names == TABLES | pictures | {"scenarios", "report.html"}
    assert {"figure3.png", "figure9.png", "figure9_aligned.png"} <= pictures and len(pictures) == 11
    table = pd.read_csv(tmp_path / "out" / "table2.csv")
    wanted = {f"{before}{name}" for before in ("", "paper_", "aligned_") for name in friedl1995_table.COEFFICIENTS}
    assert len(table) == 18 and wanted <= set(table.columns)
    assert (table["aligned_r2"] > table["r2"]).mean() > 0.5
    scenes = sorted((tmp_path / "out" / "scenarios").iterdir())
    assert len(scenes) == 9 and all([path.name for path in scene.iterdir()] == ["scenario.toml"] for scene in scenes)
    assert read_scenario(scenes[0] / "scenario.toml").ground.seed == 1995
    page = (tmp_path / "out" / "report.html").read_text()
    assert page.count("data:image/png;base64,") == 1 + 11
    assert "http" not in page.replace("http-equiv", "") and "nan" not in page.split("base64")[0].lower()
    # Every reading has a row of R2 and slopes, and the aligned reading has a column in Table 2.
    assert "Drift or blur?" in page and "slope: native</th>" in page and "aligned</th>" in page
    # The page shows the drift together with the passages of the paper that contradict it.
    assert "The text of the paper suggests aligned pixels: " in page
    assert all(f"“{passage}” (section {section})" in page for section, passage in PASSAGES.items())
    assert prepared("-o", "out").exit_code == 2


def test_page_states_the_reading_the_inputs_and_the_fitted_values(prepared, tmp_path, folders, monkeypatch):
    monkeypatch.setattr(reproduction.figures, "plot_reproduction", lambda *arguments, **options: Figure((1, 1)))
    result = prepared("-o", "own", "--reading", "aligned", "--dem", "flint-hills", *given(folders))
    assert result.exit_code == 0, result.output
    page = re.sub(r"\s+", " ", (tmp_path / "own" / "report.html").read_text())
    assert "Table 1 is interpreted as <em>aligned</em>" in page and "also shown for <em>native</em>" in page
    assert "The ground is the synthetic Flint Hills." in page
    assert "0 of the values below were fitted to the 54" in page
    assert "given by you" in page and "--reading aligned --dem flint-hills --densities" in page
    (case,) = prepared.asked
    assert case.optics == {"TM3": (0.09, 0.05), "TM4": (0.42, 0.40)} and case.cells == 90
    keys = read_scenario(tmp_path / "own" / "scenarios" / "burned-ungrazed-0.05" / "scenario.toml")
    assert keys.ground.distribution == str(folders["densities"] / "burned-ungrazed.csv")
    assert keys.ground.background == {"TM3": 0.1, "TM4": 0.16} and keys.terrain.dem == "flint-hills"


def given(folders):
    return [word for name, path in folders.items() for word in (f"--{name}", str(path))]


@pytest.mark.parametrize(("stage", "arguments", "said"), mistakes("reproduce", name="experiment_mistakes"), ids=str)
def test_mistake_prints_one_line_and_writes_nothing(quick, tmp_path, stage, arguments, said):
    result = quick("-o", "out", *arguments)
    assert result.exit_code == 2
    assert said in result.stderr and len(result.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_printed_command_lists_the_changed_options():
    line = reproduction.command({"reading": "native", "dem": "my hills.tif", "optics": None, "cells": 333})
    assert line == "fifesim reproduce --dem 'my hills.tif' --cells 333"
