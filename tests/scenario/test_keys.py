"""Keys of a scenario: spelling, units and files."""

from datetime import date, datetime, timedelta, timezone

import pytest
from pydantic import Field, ValidationError

from fifesim.scenario.keys import (
    VARYING,
    ClassKeys,
    Keys,
    LandscapeKeys,
    Section,
    StandKeys,
    SunAndViewKeys,
    file,
    number,
    seed,
    text,
)
from fifesim.scenario.scenario import Scenario


def test_scenario_sections_match_the_key_tables_in_order():
    assert list(Scenario.model_fields) == list(Keys.model_fields)
    for place in [*((name,) for name in Keys.model_fields if name != "classes"), ("classes", "grass")]:
        meant, spelled = Scenario.section(place), Keys.section(place)
        assert issubclass(meant, spelled) and list(meant.model_fields) == list(spelled.model_fields)
    assert Keys.section(("classes",)) is Keys.section(("ground", "leaf")) is Keys.section(("grund",)) is None


def test_time_is_utc_unless_it_names_an_offset_and_must_be_complete():
    """An incomplete time would give another sun tomorrow."""
    for time in ("1987-06-06 16:35", datetime(1987, 6, 6, 11, 35, tzinfo=timezone(timedelta(hours=-5)))):
        assert Scenario(geometry={"time": time}).sun_and_view() == Scenario().sun_and_view()
    for time in ("now", "1987-06-06", 1987, date(1987, 6, 6), "06/07/1987 16:35", "9999-12-31T23:59"):
        with pytest.raises(ValidationError, match=r"must be a date and time|is a date alone|of the years 1957 to 2100"):
            SunAndViewKeys(time=time)


class Shelf(Section):
    """Keys of every kind."""

    length: float = number(2.0, "m", "of it")
    step: float | str = Field(1.0, description="or a word", json_schema_extra={"unit": "m"})
    colour: str = text("red", "of it")
    grain: int = seed(3, "of its noise")
    picture: str | None = file(None, "always a file")
    list_of: str = file("oak", "a name, or a .csv", suffix=".csv")
    map_of: str = file("flat", "flat, or a file of any suffix", names=("flat", "v1.2"), suffix="*")


@pytest.mark.parametrize(("written", "value"), [("3 m", 3.0), ("3", 3.0), (" 3e0m ", 3.0), (3, 3.0)])
def test_number_may_carry_its_unit(written, value):
    assert Shelf(length=written).length == value


def test_wrong_units_are_rejected_and_words_accepted_where_allowed():
    with pytest.raises(ValidationError, match="length is in m; write a number, or a number and 'km' or 'm' or 'cm'"):
        Shelf(length="3 ft")
    assert (Shelf(length="3 km").length, Shelf(length="3 cm").length) == (3000.0, 0.03)
    assert Shelf(step="native").step == "native"
    with pytest.raises(ValidationError, match="step is in m"):
        Shelf(step="3 ft")


@pytest.mark.parametrize(
    ("key", "value", "answer"),
    [
        ("picture", "anything", True),
        ("picture", None, False),
        ("list_of", "oak", False),
        ("list_of", "mine.CSV", True),
        ("list_of", "mine.tif", False),
        ("map_of", "flat", False),
        ("map_of", "hills", False),
        ("map_of", "hills.tif", True),
        ("map_of", "v1.2", False),
        ("colour", "red.csv", False),
        ("unknown", "a.csv", False),
    ],
)
def test_key_tells_whether_its_value_is_a_file(key, value, answer):
    assert Shelf.names_a_file(key, value) == answer


@pytest.mark.parametrize("value", [-1, 2**63, 1.0, "1", True])
def test_seed_is_an_integer_that_toml_can_hold(value):
    with pytest.raises(ValidationError, match="grain"):
        Shelf(grain=value)
    assert Shelf(grain=2**63 - 1).grain == 2**63 - 1


def test_numbers_come_with_their_unit_and_limits_are_allowed():
    assert LandscapeKeys(size="1.2 km").size == 1200.0
    LandscapeKeys(deviations=dict.fromkeys(VARYING, 1))
    StandKeys(hotspot=1e-6, brown=1, dissociation=1, crown_cover=0, crown_shape=10, soil=-1, moisture=1)
    ClassKeys(share=1)


@pytest.mark.parametrize(
    ("values", "is_one"),
    [
        ({"learned": "konza"}, False),
        ({"cover": "none", "size": 50.0}, True),
        ({"deviations": {"soil": 0.0, "brown": 0}}, True),
        ({"cover": "pastures"}, False),
        ({"cover": "cover.tif"}, False),
        ({"deviations": {"soil": 0.0, "brown": 0.1}}, False),
    ],
)
def test_landscape_is_one_stand_if_only_leaf_area_varies(values, is_one):
    assert Scenario(landscape={"learned": "none"} | values).is_one() is is_one
    is_file = values.get("cover", "none").endswith(".tif")
    assert LandscapeKeys(**values).files == ({"cover": "cover.tif"} if is_file else {})
