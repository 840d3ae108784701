"""Sobol indices of functions with closed forms, and of a study."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import qmc

import fifesim
from fifesim.analysis.variance_indices import sobol_indices, sobol_points

TABLE = pd.read_csv(Path(__file__).parents[1] / "data" / "sobol_indices.csv", comment="#")


def ishigami(text, share):
    a, b = (float(each.partition("=")[2]) for each in text.split())
    x = np.pi * (2 * share - 1)
    return np.sin(x[..., 0]) + a * np.sin(x[..., 1]) ** 2 + b * x[..., 2] ** 4 * np.sin(x[..., 0])


def sobol_g(text, share):
    a = np.array([float(each) for each in text.removeprefix("a=").split()])
    return np.prod((np.abs(4 * share - 2) + a) / (1 + a), axis=-1)


@pytest.mark.parametrize("case", TABLE["case"].unique())
def test_indices_are_those_of_the_closed_form(case):
    rows = TABLE[TABLE["case"] == case]
    function = ishigami if case.startswith("ishigami") else sobol_g
    sets = sobol_points(qmc.Sobol(2 * len(rows), seed=1).random_base2(12))
    values = function(rows["parameters"].iloc[0], sets)
    np.testing.assert_allclose(values[:2].var(), rows["variance"].iloc[0], rtol=0.01)
    found = sobol_indices(values)
    for name in ("first", "total"):
        index, error = getattr(found, name), getattr(found, f"{name}_error")
        difference = np.abs(index - rows[name].to_numpy())
        assert (difference < 3 * error).all() and (difference < 0.01).all(), name


def test_indices_are_those_of_salib():
    pytest.importorskip("SALib")
    from SALib.analyze import sobol

    sets = sobol_points(np.random.default_rng(4).random((512, 6)))
    values = ishigami("a=7 b=0.1", sets)
    # SALib has one block of A, A_B of each input and B for each point.
    ordered = np.concatenate([values[:1], values[2:], values[1:2]]).T.ravel()
    problem = {"num_vars": 3, "names": ["a", "b", "c"], "bounds": [[0, 1]] * 3}
    expected = sobol.analyze(problem, ordered, calc_second_order=False, seed=1)
    found = sobol_indices(values)
    np.testing.assert_allclose(found.first, expected["S1"], rtol=1e-9)
    np.testing.assert_allclose(found.total, expected["ST"], rtol=1e-9)


def test_constant_and_undefined_functions_are_refused():
    with pytest.raises(ValueError, match="constant"):
        sobol_indices(np.ones((4, 8)))
    with pytest.raises(ValueError, match="not finite"):
        sobol_indices(np.full((4, 8), np.nan))


CHIP = fifesim.Scenario(grid={"width": 120, "height": 120}, terrain={"dem": "flat"})


def test_parameters_of_a_study_have_their_shares():
    """Of a function of the scenario: twice the range has four times the variance."""
    study = fifesim.Study(CHIP, {"brown": {"uniform": [0, 0.2]}, "moisture": {"uniform": [0, 0.4]}})
    found = fifesim.sensitivity(study, lambda each: each.ground.brown + each.ground.moisture, n=256, each=iter)
    assert found.parameter.values.tolist() == ["ground.brown", "ground.moisture"]
    np.testing.assert_allclose(found["first"], [0.2, 0.8], atol=0.02)
    np.testing.assert_allclose(found["total"], [0.2, 0.8], atol=0.02)
    # Only green leaves produce, and soil hardly matters for the light that they absorb.
    gpp = fifesim.sensitivity(study, "gpp", n=16, each=iter)
    assert gpp["first"].sel(parameter="ground.brown") > 0.95
    with pytest.raises(ValueError, match="must return a number for a scenario, it returns list"):
        fifesim.sensitivity(study, lambda scenario: [1, 2], n=4, each=iter)
    with pytest.raises(ValueError, match="n must be at least 2"):
        fifesim.sensitivity(study, n=1)
