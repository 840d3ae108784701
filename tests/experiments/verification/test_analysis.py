"""Checks of the analysis see the kernels that production calls."""

import pytest
from broken import exceeded, notices

from fifesim.analysis import attribution, density, scaling, uncertainty, variogram
from fifesim.experiments.verification import analysis


@pytest.mark.parametrize("check", analysis.CHECKS)
def test_all_is_well(check):
    assert exceeded(check) == []


@pytest.mark.parametrize(
    ("owner", "kernel", "check"),
    [
        (uncertainty, "increment_sums", analysis._increments),
        (variogram, "lag_sums", analysis._lags),
        (scaling, "ndvi_hessian", analysis._scales),
        (density, "sample_density", analysis._densities),
        (attribution, "shapley", analysis._causes),
    ],
)
def test_production_kernels_are_checked(monkeypatch, owner, kernel, check):
    assert notices(check, monkeypatch, owner, kernel)
