"""Figures hold the numbers that they are of."""

import dataclasses

import numpy as np
import pytest

import fifesim
from fifesim.analysis.regression_labels import regress
from fifesim.output.report import fit_figure, histogram_figures, reflectance_change
from fifesim.scenario.scenario import parse_scenario


@pytest.fixture(scope="module")
def run():
    scenario = parse_scenario({"grid": {"width": 600, "height": 300}, "terrain": {"dem": "flat"}})
    tree = fifesim.simulate(scenario.complete()).compute()
    image = tree["image"].to_dataset()
    return image.assign(ndvi=image["dn"].fifesim.ndvi()), tree["truth"].to_dataset(), tree["scene"]["lai"]


def test_regression_is_written_above_its_line(run):
    image, truth, _ = run
    fit = regress(truth["lai"], image["ndvi"], pair="index")
    axis = fit_figure(image, truth, "lai", fit).axes[0]
    assert f"n = {fit.n}" in axis.get_title()
    (line,) = axis.lines
    np.testing.assert_allclose(line.get_ydata(), fit.intercept + fit.slope * line.get_xdata())


def test_leaf_area_is_not_drawn_below_zero(run):
    """The line of a steep relation goes below it where few leaves are."""
    image, truth, _ = run
    fit = regress(truth["lai"], image["ndvi"], pair="index")
    steep = dataclasses.replace(fit, slope=4 * fit.slope, intercept=fit.intercept - 3 * fit.slope * fit.x_mean)
    axis = fit_figure(image, truth, "lai", steep).axes[0]
    assert axis.lines[0].get_ydata().min() < 0 == axis.get_ylim()[0]


def test_every_pixel_is_counted_where_it_lies(run):
    image, truth, _ = run
    axis = fit_figure(image, truth, "lai", regress(truth["lai"], image["ndvi"], pair="index")).axes[0]
    (density,) = axis.images
    counts = 10.0 ** density.get_array()
    ndvi = image["ndvi"].values[np.isfinite(image["ndvi"].values)]
    assert counts.sum() == pytest.approx(ndvi.size)
    assert density.get_extent()[:2] == pytest.approx([ndvi.min(), ndvi.max()])
    centres = np.linspace(*density.get_extent()[:2], 2 * counts.shape[1] + 1)[1::2]
    step = centres[1] - centres[0]
    assert (counts.filled(0).sum(axis=0) @ centres) / ndvi.size == pytest.approx(float(ndvi.mean()), abs=step / 2)


def test_frequencies_are_of_all_pixels(run):
    image, truth, detail = run
    axis = histogram_figures(image, truth, detail)[2].axes[0]
    shares = {line.get_label(): line.get_ydata().sum() for line in axis.lines}
    assert shares == pytest.approx(dict.fromkeys(map(str, image["band"].values), 1.0))
    assert [text.get_text() for text in axis.get_legend().get_texts()] == list(shares)


def test_change_is_in_reflectance(run):
    dn = run[0]["dn"]
    change = reflectance_change(dn + (dn > 0).astype(dn.dtype), dn, "TM4")
    step = dn["gain"].sel(band="TM4") if "gain" in dn.coords else 0
    assert float(change.min()) > 0 and float(change.max() - change.min()) < 1e-12 and float(step) > 0
