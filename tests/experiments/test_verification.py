"""`fifesim verify` passes on a sound installation, covers all stages and names broken physics."""

import numpy as np
import pytest
from typer.testing import CliRunner

import fifesim
from fifesim.base import files
from fifesim.cli import app
from fifesim.experiments.verification import COMPARED

TABLE = files.table("verification.csv")


def run():
    return CliRunner().invoke(app, ["verify"])


@pytest.fixture
def only(monkeypatch):
    """A function that leaves only the rows of one quantity."""

    right = files.table

    def select(quantity):
        rows = TABLE[TABLE["quantity"] == quantity]
        monkeypatch.setattr(files, "table", lambda name: rows if name == "verification.csv" else right(name))
        return rows

    return select


def test_installation_is_within_all_bounds():
    result = run()
    assert result.exit_code == 0, result.output
    *lines, last = result.stdout.splitlines()
    assert last == f"{len(TABLE)} comparisons, all within their bounds"
    for (_, row), line in zip(TABLE.iterrows(), lines[1:], strict=True):
        assert line.startswith(row["area"]) and line.endswith(row["source"])


def test_rows_cover_all_areas_and_use_all_quantities():
    assert TABLE["area"].nunique() == 12
    assert set(TABLE["quantity"]) == set(COMPARED)
    assert not TABLE.duplicated(["area", "compared"]).any()


@pytest.mark.parametrize("quantity", COMPARED)
def test_results_that_are_2_percent_too_large_are_noticed(monkeypatch, only, quantity):
    """5 % for the variance of a sample, and 25 % for crowns, whose model has an error of 14 %."""
    rows, right, factor = only(quantity), COMPARED[quantity], {"noise variance": 1.05, "crowns": 1.25}
    monkeypatch.setitem(COMPARED, quantity, lambda **inputs: factor.get(quantity, 1.02) * right(**inputs))
    found = fifesim.experiments.verify()
    assert len(found) == len(rows) and not all(each.within for each in found)


def test_broken_kernel_is_named_with_exit_code_1(monkeypatch, only):
    only("Ross-Li")
    monkeypatch.setitem(COMPARED, "Ross-Li", lambda **inputs: np.nan)
    result = run()
    assert result.exit_code == 1
    last = "1 comparisons, 1 beyond their bounds: analysis: reflectance of Ross and Li"
    assert result.stdout.splitlines()[-1] == last and result.stdout.count("EXCEEDED") == 1
