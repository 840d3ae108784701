"""All checks pass, and the page on the physics states the errors that they find."""

import re
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from fifesim.atmosphere import engines
from fifesim.atmosphere.engines import mixed_scattering
from verification import areas, atmosphere, canopy, tables

TESTS = Path(__file__).parents[1]

# Checks with many cases of successive orders.
SLOW = (atmosphere._successive_orders, canopy._foliage_tables)
CHECKS = [
    pytest.param(check, marks=[pytest.mark.slow] if check in SLOW else [], id=f"{area}-{check.__name__}")
    for area, checks in areas.AREAS.items()
    for check in checks
]


@pytest.mark.parametrize("check", CHECKS)
def test_check_passes(check):
    found = list(check())
    assert found and [each.what for each in found if not each.within] == []


@pytest.mark.slow
def test_successive_orders_without_polarization_agree_with_scalar_6s(monkeypatch):
    """Scalar 6S is not always self-consistent, so its table has fewer cases."""
    scalar, table = pd.read_csv(TESTS / "data" / "sixs_scalar.csv", comment="#"), tables.table
    monkeypatch.setitem(engines.SCATTERING, "successive-orders", partial(mixed_scattering, polarized=False))
    monkeypatch.setattr(engines, "_band_terms", engines._band_terms.__wrapped__)
    monkeypatch.setattr(tables, "table", lambda name: scalar if name == "sixs_grid.csv" else table(name))
    found = list(atmosphere._successive_orders())
    assert len(found) == 8 and all(each.within for each in found)


def test_deviation_is_nan_where_a_result_is_nan():
    assert np.isnan(tables.largest([1.0, np.nan], 1.0))
    assert tables.largest([1.0, 4.0], [2.0, 2.0]) == 2.0
    assert tables.largest([1.0, 4.0], [2.0, 4.0], relative=True) == 0.5
    assert tables.rms_percent([1.03, 0.96], 1.0) == pytest.approx(np.sqrt((9 + 16) / 2), rel=1e-12)


def test_errors_of_crowns_match_the_physics_page():
    page = (TESTS.parent / "docs" / "physics.md").read_text(encoding="utf-8")
    row = r"^\| (HET0\d).* \| ([\d.]+)(?:, .+)? \| (.+) % \| (.+) % \| (.+) % \|$"
    rows = re.findall(row, page, re.MULTILINE)
    cases = [f"{scene} {cover}" for scene, cover, *_ in rows]
    assert cases == ["HET01 0.4712", "HET04 0.2989", "HET04 0.2592", "HET01 1", "HET04 1"]
    for scene, cover, *printed in rows:
        error = canopy.crown_errors(scene, float(cover))
        found = error.mean(), error.min(), error.max()
        assert [f"{each:+.0f}".replace("-", "−") for each in found] == printed
