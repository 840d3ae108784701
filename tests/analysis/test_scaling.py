"""Scale effects against closed forms, quadrature, brute force and scipy; Shapley shares and Sobol indices."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from scipy.stats import qmc

from fifesim.analysis import scaling
from fifesim.analysis.scaling import sobol_indices, sobol_points
from fifesim.base import footprints

# ------------------------------------------------------------------------------------------ variograms


def test_pixels_beyond_the_scene_are_ignored():
    """Two of three pixels of four cells lie inside the scene; their correlation is a triangle."""
    axis = footprints.axis_operator(
        footprints.Boxcar(4), cell_origin=0, cell_size=1, n_cells=10, pixel_origin=-2, pixel_size=4, n_pixels=3
    )
    triangle = np.maximum(4 - np.abs(np.arange(-5, 6)), 0) / 16
    np.testing.assert_allclose(scaling.weight_correlation(axis, 5), triangle, atol=1e-15)


# ------------------------------------------------------------------------------------------ densities


def test_reflected_density_has_all_its_mass_above_zero():
    """
    Expected: twice scipy's density of the samples and their mirror images. Without reflection, part of the mass is
    below zero.
    """
    samples = np.abs(np.random.default_rng(8).normal(0, 1, 400))
    theirs = stats.gaussian_kde(np.r_[samples, -samples], bw_method=0.2 / np.r_[samples, -samples].std(ddof=1))
    at = np.linspace(0, 6, 901)
    found = scaling.gaussian_density(samples, at, 0.2, reflect=True)
    np.testing.assert_allclose(found, 2 * theirs(at), rtol=1e-10)
    assert np.trapezoid(found, at) == pytest.approx(1, abs=1e-6)
    assert np.trapezoid(scaling.gaussian_density(samples, at, 0.2), at) < 0.95
    np.testing.assert_array_equal(scaling.gaussian_density(samples, np.array([-0.1, -1e-9]), 0.2, reflect=True), 0.0)
    bandwidth = scaling.silverman_bandwidth(samples.std(ddof=1), stats.iqr(samples), 400)
    mine = scaling.gaussian_density(samples, at, bandwidth, reflect=True)
    np.testing.assert_allclose(scaling.sample_density(samples, at, reflect=True), mine, rtol=1e-12)
    # The smaller of the two spreads is used; the standard deviation replaces an interquartile range of 0.
    assert scaling.silverman_bandwidth(1.0, 1.34 * 0.5, 32.0) == pytest.approx(0.9 * 0.5 / 2, rel=1e-12)
    assert scaling.silverman_bandwidth(1.0, 0.0, 1.0) == pytest.approx(0.9, rel=1e-12)


def test_density_is_the_same_in_parts(monkeypatch):
    samples, at = np.random.default_rng(2).normal(size=50), np.linspace(-3, 3, 7)
    whole = scaling.gaussian_density(samples, at, 0.3)
    monkeypatch.setattr(scaling, "_PART", 7)
    np.testing.assert_allclose(scaling.gaussian_density(samples, at, 0.3), whole, rtol=1e-13)


# ------------------------------------------------------------------------------------------ shares and indices


SOBOL = pd.read_csv(Path(__file__).parents[1] / "data" / "sobol_indices.csv", comment="#")


def ishigami(text, share):
    a, b = (float(each.partition("=")[2]) for each in text.split())
    x = np.pi * (2 * share - 1)
    return np.sin(x[..., 0]) + a * np.sin(x[..., 1]) ** 2 + b * x[..., 2] ** 4 * np.sin(x[..., 0])


def sobol_g(text, share):
    a = np.array([float(each) for each in text.removeprefix("a=").split()])
    return np.prod((np.abs(4 * share - 2) + a) / (1 + a), axis=-1)


@pytest.mark.parametrize("case", SOBOL["case"].unique())
def test_sobol_indices_agree_with_the_closed_form(case):
    rows = SOBOL[SOBOL["case"] == case]
    function = ishigami if case.startswith("ishigami") else sobol_g
    sets = sobol_points(qmc.Sobol(2 * len(rows), seed=1).random_base2(12))
    values = function(rows["parameters"].iloc[0], sets)
    np.testing.assert_allclose(values[:2].var(), rows["variance"].iloc[0], rtol=0.01)
    found = sobol_indices(values)
    for name in ("first", "total"):
        index, error = getattr(found, name), getattr(found, f"{name}_error")
        difference = np.abs(index - rows[name].to_numpy())
        assert (difference < 3 * error).all() and (difference < 0.01).all(), name


def test_sobol_indices_agree_with_salib():
    pytest.importorskip("SALib")
    from SALib.analyze import sobol

    sets = sobol_points(np.random.default_rng(4).random((512, 6)))
    values = ishigami("a=7 b=0.1", sets)
    # For each point, SALib expects A, then A_B of each input, then B.
    ordered = np.concatenate([values[:1], values[2:], values[1:2]]).T.ravel()
    problem = {"num_vars": 3, "names": ["a", "b", "c"], "bounds": [[0, 1]] * 3}
    expected = sobol.analyze(problem, ordered, calc_second_order=False, seed=1)
    found = sobol_indices(values)
    np.testing.assert_allclose(found.first, expected["S1"], rtol=1e-9)
    np.testing.assert_allclose(found.total, expected["ST"], rtol=1e-9)


def test_correlation_above_the_threshold_has_no_range():
    assert np.isnan(scaling.crossing(np.arange(3.0), np.array([1.0, 0.9, 0.8])))
    assert scaling.crossing(2 * np.arange(3.0), np.array([1.0, 0.55, -0.45])) == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: sobol_indices(np.ones((4, 8))), "constant"),
        (lambda: sobol_indices(np.full((4, 8), np.nan)), "not finite"),
        (lambda: scaling.shapley(np.zeros((2, 2)), 3), "3 axes of 2 first"),
        (lambda: scaling.sample_density([1.0, np.nan], [0.0]), "at least 2 values"),
        (lambda: scaling.sample_density([1.0, 1.0], [0.0]), "bandwidth must be above 0, got 0: do the samples vary"),
        (lambda: scaling.gaussian_density(np.array([1.0, -0.5]), np.zeros(1), 0.1, reflect=True), r"least 0 .*-0\.5"),
    ],
)
def test_samples_without_a_result_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
