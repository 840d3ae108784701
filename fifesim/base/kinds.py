"""Kinds of arguments: numbers, names, rasters and descriptions, each with its words and its test."""

import os
import re
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np


class Kind(NamedTuple):
    """Set of values that an argument may have, by its words in messages and a test, which the type gives by default."""

    words: str
    fits: Callable | None = None
    # Smallest number of dimensions of a raster, which then must have cells.
    dimensions: int | None = None
    # Kinds of numpy's dtypes that rasters in the value may have; None for any.
    numbers: str | None = "iuf"


def is_a(value, *names):
    """
    Whether a value is of a class or of one derived from it, by name.

    Classes of other libraries need not be imported.

    Parameters
    ----------
    value : object
    *names : str

    Returns
    -------
    answer : bool

    Examples
    --------
    >>> is_a(1.5, "float", "int"), is_a("1.5", "float")
    (True, False)
    """
    return any(each.__name__ in names for each in type(value).__mro__)


def described(value):
    """
    A value in a few words, whatever its size.

    Parameters
    ----------
    value : object

    Returns
    -------
    text : str

    Examples
    --------
    >>> described([1, 2]), described("TM"), described(np.ones((2, 3)))
    ('a list of 2', "'TM'", 'a numpy array (2, 3)')
    """
    if is_a(value, "DataArray"):
        sizes = ", ".join(f"{name}: {size}" for name, size in value.sizes.items())
        return f"an xarray.DataArray ({sizes})"
    if is_a(value, "Dataset", "DataTree"):
        names = ", ".join(str(name) for name in list(value)[:4])
        return f"an xarray.{type(value).__name__} of {names or 'nothing'}"
    if isinstance(value, np.ndarray):
        masked = "masked " if is_a(value, "MaskedArray") else ""
        return f"a {masked}numpy array {value.shape}"
    if isinstance(value, list | tuple | dict | set):
        return f"a {type(value).__name__} of {len(value)}"
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:50]}... ({type(value).__name__})"


def _is_number(value):
    if isinstance(value, bool | np.bool_ | str | bytes) or is_a(value, "Dataset", "DataTree"):
        return False
    if np.ndim(value):
        return False
    return isinstance(value, int | float | np.number) or getattr(getattr(value, "dtype", None), "kind", "-") in "iuf"


def _are_numbers(value):
    if isinstance(value, list | tuple):
        return all(_are_numbers(each) for each in value)
    if is_a(value, "ndarray", "DataArray", "Array", "Index", "Series"):
        return value.dtype.kind in "iuf"
    return _is_number(value)


def _is_pair(value):
    several = isinstance(value, list | tuple | np.ndarray)
    return _is_number(value) or (several and np.shape(value) == (2,) and _are_numbers(value))


def _are_two(value):
    return isinstance(value, list | tuple | np.ndarray) and getattr(value, "ndim", 1) > 0 and len(value) == 2


def _is_plain(value):
    return value is not None and not is_a(value, "Dataset", "DataTree", "ndarray", "DataArray", "Array")


def _is_row(value):
    return _is_plain(value) or (isinstance(value, np.ndarray) and value.ndim == 1)


def _is_mapping(value):
    return _is_plain(value) and isinstance(value, Mapping)


def is_path(value):
    """
    Whether a value may be the path of a file.

    Parameters
    ----------
    value : object

    Returns
    -------
    answer : bool
    """
    return isinstance(value, str | os.PathLike)


def _is_size(value):
    return isinstance(value, str) and re.fullmatch(r"auto|[\d.]+ *[kMGT]?i?B", value) is not None


NUMBER = Kind("a number", _is_number)
NUMBERS = Kind("a number, or an array of them", _are_numbers)
PAIR = Kind("a number, or two: down and across", _is_pair)
LIST = Kind("a number, or a list of them", lambda value: _are_numbers(value) and np.ndim(value) < 2)
TWO = Kind("two numbers, such as (0.5, 2.0)", _are_two)
ROW = Kind("a name, a mapping, a description, or an array with one dimension", _is_row)
LISTED = Kind("a list", lambda value: _is_row(value) and np.iterable(value) and not isinstance(value, str))
FLAG = Kind("True or False", lambda value: isinstance(value, bool | np.bool_))
TEXT = Kind("a name", lambda value: isinstance(value, str))
NAMES = Kind("a list of names", lambda value: isinstance(value, str) or (_is_plain(value) and np.iterable(value)))
PATH = Kind("the path of a file", is_path)
MAPPING = Kind("a mapping of names", _is_mapping)
FUNCTION = Kind("a function", callable)
CHUNKS = Kind(
    "a number of cells, 'auto', '64MB', None or a mapping such as {'y': 1024, 'x': 1024}",
    lambda value: (
        value is None or _is_number(value) or isinstance(value, tuple) or _is_mapping(value) or _is_size(value)
    ),
)
RASTER = Kind("an xarray.DataArray over (y, x)", lambda value: is_a(value, "DataArray"), dimensions=2)
GRID = Kind(
    "an odc.geo.geobox.GeoBox, such as fifesim.grid_at or raster.odc.geobox give", lambda value: is_a(value, "GeoBox")
)
PLAIN = Kind("a name, a mapping or a description, and no raster", _is_plain)
ANYTHING = Kind("a number, a mapping, a description or a raster", lambda value: True, dimensions=0)
# The function checks the argument, and its message names the range.
UNCHECKED = Kind("a value", lambda value: True)
DATES = Kind("a date and time", lambda value: True, numbers=None)
