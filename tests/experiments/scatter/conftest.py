"""Small scenarios for budgets: 14 x 12 pixels of 30 m."""

import pytest

from fifesim.scenario.scenario import parse_scenario

GRID = {"west": 707970.0, "north": 4331220.0, "width": 420.0, "height": 360.0}


def scenario_of(sensor=None, dem="flat", **ground):
    terrain = {"dem": dem} | ({} if dem == "flat" else {"horizon_reach": 300})
    return parse_scenario(
        {"grid": GRID, "sensor": sensor or {"response": "paper"}, "terrain": terrain, "ground": ground}
    )


@pytest.fixture(scope="session")
def scenario():
    """A function that makes a scenario from sensor, elevation and ground."""
    return scenario_of


@pytest.fixture(scope="session")
def rough(scenario):
    """A scenario in which every stage has an effect."""
    sensor = {"instrument": "L4TM", "interval": "native", "offset": [0.1, 0.0], "noise": ["thermal"]}
    return scenario(sensor, dem="flint-hills")
