"""Checks of the random field see the kernels that make landscapes."""

import pytest
from broken import exceeded, notices

from fifesim.experiments.verification import landscape
from fifesim.ground.landscape import autoregression


@pytest.mark.parametrize("check", landscape.CHECKS)
def test_all_is_well(check):
    assert exceeded(check) == []


@pytest.mark.parametrize(
    "owner, kernel, check",
    [
        (landscape, "philox", landscape._generator),
        (autoregression, "_fill", landscape._white_noise),
        (landscape, "streaming_field", landscape._tiles),
        (landscape, "quantile_map", landscape._quantiles),
        (landscape, "rank_map", landscape._quantiles),
        (landscape, "periodic_field", landscape._equation),
    ],
)
def test_production_kernels_are_checked(monkeypatch, owner, kernel, check):
    assert notices(check, monkeypatch, owner, kernel)
