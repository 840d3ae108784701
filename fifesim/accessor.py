"""Public names, found when they are first used, and the ``.fifesim`` accessor, whose methods are some of them."""

import re
from functools import cache
from importlib import import_module
from inspect import isfunction
from pathlib import Path
from types import MethodType
from typing import NamedTuple

import xarray as xr

from fifesim.base.arguments import checked

# One line of the table: where a name lives, and whether it is a method of a DataArray, or of a Dataset too.
_LINE = re.compile(r"from \.([\w.]+) import (\w+) as \2(  # method(, of a Dataset too)?)?")


class Public(NamedTuple):
    """A public name: the module it lives in, the kinds of raster it is a method of, and its group in the API page."""

    module: str
    methods_of: tuple[str, ...]
    group: str


def _table():
    """What ``__init__.pyi`` says, by name."""
    found, group = {}, ""
    for line in Path(__file__).with_name("__init__.pyi").read_text(encoding="utf-8").splitlines():
        if line.startswith("# "):
            group = line[2:]
        elif match := _LINE.fullmatch(line):
            module, name, of_array, of_dataset = match.groups()
            methods_of = ("DataArray",) * bool(of_array) + ("Dataset",) * bool(of_dataset)
            found[name] = Public(f"fifesim.{module}", methods_of, group)
    return found


PUBLIC = _table()


@cache
def find(name):
    """
    A public name; a function looks at its arguments first.

    Parameters
    ----------
    name : str
        A key of `PUBLIC`.

    Returns
    -------
    found : object
    """
    found = getattr(import_module(PUBLIC[name].module), name)
    if not isfunction(found):
        return found
    function = checked(found, PUBLIC[name].methods_of)
    # Pickle looks a function up where it says that it lives.
    function.__module__, function.__qualname__ = "fifesim", name
    return function


class _Method:
    """
    Forward to a function, found when it is first asked for: importing fifesim stays quick.

    A bound method keeps the function's name, signature and documentation.
    """

    def __init__(self, name):
        self._name = name

    def __get__(self, accessor, owner=None):
        return find(self._name) if accessor is None else MethodType(find(self._name), accessor._raster)


class _Accessor:
    def __init__(self, raster):
        self._raster = raster


def _methods(kind):
    return {name: _Method(name) for name, public in PUBLIC.items() if kind in public.methods_of}


DataArrayAccessor = type(
    "DataArrayAccessor", (_Accessor,), {"__doc__": "fifesim on a DataArray."} | _methods("DataArray")
)
DatasetAccessor = type("DatasetAccessor", (_Accessor,), {"__doc__": "fifesim on a Dataset."} | _methods("Dataset"))

xr.register_dataarray_accessor("fifesim")(DataArrayAccessor)
xr.register_dataset_accessor("fifesim")(DatasetAccessor)
