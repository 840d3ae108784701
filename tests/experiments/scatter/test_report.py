"""Report page, mechanisms, output folder and command of a budget."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from mistakes import mistakes
from typer.testing import CliRunner

from fifesim.cli import app
from fifesim.experiments.scatter import report
from fifesim.experiments.scatter import report as scatter_run
from fifesim.experiments.scatter import shares as scatter
from fifesim.experiments.scatter.shares import CURVATURE
from fifesim.experiments.scatter.stages import STAGES, VARIABLES


@pytest.fixture
def budget():
    """Shares of 1 to 8 % for the stages in order and a curvature of 9 %, in two equal realisations."""
    shares = np.broadcast_to(np.arange(1, len(STAGES) + 1) / 100, (2, len(VARIABLES), len(STAGES)))
    curvature = np.full((2, len(VARIABLES)), 0.09)
    return xr.Dataset(
        {
            "share": (("realisation", "variable", "stage"), shares),
            "curvature": (("realisation", "variable"), curvature),
            "total": (("realisation", "variable"), shares.sum(axis=-1) + curvature),
        },
        coords={"stage": list(STAGES), "variable": list(VARIABLES)},
    )


def test_every_stage_belongs_to_one_mechanism(budget):
    rows = report.mechanisms(budget)
    parts = [part for row in rows for part in report.MECHANISMS[row["name"]]]
    assert len(parts) == len(set(parts)) and set(parts) <= {*STAGES, CURVATURE}
    known = dict(zip(STAGES, np.arange(1, len(STAGES) + 1) / 100, strict=True)) | {CURVATURE: 0.09}
    for row in rows:
        expected = sum(known[part] for part in report.MECHANISMS[row["name"]])
        assert row["lai"]["share"] == pytest.approx(expected, rel=1e-12)
        assert row["lai"]["of_total"] == pytest.approx(expected / float(budget["total"][0, 0]), rel=1e-12)
        assert row["lai"]["error"] == pytest.approx(0, abs=1e-12)


@pytest.fixture
def command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(scatter_run, "_DPI", 40)
    text = "[grid]\nwidth = 360\nheight = 330\n[terrain]\ndem = 'flat'\n[sensor]\nbands = ['TM2', 'TM3', 'TM4']\n"
    (tmp_path / "mine.toml").write_text(text)

    def call(*arguments):
        return CliRunner().invoke(app, ["budget", *map(str, arguments)])

    return call


def test_command_writes_table_chart_and_page(command, tmp_path):
    result = command("mine.toml", "-o", "out", "--realisations", 2)
    assert result.exit_code == 0, result.output
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(scatter_run.BUDGET_FILES)
    table = pd.read_csv(tmp_path / "out" / "budget.csv")
    assert set(table["stage"]) == {*STAGES, scatter.CURVATURE, scatter.TOTAL, scatter.VARIATION}
    assert {"stage", "variable", "alone", "alone_error", "share", "share_error"} <= set(table.columns)
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") == 1 and "http" not in page
    total = table[(table["stage"] == "total") & (table["variable"] == "lai")].iloc[0]
    assert f"{100 * total['share']:.1f}" in page
    first = {name: (tmp_path / "out" / name).read_bytes() for name in scatter_run.BUDGET_FILES}
    assert command("mine.toml", "-o", "out", "--realisations", 2).exit_code == 2
    again = command("out/scenario.toml", "-o", "again", "--realisations", 2)
    assert again.exit_code == 0, again.output
    assert {name: (tmp_path / "again" / name).read_bytes() for name in scatter_run.BUDGET_FILES} == first


def test_one_realisation_has_no_error(command, tmp_path):
    assert command("mine.toml", "-o", "out", "--realisations", 1).exit_code == 0
    table = pd.read_csv(tmp_path / "out" / "budget.csv")
    assert table["share_error"].isna().all() and table["share"].notna().sum() == 2 * (len(STAGES) + 2)
    assert "nan" not in (tmp_path / "out" / "report.html").read_text(encoding="utf-8").split("base64")[0]


@pytest.mark.parametrize(("stage", "given", "said"), mistakes("budget", name="experiment_mistakes"), ids=str)
def test_mistake_prints_one_line_and_writes_nothing(command, tmp_path, stage, given, said):
    text, *arguments = given
    (tmp_path / "wrong.toml").write_text(text)
    result = command("wrong.toml", "-o", "out", *arguments)
    assert result.exit_code == 2
    assert said in result.stderr and len(result.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()
