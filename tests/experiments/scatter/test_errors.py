"""Bias and variance of the error of a quantity, by stage, their report, and the sensitivity to parameters."""

import re
import warnings

import numpy as np
import pandas as pd
import pytest
from scipy import stats

import fifesim
from fifesim.analysis.scaling import shapley
from fifesim.experiments.scatter import endtoend
from fifesim.experiments.scatter.errors import ERROR_STAGES, target_of
from fifesim.experiments.scatter.shares import budget_cases
from fifesim.output import report

SQUARE = {"west": 707970.0, "north": 4331220.0, "width": 420.0, "height": 420.0}
BURNED = {"grid": SQUARE, "ground": {"arp": 0.15}, "terrain": {"dem": "flat"}, "sensor": {"offset": [0.3, 0.0]}}
PASTURES = BURNED | {
    "landscape": {"cover": "voronoi", "size": 150.0, "deviations": {"soil": 0.03}},
    "classes": {name: {"distribution": name} for name in fifesim.ground.treatments()},
}


def shares_of(sections, quantity="gpp", realisations=3, **options):
    scenario = fifesim.Scenario(**sections)
    return fifesim.budget(scenario, quantity=quantity, realisations=realisations, each=iter, **options)


@pytest.mark.parametrize("quantity", ["gpp", "photosynthesis", "penman-monteith"])
def test_shares_add_up_and_bias_comes_from_scaling(quantity):
    found = shares_of(BURNED, quantity)
    for kind in ("bias", "variance"):
        np.testing.assert_allclose(found[kind].sum("stage"), found[f"total_{kind}"], rtol=0, atol=1e-9)
        ideal = ["noise", "topography", "soil", "dead leaves", "cover", "clumping"]
        assert (found[kind].sel(stage=ideal) == 0).all()
    assert list(found.stage.values) == list(ERROR_STAGES)
    assert found.bias.attrs["units"] in ("g m-2 d-1", "kg m-2 d-1")
    if quantity == "photosynthesis":
        found = found.mean("realisation")
        assert found.bias.sel(stage="scaling") > 0.9 * found.total_bias > 0
        assert found.variance.sel(stage="registration") > 0.5 * found.total_variance


def test_pastures_have_a_share_of_their_soil():
    found = shares_of(PASTURES, "photosynthesis").mean("realisation")
    assert found.bias.sel(stage="scaling") > 0.9 * found.total_bias > 0
    assert found.variance.sel(stage="soil") > 0


def test_truth_and_bias_follow_from_the_leaf_area_of_the_cells():
    """
    With the true mean LAI, the bias is the model at the pixel means minus the mean of the model over cells.

    The truth is the sum of the day: the sun of the overpass gives 12 % more, and C3 leaves half of it.
    """
    (case,) = budget_cases(fifesim.Scenario(**BURNED), realisations=1, cells=333)
    lai = fifesim.lai_scene(case.geobox(), "burned-grazed", arp=0.15, seed=7)

    def saturating(area):
        return 1 - np.exp(-0.6 * area)

    # Pixels at the edge have no data; the mean of the remaining pixels differs little.
    inside = {"y": slice(1, -1), "x": slice(1, -1)}
    expected = (saturating(lai.fifesim.aggregate(30)) - saturating(lai).fifesim.aggregate(30)).isel(inside).mean()
    found = shares_of(BURNED, saturating, realisations=1)
    np.testing.assert_allclose(found.bias.sel(stage="scaling").item(), expected.item(), rtol=0.05)
    found = shares_of(BURNED, "farquhar", realisations=1)
    np.testing.assert_allclose(found.truth, float(lai.fifesim.gpp(model="farquhar").mean()), rtol=0.03)
    assert abs(found.total_bias.item()) < 0.15 * found.truth.item()


def test_shares_of_a_linear_quantity_and_a_regression_line_match_the_closed_form(tmp_path):
    """
    Independent cells with nearly constant leaf area, displaced by a third of a pixel.

    Footprint and block are correlated with r = 2 / 3. The error variance, relative to the variance of the block means,
    is 2 (1 - r) if LAI of the footprint is known. On a regression line it is 1 - r^2 / (1 + q), where q is the share of
    quantisation in the variance of NDVI. The total of the budget gives q, and q gives the three shares.
    """
    path = tmp_path / "narrow.csv"
    np.savetxt(path, np.random.default_rng(1).normal(2.0, 0.1, 200), header="lai", comments="")
    sensor = {"instrument": "OLI2", "response": "detector", "offset": [1 / 3, 0.0]}
    sections = BURNED | {"sensor": sensor, "ground": {"distribution": str(path), "arp": 0.0}}
    sections |= {"grid": SQUARE | {"width": 600.0, "height": 600.0}}
    found = shares_of(sections, lambda area: 3.0 * area, realisations=8)
    shares, total = found.variance / found.truth_variance, found.total_variance / found.truth_variance
    q = (4 / 9) / (1 - float(total.mean())) - 1
    values = np.zeros((2, 2, 2))  # retrieval, registration, quantisation
    values[0, 1] = 2 * (1 - 2 / 3)
    for displaced, r in enumerate((1, 2 / 3)):
        values[1, displaced] = 1 - r**2, 1 - r**2 / (1 + q)
    for stage, expected in zip(("retrieval", "registration", "quantisation"), shapley(values, 3), strict=True):
        each = shares.sel(stage=stage)
        error = float(each.std("realisation", ddof=1)) / np.sqrt(each.size)
        assert abs(float(each.mean()) - expected) < 3 * error, stage
        assert error < 0.015
    np.testing.assert_allclose(found.variance.sel(stage="scaling"), 0, atol=1e-12)
    np.testing.assert_allclose(found.bias.sel(stage="scaling"), 0, atol=1e-12)


def test_retrieval_from_reflectance_states_why_stages_cannot_be_ideal(retrieval):
    found = shares_of(BURNED, "photosynthesis", realisations=1, retrieval=retrieval)
    for kind in ("bias", "variance"):
        np.testing.assert_allclose(found[kind].sum("stage"), found[f"total_{kind}"], rtol=0, atol=1e-9)
    assert "top of the atmosphere" in str(found.reason.sel(stage="atmosphere").item())
    assert "not NDVI" in str(found.reason.sel(stage="NDVI scaling").item())
    assert found.variance.sel(stage="atmosphere").isnull().all()
    # The estimates are the same as for the image of the whole chain.
    (case,) = budget_cases(fifesim.Scenario(**BURNED), realisations=1, cells=333)
    run = fifesim.simulate(case)
    image = run["image"]["dn"].fifesim.to_reflectance().fifesim.retrieve(retrieval).lai
    truth = run["truth"].to_dataset().lai.values
    both = np.isfinite(image.values) & np.isfinite(truth)
    area = fifesim.budget(fifesim.Scenario(**BURNED), quantity="lai", retrieval=retrieval, realisations=1, each=iter)
    np.testing.assert_allclose(area.total_bias, (image.values - truth)[both].mean(), atol=2e-3)


def test_report_has_the_numbers_of_the_budget(tmp_path):
    scenario = fifesim.Scenario(**BURNED)
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
    assert re.search(rf"{re.escape(report.fixed(table.loc['total', 'bias'], 1, True))}<span", page)
    assert f"Mean {float(found.truth.mean()):.2f} g C m⁻² d⁻¹" in page and "topography (level ground)" in page
    assert "--quantity gpp --realisations 2 --cells 333 --seed 7" in page
    assert fifesim.scenario.read_scenario(tmp_path / "out" / "scenario.toml").sensor.offset == [0.3, 0.0]


def test_maps_of_one_quantity_have_one_range_and_no_map_has_one_colour(retrieval):
    """Intervals of lines have one width, so the map shows the error of LAI instead; those of a table vary."""
    (case,) = budget_cases(fifesim.Scenario(**BURNED), realisations=1, cells=333)
    target = target_of("gpp", case)
    chip = fifesim.Scenario(grid={"width": 300, "height": 300}, ground={"arp": 0.15}, terrain={"dem": "flat"})
    study = fifesim.Study(chip, {"visibility": {"uniform": [20, 60]}}, landscapes=10)
    with pytest.warns(UserWarning, match="few landscapes"):
        table = fifesim.train(study, "lookup", chips=10)
    for method, title in (("line", "Retrieved minus"), (retrieval, "Retrieved minus"), (table, "Width of the 95 %")):
        maps, text = endtoend.maps_of(case, target, method)
        ticks = [each.bar.ticks if each.bar else None for each in maps]
        assert ticks[1] == ticks[2] and ticks[4] == ticks[5] == ticks[6] != ticks[1]
        assert all(len(np.unique(each.pixels.reshape(-1, 3), axis=0)) > 10 for each in maps[1:])
        assert maps[6].title.split() == ["GPP", "from", "retrieved", "LAI", "[g", "C", "m⁻²", "d⁻¹]"]
        assert maps[3].title.startswith(title) and ("nearly the same width" in text) is (method is not table)
    run = fifesim.simulate(case)
    truth, ndvi = run["truth"]["lai"].values, run["image"]["ndvi"].values
    both = np.isfinite(ndvi)
    line = stats.linregress(ndvi[both], truth[both])
    error = np.abs(truth - line.intercept - line.slope * ndvi)[both]
    half = 1.96 * np.sqrt((error**2).sum() / (both.sum() - 2))
    _, text = endtoend.maps_of(case, target, "line")
    assert f"in {100 * (error < half).mean():.0f} % of the pixels" in text and f"± {half:.1f}" in text


def test_weather_outside_the_site_is_assumed_with_a_warning():
    """Berlin; the scatter of LAI needs no weather, and given weather is taken."""
    far = BURNED | {
        "grid": {"crs": "EPSG:32633", "west": 390000.0, "north": 5820000.0, "width": 420.0, "height": 420.0}
    }
    far |= {"geometry": {"sza": 30.0, "saa": 150.0}, "atmosphere": {"visibility": 40.0, "altitude": 0.0}}
    far = fifesim.Scenario(**far)
    with pytest.warns(UserWarning, match="weather over the scene is unknown.*300 K"):
        target = target_of("gpp", far)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert target_of("gpp", fifesim.Scenario(**BURNED)).weather == target.weather
        target_of("lai", far)
        assert target_of("gpp", far, target.weather.replace(humidity=0.4)).weather.humidity == 0.4


def test_sensitivity_matches_a_linear_function():
    """The quantity is a sum of two parameters: twice the range has four times the variance."""
    chip = fifesim.Scenario(grid={"width": 120, "height": 120}, ground={"arp": 0.15}, terrain={"dem": "flat"})
    study = fifesim.Study(chip, {"brown": {"uniform": [0, 0.2]}, "moisture": {"uniform": [0, 0.4]}})
    found = fifesim.experiments.sensitivity(
        study, lambda each: each.ground.brown + each.ground.moisture, n=64, each=iter
    )
    assert found.parameter.values.tolist() == ["ground.brown", "ground.moisture"]
    np.testing.assert_allclose(found["first"], [0.2, 0.8], atol=0.02)
    np.testing.assert_allclose(found["total"], [0.2, 0.8], atol=0.02)
    # Only green leaves produce, and soil hardly affects the light that they absorb.
    gpp = fifesim.experiments.sensitivity(study, "gpp", n=8, each=iter)
    brown, moisture = gpp["total"]
    assert moisture < 0.02 and brown > 0.9
    with pytest.raises(ValueError, match="must return a number for a scenario, it returns list"):
        fifesim.experiments.sensitivity(study, lambda scenario: [1, 2], n=4, each=iter)
