"""
Public names, imported when they are first used, and the ``.fifesim`` accessor, which offers many of them as methods.

``lazy_loader.attach_stub`` reads modules from the same stub, but neither methods nor groups, and it puts a function
into the package before the checks of its arguments are around it.
"""

import re
from dataclasses import is_dataclass
from functools import cache
from importlib import import_module
from inspect import isfunction
from pathlib import Path
from textwrap import fill
from typing import NamedTuple

import xarray as xr

from fifesim.base.arguments import Method, checked
from fifesim.base.messages import nearest, spelled

# One line of the table: where a name lives, and whether it is a method of a DataArray, of a Dataset or a DataTree too,
# or of a DataTree instead.
_LINE = re.compile(
    r"from (\.+)([\w.]+) import (\w+) as \3(?:  # method(, of a (?:Dataset|DataTree) too| of a DataTree)?)?"
)
_KINDS = {
    None: ("DataArray",),
    ", of a Dataset too": ("DataArray", "Dataset"),
    ", of a DataTree too": ("DataArray", "DataTree"),
    " of a DataTree": ("DataTree",),
}


NAMESPACES = (
    *("ground", "terrain", "atmosphere", "sensor", "scaling"),
    *("retrieval", "models", "output", "scenario", "experiments"),
)
"""Submodules with public names."""


class Public(NamedTuple):
    """Public name: its module, the kinds of raster with it as a method, its group on the API page, and its path."""

    module: str
    methods_of: tuple[str, ...]
    group: str
    namespace: str
    path: str


def _table():
    """Public names of ``__init__.pyi`` and of the stubs of the submodules, by name."""
    found, package = {}, Path(__file__).parent
    for namespace in ("", *NAMESPACES):
        folder = package / namespace
        stub = folder / "__init__.pyi" if folder.is_dir() else folder.with_suffix(".pyi")
        inside, group = ("fifesim", namespace)[: 2 if namespace and folder.is_dir() else 1], ""
        for line in stub.read_text(encoding="utf-8").splitlines():
            if line.startswith("# "):
                group = line[2:]
            elif match := _LINE.fullmatch(line):
                dots, module, name, which = match.groups()
                methods_of = _KINDS[which] if "  # method" in line else ()
                module = ".".join([*inside[: len(inside) + 1 - len(dots)], module])
                found[name] = Public(
                    module, methods_of, group, namespace, ".".join(filter(None, ("fifesim", namespace, name)))
                )
    return found


PUBLIC = _table()

# Removed public names and their replacements.
REMOVED = {
    "correlated_fields": "fifesim.landscape draws independent fields, and learned landscapes follow the terrain",
    "invert": "the line is fit.predict(ndvi.values); fifesim.train and retrieve map LAI with intervals and flags",
    "inversion_error": "use fifesim.score(estimate, truth)",
    "plot_reproduction": "fifesim.reproduce returns the data of Figures 3 to 9, and docs/paper_figures.py draws them",
}


@cache
def find(name):
    """Import a public name, and wrap it so that its arguments, or the names of its fields, are checked and opened."""
    found = getattr(import_module(PUBLIC[name].module), name)
    if not isfunction(found):
        # Classes made by pydantic have their own messages.
        plain = is_dataclass(found) and not hasattr(found, "__pydantic_validator__")
        return spelled(found) if plain else found
    # Importing it is slow.
    function = checked(found, import_module("fifesim.grids.inputs").opened)
    # Pickle looks a function up where it says that it lives.
    function.__module__, function.__qualname__ = PUBLIC[name].path.rpartition(".")[0], name
    return function


def namespace_of(namespace):
    """Functions ``__getattr__`` and ``__dir__`` of a submodule with public names."""
    names = sorted(name for name, public in PUBLIC.items() if public.namespace == namespace)

    def get(name):
        if name not in names:
            raise AttributeError(
                f"module 'fifesim.{namespace}' has no attribute {name!r}: {REMOVED.get(name) or nearest(name, names)}"
            )
        return find(name)

    return get, lambda: names


# Classes below find the functions that draw them here.
Method.find = staticmethod(find)


class _Accessor:
    def __init__(self, raster):
        self._raster = raster

    def __repr__(self):
        """List the methods, one line for each group."""
        groups = {}
        for name in self.methods:
            groups.setdefault(PUBLIC[name].group, []).append(name)
        indent = max(map(len, groups)) + 4
        lines = [f"fifesim on a {self.kind}, its methods:"]
        for group, names in groups.items():
            lines.append(fill(f"  {group:{indent - 2}}{', '.join(names)}", 100, subsequent_indent=" " * indent))
        return "\n".join(lines)

    def __getattr__(self, name):
        if name in REMOVED:
            message = f"{name} was removed: {REMOVED[name]}"
        elif name in PUBLIC:
            kinds = " or ".join(f"an xarray.{kind}" for kind in PUBLIC[name].methods_of)
            what = f"a method of {kinds}" if kinds else "no method of a raster"
            function = f"{PUBLIC[name].path} is the function"
            if kinds and self.kind == "DataTree":
                function = f"call it at each node, such as tree[path].dataset[name].fifesim.{name}(...)"
            elif "DataArray" in PUBLIC[name].methods_of:
                function = f"call it on a variable, such as dataset[name].fifesim.{name}(...)"
            message = f"{name} is {what}, this is an xarray.{self.kind}; {function}"
        else:
            suggestion = f"{nearest(name, self.methods)}print(raster.fifesim) lists them"
            message = f"fifesim has no method {name!r} of an xarray.{self.kind}: {suggestion}"
        raise AttributeError(message, obj=self)


def _accessor(kind):
    methods = {name: Method(name, "_raster") for name, public in PUBLIC.items() if kind in public.methods_of}
    others = {"__doc__": f"fifesim on a {kind}.", "__module__": __name__, "kind": kind, "methods": tuple(methods)}
    return type(f"{kind}Accessor", (_Accessor,), others | methods)


DataArrayAccessor, DatasetAccessor, DataTreeAccessor = map(_accessor, ("DataArray", "Dataset", "DataTree"))

xr.register_dataarray_accessor("fifesim")(DataArrayAccessor)
xr.register_dataset_accessor("fifesim")(DatasetAccessor)
xr.register_datatree_accessor("fifesim")(DataTreeAccessor)
