"""Published benchmarks are met, and a changed reference is named."""

import re
from pathlib import Path

import numpy as np
import pytest
from broken import exceeded

from fifesim.atmosphere import column as phase_expansion
from fifesim.atmosphere import gases, successive_orders
from verification import benchmarks, canopy, tables


def test_all_views_of_the_references_are_compared():
    assert sum(len(benchmarks.iprt(case)[0]) for case in ("A1a", "A1b", "A1c", "A2", "A3", "B1")) == 295
    table, found, converged = benchmarks.molecules()
    assert found.shape == converged.shape == (3, len(table)) == (3, 252)
    assert np.isfinite(found).all() and np.isfinite(converged).all()


@pytest.mark.parametrize(
    "check, name, column, row, factor, said",
    [
        (benchmarks._iprt, "iprt", "I", 3, 1.002, "IPRT A1a, intensity of air and sky"),
        (benchmarks._iprt, "iprt", "U", 290, 1.01, "IPRT B1, Q and U"),
        (benchmarks._molecules, "molecules_stokes", "I", 7, 1.00001, "I, Q and U of molecules, many layers"),
        (benchmarks._rami, "rami4atm", "reflectance", 80, 1.05, "white ground below molecules"),
        (benchmarks._rami, "rami4atm", "reflectance", 10, 1.1, "ground below aerosol and gases"),
        (benchmarks._canopy, "rami4atm", "reflectance", -1, 1.1, "HOM45, toward the sun, 65 to 75 degrees"),
    ],
)
def test_reference_changed_in_one_place_is_named(monkeypatch, check, name, column, row, factor, said):
    right = tables.table

    def wrong(path):
        table = right(path)
        if path == f"{name}.csv":
            table = table.copy()
            table.loc[table.index[row], column] *= factor
        return table

    monkeypatch.setattr(tables, "table", wrong)
    assert said in exceeded(check)


def test_other_depolarization_is_detected(monkeypatch):
    right, own = successive_orders.mixed_column, {"depolarization": gases.DEPOLARIZATION}
    monkeypatch.setattr(successive_orders, "mixed_column", lambda *given, **options: right(*given, **options | own))
    assert "IPRT A1c, Q and U" in exceeded(benchmarks._iprt)


def test_matrix_of_spheres_needs_its_diagonal(monkeypatch):
    right = phase_expansion.matrix_moments
    monkeypatch.setattr(benchmarks, "matrix_moments", lambda *given: right(*given[:5]))
    assert exceeded(benchmarks._iprt) == ["IPRT A3, Q and U"]


def test_wrong_canopy_is_detected(monkeypatch):
    right = benchmarks.sail
    monkeypatch.setattr(benchmarks, "sail", lambda *given, **o: right(*given, **{**o, "hotspot": o["hotspot"] / 2}))
    assert "HOM45, from -30 to 60 degrees" in exceeded(benchmarks._canopy)
    assert exceeded(benchmarks._flat_discs)


def test_flat_discs_without_size_have_no_hot_spot():
    """Beer's law along both directions; in exact backscatter, all visible leaves are sunlit."""
    far, back = benchmarks.flat_discs(1e-6, 2.0, [0.0, 30.0])
    assert far == pytest.approx((1 - np.exp(-4.0)) / 2, rel=1e-3)
    assert back == pytest.approx(1 - np.exp(-2.0), rel=1e-6)


def test_errors_of_crowns_match_the_pages():
    docs = Path(__file__).parents[2] / "docs"
    page = (docs / "developers" / "physics_checks.md").read_text(encoding="utf-8")
    row = r"^\| (HET0\d).* \| ([\d.]+)(?:, .+)? \| (.+) % \| (.+) % \| (.+) % \|$"
    rows = re.findall(row, page, re.MULTILINE)
    cases = [f"{scene} {cover}" for scene, cover, *_ in rows]
    assert cases == ["HET01 0.4712", "HET04 0.2989", "HET04 0.2592", "HET01 1", "HET04 1"]
    for scene, cover, *printed in rows:
        _, error = canopy.crown_errors(scene, float(cover))
        found = error.mean(), error.min(), error.max()
        assert [f"{each:+.0f}".replace("-", "−") for each in found] == printed
    summary = " ".join((docs / "physics.md").read_text(encoding="utf-8").split())
    means = re.search(
        r"is (\S+) % for spheres \(HET01\) and (\S+) % for .+ \(HET04\); without gaps it is (\S+) %", summary
    )
    assert list(means.groups()) == [rows[number][2] for number in (0, 1, 3)]
    low, high = map(int, re.search(r"crowns are not round to be (\d+) to (\d+) % too dark", page).groups())
    errors = (canopy.crown_errors("HET04", cover) for cover in (0.2989, 0.2592))
    slant = [error[abs(vza) >= 45] for vza, error in errors]
    np.testing.assert_allclose([-np.max(slant), -np.min(slant)], [low, high], atol=2)
