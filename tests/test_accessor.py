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
    for name, function in METHODS.items():
        method = getattr(lai.fifesim, name)
        assert method.__func__ is function and method.__self__ is lai, name


def test_every_line_of_the_stub_is_read():
    """A line of another form would define a name for editors but not for the package."""
    package = Path(fifesim.__file__).parent
    stubs = [*package.glob("*.pyi"), *package.glob("*/__init__.pyi")]
    assert sum(len(re.findall(r"\nfrom \.+\w", stub.read_text(encoding="utf-8"))) for stub in stubs) == len(PUBLIC)
    listed = {f"fifesim.{space}.{name}" for space in NAMESPACES for name in dir(getattr(fifesim, space))}
    own = {f"fifesim.{name}" for name in {*fifesim.__all__} - {*NAMESPACES, "__version__"}}
    assert listed | own == {public.path for public in PUBLIC.values()}


def test_the_package_itself_has_at_most_60_names():
    assert len(fifesim.__all__) - len(NAMESPACES) <= 60


def test_moved_names_still_work_with_a_warning():
    for name, public in PUBLIC.items():
        if public.namespace:
            with pytest.warns(FutureWarning, match=re.escape(f"fifesim.{name} is now {public.path}:")):
                assert getattr(fifesim, name) is find(name)
    with pytest.raises(AttributeError, match=r"module 'fifesim\.terrain' has no attribute 'slop'"):
        _ = fifesim.terrain.slop


def test_only_functions_of_rasters_are_methods():
    """A function is a method if its first parameter is documented as a raster."""
    for name, found in PUBLIC.items():
        function = find(name)
        if not inspect.isfunction(function):
            assert not found.methods_of
            continue
        first = re.search(r"Parameters\n-+\n\w+(?:, \w+)* : (.*)", inspect.cleandoc(function.__doc__))
        kind = re.match(r"xarray\.(\w+)", first[1]) if first is not None else None
        assert (kind is not None) == bool(found.methods_of), name
        assert kind is None or kind[1] in found.methods_of, name


def test_stub_names_the_defining_module():
    """The stub gives the module that defines the name or is meant for its import."""
    for name, found in PUBLIC.items():
        defined = getattr(inspect.unwrap(find(name)), "__module__", found.module)
        assert defined == found.module or not defined.startswith("fifesim"), name


def test_method_keeps_documentation_and_signature(lai):
    assert lai.fifesim.sense.__doc__ is fifesim.sense.__doc__
    parameters = list(inspect.signature(fifesim.sense).parameters)
    assert list(inspect.signature(lai.fifesim.sense).parameters) == parameters[1:]


def test_accessors_of_classes_datasets_and_trees_have_their_functions(lai):
    assert accessor.DataArrayAccessor.fpar is fifesim.fpar
    assert lai.to_dataset(name="lai").fifesim.to_geotiff.__func__ is fifesim.to_geotiff
    tree = xr.DataTree.from_dict({"/TM": lai.to_dataset(name="lai")})
    assert tree.fifesim.comparison_table.__func__ is fifesim.sensor.comparison_table
    assert tree.fifesim.comparison_table.__self__ is tree


def test_any_array_has_the_accessor_and_copies_keep_it():
    plain = xr.DataArray(np.zeros(3))
    assert plain.fifesim.fpar.__self__ is plain
    assert pickle.loads(pickle.dumps(plain)).fifesim.fpar.__func__ is fifesim.fpar
    copy = plain.copy()
    assert copy.fifesim.fpar.__self__ is copy


def test_arguments_are_passed_on(lai):
    xr.testing.assert_identical(lai.fifesim.aggregate(30.0, min_valid=0.5), fifesim.aggregate(lai, 30.0, min_valid=0.5))


def test_repr_lists_methods_by_group(lai):
    said = repr(lai.fifesim)
    assert all(name in said.replace(",", " ").split() for name in METHODS)
    assert "compare" in said and "comparison_table" not in said
    assert max(map(len, said.splitlines())) <= 100
    assert "to_geotiff" in repr(lai.to_dataset(name="lai").fifesim)


def test_removed_name_states_its_replacement(lai):
    for name, replacement in accessor.REMOVED.items():
        for holder in (fifesim, lai.fifesim, lai.to_dataset(name="lai").fifesim):
            with pytest.raises(AttributeError, match=rf"{name} was removed: {re.escape(replacement)}"):
                getattr(holder, name)
        assert name not in PUBLIC
