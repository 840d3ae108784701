"""Checks of the analysis see the kernels that production calls."""

import pytest
from broken import exceeded, notices

from fifesim.analysis import regression, scaling
from fifesim.experiments.verification import analysis


@pytest.mark.parametrize("check", analysis.CHECKS)
def test_all_is_well(check):
    assert exceeded(check) == []


@pytest.mark.parametrize(
    ("owner", "kernel", "check"),
    [
        (regression, "increment_sums", analysis._increments),
        (scaling, "lag_sums", analysis._lags),
        (scaling, "ndvi_hessian", analysis._scales),
        (scaling, "sample_density", analysis._densities),
        (scaling, "shapley", analysis._causes),
    ],
)
def test_production_kernels_are_checked(monkeypatch, owner, kernel, check):
    assert notices(check, monkeypatch, owner, kernel)
