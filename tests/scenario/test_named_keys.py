"""Keys of a scenario by name."""

import numpy as np
import pytest

from fifesim.scenario.scenario import Scenario, changed, find_key, in_text, parse_scenario, put, values_of


@pytest.mark.parametrize(
    ("name", "whole"),
    [
        ("visibility", "atmosphere.visibility"),
        ("ground.seed", "ground.seed"),
        ("classes.grass.brown", "classes.grass.brown"),
        ("ground.leaf.chlorophyll", "ground.leaf.chlorophyll"),
        ("leaf.chlorophyll", "ground.leaf.chlorophyll"),
        ("classes.grass.leaf.chlorophyll", "classes.grass.leaf.chlorophyll"),
        ("deviations.soil", "landscape.deviations.soil"),
    ],
)
def test_a_key_is_found_by_its_name(name, whole):
    assert find_key(name).name == whole


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("visibilty", "the axis 'visibilty' is not a key of a scenario: did you mean 'visibility'"),
        ("seed", r"in several sections: use ground\.seed or terrain\.seed"),
        ("ground.arp.tall", "not a key of a scenario"),
        ("ground.leaf.", "not a key of a scenario"),
        ("ground", "not a key of a scenario"),
        ("classes", "not a key of a scenario"),
        ("classes.grass", "not a key of a scenario"),
    ],
)
def test_what_is_no_key_is_refused(name, message):
    with pytest.raises(ValueError, match=message):
        find_key(name)


def test_attributes_say_what_a_plot_writes_beside_it():
    assert find_key("visibility").attributes == {"long_name": "meteorological range", "units": "km"}
    assert find_key("leaf.chlorophyll").attributes == {"long_name": "leaf: chlorophyll"}


def test_a_changed_scenario_leaves_the_first_alone():
    first = parse_scenario({"ground": {"arp": 0.1, "leaf": {"chlorophyll": 30.0}}})
    second = changed(find_key("ground.leaf.chlorophyll"), first, np.float64(50.0))
    assert (first.ground.leaf, second.ground.leaf) == ({"chlorophyll": 30.0}, {"chlorophyll": 50.0})
    assert second.ground.arp == 0.1


def test_values_are_what_is_said_and_no_default():
    assert values_of(Scenario()) == {}
    values = {}
    put(values, ("sensor", "offset"), np.array([0.5, 0.0]))
    assert values == {"sensor": {"offset": [0.5, 0.0]}}


def test_lists_stand_in_a_table_as_text():
    assert [in_text(value) for value in (["shot"], [], True, "TM")] == ["shot", "none", True, "TM"]
