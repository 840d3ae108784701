"""Figures hold the numbers that they are of."""

import numpy as np
import pytest

import fifesim
from fifesim.analysis.rasters.regression import regress
from fifesim.output.figures import fit_figure, histogram_figure, map_figure, reflectance_change
from fifesim.scenario.scenario import parse_scenario


@pytest.fixture(scope="module")
def run():
    scenario = parse_scenario({"grid": {"width": 600, "height": 300}, "terrain": {"dem": "flat"}})
    tree = fifesim.simulate(scenario.complete()).compute()
    image = tree["image"].to_dataset()
    return image.assign(ndvi=image["dn"].fifesim.ndvi()), tree["truth"].to_dataset(), tree["scene"]["lai"]


def test_maps_lie_on_their_ground_in_km(run):
    image, truth, _ = run
    *maps, ndvi = [axis for axis in map_figure(image, truth).axes if axis.get_title()]
    assert len(maps) == 2 and ndvi.get_title() == "NDVI of the image"
    drawn = maps[0].images[0]
    np.testing.assert_array_equal(drawn.get_array(), truth["lai"])
    west, east, south, north = drawn.get_extent()
    np.testing.assert_allclose([east - west, north - south], [0.6, 0.3])
    np.testing.assert_allclose((west + east) / 2, truth["x"].mean() / 1000)


def test_regression_is_written_above_its_line(run):
    image, truth, _ = run
    fit = regress(truth["lai"], image["ndvi"], pair="index")
    axis = fit_figure(image, truth, {"lai": fit}).axes[0]
    assert f"R² = {fit.r2:.3f},  n = {fit.n}" in axis.get_title()
    (line,) = axis.lines
    np.testing.assert_allclose(line.get_ydata(), fit.intercept + fit.slope * line.get_xdata())


def test_frequencies_are_of_all_pixels(run):
    image, truth, detail = run
    axis = histogram_figure(image, truth, detail).axes[2]
    shares = {line.get_label(): line.get_ydata().sum() for line in axis.lines}
    assert shares == pytest.approx(dict.fromkeys(map(str, image["band"].values), 1.0))


def test_change_is_in_reflectance(run):
    dn = run[0]["dn"]
    change = reflectance_change(dn + (dn > 0).astype(dn.dtype), dn, "TM4")
    step = dn["gain"].sel(band="TM4") if "gain" in dn.coords else 0
    assert float(change.min()) > 0 and float(change.max() - change.min()) < 1e-12 and float(step) > 0
