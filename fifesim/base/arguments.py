"""Types and kinds of arguments, and checks of the arguments of public functions by their annotations."""

import inspect
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from datetime import datetime
from functools import cache, wraps
from itertools import chain
from operator import attrgetter
from os import PathLike
from types import MethodType, NoneType, UnionType
from typing import (
    Annotated,
    Any,
    Literal,
    NamedTuple,
    Protocol,
    TypeAlias,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np

from fifesim.base.messages import closest, unknown_argument, warn


class Range(NamedTuple):
    """
    Unit of a number, its allowed and its usual values, and factors from other units to its unit.

    In ``Annotated[float, Range(...), "meaning"]``, it declares an argument, a field or a key of a scenario.
    """

    unit: str
    lowest: float
    highest: float
    usual: tuple[float, float] = (-np.inf, np.inf)
    others: Mapping[str, float] = {}
    note: str = ""  # another meaning that the number may have
    ends: str = "[]"  # "(" and ")" exclude an end

    @property
    def of(self):
        """Unit as the end of a phrase, such as " km"; empty if there is none."""
        return {"1": "", "degree": " degrees"}.get(self.unit, f" {self.unit}")

    def __hash__(self):
        return hash(self[:4])  # a mapping has no hash

    def __str__(self):
        if self.highest == np.inf:
            return f"{'above' if self.ends[0] == '(' else 'at least'} {self.lowest:g}{self.of}"
        return f"in {self.ends[0]}{self.lowest:g}, {self.highest:g}{self.ends[1]}{self.of}"


class Kind(NamedTuple):
    """Set of values that an argument may have: its words in messages, and its test."""

    words: str
    fits: Callable | None = None
    # Smallest number of dimensions of a raster, which then must have cells.
    dimensions: int | None = None
    # Kinds of numpy's dtypes that rasters in the value may have; None for any.
    numbers: str | None = "iuf"
    # The only values, if they can be listed.
    allowed: tuple = ()
    # Whether rasters are taken as they are stored, without their scale.
    stored: bool = False
    # Range of numbers.
    known: Range | None = None


_class_name = attrgetter("__name__")


def is_a(value, *names):
    """Whether a class name occurs among the classes of a value, so that other libraries need not be imported."""
    return not set(names).isdisjoint(map(_class_name, type(value).__mro__))


def described(value):
    """Short description of a value, whatever its size."""
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


def _is_whole(value):
    return _is_number(value) and (isinstance(value, int) or np.asarray(value).dtype.kind in "iu")


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
    """Whether a value may be the path of a file."""
    return isinstance(value, str | os.PathLike)


def _are_chunks(value):
    sizes = value.values() if _is_mapping(value) else value if isinstance(value, tuple) else [value]
    if any(_is_number(each) and (each == 0 or each < -1) for each in sizes):
        raise ValueError(f"chunks have 1 cell or more, or -1 for all, got {value!r}: type for instance chunks='auto'")
    if isinstance(value, str):
        return re.fullmatch(r"auto|[\d.]+ *[kMGT]?i?B", value) is not None
    return value is None or _is_number(value) or isinstance(value, tuple) or _is_mapping(value)


NUMBER = Kind("a number", _is_number)
WHOLE_NUMBER = Kind("a whole number", _is_whole)
NUMBERS = Kind("a number, or an array of them", _are_numbers)
PAIR = Kind("a number, or two: down and across", _is_pair)
LIST = Kind("a number, or a list of them", lambda value: _are_numbers(value) and np.ndim(value) < 2)
TWO = Kind("two numbers, such as (0.5, 2.0)", _are_two)
ROW = Kind("a name, a mapping, a description, or an array with one dimension", _is_row)
FLAG = Kind("True or False", lambda value: isinstance(value, bool | np.bool_))
TEXT = Kind("a name", lambda value: isinstance(value, str))
NAMES = Kind("a list of names", lambda value: isinstance(value, str) or (_is_plain(value) and np.iterable(value)))
PATH = Kind("the path of a file", is_path)
MAPPING = Kind("a mapping of names", _is_mapping)
CHUNKS = Kind("a number of cells, 'auto', '64MB', None or a mapping such as {'y': 1024, 'x': 1024}", _are_chunks)
RASTER = Kind("an xarray.DataArray over (y, x)", lambda value: is_a(value, "DataArray"), dimensions=2)
GRID = Kind(
    "an odc.geo.geobox.GeoBox, such as fifesim.grid_at or raster.odc.geobox give", lambda value: is_a(value, "GeoBox")
)
PLAIN = Kind("a name, a mapping or a description, and no raster", _is_plain)
ANYTHING = Kind("a number, a mapping, a description or a raster", lambda value: True, dimensions=0)
# The function checks the argument, and its message names the range.
UNCHECKED = Kind("a value", lambda value: True)
DATES = Kind("a date and time", lambda value: True, numbers=None)


class Method:
    """Method that calls the public function of a name with the instance, or an attribute of it, as first argument."""

    # Finds a public function by its name: the front door of the package puts it here.
    find = None

    def __init__(self, name, attribute=None):
        self._name, self._attribute = name, attribute

    def __get__(self, instance, owner=None):
        function = Method.find(self._name)
        if instance is None:
            return function
        return MethodType(function, getattr(instance, self._attribute) if self._attribute else instance)


# Kinds of types. Classes of slow libraries are found by name; `Annotated` states any other kind.
_KINDS = {
    bool: FLAG,
    int: WHOLE_NUMBER,
    float: NUMBER,
    str: TEXT,
    tuple[float, float]: TWO,
    Sequence: Kind("a list", lambda value: _is_row(value) and np.iterable(value) and not isinstance(value, str)),
    Mapping: MAPPING,
    Callable: Kind("a function", callable),
    Any: UNCHECKED,
    "DataArray": RASTER,
    "Dataset": Kind("an xarray.Dataset", lambda value: is_a(value, "Dataset")),
    "DataTree": Kind("an xarray.DataTree", lambda value: is_a(value, "DataTree")),
    "GeoBox": GRID,
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
    """Kind of the values that an annotation allows, apart from None."""
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        kind = _named(parts[0], [each for each in parts[1:] if isinstance(each, Kind)])
        known = next((each for each in parts[1:] if isinstance(each, Range)), None)
        return kind._replace(words=f"{kind.words} in{known.of}" if known and known.of else kind.words, known=known)
    if isinstance(annotation, TypeVar):
        origin, parts = Union, annotation.__constraints__
    if origin in (Union, UnionType):
        return _either([kind_of(each) for each in parts if each is not NoneType])
    if origin is Literal:
        return kind_of(type(parts[0]))._replace(allowed=parts)
    for key in (annotation, origin, getattr(annotation, "__name__", None)):
        if key is not None and key in _KINDS:
            return _KINDS[key]
    if not isinstance(annotation, type):
        raise TypeError(f"nothing states the kind of {annotation}: type Annotated[..., Kind(...)]")
    library = annotation.__module__.partition(".")[0]
    words = getattr(annotation, "_in_words", f"a {library}.{annotation.__name__}")
    return Kind(words, lambda value: isinstance(value, annotation))


def _named(type_, stated):
    """Last of the kinds stated for a type, with the test of an earlier kind or of the type where it has none."""
    *others, kind = stated or [kind_of(type_)]
    return kind if kind.fits else kind._replace(fits=_named(type_, others).fits)


def _either(parts):
    """Union of kinds."""
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
    """Raise TypeError if a value is not of a kind, and ValueError if it is a number out of the range of the kind."""
    if not kind.fits(value):
        raise TypeError(f"{name} must be {kind.words}, got {described(value)}{_cure(value, kind)}")
    if kind.allowed and value not in kind.allowed:
        *others, last = map(repr, kind.allowed)
        near = closest(value, kind.allowed)
        hint = f": did you mean {near!r}?" if near else ""
        raise ValueError(f"{name} must be {', '.join(others)} or {last}, got {described(value)}{hint}")
    if kind.known and (_is_number(value) or isinstance(value, list | tuple | np.ndarray)):
        check_number(name, value, kind.known)
    if kind.dimensions is None or not is_a(value, "DataArray"):
        return
    if value.ndim < kind.dimensions:
        dims = ", ".join(map(str, value.dims))
        kept = ", ".join(f"{axis}=[0]" for axis in ("y", "x") if axis not in value.dims)
        cure = f"if you selected a cell, keep them with .isel({kept}); "
        if "band" in value.dims:
            cure += "multiply one spectrum by a raster of ones, odc.geo.xr.wrap_xr(numpy.ones((1, 1)), grid)"
        else:
            cure += "a list of values becomes a raster by xarray.DataArray([values], dims=('y', 'x'))"
        raise ValueError(f"{name} must have dimensions y and x, got ({dims}): {cure}")
    if not value.size:
        sizes = ", ".join(f"{dim}: {size}" for dim, size in value.sizes.items())
        raise ValueError(f"{name} has no cells, its sizes are {sizes}: does the window that was cut out overlap it?")


def checked(function, opened=lambda value: value):
    """Wrap a public function to check its arguments against its annotations, and to open rasters in them."""
    signature = inspect.signature(function)

    @wraps(function)
    def checking(*args, **options):
        try:
            bound = signature.bind(*args, **options)
        except TypeError as error:
            wrong = unknown_argument(function.__name__, signature, options)
            raise TypeError(wrong or f"{function.__name__}: {error}") from None
        expected, given = _kinds_of(function), bound.arguments
        # A default value is always allowed.
        for name, value in given.items():
            if value is not signature.parameters[name].default:
                check(name, value, expected[name])
        for name, value in given.items():
            if rasters := _rasters(value):
                _check_numbers(name, rasters, expected[name].numbers)
                given[name] = value if expected[name].stored else opened(value)
        return function(*bound.args, **bound.kwargs)

    return checking


def check_fields(description, *names):
    """Check fields of a description, all by default, against their annotations; a default value is always allowed."""
    expected = _kinds_of(type(description))
    for name in names or expected:
        value = getattr(description, name)
        if value is not type(description).__dataclass_fields__[name].default:
            check(name, value, expected[name])


def _check_numbers(name, rasters, allowed):
    """Raise TypeError if cells or wavelengths of the rasters in an argument do not have an allowed dtype."""
    for raster in rasters if allowed else ():
        arrays = {name: raster}
        if "wavelength" in raster.coords:
            arrays[f"wavelength of {name}"] = raster.coords.variables["wavelength"]
        for what, array in arrays.items():
            if array.dtype.kind not in allowed:
                cure = _NOT_REAL.get(array.dtype.kind, "text or objects, type .astype(float) if they stand for numbers")
                raise TypeError(f"{what} must hold real numbers, got {array.dtype}: it holds {cure}")


def _rasters(value):
    """Rasters in an argument: the argument itself, or the rasters in a Dataset, a mapping, a pair or a description."""
    if value is None or isinstance(value, str | int | float):
        return []
    if is_a(value, "DataArray"):
        return [value]
    if is_a(value, "Dataset"):
        return [each for each in value.data_vars.values() if each.ndim >= 2]
    # Classes of pydantic have checked their fields, and longer sequences hold no rasters.
    checked = hasattr(value, "__pydantic_validator__") or (isinstance(value, list | tuple) and len(value) != 2)
    return list(chain.from_iterable(map(_rasters, () if checked else parts_of(value).values())))


def parts_of(value):
    """Parts of a mapping, a sequence or a description by name, none of another value."""
    if isinstance(value, Mapping | list | tuple):
        return dict(value if isinstance(value, Mapping) else enumerate(value))
    own = fields(value) if is_dataclass(type(value)) else ()
    return {each.name: getattr(value, each.name) for each in own if each.init}


def with_parts(value, change):
    """Mapping, sequence or description with its parts changed by a function, itself if none changes."""
    parts = parts_of(value)
    found = {name: change(each) for name, each in parts.items()}
    changed = {name: each for name, each in found.items() if each is not parts[name]}
    if not changed:
        return value
    if isinstance(value, list | tuple):
        return type(value)._make(found.values()) if hasattr(value, "_make") else type(value)(found.values())
    if isinstance(value, Mapping):
        return found
    # A Canopy keeps which of its fields were given.
    return value.replace(**changed) if hasattr(value, "replace") else replace(value, **changed)


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
    if kind.fits in (_is_number, _is_whole) and is_a(value, "DataArray", "ndarray"):
        return ", where one is for all cells"
    if kind.known and isinstance(value, str):
        return ": leave the unit out"
    if kind is GRID and is_a(value, "DataArray"):
        return ": type raster.odc.geobox"
    return ""


def likely_units(name, value, known):
    """Units in which a value is usual, and the note of a range, as the end of a message."""
    low, high = max(known.usual[0], known.lowest), min(known.usual[1], known.highest)
    found = [
        f"if it is in {unit}, type {name}={value * factor:.4g}"
        for unit, factor in known.others.items()
        if low <= value * factor <= high
    ]
    return "; ".join([*filter(None, [known.note]), *found])


def check_number(what, values, known):
    """Raise ValueError for impossible numbers, and warn if their mean is unusual and not 0; NaN in arrays passes."""
    one, values = np.ndim(values) == 0, np.atleast_1d(np.asarray(values, float))
    wrong = (values < known.lowest) | (values > known.highest) | (one & np.isnan(values))
    wrong |= ((known.ends[0] == "(") & (values == known.lowest)) | ((known.ends[1] == ")") & (values == known.highest))
    known_values = values[np.isfinite(values)]
    number = values[wrong][0] if wrong.any() else known_values.mean() if known_values.size else 0.0
    hint = likely_units(what.rpartition(" ")[2], number, known) or (known.of and "check its unit")
    hint = f": {hint}" if hint else ""
    if wrong.any():
        raise ValueError(f"{what} must be {known}, got {number:g}{hint}")
    if number and not known.usual[0] <= number <= known.usual[1]:
        low, high = max(known.usual[0], known.lowest), min(known.usual[1], known.highest)
        warn(f"{what} is {number:g}{known.of}, and {low:g} to {high:g} is usual{hint}")


class Array(Protocol):
    """Anything that numpy reads as an array: of numpy or dask, a column of pandas, an xarray.DataArray."""

    def __array__(self) -> np.ndarray: ...


class FrozenDistribution(Protocol):
    """Frozen continuous distribution, as in `scipy.stats`."""

    def ppf(self, q: Any, /) -> Any:
        """Quantile of a share of the distribution."""

    def cdf(self, x: Any, /) -> Any:
        """Share of the distribution below a value."""

    def pdf(self, x: Any, /) -> Any:
        """Probability density."""

    def mean(self) -> Any:
        """Mean."""

    def std(self) -> Any:
        """Standard deviation."""

    def support(self) -> tuple[Any, Any]:
        """Smallest and largest value."""


FilePath: TypeAlias = Annotated[str | PathLike[str], PATH]
Time: TypeAlias = Annotated[str | datetime | np.datetime64, DATES]
Times: TypeAlias = Annotated[Time | Sequence[Time] | Array, DATES]
Names: TypeAlias = Annotated[str | Sequence[str], NAMES]
NoiseKinds: TypeAlias = Annotated[
    Names, Kind("a list of kinds of noise, such as ['shot', 'thermal'], 'all', or () for none")
]
# The function checks the number, and its message states the range.
WholeNumber: TypeAlias = Annotated[int, UNCHECKED]
Metres: TypeAlias = Annotated[float, Kind("a size in metres, such as 30.0")]
Numbers: TypeAlias = Annotated[float | Sequence[float] | Array, NUMBERS]
NumberOrArray: TypeAlias = Annotated[float | Array, NUMBERS]
NumberOrList: TypeAlias = Annotated[Numbers, LIST]
NumberByBand: TypeAlias = Annotated[Numbers | Mapping[str, float], Kind("a number, or one for each band")]
Surroundings: TypeAlias = Annotated[Numbers, Kind("a reflectance, one for each band, or a raster", dimensions=0)]
Level: TypeAlias = Annotated[float, Range("1", 0, 1, note="0.95 is a confidence of 95 %", ends="()")]
FparLimit: TypeAlias = Annotated[float, Range("1", 0, 1, note="it is a fraction, 0.94 in the paper", ends="(]")]
MinValid: TypeAlias = Annotated[float, Range("1", 0, 1, note="it is a share of the footprint")]
# One number, or two: down and across.
Pair: TypeAlias = Annotated[float | Sequence[float], PAIR]
Interval: TypeAlias = Annotated[
    Literal["native"] | Pair, Kind("'native', or metres between pixels, down and across", ROW.fits)
]
# Along rows and along columns.
Offset: TypeAlias = Annotated[
    Sequence[Numbers], Kind("two numbers, or two lists of them, such as (0.5, 0.0)", ROW.fits)
]
# Cells of a chunk along each side, by dimension, "auto", or a size such as "64MB".
Chunks: TypeAlias = Annotated[Mapping[str, int] | int | str, CHUNKS]
# How the pixels of two rasters pair.
Pairing: TypeAlias = Literal["coordinates", "index"]
# Exchange of light between ground and atmosphere. Python treats literals with the same values in another order as equal
# and reuses the first union with them, so that a second definition would make the order in messages vary.
Coupling: TypeAlias = Literal["lambert", "four-stream", "directional"]
# The name of an aerosol, or the share of each of its components.
AerosolMixture: TypeAlias = Annotated[str | Mapping[str, float], PLAIN]
LaiDistribution: TypeAlias = Annotated[
    FilePath | FrozenDistribution,
    Kind(
        "the name of a treatment, the path of a CSV file or a frozen scipy distribution",
        lambda value: is_path(value) or hasattr(value, "ppf"),
    ),
]
