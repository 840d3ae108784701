"""Small scenarios for budgets: 14 x 12 pixels of 30 m."""

import pytest

import fifesim
from fifesim.scenario.scenario import parse_scenario

GRID = {"west": 707970.0, "north": 4331220.0, "width": 420.0, "height": 360.0}


def scenario_of(sensor=None, dem="flat", **ground):
    terrain = {"dem": dem} | ({} if dem == "flat" else {"horizon_reach": 300})
    sections = {"grid": GRID, "sensor": sensor or {"response": "paper"}, "terrain": terrain}
    return parse_scenario(sections | {"ground": {"arp": 0.15} | ground})


@pytest.fixture(scope="session")
def scenario():
    """A function that makes a scenario from sensor, elevation and ground."""
    return scenario_of


@pytest.fixture(scope="session")
def rough(scenario):
    """A scenario in which every stage has an effect."""
    sensor = {"instrument": "L4TM", "interval": "native", "offset": [0.1, 0.0], "noise": ["thermal"]}
    return scenario(sensor, dem="flint-hills")


@pytest.fixture(scope="session")
def retrieval():
    """Line of LAI on reflectance, trained with ten chips."""
    chip = fifesim.Scenario(grid={"width": 300, "height": 300}, ground={"arp": 0.15}, terrain={"dem": "flat"})
    study = fifesim.Study(chip, {"visibility": {"uniform": [20, 60]}}, landscapes=10)
    with pytest.warns(UserWarning, match=r"few landscapes \(train 8, validation 1, test 1\)"):
        return fifesim.train(study, "line", chips=10)
