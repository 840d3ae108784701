"""Type annotations of public names agree with docstrings and with correct user code."""

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
from fifesim.accessor import PUBLIC, find

ROOT = Path(__file__).parents[1]


def methods(of, found):
    """Public methods and properties of a class that the package defines."""
    for each, member in vars(found).items():
        # Function of a property, a cached property or a class method.
        made_of = (getattr(member, name, None) for name in ("fget", "func", "__func__"))
        function = inspect.unwrap(next(filter(None, made_of), member))
        if not each.startswith("_") and inspect.isfunction(function) and function.__module__ == found.__module__:
            yield f"{of}.{each}", function


FUNCTIONS = {}
CLASSES = {}
for public in PUBLIC:
    if inspect.isclass(find(public)):
        CLASSES[public] = find(public)
        FUNCTIONS |= dict(methods(public, CLASSES[public]))
    else:
        FUNCTIONS[public] = inspect.unwrap(find(public))


def test_functions_and_fields_are_annotated():
    """Annotations of parameters, results and fields can be resolved in their modules."""
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
    """Parameters of a docstring and their stated types."""
    text = inspect.getdoc(function) or ""
    section = re.search(r"^Parameters\n-+\n(.*?)(?=\n\n\S+( \S+)?\n---|\Z)", text, re.DOTALL | re.MULTILINE)
    for line in section[1].splitlines() if section else ():
        if match := re.fullmatch(r"(\w[\w, ]*) : (.+)", line):
            for name in match[1].split(", "):
                yield name, match[2]


# Types by their names in docstrings.
MEANT = {"bool": bool, "int": int, "float": float, "str": str, "odc.geo.geobox.GeoBox": "GeoBox"}


def agrees(hint, words):
    """Whether an annotation agrees with the type stated in a docstring."""
    given = [each for each in get_args(hint) or [hint] if each is not type(None)]
    meant = MEANT.get(words.removesuffix(", optional"))
    if meant is str and all(isinstance(each, str) for each in given):
        return True
    if meant is not None:
        return [each if meant is each else each.__name__ for each in given] == [meant]
    if words.startswith("{"):
        literal = hint if get_origin(hint) is Literal else given[0]
        return set(get_args(literal)) == set(re.findall(r'"([^"]+)"', words.partition("}")[0]))
    kinds = getattr(given[0], "__constraints__", given)
    return not words.startswith("xarray.DataArray") or "DataArray" in {each.__name__ for each in kinds}


def test_annotations_agree_with_docstrings():
    breaches = [
        f"{name}({parameter}): {words}"
        for name, function in FUNCTIONS.items()
        for parameter, words in documented(function)
        if not agrees(get_type_hints(function)[parameter], words)
    ]
    assert breaches == []


def test_correctly_typed_code_runs(tmp_path):
    """Code that the type checker accepts runs without errors."""
    lai = typed_use.scene()
    rho = typed_use.ground(lai)
    image = typed_use.image(typed_use.air(rho))
    assert typed_use.patches(lai)["lai"].shape == (10, 12)
    assert typed_use.analysis(lai, rho, image) > 0
    assert typed_use.files(image, tmp_path).equals(image)
    assert typed_use.runs().sizes["visibility"] == 2
    plt.close("all")


@pytest.mark.slow
def test_mypy_accepts_correct_code_and_rejects_wrong_code(tmp_path):
    """Settings are in pyproject.toml; mypy reports every unneeded ``type: ignore``."""
    pytest.importorskip("mypy")
    found = run([sys.executable, "-m", "mypy", "--cache-dir", tmp_path], cwd=ROOT, capture_output=True, text=True)
    assert found.returncode == 0, found.stdout


def test_package_has_py_typed():
    assert Path(fifesim.__file__).with_name("py.typed").exists()
