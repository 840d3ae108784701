"""Budgets from covariances: an independent Monte Carlo table, limits of theory, and the simulated budget."""

import warnings
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from mistakes import mistakes
from scipy import stats

import fifesim
from fifesim.experiments.analytic import DEVIATES, Footprint, Pixel, correlation_of, mean_of_cells, prepare
from fifesim.experiments.scatter.shares import standard_error
from fifesim.ground.landscape.learned import correlation_of_scores, scores, scores_of
from fifesim.scenario.ground import learned_landscape

_BOX = np.full(9, 1 / 9)
_FIELDS = {
    "lognormal mean 1 cv .6": stats.lognorm(np.sqrt(np.log(1.36)), scale=1.36**-0.5),
    "gamma shape 4 mean 2": stats.gamma(4, scale=0.5),
}


def _ndvi(means):
    return (means[1] - means[0]) / (means[1] + means[0])


def _noise(variance, means):
    """Variance of NDVI if both bands have noise of a variance."""
    return 4 * variance * (means[1] ** 2 + means[0] ** 2) / (means[1] + means[0]) ** 4


def _blurred(sd, down):
    """Footprint of a box of 9 cells blurred by a Gaussian and displaced by cells downward."""
    reach = int(6 * sd)
    kernel = stats.norm.pdf(np.arange(-reach, reach + 1), scale=sd) if sd else np.ones(1)
    line = np.convolve(_BOX, kernel / kernel.sum())
    # Parts of a cell are phases of the frequencies of the weights.
    padded = np.pad(line, 128)
    moved = np.fft.irfft(np.fft.rfft(padded) * np.exp(-2j * np.pi * np.fft.rfftfreq(padded.size) * down), padded.size)
    return Footprint(moved if down % 1 else line, line, (-reach - 128 if down % 1 else int(down) - reach, -reach))


def test_scatter_agrees_with_an_independent_simulation():
    table = pd.read_csv(Path(__file__).parents[2] / "data" / "analytic_budget.csv", comment="#")
    assert len(table) > 150
    for (name, arp), rows in table.groupby(["lai", "arp"]):
        lai = _FIELDS[name]
        area = lai.ppf(stats.norm.cdf(DEVIATES))
        red, nir = 0.03 + 0.12 * np.exp(-0.75 * area), 0.36 - 0.20 * np.exp(-0.55 * area)
        field = prepare(correlation_of(arp), {"lai": area, "red": red, "nir": nir}, window=(1152, 1152), reach=420)
        truth = Pixel(("lai",), (Footprint(_BOX, _BOX),), mean_of_cells)
        for row in rows.itertuples():
            seen = _blurred(row.blur_sd_cells, 9 * row.shift_pixels_down)
            noise = partial(_noise, row.noise_sd_reflectance**2)
            (found,) = field.regressions([truth], Pixel(("red", "nir"), (seen, seen), _ndvi, noise))
            assert abs(found.scatter - row.scatter) <= max(0.003, 3 * row.se_scatter), row
            assert found.image_variance == pytest.approx(row.var_ndvi, rel=0.02)


def test_linear_pixels_with_noise_have_the_scatter_of_their_variances():
    field = prepare(correlation_of(0.2), {"lai": 2 + 0.5 * DEVIATES, "seen": 3 - DEVIATES})
    truth, seen = Footprint(_BOX, _BOX), Footprint(_BOX, _BOX)
    lines = []
    for noise in (0.0, 0.1):
        image = Pixel(("seen",), (seen,), mean_of_cells, lambda means, noise=noise: np.full(means[0].shape, noise))
        lines += field.regressions([Pixel(("lai",), (truth,), mean_of_cells)], image)
    assert lines[0].scatter == pytest.approx(0, abs=1e-9) and lines[0].slope == pytest.approx(-0.5)
    assert lines[1].scatter == pytest.approx(0.1 / (lines[0].image_variance + 0.1))
    # The variance of the mean of 9 x 9 cells, from the correlation along the lattice.
    assert lines[0].truth_variance == pytest.approx(0.25 * lines[0].image_variance)


def _flat(width=990, arp=0.15, distribution="burned-grazed", **sections):
    grid = {"width": width, "height": width} | sections.pop("grid", {})
    ground = {"arp": arp, "distribution": distribution}
    return fifesim.Scenario(grid=grid, terrain={"dem": "flat"}, ground=ground, **sections)


# The second one has no noise, so that the rounding errors of both bands depend on each other.
@pytest.mark.parametrize(
    "scenario",
    [
        _flat(
            arp=0.19, distribution="unburned-ungrazed", atmosphere={"visibility": 20.0},
            sensor={"offset": [0.3, -0.1], "noise": ["all"]},
        ),
        _flat(distribution="burned-ungrazed", atmosphere={"visibility": 37.0}),
    ],
    ids=["noise", "no noise"],
)  # fmt: skip
def test_analytic_budget_agrees_with_simulation(scenario):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = fifesim.budget(scenario, method="analytic", cells=297)
        drawn = fifesim.budget(scenario, realisations=6, cells=297)
    assert found.attrs["method"] == "analytic" and drawn.attrs["method"] == "simulate"
    for name in ("total", "curvature", "variation", "share"):
        allowed = np.maximum(0.005, 3 * standard_error(drawn[name]))
        apart = abs(found[name].isel(realisation=0) - drawn[name].mean("realisation"))
        assert (apart <= allowed).mean() >= 0.95, name
        assert (apart <= allowed + 0.01).all(), name
    np.testing.assert_allclose(found["share"].sum("stage") + found["curvature"], found["total"], rtol=1e-9)


@pytest.mark.parametrize(
    ("sections", "variables", "stage", "allowed"),
    [
        # In haze, NDVI of HRV is a straight function of leaf area near the mean of this field.
        (
            {
                "width": 1980, "arp": 0.17, "grid": {"cell": 20 / 9}, "sensor": {"instrument": "HRV"},
                "atmosphere": {"visibility": 34},
            },
            ["lai", "fpar"], "atmosphere", 0.003,
        ),
        # The share has the sign of the curvature of NDVI, 1e-3; standard errors are 1e-4 to 2e-4.
        ({"arp": 0.24, "distribution": "unburned-ungrazed"}, ["lai"], "NDVI scaling", 6e-4),
    ],
    ids=["without curvature", "sign of the curvature"],
)  # fmt: skip
def test_share_of_a_stage_agrees_with_simulation(sections, variables, stage, allowed):
    scenario, place = _flat(**sections), {"variable": variables, "stage": stage}
    found = fifesim.budget(scenario, method="analytic", cells=297).isel(realisation=0)
    drawn = fifesim.budget(scenario, realisations=2, cells=297).mean("realisation")
    for name in ("share", "first"):
        np.testing.assert_allclose(found[name].sel(place), drawn[name].sel(place), atol=allowed, rtol=0)
        assert stage != "NDVI scaling" or drawn[name].sel(place) > 1e-3


REFUSED = mistakes("analytic", name="experiment_mistakes")


@pytest.mark.parametrize(("stage", "sections", "reason"), REFUSED, ids=str)
def test_scenarios_beyond_the_analytic_budget_are_refused(stage, sections, reason):
    plain = {"grid": {"width": 990, "height": 990}, "terrain": {"dem": "flat"}, "landscape": {"learned": "none"}}
    options = {name: sections[name] for name in sections if name == "quantity"}
    sections = {name: sections[name] for name in sections if name not in options}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with pytest.raises(ValueError, match=reason):
            scenario = fifesim.Scenario(**(plain | {"ground": {"arp": 0.15}} | sections))
            fifesim.budget(scenario, method="analytic", cells=240, **options)


@pytest.mark.slow
def test_scores_of_a_learned_landscape_have_their_distribution_and_correlation():
    """Brute force: 2000 fields of 80 x 80 cells, far apart; broad gusts change correlations by less than 0.03."""
    land, cell = learned_landscape("konza"), 5.0
    place = np.arange(80) * cell
    drawn = np.stack([scores(land, -place, place, seed, cell=cell) for seed in range(2000)])
    lags = np.array([1, 2, 5, 10, 30, 60])
    along = [np.mean(drawn[:, :, lag:] * drawn[:, :, :-lag]) for lag in lags]
    down = [np.mean(drawn[:, lag:, lag:] * drawn[:, :-lag, :-lag]) for lag in lags]
    rho = correlation_of_scores(land, cell)
    np.testing.assert_allclose(np.array(along) / drawn.var(), rho[0, lags], atol=0.03)
    np.testing.assert_allclose(np.array(down) / drawn.var(), rho[lags, lags], atol=0.03)
    # Without broad gusts, the correlation is exact for places at random in a lattice. Cells as wide as the finest
    # lattice differ by 0.007 at lag 1; the standard errors are 0.001 to 0.007.
    still = land.model_copy(update={"level_gusts": land.level_gusts | {"broad": 0.0, "medium": 0.0}})
    calm = np.stack([scores(still, -place, place, seed, cell=cell) for seed in range(2000)])
    along = [np.mean(calm[:, :, lag:] * calm[:, :, :-lag]) for lag in lags]
    np.testing.assert_allclose(np.array(along) / calm.var(), correlation_of_scores(still, cell)[0, lags], atol=0.008)
    # Quantiles of the strata together; the distribution is symmetric.
    strata, shares = scores_of(land, DEVIATES, cell)
    below = [1.0, 2.0, 3.0]
    normal = stats.norm.pdf(DEVIATES) / stats.norm.pdf(DEVIATES).sum()
    found = [shares @ ((abs(strata) > each) @ normal) for each in below]
    np.testing.assert_allclose(found, [(abs(drawn) > each).mean() for each in below], rtol=0.03)


def _landscape(**sensor):
    ground = {"soil": 0.0, "brown": 0.05, "moisture": 0.1}
    grid = {"width": 8100, "height": 8100}
    return fifesim.Scenario(grid=grid, terrain={"dem": "flat"}, ground=ground, sensor=sensor | {"noise": ["all"]})


@pytest.mark.slow
@pytest.mark.parametrize("name", ["TM", "MSI"])
def test_budget_of_a_learned_landscape_agrees_with_simulation(name):
    scenario = _landscape(instrument=name, offset=[0.2, 0.1])
    found = fifesim.budget(scenario, method="analytic", cells=1215).isel(realisation=0)
    drawn = fifesim.budget(scenario, realisations=4, cells=1215)
    for key in ("total", "curvature", "share", "first"):
        # Non-linearity alone is 0.004 to 0.008 too small.
        allowed = np.maximum(0.01 if key == "first" else 0.005, 3 * standard_error(drawn[key]))
        assert (abs(found[key] - drawn[key].mean("realisation")) <= allowed).all(), key


@pytest.mark.slow
def test_small_windows_of_a_learned_landscape_hold_less_of_its_variation():
    """Windows of 1.1 km, over which fields of 640 m hardly vary; 20 realisations have a standard error of 0.005."""
    scenario = _landscape(offset=[0.1, 0.1])
    found = fifesim.budget(scenario, method="analytic").isel(realisation=0)
    drawn = fifesim.budget(scenario, realisations=20)
    share = drawn["share"].sel(stage="non-linearity", variable="lai").mean()
    assert float(found["share"].sel(stage="non-linearity", variable="lai")) == pytest.approx(float(share), abs=0.006)
    apart = abs(found["total"] - drawn["total"].mean("realisation"))
    assert (apart <= 3 * standard_error(drawn["total"])).all()
