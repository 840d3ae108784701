"""A small explorer page: 12 x 12 pixels of 30 m, and few values per slider."""

from dataclasses import replace

import pytest

import fifesim
from fifesim.experiments.explorer import explorer_page
from fifesim.experiments.explorer_settings import outcomes_of, sweep_of
from fifesim.scenario.scenario import parse_scenario

SMALL = {
    "grid": {"west": 707970.0, "north": 4331220.0, "width": 400.0, "height": 360.0, "cell": 10 / 3},
    "terrain": {"dem": "flat"},
    "ground": {"arp": 0.15, "seed": 3},
    "atmosphere": {"visibility": 45.0},
}


def ndvi_with_data(scenario):
    """Truth and NDVI of a run, for pixels that also have data without displacement, as in a budget."""
    run = fifesim.simulate(scenario)
    still = scenario.sensor.model_copy(update={"offset": [0.0, 0.0]})
    aligned = fifesim.simulate(scenario.model_copy(update={"sensor": still}))
    return run["truth"], run["image"]["ndvi"].where(aligned["image"]["ndvi"].notnull().values)


@pytest.fixture(scope="session")
def with_data():
    return ndvi_with_data


@pytest.fixture(scope="session")
def small():
    return parse_scenario(SMALL)


@pytest.fixture(scope="session")
def sweep(small):
    """Two values of each slider except haze, for the instruments TM and HRV."""
    found = sweep_of(small)
    return replace(
        found, arps=found.arps[:2], hazes=found.hazes[2:], szas=found.szas[:2], instruments=("HRV", "TM"),
        offsets=(found.offsets[0], found.offsets[2]),
    )  # fmt: skip


@pytest.fixture(scope="session")
def outcomes(sweep):
    return outcomes_of(sweep)


@pytest.fixture(scope="session")
def page(sweep, outcomes, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "explore.html"
    path.write_text(explorer_page(sweep, outcomes), encoding="utf-8")
    return path
