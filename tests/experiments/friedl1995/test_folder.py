"""The command: tables, figures, scenarios and page, or nothing."""

import re

import pandas as pd
import pytest
from typer.testing import CliRunner

from fifesim.cli import app
from fifesim.experiments.friedl1995 import effects
from fifesim.experiments.friedl1995 import folder as reproduction
from fifesim.experiments.friedl1995 import table as friedl1995_table
from fifesim.experiments.friedl1995.case import case_of
from fifesim.experiments.friedl1995.readings import READINGS
from fifesim.scenario.scenario import read_scenario

TABLES = {"table2.csv", "readings.csv", "sizes.csv", "sensitivity.csv"}


@pytest.fixture
def quick(monkeypatch, tmp_path):
    """The command on scenes of 10 x 10 pixels, with the tables of effects cut short."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(effects, "SIZES", (333,))
    monkeypatch.setattr(effects, "READINGS", {name: READINGS[name] for name in ("native", "aligned", "offset")})
    monkeypatch.setattr(effects, "changes", lambda case: [effects.Change("itself", "1", "1", case)])
    monkeypatch.setattr(reproduction, "_EFFECT_REALISATIONS", 1)
    monkeypatch.setattr(reproduction, "_DPI", 40)

    def call(*arguments):
        return CliRunner().invoke(app, ["reproduce", "--cells", "90", "--realisations", "1", *map(str, arguments)])

    return call


def test_command_writes_tables_figures_scenarios_and_page(quick, tmp_path, monkeypatch):
    made = {}
    for name in ("readings", "sizes", "sensitivity"):
        make = getattr(effects, name)
        monkeypatch.setattr(
            effects,
            name,
            lambda *arguments, name=name, make=make, **options: made.setdefault(name, make(*arguments, **options)),
        )
    result = quick("-o", "out")
    assert result.exit_code == 0, result.output
    names = {path.name for path in (tmp_path / "out").iterdir()}
    pictures = set(reproduction.pictures_of(case_of()).values())
    assert names == TABLES | pictures | {"scenarios", "report.html"}
    assert {"figure3.png", "figure9.png", "figure9_aligned.png"} <= pictures and len(pictures) == 11
    table = pd.read_csv(tmp_path / "out" / "table2.csv")
    wanted = {f"{before}{name}" for before in ("", "paper_") for name in friedl1995_table.COEFFICIENTS}
    assert len(table) == 18 and wanted <= set(table.columns)
    scenes = sorted((tmp_path / "out" / "scenarios").iterdir())
    assert len(scenes) == 9 and all([path.name for path in scene.iterdir()] == ["scenario.toml"] for scene in scenes)
    assert read_scenario(scenes[0] / "scenario.toml").ground.seed == 1995
    page = (tmp_path / "out" / "report.html").read_text()
    assert page.count("data:image/png;base64,") == 11
    assert "http" not in page.replace("http-equiv", "") and "nan" not in page.split("base64")[0].lower()
    first = {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir() if path.is_file()}
    assert quick("-o", "out").exit_code == 2
    # The tables of effects are the longest part, and are in the page as they came.
    assert quick("-o", "out", "--overwrite").exit_code == 0
    assert {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir() if path.is_file()} == first


def test_page_says_the_reading_the_inputs_and_what_is_fitted(quick, tmp_path, folders):
    result = quick("-o", "own", "--reading", "aligned", "--dem", "flint-hills", *given(folders))
    assert result.exit_code == 0, result.output
    page = re.sub(r"\s+", " ", (tmp_path / "own" / "report.html").read_text())
    assert "Pixels are read as <em>aligned</em>" in page and "Beside it stands <em>native</em>" in page
    assert "The ground is the synthetic Flint Hills." in page
    assert "0 of the numbers below were fitted to the 54" in page
    assert "given by you" in page and "--reading aligned --dem flint-hills --densities" in page
    keys = read_scenario(tmp_path / "own" / "scenarios" / "burned-ungrazed-0.05" / "scenario.toml")
    assert keys.ground.distribution == str(folders["densities"] / "burned-ungrazed.csv")
    assert keys.ground.background == {"TM3": 0.1, "TM4": 0.16} and keys.terrain.dem == "flint-hills"


def given(folders):
    return [word for name, path in folders.items() for word in (f"--{name}", str(path))]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--cells", 50), "at least 90, 10 pixels"),
        (("--realisations", 0), "at least 1"),
        (("--seed", -1), "seed must be"),
        (("--reading", "mine"), "must be one of native, aligned"),
        (("--densities", "."), "lacks a file of burned-grazed and"),
        (("--optics", "mine.csv"), "there is no optics file mine.csv"),
        (("--sensor", "OLI", "--background", "soil.csv"), "no background file soil.csv"),
        (("--sensor", "NOPE"), "unknown instrument"),
        (("--dem", "hills.tif"), "a raster file of elevation"),
    ],
)
def test_mistake_is_one_line_and_leaves_nothing(quick, tmp_path, arguments, said):
    result = quick("-o", "out", *arguments)
    assert result.exit_code == 2
    assert said in result.stderr and len(result.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_failure_in_the_middle_leaves_nothing(quick, tmp_path, monkeypatch):
    def full(*arguments, **options):
        raise OSError("disk full")

    monkeypatch.setattr(reproduction, "reproduction", full)
    result = quick("-o", "out")
    assert result.exit_code == 1 and "disk full" in result.stderr
    assert not (tmp_path / "out").exists()


def test_line_of_the_command_makes_the_same_again():
    line = reproduction.command({"reading": "native", "dem": "my hills.tif", "optics": None, "cells": 333})
    assert line == "fifesim reproduce --dem 'my hills.tif' --cells 333"
