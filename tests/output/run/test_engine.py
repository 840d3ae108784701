"""A run begins with the engine of its atmosphere."""

import pytest
from typer.testing import CliRunner

from fifesim.atmosphere import engines, six_s
from fifesim.cli import app
from fifesim.output.run.folder import run_engine
from fifesim.scenario.scenario import parse_scenario
from fifesim.scenario.simulation import simulate

SMALL = {"grid": {"width": 300, "height": 300}, "terrain": {"dem": "flat"}}


def test_all_that_a_simulation_asks_of_the_engine_is_known_before(monkeypatch):
    scenario = parse_scenario(SMALL | {"atmosphere": {"visibility": 17.0}}).complete()
    run_engine(scenario)
    monkeypatch.setitem(engines.SCATTERING, "5S", None)
    assert "image" in simulate(scenario).children


@pytest.mark.parametrize("command", ["simulate", "budget"])
def test_missing_engine_is_one_line_with_exit_code_1(command, monkeypatch, tmp_path):
    monkeypatch.setattr(six_s, "Py6S", None)
    (tmp_path / "6s.toml").write_text('[atmosphere]\nengine = "6S"\n[grid]\nwidth = 300\nheight = 300\n')
    result = CliRunner().invoke(app, [command, str(tmp_path / "6s.toml"), "-o", str(tmp_path / "out")])
    assert result.exit_code == 1
    assert result.stderr.strip().splitlines() == [
        "fifesim: engine='6S' needs the 6S engine: type pip install 'fifesim[sixs]' (wheels for Linux x86_64, Windows "
        "and Intel Mac), or use engine='successive-orders'"
    ]
    assert not (tmp_path / "out").exists()
