import pytest

from fifesim.scenario.ensemble import realise
from fifesim.scenario.scenario import Scenario
from fifesim.scenario.simulation import simulate

SMALL = {"width": 300.0, "height": 300.0}


def test_a_realisation_has_the_bits_of_the_same_scene_simulated_alone():
    scenario = Scenario(grid=SMALL)
    alone, found = simulate(scenario), realise(scenario)
    assert list(found) == ["image", "truth"]
    for name, node in found.items():
        assert node.identical(alone[name].to_dataset().compute())


def test_a_node_that_a_run_lacks_is_named():
    with pytest.raises(ValueError, match="keep names terrain, and this run has scene, truth, image"):
        realise(Scenario(grid=SMALL, terrain={"dem": "flat"}), keep=["terrain"])
