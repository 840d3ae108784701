"""Figures, table and statements of the page on NDVI-LAI scatter agree with the error budget."""

import importlib
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

import fifesim

DOCS = Path(__file__).parents[1] / "docs"


@pytest.fixture
def why(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS))
    yield importlib.import_module("make_why_scatter")
    plt.close("all")


@pytest.fixture
def case(why):
    """Small part of the scene, without hills, which take most of the time."""
    sections = why.scenario(cells=90).model_dump(exclude_unset=True)
    sections["terrain"] = {"dem": "flat"}
    return fifesim.Scenario(**sections)


def test_panels_agree_with_the_budget_of_their_scene(why, case):
    found = why.panels(case)
    budget = fifesim.budget(case, realisations=1, cells=90).isel(realisation=0).sel(variable="lai")
    assert found[0].r2 == pytest.approx(1 - float(budget["curvature"]), abs=1e-9)
    assert found[-1].r2 == pytest.approx(1 - float(budget["total"]), abs=1e-9)
    assert len({panel.r2 for panel in found}) >= 5
    figure = why.draw_panels(found)
    for panel, axis in zip(found, figure.axes, strict=True):
        assert panel.r2 == pytest.approx(np.corrcoef(panel.lai, panel.ndvi)[0, 1] ** 2, abs=1e-9)
        assert axis.texts[0].get_text() == f"R² = {panel.r2:.2f}"
        points, line = axis.get_lines()
        np.testing.assert_array_equal(points.get_xydata().T, [panel.ndvi, panel.lai])
        slope = np.diff(line.get_ydata()) / np.diff(line.get_xdata())
        assert slope[0] == pytest.approx(np.polyfit(panel.ndvi, panel.lai, 1)[0])


def test_mixed_pixel_has_the_ndvi_of_its_mean_reflectance(why):
    area, ndvi, (low, high, mean), (at_low, at_high, even), mixed = why.mixed_pixel()
    assert mean == (low + high) / 2 and np.all(np.diff(ndvi) > 0)
    assert np.interp([low, high, mean], area, ndvi) == pytest.approx([at_low, at_high, even], abs=1e-3)
    assert at_low < mixed < even - 0.1


def test_table_sums_to_the_total_of_the_budget(why):
    found, table = why.shares(), pd.read_csv(why.TABLE)
    total = table.query("variable == 'lai' and stage == 'total'").set_index("instrument")["share"]
    for name, column in found.items():
        assert column.loc[list(why.ROWS)].sum() == pytest.approx(column["total"], abs=0.1)
        assert column["total"] == pytest.approx(100 * total[name])
    lines = why.share_table().splitlines()
    assert len(lines) == 2 + len(why.ROWS) + 2
    assert lines[2].startswith(f"| geolocation error | {found.loc['geolocation error', 'TM']:.1f} % |")
    assert "−" in why.share_table() and "-0.0" not in why.share_table() and "−0.0" not in why.share_table()


def test_statements_of_the_page_on_the_table(why):
    found = why.shares()
    causes = found.loc[list(why.ROWS)]
    moved, curved, within = (
        "geolocation error",
        "curved relation between LAI and NDVI",
        "variation of LAI within pixels",
    )
    assert causes["TM"].idxmax() == causes["MODIS"].idxmax() == moved and causes["MSI"].idxmax() == curved
    assert set(causes["TM"].nlargest(2).index) == {moved, curved}
    assert abs(causes.loc[curved, "TM"] - causes.loc[moved, "TM"]) < 1
    assert causes.loc[within, ["TM", "MSI"]].abs().max() < 1.5 and causes["MODIS"].nlargest(2).index[1] == within
    assert causes.loc[["terrain", "atmosphere"]].abs().max().max() < 2
    assert found.loc["total"].idxmax() == "MODIS"
    assert found.loc["sub-pixel variation", "MODIS"] == pytest.approx(6, abs=0.5)


@pytest.mark.slow
def test_statements_of_the_page_on_the_panels(why):
    """Full scene of the figure."""
    page = (DOCS / "why_scatter.md").read_text("utf-8")
    assert "most in panel 5" in page
    found = why.panels(why.scenario())
    falls = -np.diff([panel.r2 for panel in found])
    assert np.argmax(falls) == 3 and falls[3] > 0.05
    assert np.abs(falls[[0, 4]]).max() < 0.03
