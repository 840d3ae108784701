"""`fifesim reproduce`: its files and its page."""

import re

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from mistakes import mistakes
from typer.testing import CliRunner

from fifesim.cli import app
from fifesim.experiments.friedl1995 import report
from fifesim.experiments.friedl1995.table import COEFFICIENTS
from fifesim.scenario.scenario import read_scenario


@pytest.fixture
def quick(monkeypatch, tmp_path):
    """The command on scenes of 10 x 10 pixels."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(report, "_DPI", 40)

    def call(*arguments):
        return CliRunner().invoke(app, ["reproduce", "--cells", "90", "--realisations", "1", *map(str, arguments)])

    return call


def test_command_writes_table_data_scenarios_and_page(quick, small, tmp_path):
    result = quick("-o", "out")
    assert result.exit_code == 0, result.output
    assert {path.name for path in (tmp_path / "out").iterdir()} == set(report.REPRODUCED)
    table = pd.read_csv(tmp_path / "out" / "table2.csv")
    wanted = {f"{before}{name}" for before in ("", "paper_", "aligned_") for name in COEFFICIENTS}
    assert len(table) == 18 and wanted <= set(table.columns)
    assert (table["aligned_r2"] > table["r2"]).mean() > 0.5
    with xr.open_dataset(tmp_path / "out" / "reproduction.nc") as stored:
        for name in small.data_vars:
            np.testing.assert_array_equal(stored[name], small[name], err_msg=name)
    scenes = sorted((tmp_path / "out" / "scenarios").iterdir())
    assert len(scenes) == 9 and all([path.name for path in scene.iterdir()] == ["scenario.toml"] for scene in scenes)
    assert read_scenario(scenes[0] / "scenario.toml").ground.seed == 1995
    page = (tmp_path / "out" / "report.html").read_text()
    assert page.count("data:image/png;base64,") == 1
    assert "http" not in page.replace("http-equiv", "") and "nan" not in page.split("base64")[0].lower()
    rms = float(np.sqrt(((table["r2"] - table["paper_r2"])[table["variable"] == "lai"] ** 2).mean()))
    assert f"For native pixels, R² of LAI differs from Table 2 of the paper by {rms:.2f}" in page
    assert (
        "Inputs fitted to this table: the densities of LAI, leaf reflectance and transmittance, the background" in page
    )
    # The aligned reading has a column in Table 2, and the page states the evidence for it.
    assert "slope: native</th>" in page and "aligned</th>" in page
    assert "The text of the paper suggests aligned pixels" in page
    assert quick("-o", "out").exit_code == 2
    for name in ("readings.csv", "figure5_aligned.png", "mine.txt"):
        (tmp_path / "out" / name).write_text("of another version, and of the user")
    assert quick("-o", "out", "--overwrite").exit_code == 0
    assert {path.name for path in (tmp_path / "out").iterdir()} == {*report.REPRODUCED, "mine.txt"}


def test_page_states_the_reading_and_the_inputs(quick, tmp_path, folders):
    given = [word for name, path in folders.items() for word in (f"--{name}", str(path))]
    result = quick("-o", "own", "--reading", "aligned", "--dem", "flint-hills", *given)
    assert result.exit_code == 0, result.output
    page = re.sub(r"\s+", " ", (tmp_path / "own" / "report.html").read_text())
    assert "Table 1 is interpreted as <em>aligned</em>" in page and "also shown for <em>native</em>" in page
    assert "The ground is the synthetic Flint Hills." in page and "fitted to" not in page
    assert "fifesim reproduce --reading aligned --dem flint-hills --densities" in page
    keys = read_scenario(tmp_path / "own" / "scenarios" / "burned-ungrazed-0.05" / "scenario.toml")
    assert keys.ground.distribution == str(folders["densities"] / "burned-ungrazed.csv")
    assert keys.ground.leaf_reflectance == {"TM3": 0.09, "TM4": 0.42}
    assert keys.ground.background == {"TM3": 0.1, "TM4": 0.16} and keys.terrain.dem == "flint-hills"


@pytest.mark.parametrize(("stage", "arguments", "said"), mistakes("reproduce", name="experiment_mistakes"), ids=str)
def test_mistake_prints_one_line_and_writes_nothing(quick, tmp_path, stage, arguments, said):
    result = quick("-o", "out", *arguments)
    assert result.exit_code == 2
    assert said in result.stderr and len(result.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()
