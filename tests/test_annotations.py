"""Every public name is annotated, and a type checker reads it as a user means it."""

import inspect
import re
import sys
from dataclasses import fields, is_dataclass
from pathlib import Path
from subprocess import run
from typing import Any, Literal, get_args, get_origin, get_type_hints

import matplotlib.pyplot as plt
import pytest
import typed_use

import fifesim
from fifesim.accessor import PUBLIC

ROOT = Path(__file__).parents[1]


def methods(of, found):
    """Public methods and properties of a class that is written in the package."""
    for each, member in vars(found).items():
        # Of a property, a cached one or a class method.
        made_of = (getattr(member, name, None) for name in ("fget", "func", "__func__"))
        function = inspect.unwrap(next(filter(None, made_of), member))
        if not each.startswith("_") and inspect.isfunction(function) and function.__module__ == found.__module__:
            yield f"{of}.{each}", function


FUNCTIONS = {"atmosphere.spectrum": fifesim.atmosphere.spectrum}
CLASSES = {}
for public in PUBLIC:
    if inspect.isclass(getattr(fifesim, public)):
        CLASSES[public] = getattr(fifesim, public)
        FUNCTIONS |= dict(methods(public, CLASSES[public]))
    else:
        FUNCTIONS[public] = inspect.unwrap(getattr(fifesim, public))


@pytest.mark.parametrize("name", FUNCTIONS)
def test_function_is_annotated(name):
    """All of its parameters and what it gives, by names that its module has."""
    function = FUNCTIONS[name]
    hints = get_type_hints(function)
    lacking = [each for each in inspect.signature(function).parameters if each not in (*hints, "self", "cls")]
    assert not lacking and "return" in hints
    assert object not in hints.values()


@pytest.mark.parametrize("name", CLASSES)
def test_fields_of_a_class_are_annotated(name):
    hints = get_type_hints(CLASSES[name])
    assert object not in hints.values() and Any not in hints.values()
    if is_dataclass(CLASSES[name]):
        assert {field.name for field in fields(CLASSES[name])} <= set(hints)


def documented(function):
    """Parameters of a docstring with the words that say their type."""
    text = inspect.getdoc(function) or ""
    section = re.search(r"^Parameters\n-+\n(.*?)(?=\n\n\S+( \S+)?\n---|\Z)", text, re.DOTALL | re.MULTILINE)
    for line in section[1].splitlines() if section else ():
        if match := re.fullmatch(r"(\w[\w, ]*) : (.+)", line):
            for name in match[1].split(", "):
                yield name, match[2]


# Words of docstrings that mean one type.
MEANT = {"bool": bool, "int": int, "float": float, "str": str, "odc.geo.geobox.GeoBox": "GeoBox"}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_annotation_is_what_the_docstring_says(name):
    hints = get_type_hints(FUNCTIONS[name])
    for parameter, words in documented(FUNCTIONS[name]):
        given = [each for each in get_args(hints[parameter]) or [hints[parameter]] if each is not type(None)]
        meant = MEANT.get(words.removesuffix(", optional"))
        if meant is not None:
            assert [each if meant is each else each.__name__ for each in given] == [meant], parameter
        if words.startswith("{"):
            literal = hints[parameter] if get_origin(hints[parameter]) is Literal else given[0]
            assert set(get_args(literal)) == set(re.findall(r'"([^"]+)"', words.partition("}")[0])), parameter
        if words.startswith("xarray.DataArray"):
            kinds = getattr(given[0], "__constraints__", given)
            assert "DataArray" in {each.__name__ for each in kinds}, parameter


def test_what_is_right_runs(tmp_path):
    """The lines that a type checker passes are right."""
    lai = typed_use.scene()
    rho = typed_use.ground(lai)
    image = typed_use.image(typed_use.air(rho))
    assert typed_use.patches(lai)["lai"].shape == (10, 12)
    assert typed_use.analysis(lai, rho, image) > 0
    assert typed_use.files(image, tmp_path).equals(image)
    assert typed_use.runs().sizes["visibility"] == 2
    plt.close("all")


@pytest.mark.slow
def test_type_checker_passes_what_is_right_and_refuses_what_is_wrong(tmp_path):
    """By the settings of pyproject.toml; every ``type: ignore`` of the user's code must be needed."""
    pytest.importorskip("mypy")
    found = run([sys.executable, "-m", "mypy", "--cache-dir", tmp_path], cwd=ROOT, capture_output=True, text=True)
    assert found.returncode == 0, found.stdout


def test_package_says_that_it_is_typed():
    assert Path(fifesim.__file__).with_name("py.typed").exists()
