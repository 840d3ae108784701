"""End-to-end report: files, maps and text."""

import numpy as np
import pandas as pd
import pytest

import fifesim
from fifesim.experiments.scatter import endtoend, errors
from fifesim.experiments.scatter.shares import budget_cases

SQUARE = {"west": 707970.0, "north": 4331220.0, "width": 360.0, "height": 360.0}
SECTIONS = {"grid": SQUARE, "ground": {"arp": 0.15}, "terrain": {"dem": "flat"}, "sensor": {"offset": [0.3, 0.0]}}


def test_report_has_the_numbers_of_the_budget(tmp_path):
    scenario = fifesim.Scenario(**SECTIONS)
    with pytest.raises(ValueError, match="quantity must be"):
        endtoend.endtoend_to_folder(scenario, tmp_path / "out", quantity="yield")
    assert not (tmp_path / "out").exists()
    files = endtoend.endtoend_to_folder(scenario, tmp_path / "out", realisations=2)
    assert [path.name for path in files] == list(endtoend.ENDTOEND_FILES)
    table = pd.read_csv(tmp_path / "out" / "budget.csv").set_index("stage")
    found = fifesim.budget(scenario, quantity="gpp", realisations=2, each=iter)
    bias = 100 * found.bias.mean("realisation") / found.truth.mean()
    for stage in ("scaling", "registration"):
        np.testing.assert_allclose(table.loc[stage, "bias"], bias.sel(stage=stage), rtol=1e-4)
    assert "topography" not in table.index
    np.testing.assert_allclose(table["bias"].drop("total").sum(), table.loc["total", "bias"], rtol=1e-4)
    np.testing.assert_allclose(table["variance"].drop("total").sum(), 100, rtol=1e-4)
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "<b>scaling</b>" in page and "MOD17" not in page and "{{" not in page
    assert f"{table.loc['total', 'bias']:+.1f} %" in page and page.count("data:image/png") == 2
    assert "temperature 300 K" in page and 'src="http' not in page
    assert fifesim.scenario.read_scenario(tmp_path / "out" / "scenario.toml").sensor.offset == [0.3, 0.0]


def test_maps_show_the_retrieval_and_the_width_of_its_interval(retrieval):
    (case,) = budget_cases(fifesim.Scenario(**SECTIONS), realisations=1, cells=333)
    run = fifesim.simulate(case)
    image, truth = run["image"]["dn"], run["truth"]["lai"]
    for each in ("line", retrieval):
        lai, width = endtoend.estimated(image, truth, each)
        inside = np.isfinite(lai.values)
        assert inside.sum() > 60 and (width.values[inside] > 0).all()
        # The 80 % interval contains most of the truth.
        near = np.abs(lai.values - truth.values)[inside] < width.values[inside] / 2
        assert 0.4 < near.mean() <= 1
    figure = endtoend.map_figure(case, errors.target_of("photosynthesis"), retrieval)
    titles = [axis.get_title() for axis in figure.axes if axis.get_title()]
    assert titles[0].startswith("1. Truth: GPP of cells of 3.33 m [g m-2 d-1]") and len(titles) == 6
