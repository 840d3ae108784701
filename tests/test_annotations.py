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


def test_functions_and_fields_are_annotated():
    """Parameters, results and fields, by names that their module has."""
    breaches = []
    for name, function in FUNCTIONS.items():
        hints = get_type_hints(function)
        lacking = {*inspect.signature(function).parameters, "return"} - {*hints, "self", "cls"}
        breaches += [f"{name}: {lacking}"] if lacking or object in hints.values() else []
    for name, found in CLASSES.items():
        hints = get_type_hints(found)
        lacking = {field.name for field in fields(found)} - set(hints) if is_dataclass(found) else set()
        breaches += [f"{name}: {lacking}"] if lacking or {object, Any} & set(hints.values()) else []
    assert breaches == []


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


def agrees(hint, words):
    """Whether an annotation is the type that the words of a docstring say."""
    given = [each for each in get_args(hint) or [hint] if each is not type(None)]
    meant = MEANT.get(words.removesuffix(", optional"))
    if meant is not None:
        return [each if meant is each else each.__name__ for each in given] == [meant]
    if words.startswith("{"):
        literal = hint if get_origin(hint) is Literal else given[0]
        return set(get_args(literal)) == set(re.findall(r'"([^"]+)"', words.partition("}")[0]))
    kinds = getattr(given[0], "__constraints__", given)
    return not words.startswith("xarray.DataArray") or "DataArray" in {each.__name__ for each in kinds}


def test_annotations_are_what_docstrings_say():
    breaches = [
        f"{name}({parameter}): {words}"
        for name, function in FUNCTIONS.items()
        for parameter, words in documented(function)
        if not agrees(get_type_hints(function)[parameter], words)
    ]
    assert breaches == []


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
