"""The command: table, figures and page, or nothing."""

import pandas as pd
import pytest
from typer.testing import CliRunner

from fifesim.cli import app
from fifesim.experiments.friedl1995 import case as friedl1995
from fifesim.experiments.friedl1995 import effects as friedl1995_effects
from fifesim.experiments.friedl1995 import folder as reproduction
from fifesim.experiments.friedl1995 import table as friedl1995_table
from fifesim.experiments.friedl1995.case import READINGS, USED


@pytest.fixture
def quick(monkeypatch, tmp_path):
    """The command on scenes of 10 x 10 pixels, with the tables of effects cut short."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(friedl1995_effects, "SIZES", (90,))
    monkeypatch.setattr(friedl1995, "READINGS", (USED, *(each for each in READINGS if each.topography)))
    monkeypatch.setattr(friedl1995_effects, "changes", lambda case: [])
    monkeypatch.setattr(reproduction, "_EFFECT_REALISATIONS", 1)
    monkeypatch.setattr(reproduction, "_DPI", 40)

    def call(*arguments):
        return CliRunner().invoke(app, ["reproduce", "--cells", "90", "--realisations", "1", *map(str, arguments)])

    return call


def test_command_writes_table_figures_and_page(quick, tmp_path, monkeypatch):
    tables = {}
    for name in ("readings", "sizes", "sensitivity"):
        make = getattr(friedl1995_effects, name)
        monkeypatch.setattr(
            friedl1995_effects,
            name,
            lambda *arguments, name=name, make=make, **options: tables.setdefault(name, make(*arguments, **options)),
        )
    result = quick("-o", "out")
    assert result.exit_code == 0, result.output
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(reproduction.FILES)
    table = pd.read_csv(tmp_path / "out" / "table2.csv")
    wanted = {f"{before}{name}" for before in ("", "paper_") for name in friedl1995_table.COEFFICIENTS}
    assert len(table) == 18 and wanted <= set(table.columns)
    page = (tmp_path / "out" / "report.html").read_text()
    assert page.count("data:image/png;base64,") == 7
    # The argument rests on the size of the scene, which is another here.
    assert f"argued for scenes of {friedl1995.CELLS} cells" in page
    assert USED.name in page and "http" not in page.replace("http-equiv", "")
    first = {name: (tmp_path / "out" / name).read_bytes() for name in reproduction.FILES}
    assert quick("-o", "out").exit_code == 2
    # The tables of effects are the longest part, and are in the page as they came.
    for name, made in tables.items():
        monkeypatch.setattr(friedl1995_effects, name, lambda *arguments, made=made, **options: made)
    assert quick("-o", "out", "--overwrite").exit_code == 0
    assert {name: (tmp_path / "out" / name).read_bytes() for name in reproduction.FILES} == first


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--cells", 50), "at least 90, 10 pixels"),
        (("--realisations", 0), "at least 1"),
        (("--seed", -1), "seed must be"),
    ],
)
def test_mistake_is_one_line_and_leaves_nothing(quick, tmp_path, arguments, said):
    result = quick("-o", "out", *arguments)
    assert result.exit_code == 2
    assert said in result.stderr and len(result.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_failure_in_the_middle_leaves_nothing(quick, tmp_path, monkeypatch):
    for name in ("readings", "sizes", "sensitivity"):
        monkeypatch.setattr(friedl1995_effects, name, lambda *arguments, **options: None)

    def full(*arguments):
        raise OSError("disk full")

    monkeypatch.setattr(reproduction.friedl1995_report, "reproduction_page", full)
    result = quick("-o", "out")
    assert result.exit_code == 1 and "disk full" in result.stderr
    assert not (tmp_path / "out").exists()
