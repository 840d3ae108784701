"""Scenarios as text."""

import pytest

from fifesim.scenario.scenario import Scenario
from fifesim.scenario.toml import check_spelling, load_values, write_scenario


def written(tmp_path, text):
    (tmp_path / "s.toml").write_text(text, encoding="utf-8")
    return tmp_path / "s.toml"


def test_files_lie_beside_the_text(tmp_path):
    """Each key that names a file, and none that is a name."""
    path = written(
        tmp_path,
        "[ground]\nlai_file = 'lai.tif'\ndistribution = 'burned-grazed'\n[terrain]\ndem = 'dem.tif'\n"
        "[sensor]\ninstrument = 'mine.toml'\n",
    )
    values = load_values(path)
    assert values["ground"] == {"lai_file": str(tmp_path.resolve() / "lai.tif"), "distribution": "burned-grazed"}
    assert values["terrain"]["dem"] == str(tmp_path.resolve() / "dem.tif")
    assert values["sensor"]["instrument"] == str(tmp_path.resolve() / "mine.toml")


def test_spelling_tells_each_mistake_in_a_line(tmp_path):
    path = written(tmp_path, "[sensor]\nbandz = ['TM3']\npixel = -1\n[ground]\narp = 0.3\n")
    with pytest.raises(ValueError) as caught:
        check_spelling(path)
    assert [line.partition(" =")[0] for line in str(caught.value).splitlines()] == [
        "ground.arp",
        "sensor.pixel",
        "unknown key sensor.bandz",
    ]


def test_what_physics_alone_knows_passes_spelling(tmp_path):
    check_spelling(written(tmp_path, "[sensor]\ninstrument = 'TN'\n[ground]\nleaf_angles = 'sphere'\n"))


def test_quotes_and_backslashes_go_through(tmp_path):
    odd = Scenario(ground={"lai_file": 'a "map" in C:\\maps.tif'}, terrain={"dem": "flat"})
    path = written(tmp_path, write_scenario(odd))
    assert load_values(path)["ground"]["lai_file"].endswith('a "map" in C:\\maps.tif')
