"""Keys of a scenario by name."""

import numpy as np
import pytest

from fifesim.scenario.scenario import Scenario, find_key, in_text, parse_scenario, put, values_of


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
        ("sensor.sed", r"not a key of a scenario: did you mean 'sensor\.seed'"),
        ("senser.seed", r"not a key of a scenario: did you mean 'sensor\.seed'"),
        ("classes.grass.brwn", r"not a key of a scenario: did you mean 'classes\.grass\.brown'"),
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
    second = first.replace(**{"ground.leaf.chlorophyll": np.float64(50.0)})
    assert (first.ground.leaf, second.ground.leaf) == ({"chlorophyll": 30.0}, {"chlorophyll": 50.0})
    assert second.ground.arp == 0.1


def test_replaced_keys_are_those_of_a_new_scenario():
    """Keys of several sections, of a class and of a table, and two that must be given together."""
    values = {
        "ground": {"arp": 0.1, "seed": 5},
        "landscape": {"cover": "voronoi"},
        "classes": {"grass": {"brown": 0.1}},
    }
    changes = {"visibility": "20 km", "sensor.seed": 3, "classes.grass.brown": 0.4, "sza": 30, "saa": np.float64(140)}
    expected = values | {
        "atmosphere": {"visibility": 20}, "sensor": {"seed": 3}, "classes": {"grass": {"brown": 0.4}},
        "geometry": {"sza": 30, "saa": 140},
    }  # fmt: skip
    first = Scenario(**values)
    assert first.replace(**changes) == Scenario(**expected)
    assert first == Scenario(**values) and first.replace() == first


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"sensor.sed": 3}, r"replace: 'sensor\.sed' is not a key of a scenario: did you mean 'sensor\.seed'"),
        ({"visibilty": 3}, "replace: 'visibilty' is not a key of a scenario: did you mean 'visibility'"),
        ({"seed": 3}, r"replace: 'seed' exists in several sections: use .*sensor\.seed"),
        ({"sensor.seed": -1}, r"sensor\.seed = -1: must be at least 0"),
        ({"sza": 30}, "sza and saa go together"),
        ({"leaf.chlorofyll": 30}, "unknown key 'chlorofyll': did you mean 'chlorophyll'"),
        (
            {"classes.gras.brown": 0.3},
            r"classes\.gras\.brown is of a class .*did you mean 'grass'\? its classes are grass",
        ),
        ({"arp": 0.1, "ground.arp": 0.2}, r"replace: arp and ground\.arp are one key"),
        ({"bands": ["OLI4"]}, "OLI4"),
    ],
)
def test_impossible_replacements_are_refused(changes, message):
    scenario = Scenario(landscape={"cover": "voronoi"}, classes={"grass": {"brown": 0.1}})
    with pytest.raises(ValueError, match=message):
        scenario.replace(**changes)


def test_values_are_what_is_said_and_no_default():
    assert values_of(Scenario()) == {}
    values = {}
    put(values, ("sensor", "offset"), np.array([0.5, 0.0]))
    assert values == {"sensor": {"offset": [0.5, 0.0]}}


def test_lists_stand_in_a_table_as_text():
    assert [in_text(value) for value in (["shot"], [], True, "TM")] == ["shot", "none", True, "TM"]
