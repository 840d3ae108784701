"""Public names, found when they are first used, and the ``.fifesim`` accessor, whose methods are some of them."""

import re
from dataclasses import is_dataclass
from functools import cache
from importlib import import_module
from inspect import isfunction
from pathlib import Path
from textwrap import fill
from typing import NamedTuple

import xarray as xr

from fifesim.base.arguments import checked
from fifesim.base.methods import Method
from fifesim.base.spelling import nearest, spelled

# One line of the table: where a name lives, and whether it is a method of a DataArray, of a Dataset too, or of a
# DataTree instead.
_LINE = re.compile(r"from \.([\w.]+) import (\w+) as \2(?:  # method(, of a Dataset too| of a DataTree)?)?")
_KINDS = {None: ("DataArray",), ", of a Dataset too": ("DataArray", "Dataset"), " of a DataTree": ("DataTree",)}


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
            module, name, which = match.groups()
            methods_of = _KINDS[which] if "  # method" in line else ()
            found[name] = Public(f"fifesim.{module}", methods_of, group)
    return found


PUBLIC = _table()


@cache
def find(name):
    """
    A public name; a function checks its arguments first, a description their names.

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
        # What pydantic makes has messages of its own.
        plain = is_dataclass(found) and not hasattr(found, "__pydantic_validator__")
        return spelled(found) if plain else found
    function = checked(found)
    # Pickle looks a function up where it says that it lives.
    function.__module__, function.__qualname__ = "fifesim", name
    return function


# Classes below find the functions that draw them here.
Method.find = staticmethod(find)


class _RasterMethod(Method):
    """Method of the accessor, which hands the function its raster."""

    def __get__(self, accessor, owner=None):
        return super().__get__(None if accessor is None else accessor._raster)


class _Accessor:
    def __init__(self, raster):
        self._raster = raster

    def __repr__(self):
        return _summary(type(self).kind)

    def __getattr__(self, name):
        raise AttributeError(_unknown(type(self).kind, name), obj=self)


def _summary(kind):
    """The methods of a kind of object by their group, a line for each."""
    groups = {}
    for name, public in PUBLIC.items():
        if kind in public.methods_of:
            groups.setdefault(public.group, []).append(name)
    indent = max(map(len, groups)) + 4
    lines = [
        fill(f"  {group:{indent - 2}}{', '.join(names)}", 100, subsequent_indent=" " * indent)
        for group, names in groups.items()
    ]
    return "\n".join([f"fifesim on a {kind}, its methods:", *lines])


def _unknown(kind, name):
    """What is wrong with the name of a method."""
    if name in PUBLIC:
        kinds = " or ".join(f"an xarray.{each}" for each in PUBLIC[name].methods_of)
        what = f"a method of {kinds}" if kinds else "no method of a raster"
        return f"{name} is {what}, this is an xarray.{kind}; fifesim.{name} is the function"
    known = [each for each, public in PUBLIC.items() if kind in public.methods_of]
    return f"fifesim has no method {name!r} of an xarray.{kind}: {nearest(name, known)}print(raster.fifesim) lists them"


def _accessor(kind):
    methods = {name: _RasterMethod(name) for name, public in PUBLIC.items() if kind in public.methods_of}
    told = {"__doc__": f"fifesim on a {kind}.", "kind": kind, "__module__": __name__}
    return type(f"{kind}Accessor", (_Accessor,), told | methods)


DataArrayAccessor, DatasetAccessor, DataTreeAccessor = map(_accessor, ("DataArray", "Dataset", "DataTree"))

xr.register_dataarray_accessor("fifesim")(DataArrayAccessor)
xr.register_dataset_accessor("fifesim")(DatasetAccessor)
xr.register_datatree_accessor("fifesim")(DataTreeAccessor)
