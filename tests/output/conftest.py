"""A small run folder that includes the cells of the scene, for other programs to open."""

import pytest

from fifesim.output import report
from fifesim.output.run_folder import simulate_to_folder
from fifesim.scenario.scenario import parse_scenario

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
