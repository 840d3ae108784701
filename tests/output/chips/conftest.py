"""Chips of 6 x 6 pixels."""

import pytest

from fifesim.scenario.chips import chips_of
from fifesim.scenario.scenario import parse_scenario
from fifesim.scenario.studies import Study

SMALL = {"grid": {"width": 180.0, "height": 180.0}, "terrain": {"dem": "flat"}}


@pytest.fixture(scope="session")
def small():
    """Function that returns a scenario with other sections."""
    return lambda **sections: parse_scenario(SMALL | sections | {"ground": {"arp": 0.15} | sections.get("ground", {})})


@pytest.fixture(scope="session")
def chips_on(small):
    """Function that returns chips with drawn visibility and other drawn parameters."""

    def make(count, landscapes=3, draws=None, **sections):
        draws = {"visibility": {"uniform": [10, 60]}} | (draws or {})
        return chips_of(Study(small(**sections), draws, landscapes=landscapes), count)

    return make
