"""Studies: parameters that may be drawn, and settings shared by the chips."""

import re
from pathlib import Path

import pytest
from mistakes import check_message, mistakes

from fifesim.scenario.scenario import parse_scenario
from fifesim.scenario.studies import Study, read_study

GRID = {"width": 180.0, "height": 180.0}
SMALL = {"grid": GRID, "terrain": {"dem": "flat"}}
DRAWS = {"visibility": {"uniform": [10, 60]}}

WHOLE = """
[grid]
width = 180
height = "0.18 km"

[terrain]
dem = "flat"

[dataset]
sequence = "random"
seed = 3
landscapes = 4
split = { train = 0.75, test = 0.25 }

[draw]
visibility = { log-uniform = ["5 km", 60] }
"ground.arp" = { uniform = [0.05, 0.2] }

[draw.ground]
leaf.chlorophyll = { normal = [40, 10], within = [10, 80] }
distribution = { choice = ["burned-grazed", "mine.csv"] }
"""


@pytest.fixture
def path(tmp_path):
    (tmp_path / "mine.csv").write_text("lai\n" + "\n".join(str(0.1 * k) for k in range(1, 9)))
    (tmp_path / "study.toml").write_text(WHOLE)
    return tmp_path / "study.toml"


def test_study_file_lists_the_drawn_parameters(path):
    study = read_study(path)
    assert (study.sequence, study.seed, study.landscapes) == ("random", 3, 4)
    assert study.split == {"train": 0.75, "test": 0.25}
    assert {key.name: one.table for key, one in study.drawn.items()} == {
        "atmosphere.visibility": {"log-uniform": [5.0, 60.0]},
        "ground.arp": {"uniform": [0.05, 0.2]},
        "ground.leaf.chlorophyll": {"normal": [40.0, 10.0], "within": [10.0, 80.0]},
        "ground.distribution": {"choice": ["burned-grazed", str(path.parent / "mine.csv")]},
    }
    # The study that is written and read again is the same.
    again = path.parent / "elsewhere" / "again.toml"
    again.parent.mkdir()
    again.write_text(study.to_toml())
    assert read_study(again) == study and read_study(again).to_toml() == study.to_toml()
    path.write_text(WHOLE.replace("sequence =", "sequnce ="))
    with pytest.raises(ValueError, match=r"unknown key dataset\.sequnce: did you mean 'sequence'"):
        read_study(path)


def test_chips_share_sun_and_atmosphere_of_the_study():
    """The paper's overpass belongs to its site, but chips lie elsewhere."""
    study = Study(parse_scenario(SMALL), DRAWS)
    far = study.scenario_with({("grid", "west"): 600_000.0, ("grid", "north"): 4_200_000.0})
    assert far.sun_and_view() == study.scenario.sun_and_view()
    assert far.model_atmosphere() == study.scenario.model_atmosphere()
    # The angles are stored, so no chip computes the sun position again.
    assert study.values["geometry"]["sza"] == study.scenario.sun_and_view().sza
    dates = Study(parse_scenario(SMALL), {"time": {"choice": ["1987-06-06T16:35Z", "1987-10-06T16:35Z"]}})
    drawn = {("geometry", "time"): "1987-10-06T16:35Z"}
    here = dates.scenario_with(drawn)
    far = dates.scenario_with(drawn | {("grid", "west"): 600_000.0})
    assert here.sun_and_view() == far.sun_and_view() != study.scenario.sun_and_view()
    band = Study(parse_scenario(SMALL), {"ground.background.TM3": {"uniform": [0.05, 0.2]}})
    found = band.scenario_with({("ground", "background", "TM3"): 0.07}).ground.background
    assert found["TM3"] == 0.07 and found["TM4"] == band.scenario.complete().ground.background["TM4"]


@pytest.mark.parametrize(
    ("landscapes", "split", "quotas"),
    [
        (50, {"train": 0.8, "validation": 0.1, "test": 0.1}, [40, 5, 5]),
        (3, {"train": 0.8, "validation": 0.1, "test": 0.1}, [1, 1, 1]),
        (11, {"train": 0.8, "validation": 0.1, "test": 0.1}, [9, 1, 1]),
        (7, {"a": 0.5, "b": 0.5}, [4, 3]),
        (1, {"all": 1.0}, [1]),
    ],
)
def test_every_part_has_its_share_and_at_least_one_landscape(landscapes, split, quotas):
    study = Study(parse_scenario(SMALL), DRAWS, landscapes=landscapes, split=split)
    assert list(study.quotas().values()) == quotas


def test_study_in_the_documentation_is_valid(tmp_path):
    page = Path(__file__).parents[2] / "docs" / "howto" / "training_set.md"
    (block,) = re.findall(r"^```toml\n(.*?)^```", page.read_text("utf-8"), re.S | re.M)
    (tmp_path / "study.toml").write_text(block)
    study = read_study(tmp_path / "study.toml")
    assert len(study.drawn) == 7 and study.landscapes == 50


@pytest.mark.parametrize(("stage", "values", "said"), mistakes("study"), ids=str)
def test_invalid_studies_are_rejected(stage, values, said):
    with pytest.raises(ValueError) as caught:
        scenario = parse_scenario(SMALL | values.get("sections", {}))
        Study(scenario, values.get("draws", DRAWS), **values.get("plan", {}))
    check_message(str(caught.value), said)
