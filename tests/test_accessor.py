"""The accessor only forwards to functions."""

import inspect
import pickle
import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import fifesim
from fifesim import accessor
from fifesim.accessor import NAMESPACES, PUBLIC, find

METHODS = {name: find(name) for name, found in PUBLIC.items() if "DataArray" in found.methods_of}


def test_methods_are_the_public_functions(lai):
    """Also of any array, of copies, and of classes, datasets and trees."""
    plain = xr.DataArray(np.zeros(3))
    for holder in (lai, plain, plain.copy(), pickle.loads(pickle.dumps(plain))):
        for name, function in METHODS.items():
            method = getattr(holder.fifesim, name)
            assert method.__func__ is function and method.__self__ is holder, name
    assert accessor.DataArrayAccessor.fpar is fifesim.fpar
    assert lai.to_dataset(name="lai").fifesim.to_geotiff.__func__ is fifesim.to_geotiff
    tree = xr.DataTree.from_dict({"/TM": lai.to_dataset(name="lai")})
    method = tree.fifesim.comparison_table
    assert method.__func__ is fifesim.sensor.comparison_table and method.__self__ is tree
    parameters = list(inspect.signature(fifesim.sense).parameters)
    assert list(inspect.signature(lai.fifesim.sense).parameters) == parameters[1:]
    xr.testing.assert_identical(lai.fifesim.aggregate(30.0, min_valid=0.5), fifesim.aggregate(lai, 30.0, min_valid=0.5))


def test_every_line_of_the_stub_is_read():
    """A line of another form would define a name for editors but not for the package, which has at most 60 names."""
    package = Path(fifesim.__file__).parent
    stubs = [*package.glob("*.pyi"), *package.glob("*/__init__.pyi")]
    assert sum(len(re.findall(r"\nfrom \.+\w", stub.read_text(encoding="utf-8"))) for stub in stubs) == len(PUBLIC)
    listed = {f"fifesim.{space}.{name}" for space in NAMESPACES for name in dir(getattr(fifesim, space))}
    own = {f"fifesim.{name}" for name in {*fifesim.__all__} - {*NAMESPACES, "__version__"}}
    assert listed | own == {public.path for public in PUBLIC.values()} and len(own) <= 60


def test_moved_and_removed_names_state_their_replacement(lai):
    """Moved names still work with a warning."""
    for name, public in PUBLIC.items():
        if public.namespace:
            with pytest.warns(FutureWarning, match=re.escape(f"fifesim.{name} is now {public.path}:")):
                assert getattr(fifesim, name) is find(name)
    with pytest.raises(AttributeError, match=r"module 'fifesim\.terrain' has no attribute 'slop'"):
        _ = fifesim.terrain.slop
    for name, replacement in accessor.REMOVED.items():
        for holder in (fifesim, lai.fifesim, lai.to_dataset(name="lai").fifesim):
            with pytest.raises(AttributeError, match=rf"{name} was removed: {re.escape(replacement)}"):
                getattr(holder, name)
        assert name not in PUBLIC


def test_functions_are_methods_of_rasters_and_their_stub_names_their_module():
    """
    A function is a method if its first parameter is documented as a raster.

    The stub gives the module that defines the name or is meant for its import.
    """
    for name, found in PUBLIC.items():
        function = find(name)
        defined = getattr(inspect.unwrap(function), "__module__", found.module)
        assert defined == found.module or not defined.startswith("fifesim"), name
        kind = None
        if inspect.isfunction(function):
            first = re.search(r"Parameters\n-+\n\w+(?:, \w+)* : (.*)", inspect.cleandoc(function.__doc__))
            kind = re.match(r"xarray\.(\w+)", first[1]) if first is not None else None
        assert (kind is not None) == bool(found.methods_of), name
        assert kind is None or kind[1] in found.methods_of, name
