"""What a page says of a scenario."""

import pytest

from fifesim.output.report import title
from fifesim.scenario.scenario import parse_scenario


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"ground": {"arp": 0.15}}, "arp 0.15, seen by TM"),
        ({"sensor": {"instrument": "OLI", "bands": ["OLI4", "OLI5"]}}, "seen by OLI"),
    ],
)
def test_title_names_ground_and_instrument(values, said):
    assert title(parse_scenario(values)).endswith(said)


def test_title_has_the_names_of_files_and_not_their_folders():
    scenario = parse_scenario({})
    ground = scenario.ground.model_copy(update={"lai_file": "/somewhere/leaves.tif"})
    sensor = scenario.sensor.model_copy(update={"instrument": "/elsewhere/camera.toml"})
    scenario = scenario.model_copy(update={"ground": ground, "sensor": sensor})
    assert title(scenario) == "leaves.tif, seen by camera.toml"
