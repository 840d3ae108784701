"""The command and the function: one whole file, or nothing."""

import re

import pytest
from typer.testing import CliRunner

import fifesim
from fifesim.cli import app
from fifesim.experiments.explorer import page
from fifesim.scenario.toml import write_scenario


@pytest.fixture
def quick(sweep, monkeypatch):
    """Four settings in the place of all."""
    few = type(sweep)(**{**vars(sweep), "arps": sweep.arps[:1], "szas": sweep.szas[:1], "instruments": ("TM",)})
    monkeypatch.setattr(page, "sweep_of", lambda scenario: few)


def test_command_writes_one_page_and_replaces_none(quick, small, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(write_scenario(small.complete()))
    made = CliRunner().invoke(app, ["explore", "mine.toml", "-o", "pages/mine.html"])
    assert made.exit_code == 0, made.output
    assert re.fullmatch(r"pages/mine.html\ndone in .*: open pages/mine.html in a browser\n", made.output)
    assert [path.name for path in (tmp_path / "pages").iterdir()] == ["mine.html"]
    again = CliRunner().invoke(app, ["explore", "mine.toml", "-o", "pages/mine.html"])
    assert again.exit_code == 2 and "--overwrite" in again.output
    first = (tmp_path / "pages" / "mine.html").read_bytes()
    assert CliRunner().invoke(app, ["explore", "mine.toml", "-o", "pages/mine.html", "--overwrite"]).exit_code == 0
    assert (tmp_path / "pages" / "mine.html").read_bytes() == first


def test_a_folder_is_no_page(tmp_path):
    with pytest.raises(ValueError, match="is a folder, and explore writes one page"):
        fifesim.explore(path=tmp_path)


def test_a_path_is_no_scenario(tmp_path):
    with pytest.raises(TypeError, match="read_scenario"):
        fifesim.explore("mine.toml", tmp_path / "explore.html")
