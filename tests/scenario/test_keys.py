"""Keys: what is spelled, and what is left to physics."""

import subprocess
import sys

import pytest
from pydantic import ValidationError

from fifesim.atmosphere.air import models
from fifesim.scenario.keys import AirKeys, Keys, SensorKeys, TerrainKeys
from fifesim.scenario.scenario import Scenario


def test_engines_are_those_of_the_atmosphere():
    """Written out beside the keys, which load no physics."""
    described = AirKeys.model_fields["engine"].description
    assert described == f"one of {', '.join(models.ENGINES)}"


def test_spelling_needs_no_physics():
    """A typo is told before the scientific stack is loaded."""
    heavy = "scipy", "numba", "rasterio", "odc", "pvlib", "matplotlib", "distributed"
    code = f"import sys, fifesim.scenario.toml; print([name for name in {heavy!r} if name in sys.modules])"
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert printed.strip() == "[]"


def test_sections_of_a_scenario_are_the_keys_in_their_order():
    assert list(Scenario.model_fields) == list(Keys.model_fields)
    for name, field in Keys.model_fields.items():
        section = Scenario.model_fields[name].annotation
        assert issubclass(section, field.annotation) and list(section.model_fields) == list(
            field.annotation.model_fields
        )


@pytest.mark.parametrize(
    ("section", "values", "said"),
    [
        (TerrainKeys, {"dem": "flt"}, "did you mean 'flat'"),
        (TerrainKeys, {"fill": 30.0}, "fill is for an elevation file"),
        (SensorKeys, {"interval": 0.0}, "metres above 0"),
        (SensorKeys, {"offset": [float("inf"), 0.0]}, "two finite numbers"),
        (AirKeys, {"aot": 2.5}, "less than or equal to 2"),
    ],
)
def test_impossible_values_are_refused(section, values, said):
    with pytest.raises(ValidationError, match=said):
        section(**values)


def test_optical_thickness_stands_in_the_place_of_visibility():
    assert AirKeys(aot=0.1).visibility is None
    assert AirKeys().visibility == 45.0
