"""Benchmarks of others hold, and what breaks one of them is named."""

import numpy as np
import pytest
from broken import exceeded
from typer.testing import CliRunner

from fifesim.atmosphere import column as phase_expansion
from fifesim.atmosphere import gases, successive_orders
from fifesim.base import files
from fifesim.cli import app
from fifesim.experiments.verification import areas, benchmarks


@pytest.mark.parametrize("check", [*benchmarks.CHECKS, *benchmarks.CANOPY])
def test_all_is_well(check):
    assert exceeded(check) == []


def test_every_view_of_the_references_is_compared():
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
def test_a_reference_changed_in_one_place_is_named(monkeypatch, check, name, column, row, factor, said):
    right = files.table

    def wrong(path):
        table = right(path)
        if path == f"verification/{name}.csv":
            table = table.copy()
            table.loc[table.index[row], column] *= factor
        return table

    monkeypatch.setattr(benchmarks.files, "table", wrong)
    monkeypatch.setattr(areas, "AREAS", {"atmosphere": [check]})
    result = CliRunner().invoke(app, ["verify"])
    assert result.exit_code == 1
    assert said in result.stdout.splitlines()[-1]


@pytest.mark.parametrize("component", [1, 2])
def test_turned_polarization_is_noticed(monkeypatch, component):
    """The plane of scattering, turned in one of two places: in what is scattered once."""
    right = successive_orders._rotation
    turned = np.array([1, -1] if component == 2 else [-1, 1])[:, None, None]
    monkeypatch.setattr(successive_orders, "_rotation", lambda *given: right(*given) * turned)
    assert "IPRT A1b, Q and U" in exceeded(benchmarks._iprt)


def test_another_depolarization_is_noticed(monkeypatch):
    right, own = successive_orders.mixed_column, {"depolarization": gases.DEPOLARIZATION}
    monkeypatch.setattr(successive_orders, "mixed_column", lambda *given, **options: right(*given, **options | own))
    assert "IPRT A1c, Q and U" in exceeded(benchmarks._iprt)


def test_matrix_of_spheres_needs_its_diagonal(monkeypatch):
    right = phase_expansion.matrix_moments
    monkeypatch.setattr(benchmarks, "matrix_moments", lambda *given: right(*given[:5]))
    assert exceeded(benchmarks._iprt) == ["IPRT A3, Q and U"]


@pytest.mark.parametrize(
    "owner, kernel",
    [(successive_orders, "_from_ground"), (successive_orders, "_rescattered"), (successive_orders, "fluxes")],
)
def test_wrong_light_is_noticed(monkeypatch, owner, kernel):
    """By a thousandth."""
    right = getattr(owner, kernel)

    def wrong(*given, **options):
        found = right(*given, **options)
        return (1.001 * found[0], found[1]) if isinstance(found, tuple) else 1.001 * found

    monkeypatch.setattr(owner, kernel, wrong)
    assert exceeded(benchmarks._molecules)


def test_wrong_canopy_is_noticed(monkeypatch):
    right = benchmarks.sail
    monkeypatch.setattr(benchmarks, "sail", lambda *given, **o: right(*given, **{**o, "hotspot": o["hotspot"] / 2}))
    assert "HOM45, from -30 to 60 degrees" in exceeded(benchmarks._canopy)
    assert exceeded(benchmarks._flat_discs)


def test_flat_discs_without_size_have_no_hot_spot():
    """Beer's law both ways, and straight back the leaves seen are those lit."""
    far, back = benchmarks.flat_discs(1e-6, 2.0, [0.0, 30.0])
    assert far == pytest.approx((1 - np.exp(-4.0)) / 2, rel=1e-3)
    assert back == pytest.approx(1 - np.exp(-2.0), rel=1e-6)
