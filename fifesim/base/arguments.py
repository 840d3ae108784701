"""Checks of the arguments of public functions, derived from their annotations."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache, wraps
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from fifesim.base import kinds
from fifesim.base.kinds import Kind, described, is_a
from fifesim.base.spelling import unknown_argument

# Kinds of types. Classes of slow libraries are found by name; `Annotated` states any other kind.
_KINDS = {
    bool: kinds.FLAG,
    int: kinds.NUMBER,
    float: kinds.NUMBER,
    str: kinds.TEXT,
    tuple[float, float]: kinds.TWO,
    Sequence: kinds.LISTED,
    Mapping: kinds.MAPPING,
    Callable: kinds.FUNCTION,
    Any: kinds.UNCHECKED,
    "DataArray": kinds.RASTER,
    "Dataset": Kind("an xarray.Dataset", lambda value: is_a(value, "Dataset")),
    "DataTree": Kind("an xarray.DataTree", lambda value: is_a(value, "DataTree")),
    "GeoBox": kinds.GRID,
}

# Remedies for values that are not real numbers, by the kind of their dtype.
_NOT_REAL = {
    "b": "a mask, type .astype(float) if 0 and 1 are its values",
    "c": "complex numbers, type .real or abs(...)",
    "M": "dates, take the variable that holds the quantity",
    "m": "durations, take the variable that holds the quantity",
}


@cache
def kind_of(annotation):
    """
    Kind of the values that an annotation allows, apart from None.

    Parameters
    ----------
    annotation : type
        The last Kind in the metadata of an ``Annotated`` is its kind.

    Returns
    -------
    kind : Kind

    Raises
    ------
    TypeError
        If nothing states the kind of the annotation.

    Examples
    --------
    >>> kind_of(float | Mapping[str, float] | None).words
    'a number, or a mapping of names'
    """
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return _named(parts[0], [each for each in parts[1:] if isinstance(each, Kind)])
    if isinstance(annotation, TypeVar):
        origin, parts = Union, annotation.__constraints__
    if origin in (Union, UnionType):
        return _either([kind_of(each) for each in parts if each is not NoneType])
    if origin is Literal:
        return kind_of(type(parts[0]))
    for key in (annotation, origin, getattr(annotation, "__name__", None)):
        if key is not None and key in _KINDS:
            return _KINDS[key]
    if not isinstance(annotation, type):
        raise TypeError(f"nothing states the kind of {annotation}: type Annotated[..., Kind(...)]")
    library = annotation.__module__.partition(".")[0]
    words = getattr(annotation, "_in_words", f"a {library}.{annotation.__name__}")
    return Kind(words, lambda value: isinstance(value, annotation))


def _named(type_, stated):
    """The last of the kinds stated for a type, with the test of an earlier one or of the type where it has none."""
    *others, kind = stated or [kind_of(type_)]
    return kind if kind.fits else kind._replace(fits=_named(type_, others).fits)


def _either(parts):
    """The union of kinds."""
    if len(parts) == 1:
        return parts[0]
    *others, last = [kind.words for kind in parts]
    numbers = None if any(kind.numbers is None for kind in parts) else "".join(kind.numbers for kind in parts)
    return Kind(f"{', '.join(others)}, or {last}", lambda value: any(kind.fits(value) for kind in parts), None, numbers)


@cache
def _kinds_of(annotated):
    """Kinds of the arguments of a function, or of the fields of a dataclass, by name."""
    hints = get_type_hints(annotated, include_extras=True)
    names = [each.name for each in fields(annotated)] if is_dataclass(annotated) else [*hints]
    return {name: kind_of(hints[name]) for name in names if name != "return"}


def check(name, value, kind):
    """
    Refuse a value of another kind.

    Parameters
    ----------
    name : str
    value : object
    kind : Kind

    Raises
    ------
    TypeError
        If the value is of another kind.
    ValueError
        If it is a raster without cells, or without rows and columns.

    Examples
    --------
    >>> check("hotspot", 0.1, kinds.NUMBER)
    """
    if not kind.fits(value):
        raise TypeError(f"{name} must be {kind.words}, got {described(value)}{_cure(value, kind)}")
    if kind.dimensions is None or not is_a(value, "DataArray"):
        return
    if value.ndim < kind.dimensions:
        dims = ", ".join(map(str, value.dims))
        raise ValueError(f"{name} must have dimensions y and x, got ({dims}): select with .isel(x=[0]), not .isel(x=0)")
    if not value.size:
        sizes = ", ".join(f"{dim}: {size}" for dim, size in value.sizes.items())
        raise ValueError(f"{name} has no cells, its sizes are {sizes}: does the window that was cut out overlap it?")


def checked(function):
    """
    A public function that checks its arguments against its annotations.

    Parameters
    ----------
    function : callable

    Returns
    -------
    function : callable
        It has the same name, documentation and signature. An argument may always have its default value. The function
        raises TypeError for an argument of another kind, or for a raster whose cells are not real numbers.
    """
    signature = inspect.signature(function)

    @wraps(function)
    def checking(*args, **options):
        try:
            given = signature.bind(*args, **options).arguments
        except TypeError as error:
            wrong = unknown_argument(function.__name__, signature, options)
            raise TypeError(wrong or f"{function.__name__}: {error}") from None
        expected = _kinds_of(function)
        for name, value in given.items():
            if value is not signature.parameters[name].default:
                check(name, value, expected[name])
        for name, value in given.items():
            _check_numbers(name, value, expected[name].numbers)
        return function(*args, **options)

    return checking


def check_fields(description, *names):
    """
    Check fields of a description against their annotations.

    Parameters
    ----------
    description : object
        An instance of a dataclass.
    *names : str
        The fields to check; all by default. A field may always have its default value.

    Raises
    ------
    TypeError
        If a value is of another kind.
    """
    expected = _kinds_of(type(description))
    for name in names or expected:
        value = getattr(description, name)
        if value is not type(description).__dataclass_fields__[name].default:
            check(name, value, expected[name])


def _check_numbers(name, value, allowed):
    """Raise TypeError if the cells or wavelengths of the rasters in an argument have another dtype than allowed."""
    for raster in _rasters(value) if allowed else ():
        wavelength = (raster.coords["wavelength"],) if "wavelength" in raster.coords else ()
        for what, each in ((name, raster), *((f"wavelength of {name}", each) for each in wavelength)):
            if each.dtype.kind not in allowed:
                cure = _NOT_REAL.get(each.dtype.kind, "text or objects, type .astype(float) if they stand for numbers")
                raise TypeError(f"{what} must hold real numbers, got {each.dtype}: it holds {cure}")


def _rasters(value):
    """Rasters in an argument: itself, or those in a Dataset, a mapping, a pair or a description."""
    if value is None or isinstance(value, str | int | float):
        return []
    if is_a(value, "DataArray"):
        return [value]
    if is_a(value, "Dataset"):
        return [each for each in value.data_vars.values() if each.ndim >= 2]
    if isinstance(value, Mapping):
        parts = value.values()
    elif isinstance(value, list | tuple) and len(value) == 2:
        parts = value
    else:
        # Classes of pydantic have checked their fields.
        plain = is_dataclass(type(value)) and not hasattr(value, "__pydantic_validator__")
        parts = [getattr(value, each.name) for each in fields(value)] if plain else ()
    return [raster for part in parts for raster in _rasters(part)]


def _cure(value, kind):
    """Remedy for a value of another kind; empty if none is known."""
    takes_raster = "xarray.DataArray" in kind.words
    if takes_raster and is_a(value, "MaskedArray"):
        return ": xarray.DataArray(values.filled(numpy.nan), dims=('y', 'x'), coords=...) with a CRS has a place"
    if takes_raster and isinstance(value, np.ndarray):
        return ": xarray.DataArray(values, dims=('y', 'x'), coords=...).rio.write_crs('EPSG:26914') gives it a place"
    if takes_raster and is_a(value, "Dataset") and len(value):
        return f": take one of its variables, such as dataset[{next(iter(value))!r}]"
    if takes_raster and is_a(value, "DataTree"):
        return ": take one of its arrays, such as tree['10m/dn']"
    if takes_raster and isinstance(value, str):
        return ": open it with fifesim.open_image, rioxarray.open_rasterio, or onto a grid with fine_dem or open_lai"
    if kind is kinds.NUMBER and is_a(value, "DataArray", "ndarray"):
        return ", where one is for all cells"
    if kind is kinds.GRID and is_a(value, "DataArray"):
        return ": type raster.odc.geobox"
    return ""
