"""A small run folder that includes the cells of the scene, and chips of 6 x 6 pixels."""

import pytest

from fifesim.output import report
from fifesim.output.run_folder import simulate_to_folder
from fifesim.scenario.chips import chips_of
from fifesim.scenario.scenario import parse_scenario
from fifesim.scenario.studies import Study

TRAVELLED = {
    "grid": {"width": 900, "height": 600},
    "ground": {"arp": 0.24, "seed": 3},
    "terrain": {"dem": "flat"},
    "sensor": {"bands": ["TM2", "TM3", "TM4"], "response": "paper"},
    "geometry": {"vza": 20.0, "vaa": 100.0},
}


@pytest.fixture(scope="session")
def run_without_pictures():
    """Function that writes a run folder with empty pictures and returns its files."""

    def run(*given, **options):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(report, "png", lambda figure, dpi: b"")
            return simulate_to_folder(*given, **options)

    return run


@pytest.fixture(scope="session")
def small_run(tmp_path_factory, run_without_pictures):
    """Folder of the run, written without pictures."""
    folder = tmp_path_factory.mktemp("travelled") / "out"
    run_without_pictures(parse_scenario(TRAVELLED), folder, scene=True, threads=1)
    return folder


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
