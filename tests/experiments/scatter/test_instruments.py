"""The same ground simulated for every instrument."""

import importlib
from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner

import fifesim
from fifesim.cli import app
from fifesim.experiments.scatter.report import bar_chart
from fifesim.experiments.scatter.shares import budget_table, instrument_scenario, total_range
from fifesim.sensor.description.spatial_response import knows_blur

DOCS = Path(__file__).parents[3] / "docs"


@pytest.fixture
def make_instruments(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS))
    return importlib.import_module("make_instruments")


def test_instrument_scenario_has_all_known_errors_of_the_instrument():
    msi = instrument_scenario("Sentinel-2", arp=0.24)
    assert msi.sensor.bands == ["MSI4", "MSI8"] and msi.sensor.size == 10.0 and msi.ground.arp == 0.24
    assert msi.sensor.offset == pytest.approx([0.33, 0.33]) and msi.sensor.noise == ["all"]
    mss = instrument_scenario("MSS")
    assert mss.sensor.offset == [0.0, 0.0] and mss.sensor.noise == [] and mss.terrain.dem == "flat"


def test_terms_without_a_source_are_unknown_and_so_is_the_total(make_instruments):
    """The geolocation of EMIT is unknown; so are blur, noise and geolocation of MSS."""
    found = make_instruments.compare_instruments(["EMIT", "MSS"], arps=(0.15,), realisations=2)
    unknown = found[found["share"].isna() & found["alone"].isna()]
    by_name = unknown[unknown["variable"] == "lai"].groupby("instrument")["stage"].agg(set)
    total = {"total", "sub-pixel variation"}
    assert by_name.to_dict() == {
        "EMIT": {"registration"} | total,
        "MSS": {"point spread", "registration", "noise"} | total,
    }
    numbers = unknown.select_dtypes("number").columns.difference(["arp", "pixel"])
    assert unknown[numbers].isna().all(axis=None) and len(numbers) == 6
    known = found[~found.index.isin(unknown.index)]
    assert known["share"].notna().all() and (known.query("stage == 'quantisation'")["share"] != 0).all()


def test_gallery_table_has_no_numbers_for_unknown_terms(make_instruments):
    table = pd.read_csv(DOCS / "instruments.csv")
    complete = table[list(make_instruments.KNOWN.values())].all(axis=1)
    hidden = table["stage"].isin(["total", "sub-pixel variation"]) & ~complete
    for stage, name in make_instruments.KNOWN.items():
        hidden |= (table["stage"] == stage) & ~table[name]
    # The variation of the ground itself has no additive share.
    hidden |= table["stage"] == "sub-pixel variation"
    assert (table["share"].isna() == hidden).all() and (table["share_error"].isna() == hidden).all()
    columns = table.drop_duplicates("instrument").set_index("instrument")[list(make_instruments.KNOWN.values())]
    for name, known in columns.iterrows():
        own = fifesim.instrument(name)
        bands = own.red_and_near_infrared()
        stated = all(knows_blur(own, band) for band in bands), own.geolocation is not None, all(b.noise for b in bands)
        assert tuple(known) == stated, name


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


def test_command_makes_the_budget_of_an_instrument(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    made = CliRunner().invoke(app, ["budget", "--sensor", "MSS", "-o", "out", "--realisations", "1"])
    assert made.exit_code == 0, made.output
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "only the detector of MSS5, MSS7 is known" in page
    assert "<td>blur –; noise –; geolocation –</td>" in page
    assert "excludes unknown properties of the instrument: registration, noise" in page
    both = CliRunner().invoke(app, ["budget", "x.toml", "--sensor", "HRV"])
    assert both.exit_code == 2
