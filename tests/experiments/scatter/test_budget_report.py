"""Report page and command of a budget, and budgets of instruments with unknown properties."""

import re

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from mistakes import mistakes
from typer.testing import CliRunner

import fifesim
from fifesim.cli import app
from fifesim.experiments.scatter import report
from fifesim.experiments.scatter import shares as scatter
from fifesim.experiments.scatter.report import bar_chart
from fifesim.experiments.scatter.shares import CURVATURE, budget_table, instrument_scenario, total_range
from fifesim.experiments.scatter.stages import STAGES, VARIABLES


def test_every_stage_belongs_to_one_mechanism():
    """Shares of 1, 2, 3 ... % for the stages in order and a curvature of 9 %, in two equal realisations."""
    known = dict(zip(STAGES, np.arange(1, len(STAGES) + 1) / 100, strict=True)) | {CURVATURE: 0.09}
    shares = np.broadcast_to([known[name] for name in STAGES], (2, len(VARIABLES), len(STAGES)))
    curvature, total = np.full(shares.shape[:2], 0.09), np.full(shares.shape[:2], sum(known.values()))
    axes = ("realisation", "variable")
    variables = {"share": ((*axes, "stage"), shares), "curvature": (axes, curvature), "total": (axes, total)}
    rows = report.mechanisms(xr.Dataset(variables, coords={"stage": list(STAGES), "variable": list(VARIABLES)}))
    parts = [part for row in rows for part in report.MECHANISMS[row["name"]]]
    assert len(parts) == len(set(parts)) and set(parts) <= {*STAGES, CURVATURE}
    for row in rows:
        expected = sum(known[part] for part in report.MECHANISMS[row["name"]])
        found = row["lai"]["share"], row["lai"]["of_total"], row["lai"]["error"]
        assert found == pytest.approx((expected, expected / sum(known.values()), 0), rel=1e-12, abs=1e-12)


def row_of(name, text):
    """Row of a table of inputs."""
    return f'<tr><th>{name}</th><td class="number">{text}</td></tr>'


@pytest.fixture
def command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(report, "_DPI", 40)
    text = "[grid]\nwidth = 360\nheight = 330\n[terrain]\ndem = 'flat'\n[sensor]\nbands = ['TM2', 'TM3', 'TM4']\n"
    (tmp_path / "mine.toml").write_text(text)

    def call(*arguments):
        return CliRunner().invoke(app, ["budget", *map(str, arguments)])

    return call


def test_command_writes_table_chart_and_page(command, tmp_path):
    result = command("mine.toml", "-o", "out", "--realisations", 2)
    assert result.exit_code == 0, result.output
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(report.BUDGET_FILES)
    table = pd.read_csv(tmp_path / "out" / "budget.csv")
    assert set(table["stage"]) == {*STAGES, scatter.CURVATURE, scatter.TOTAL, scatter.VARIATION}
    assert {"stage", "variable", "alone", "alone_error", "share", "share_error"} <= set(table.columns)
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") == 1
    total = table[(table["stage"] == "total") & (table["variable"] == "lai")].iloc[0]
    assert f"{100 * total['share']:.1f}" in page and row_of("Terrain", "level") in page
    # A stage without any effect is explained once, instead of rows of 0.
    assert "noise (none)" in page and not re.search("<td>(noise|clouds|registration)</td>", page)
    assert [f'<a href="{name}">' in page for name in report.BUDGET_FILES] == [True, True, False, True]
    assert "fifesim budget scenario.toml -o FOLDER --realisations 2 --cells 333 --seed 7" in page
    first = {name: (tmp_path / "out" / name).read_bytes() for name in report.BUDGET_FILES}
    assert command("mine.toml", "-o", "out", "--realisations", 2).exit_code == 2
    again = command("out/scenario.toml", "-o", "again", "--realisations", 2)
    assert again.exit_code == 0, again.output
    assert {name: (tmp_path / "again" / name).read_bytes() for name in report.BUDGET_FILES} == first


@pytest.mark.parametrize(("stage", "given", "said"), mistakes("budget", name="experiment_mistakes"), ids=str)
def test_mistake_prints_one_line_and_writes_nothing(command, tmp_path, stage, given, said):
    text, *arguments = given
    (tmp_path / "wrong.toml").write_text(text)
    result = command("wrong.toml", "-o", "out", *arguments)
    assert result.exit_code == 2
    assert said in result.stderr and len(result.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_command_makes_the_budget_of_an_instrument(command, tmp_path):
    """One realisation has no error."""
    made = command("--sensor", "MSS", "-o", "out", "--realisations", 1)
    assert made.exit_code == 0, made.output
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "only the detector of MSS5, MSS7 is known" in page
    assert row_of("Origin of the description", "blur –; noise –; geolocation –") in page
    assert "excludes unknown properties of the instrument: registration, noise" in page
    table = pd.read_csv(tmp_path / "out" / "budget.csv")
    assert table["share_error"].isna().all() and "nan" not in page.split("base64")[0]
    assert command("x.toml", "--sensor", "HRV").exit_code == 2


def test_instrument_scenario_has_all_known_errors_of_the_instrument():
    msi = instrument_scenario("Sentinel-2", arp=0.24)
    assert msi.sensor.bands == ["MSI4", "MSI8"] and msi.sensor.size == 10.0 and msi.ground.arp == 0.24
    assert msi.sensor.offset == pytest.approx([0.33, 0.33]) and msi.sensor.noise == ["all"]
    mss = instrument_scenario("MSS")
    assert mss.sensor.offset == [0.0, 0.0] and mss.sensor.noise == [] and mss.terrain.dem == "flat"


def test_budget_states_origins_and_shows_unknown_terms_as_unknown():
    """Blur, geolocation and noise of MSS are unknown; the detector alone blurs by more than a pixel of 60 m."""
    found = fifesim.budget(instrument_scenario("MSS"), realisations=1, cells=333, each=iter)
    unknown = ["point spread", "registration", "noise"]
    assert found["origin"].sel(stage=unknown).values.tolist() == ["–"] * 3
    known = fifesim.budget(instrument_scenario("TM"), realisations=1, cells=90, each=iter)
    assert known["origin"].sel(stage="point spread") == "in-flight ± 0.12" and known["share"].notnull().all()
    chart = bar_chart(budget_table(found))
    assert sum(text.get_text() == "unknown" for text in chart.axes[0].texts) == 4


def test_range_of_the_total_contains_the_total():
    """The two ends of the uncertainty of the blur enclose the total."""
    options = {"realisations": 2, "cells": 120, "each": iter}
    for name in ("OLI", "TM"):
        scenario = instrument_scenario(name)
        total = fifesim.budget(scenario, **options)["total"].sel(variable="lai").mean()
        low, high = total_range(scenario, **options)["lai"]
        assert low < float(total) < high and high - low > 0.002
    assert total_range(instrument_scenario("MSS"), **options) is None
