"""What is synthetic in a scenario is stated, and nothing that a file gives is called so."""

import re
from pathlib import Path

import pytest

from fifesim.base import files
from fifesim.scenario.scenario import Scenario, default_scenario, parse_scenario, read_scenario, statement, summary
from fifesim.scenario.toml import write_scenario

ROOT = Path(__file__).parents[2]
DEFAULT = (
    "Synthetic landscape: fields and hills are synthetic; only the three grass types and the location are FIFE's. "
    "Hypothetical overpass, 6 June 1987 16:35 UTC."
)
OVERPASS = "Hypothetical overpass, 6 June 1987 16:35 UTC."
PASTURES = {"landscape": {"cover": "pastures"}}
GIVEN = {"ground": {"lai_file": "lai.tif"}, "terrain": {"dem": "dem.tif"}}
# On the site of FIFE; a scene that covers a LAI file has the grid of the file.
PLACE = {"grid": {"west": 704970.0, "north": 4334220.0, "width": 900.0, "height": 900.0}}
ELSEWHERE = {"grid": {"west": 600_000.0}, "geometry": {"time": "2022-06-01T10:05:00Z"}}


def test_default_landscape_is_called_synthetic():
    """Also once every default is written out and read again."""
    found = default_scenario()
    for scenario in (found, found.complete(), parse_scenario(PASTURES)):
        assert statement(scenario) == scenario.provenance() == DEFAULT
        assert summary(scenario) == "synthetic landscape, hypothetical overpass"


@pytest.mark.parametrize(
    ("values", "said", "short"),
    [
        (
            {},
            "Synthetic landscape: leaf area and hills are synthetic; only the grass type and the location are FIFE's.",
            "synthetic landscape, hypothetical overpass",
        ),
        (
            {"terrain": {"dem": "flat"}, "ground": {"distribution": "mine.csv"}},
            "Synthetic landscape: leaf area is synthetic; the ground is level; only the location is FIFE's.",
            "synthetic landscape, hypothetical overpass",
        ),
        (
            {"landscape": {"cover": "levels"}, "classes": {"a": {"distribution": "mine.csv"}, "b": {}}},
            "Synthetic landscape: patches and hills are synthetic; only the location is FIFE's.",
            "synthetic landscape, hypothetical overpass",
        ),
        (
            {"landscape": {"deviations": {"soil": 0.03, "brown": 0.0, "moisture": 0.1}}},
            "Synthetic landscape: leaf area, soil brightness, soil moisture and hills are synthetic; only the grass "
            "type and the location are FIFE's.",
            "synthetic landscape, hypothetical overpass",
        ),
        (
            PASTURES | {"terrain": {"dem": "dem.tif"}},
            "Partly synthetic landscape: fields are synthetic; elevation is from a file.",
            "partly synthetic landscape, hypothetical overpass",
        ),
        (
            {"landscape": {"cover": "map.tif"}, "terrain": {"dem": "dem.tif"}},
            "Partly synthetic landscape: leaf area is synthetic; land cover and elevation are from files.",
            "partly synthetic landscape, hypothetical overpass",
        ),
        (
            PLACE | {"ground": {"lai_file": "lai.tif"}, "terrain": {"dem": "flint-hills"}},
            "Partly synthetic landscape: hills are synthetic; leaf area is from a file.",
            "partly synthetic landscape, hypothetical overpass",
        ),
        (
            PLACE | {"ground": {"lai_file": "lai.tif"}, "landscape": {"deviations": {"brown": 0.1}}},
            "Partly synthetic landscape: dead leaves are synthetic; leaf area is from a file; the ground is level.",
            "partly synthetic landscape, hypothetical overpass",
        ),
        (PLACE | GIVEN, "Leaf area and elevation are from files.", "hypothetical overpass"),
    ],
)
def test_parts_are_told_apart_by_where_they_come_from(values, said, short):
    scenario = parse_scenario(values)
    assert statement(scenario) == f"{said} {OVERPASS}"
    assert summary(scenario) == short


@pytest.mark.parametrize("time", ["1987-06-06T16:35Z", "1987-06-06T11:35:00-05:00"])
def test_time_of_the_hypothetical_overpass_is_known_in_any_spelling(time):
    assert statement(parse_scenario(PASTURES | {"geometry": {"time": time}})) == DEFAULT


@pytest.mark.parametrize(
    ("geometry", "said"),
    [
        ({"time": "1987-08-15T16:40:30Z"}, "Time as given, 15 August 1987 16:40 UTC."),
        ({"time": "1987-08-15T23:40:00-05:00"}, "Time as given, 16 August 1987 04:40 UTC."),
        ({"sza": 30.0, "saa": 120.0}, "Sun angles as given."),
    ],
)
def test_a_time_of_ones_own_is_not_called_hypothetical(geometry, said):
    scenario = parse_scenario(GIVEN | {"geometry": geometry})
    assert statement(scenario) == f"Leaf area and elevation are from files. {said}"
    assert summary(scenario) == ""


def test_another_place_has_no_location_and_no_overpass_of_fife():
    """There even the same time may be that of a real image."""
    said = "Synthetic landscape: fields and hills are synthetic; only the three grass types are FIFE's."
    scenario = parse_scenario(PASTURES | ELSEWHERE)
    assert statement(scenario) == f"{said} Time as given, 1 June 2022 10:05 UTC."
    same = parse_scenario(PASTURES | ELSEWHERE | {"geometry": {"time": "1987-06-06T16:35Z"}})
    assert statement(same) == f"{said} Time as given, 6 June 1987 16:35 UTC." and "overpass" not in summary(same)


def test_a_grid_that_only_a_file_or_nobody_knows_is_nowhere():
    """A scenario that is not complete is written without its files being opened."""
    assert statement(parse_scenario(GIVEN)) == "Leaf area and elevation are from files."
    assert "location" not in statement(parse_scenario({"grid": {"crs": "EPSG:1"}}))


def test_scenario_file_states_it_in_its_first_line_and_is_read_back(tmp_path):
    scenario = default_scenario().complete()
    text = write_scenario(scenario)
    assert text.splitlines()[0] == f"# {DEFAULT}"
    (tmp_path / "scenario.toml").write_text(text, encoding="utf-8")
    again = read_scenario(tmp_path / "scenario.toml")
    assert again == scenario and write_scenario(again.complete()) == text
    other = write_scenario(Scenario(**GIVEN))
    assert other.splitlines()[0] == "# Leaf area and elevation are from files."


def test_readme_and_the_default_scenario_begin_with_it():
    assert files.path("fife.toml").read_text(encoding="utf-8").splitlines()[0] == f"# {DEFAULT}"
    _, first, *_ = (ROOT / "README.md").read_text(encoding="utf-8").split("\n\n")
    assert re.sub(r"\s+", " ", first).endswith(f"shows no real scene. *{DEFAULT}*")
