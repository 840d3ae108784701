"""Sections: units, and which keys name files."""

import os
from pathlib import Path

import pytest
from pydantic import Field, ValidationError

from fifesim.scenario.keys import Section, file, number, seed, text


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


def test_another_unit_is_a_mistake_and_words_pass_where_they_may():
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
def test_a_key_says_whether_its_value_is_a_file(key, value, answer):
    assert Shelf.names_a_file(key, value) == answer


def test_files_get_their_whole_paths_and_names_stay():
    shelf = Shelf(picture="a.png", list_of="b.csv")
    assert shelf.files == {"picture": "a.png", "list_of": "b.csv"}
    whole = shelf.with_paths(os.path.abspath)
    assert whole.picture == str(Path("a.png").resolve()) and whole.list_of == str(Path("b.csv").resolve())
    assert (whole.map_of, whole.colour) == ("flat", "red")
    assert whole.with_paths(os.path.abspath) == whole


@pytest.mark.parametrize("value", [-1, 2**63, 1.0, "1", True])
def test_seed_is_a_whole_number_that_toml_holds(value):
    with pytest.raises(ValidationError, match="grain"):
        Shelf(grain=value)
    assert Shelf(grain=2**63 - 1).grain == 2**63 - 1


def test_unknown_keys_and_tables_that_are_none_are_refused():
    with pytest.raises(ValidationError, match="Extra inputs"):
        Shelf(width=1.0)
    with pytest.raises(ValidationError, match="expected a table of keys, got 3"):
        Shelf.model_validate(3)
