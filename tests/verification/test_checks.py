"""Checks pass, and detect changes of the kernels used in production."""

import string
from importlib import import_module
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from broken import exceeded, notices

from fifesim.atmosphere import adjacency, column
from verification import areas, atmosphere, canopy, scattering
from verification.deviations import largest, rms_percent

TABLE = Path(__file__).parents[1] / "data" / "broken_kernels.csv"
BROKEN = pd.read_csv(TABLE, comment="#", keep_default_na=False, dtype=str)

# Checks with many cases of successive orders.
SLOW = (atmosphere._light, atmosphere._successive_orders, canopy._foliage_tables)
CHECKS = [
    pytest.param(check, marks=[pytest.mark.slow] if check in SLOW else [], id=f"{area}-{check.__name__}")
    for area, checks in areas.AREAS.items()
    for check in checks
]


@pytest.mark.parametrize("check", CHECKS)
def test_check_passes(check):
    assert exceeded(check) == []


def found(path):
    """Module, class or function at a dotted path."""
    module, _, name = path.rpartition(".")
    return getattr(import_module(module), name) if name[0] in string.ascii_uppercase + "_" else import_module(path)


@pytest.mark.parametrize(("owner", "kernel", "factor", "check", "what"), BROKEN.to_numpy().tolist())
def test_production_kernels_are_checked(monkeypatch, owner, kernel, factor, check, what):
    owner, check = found(owner), found(f"verification.{check}")
    if not factor:
        assert notices(check, monkeypatch, owner, kernel)
        return
    right, factors = getattr(owner, kernel), np.array(factor.split(), float)
    # The rotation of the scattering plane has two places; only single scattering is changed here.
    factors = factors[:, None, None] if kernel == "_rotation" else factors

    def wrong(*given, **options):
        light = right(*given, **options)
        return (factors * light[0], light[1]) if isinstance(light, tuple) else factors * np.asarray(light)

    monkeypatch.setattr(owner, kernel, wrong)
    assert any(each.startswith(what) for each in exceeded(check))


@pytest.mark.parametrize("turned", [(1, 0), (0, 2), (2, -2)])
def test_wigner_functions_of_the_wrong_sign_are_detected(monkeypatch, turned):
    right = column.wigner

    def wigner(order, spin, cosine, count):
        return right(order, spin, cosine, count) * (-1 if (order, spin) == turned else 1)

    monkeypatch.setattr(column, "wigner", wigner)
    assert "Wigner functions" in exceeded(scattering._wigner_functions)


def test_displaced_surroundings_are_detected(monkeypatch):
    """The surroundings are displaced by one block."""
    right = adjacency.block_environment

    def shifted(sums, surroundings, spread):
        return right(sums, np.roll(surroundings, 1, axis=1) if np.ndim(surroundings) else surroundings, spread)

    monkeypatch.setattr(adjacency, "block_environment", shifted)
    assert exceeded(scattering._part_of_a_scene) == ["environment of a part of a scene"]


def test_sum_over_blocks_of_the_wrong_sign_is_detected(monkeypatch):
    right = adjacency._add_moments
    monkeypatch.setattr(adjacency, "_add_moments", lambda values, *given: right(-values, *given))
    assert exceeded(scattering._direct_sums) == ["environment of cells"]


def test_deviation_is_nan_where_a_result_is_nan():
    assert np.isnan(largest([1.0, np.nan], 1.0))
    assert largest([1.0, 4.0], [2.0, 2.0]) == 2.0 and largest([1.0, 4.0], [2.0, 4.0], relative=True) == 0.5
    assert rms_percent([1.03, 0.96], 1.0) == pytest.approx(np.sqrt((9 + 16) / 2), rel=1e-12)
