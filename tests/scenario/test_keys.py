"""Keys: what is spelled, and what is left to physics."""

import math
import subprocess
import sys
from datetime import date, datetime, timedelta, timezone

import pytest
from pydantic import ValidationError

from fifesim.atmosphere import ENGINES, engines
from fifesim.scenario.keys import (
    AirKeys,
    ClassKeys,
    GridKeys,
    GroundKeys,
    Keys,
    LandscapeKeys,
    SensorKeys,
    StandKeys,
    SunAndViewKeys,
    TerrainKeys,
)
from fifesim.scenario.scenario import Scenario


def test_engines_are_those_of_the_atmosphere():
    """The keys name the engines that the atmosphere has."""
    described = AirKeys.model_fields["engine"].description
    assert described == f"radiative transfer model: {', '.join([*engines.SCATTERING, '6S'])}"
    assert (*engines.SCATTERING, "6S") == ENGINES


def test_spelling_needs_no_physics():
    """A typo is told before the scientific stack is loaded."""
    heavy = "scipy", "numba", "rasterio", "odc", "pvlib", "matplotlib", "distributed"
    code = f"import sys, fifesim.scenario.toml; print([name for name in {heavy!r} if name in sys.modules])"
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert printed.strip() == "[]"


def test_sections_of_a_scenario_are_the_keys_in_their_order():
    assert list(Scenario.model_fields) == list(Keys.model_fields)
    for place in [*((name,) for name in Keys.model_fields if name != "classes"), ("classes", "grass")]:
        meant, spelled = Scenario.section(place), Keys.section(place)
        assert issubclass(meant, spelled) and list(meant.model_fields) == list(spelled.model_fields)
    assert Keys.section(("classes",)) is Keys.section(("ground", "leaf")) is Keys.section(("grund",)) is None


def test_a_class_has_the_keys_of_a_stand():
    assert set(StandKeys.model_fields) == set(ClassKeys.model_fields) & set(GroundKeys.model_fields)


@pytest.mark.parametrize(
    ("section", "values", "said"),
    [
        (TerrainKeys, {"dem": "flt"}, "did you mean 'flat'"),
        (TerrainKeys, {"fill": 30.0}, "fill needs an elevation file"),
        (SensorKeys, {"interval": 0.0}, "a positive distance between pixels in metres"),
        (SensorKeys, {"offset": [float("inf"), 0.0]}, "two finite numbers"),
        (AirKeys, {"aot": 2.5}, "less than or equal to 2"),
        (LandscapeKeys, {"cover": "pasture"}, "did you mean 'pastures'"),
        (LandscapeKeys, {"deviations": {"soils": 0.1}}, "did you mean 'soil'"),
        (LandscapeKeys, {"deviations": {"soil": -0.1}}, r"must be in \[0, 1\]"),
        (LandscapeKeys, {"covary": {"elevation": 1.1}}, r"elevation = 1.1: must be in \[-1, 1\]"),
        (LandscapeKeys, {"covary": {"soil": 0.1}}, "give deviations.soil too"),
        (Keys, {"classes": {"tall grass": {}}}, "one word"),
    ],
)
def test_impossible_values_are_refused(section, values, said):
    with pytest.raises(ValidationError, match=said):
        section(**values)


def test_optical_thickness_stands_in_the_place_of_visibility():
    assert AirKeys(aot=0.1).visibility is None
    assert AirKeys().visibility == 45.0


@pytest.mark.parametrize(
    "time",
    [
        *("now", "today", "12:00", "-1987-06-06", "-1987-06-06T12:00", "1987-06-06", "1987-06", "06/07/1987 16:35"),
        *("June 6 1987 16:35", "1987-W23-6T12:00", "1987-02-30T12:00", "1987-06-06T24:00", "NaT", "", " ", 1987),
        *("1987-06-06T16:35 US/Central", "0001-01-01T12:00", "9999-12-31T23:59", date(1987, 6, 6)),
    ],
)
def test_what_is_no_date_and_time_is_refused(time):
    """It would be another sun tomorrow, or another date to another reader."""
    with pytest.raises(ValidationError, match=r"must be a date and time|is a date alone"):
        SunAndViewKeys(time=time)


@pytest.mark.parametrize(
    "time",
    [
        *("1987-06-06T16:35:00Z", "1987-06-06 16:35", "1987-06-06T16:35:00.0", "1987-06-06 11:35-05:00"),
        datetime(1987, 6, 6, 16, 35),
        datetime(1987, 6, 6, 11, 35, tzinfo=timezone(timedelta(hours=-5))),
    ],
)
def test_time_is_utc_unless_it_names_an_offset(time):
    sun = Scenario(geometry={"time": time}).sun_and_view()
    assert sun == Scenario().sun_and_view()


@pytest.mark.parametrize(
    ("section", "values"),
    [
        (SunAndViewKeys, {"vaa": 1e20}),
        (GridKeys, {"cell": 1e-9}),
        (GridKeys, {"cell": True}),
        (GroundKeys, {"hotspot": 1e300}),
        (GroundKeys, {"background": {"TM3": math.nan}}),
        (GroundKeys, {"background": {"TM3": True}}),
        (GroundKeys, {"background": {"TM\x1b3": 0.1}}),
        (GroundKeys, {"background": {"TM3" * 100: 0.1}}),
    ],
)
def test_nonsense_is_refused(section, values):
    with pytest.raises(ValidationError):
        section(**values)
