"""Descriptions on the prompt and in a notebook: short texts, tables and completion."""

import re
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from pydantic import BaseModel

import fifesim
from fifesim.base.messages import html_table
from fifesim.scenario.scenario import default_scenario

GRASS = fifesim.Canopy(brown=xr.DataArray(np.full((2, 3), 0.25), dims=("y", "x")), leaf_angles="erectophile")
FIT = fifesim.Regression(4.0, -0.7, 0.9, 100, 0.1, x_mean=0.5, x_sum_of_squares=0.8, y_name="<b>", x_name="ndvi")
LINE = fifesim.Retrieval(
    method="line", level="toa", instrument="TM", bands=("TM3", "TM4"), wavelengths=(0.66, 0.838), quantities=("lai",),
    levels=(0.5, 0.95), prior="lai < 8 & lai > 0", seed=0, tables={},
)  # fmt: skip
TM = fifesim.instrument("TM")
SMALL = fifesim.Scenario(grid={"width": 300}, atmosphere={"aerosol": "dust:0.5+soot:0.5"})
EACH = {"canopy": GRASS, "regression": FIT, "retrieval": LINE, "instrument": TM, "scenario": SMALL} | {
    "atmosphere": fifesim.Atmosphere(visibility=23), "default canopy": fifesim.Canopy(),
}  # fmt: skip


def rows(html):
    """Rows of the tables of a description, as texts of their cells."""
    return [re.findall(r"<td[^>]*>(.*?)</td>", row) for row in re.findall(r"<tr>(.*?)</tr>", html)]


@pytest.mark.parametrize("name", EACH)
def test_description_is_a_table_of_three_columns_in_a_notebook(name):
    html = EACH[name]._repr_html_()
    assert rows(html) and all(len(row) == 3 for row in rows(html))
    assert not re.search(r"<(?!/?(div|strong|table|tbody|tr|td|details|summary)\b)", html)
    assert "color" not in html and " at 0x" not in html


def test_values_are_escaped_and_shortened():
    assert rows(html_table("<i>", [("a & b", ["<script>", 0.1 + 0.2, None], {"x": 4334220.0})])) == [
        ["a &amp; b", "&lt;script&gt;, 0.3, not given", "x: 4334220"]
    ]
    assert "<strong>&lt;i&gt;</strong>" in html_table("<i>", [])
    assert "of &lt;b&gt; on ndvi" in FIT._repr_html_() and "lai &lt; 8 &amp; lai &gt; 0" in LINE._repr_html_()
    assert "&lt;x&gt;: Landsat-5" in replace(TM, name="<x>")._repr_html_()
    assert len(rows(html_table("", [("long", "y" * 9999, "")]))[0][1]) <= 400


def test_tables_have_values_with_units():
    found = {name: {row[0]: row[1] for row in rows(each._repr_html_())} for name, each in EACH.items()}
    assert found["atmosphere"]["visibility"] == "23 km" and found["atmosphere"]["h2o"] == "not given"
    assert found["regression"]["slope"] == "4 ± 0.112" and found["regression"]["n"] == "100"
    assert found["instrument"]["altitude"] == "705 km" and found["instrument"]["pixel"] == "30 m"
    assert found["canopy"]["brown"] == "&lt;an xarray.DataArray (y: 2, x: 3)&gt;"
    assert found["default canopy"]["leaf_optics"] == "green tallgrass"
    assert found["scenario"]["grid.width"] == "300 m" and found["scenario"]["grid.north"] == "4334220 m"


def test_scenario_prints_its_changed_keys_and_its_landscape_in_a_few_lines():
    text = repr(SMALL)
    assert str(SMALL) == text and text.endswith("\n  TM, bands TM3, TM4")
    assert text.startswith("Scenario(grid={'width': 300.0}, atmosphere={'aerosol': 'dust:0.5+soot:0.5'})\n  Synthetic")
    shown, _, folded = SMALL._repr_html_().partition("<details>")
    assert [row[0] for row in rows(shown)] == ["grid.width", "atmosphere.aerosol"] and "ground.brown" in folded
    for scenario in (SMALL, default_scenario().complete(), fifesim.Scenario(base="paper")):
        lines = repr(scenario).splitlines()
        assert len(lines) <= 11 and max(map(len, lines)) <= 102


@pytest.mark.parametrize(
    "scenario",
    [
        fifesim.Scenario(base="paper"),
        fifesim.Scenario(ground={"arp": 0.15}),
        fifesim.Scenario(landscape={"cover": "pastures"}, classes={"a": {"brown": 0.3}, "b": {}}),
    ],
)
def test_text_of_a_scenario_recreates_it(scenario):
    """A default of `[ground]` that is given replaces the learned landscape, so that it is shown."""
    made = re.match(r"Scenario\(.*?\)\n", repr(scenario), re.DOTALL)[0]
    again = eval(made, {"Scenario": fifesim.Scenario})
    assert again.learned == scenario.learned and again.complete() == scenario.complete()


def test_other_texts_are_short():
    assert repr(fifesim.Canopy()) == "Canopy(<all defaults: green tallgrass above its soil and litter>)"
    assert repr(GRASS) == "Canopy(leaf_angles='erectophile', brown=<an xarray.DataArray (y: 2, x: 3)>)"
    assert repr(fifesim.CoverClass("water", lai=0.0)) == "CoverClass(name='water', lai=0.0)"
    assert repr(fifesim.instrument("EMIT")).endswith("\n  bands EMIT1 to EMIT285 (285)")
    assert repr(LINE).startswith(
        "Retrieval of lai by line from toa reflectance of TM, bands TM3, TM4\n  intervals 0.5,"
    )


def test_completion_has_no_names_of_pydantic():
    scenario = fifesim.Scenario()
    for each in (scenario, scenario.ground):
        names = {name for name in dir(each) if not name.startswith("_")}
        assert names.isdisjoint(dir(BaseModel)) and len(names) < 35
    assert {"replace", "complete", "provenance", "ground", "classes"} <= set(dir(scenario))
    assert {"brown", "arp", "lai_file"} <= set(dir(scenario.ground))
