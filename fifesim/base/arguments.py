"""Arguments of public functions: of the kind that their names say, or refused in a line that names them."""

import inspect
import os
import re
from collections.abc import Mapping
from functools import wraps
from typing import NamedTuple

import numpy as np


class Kind(NamedTuple):
    """What an argument may be: in words, and a function that says whether a value is it."""

    words: str
    fits: object


def is_a(value, *names):
    """
    Whether a value is of a class or of one derived from it, by name.

    Classes of other libraries and of later folders need not be imported to be told apart.

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
    return _is_number(value) or (
        isinstance(value, list | tuple | np.ndarray) and len(value) == 2 and _are_numbers(value)
    )


def _is_plain(value):
    """No array or raster, of which some other thing is made by mistake."""
    return value is not None and not is_a(value, "Dataset", "DataTree", "ndarray", "DataArray", "Array")


def _is_mapping(value):
    return _is_plain(value) and isinstance(value, Mapping)


def _is_path(value):
    return isinstance(value, str | os.PathLike)


def _is_crs(value):
    return isinstance(value, str | int) or hasattr(value, "to_wkt")


def _is_size(value):
    return isinstance(value, str) and re.fullmatch(r"auto|[\d.]+ *[kMGT]?i?B", value) is not None


def _is_raster(value):
    return is_a(value, "DataArray")


NUMBER = Kind("a number", _is_number)
NUMBERS = Kind("a number, or an array of them", _are_numbers)
PAIR = Kind("a number, or two: down and across", _is_pair)
FLAG = Kind("True or False", lambda value: isinstance(value, bool | np.bool_))
TEXT = Kind("a name", lambda value: isinstance(value, str))
NAMES = Kind("a list of names", lambda value: isinstance(value, str) or (_is_plain(value) and np.iterable(value)))
PATH = Kind("the path of a file", _is_path)
RASTER = Kind("an xarray.DataArray over (y, x)", _is_raster)
FILE_OR_RASTER = Kind("the path of a file, or an xarray.DataArray", lambda value: _is_path(value) or _is_raster(value))
GRID = Kind("an odc.geo.geobox.GeoBox, such as fifesim.grid_at or raster.odc.geobox give", lambda v: is_a(v, "GeoBox"))
INSTRUMENT = Kind(
    "the name of an instrument, such as 'TM', or a fifesim.Instrument",
    lambda value: _is_path(value) or is_a(value, "Instrument"),
)
INSTRUMENTS = Kind(
    "a list of instruments, such as ['TM', 'OLI']",
    lambda value: isinstance(value, str) or (_is_plain(value) and np.iterable(value)),
)
CHUNKS = Kind(
    "a number of cells, 'auto', '64MB' or a mapping such as {'y': 1024, 'x': 1024}",
    lambda value: _is_number(value) or isinstance(value, tuple) or _is_mapping(value) or _is_size(value),
)
GEOMETRY = Kind(
    "a fifesim.Geometry, or an xarray.Dataset of sza, saa, vza and vaa",
    lambda value: is_a(value, "Geometry") or (is_a(value, "Dataset") and "sza" in value.variables),
)
ATMOSPHERE = Kind("a fifesim.Atmosphere", lambda value: is_a(value, "Atmosphere"))
SETUP = Kind("a fifesim.Setup", lambda value: is_a(value, "Setup"))
TRACK = Kind("a fifesim.Track", lambda value: is_a(value, "Track"))
REGRESSION = Kind("a fifesim.Regression, as fifesim.regress gives it", lambda value: is_a(value, "Regression"))
SCENARIO = Kind("a fifesim.Scenario, as fifesim.read_scenario gives it", lambda value: is_a(value, "Scenario"))
SPREAD = Kind(
    "a line spread function, such as fifesim.instrument('TM').line_spread", lambda value: hasattr(value, "half_width")
)
FUNCTION = Kind("a function", callable)
HORIZON = Kind(
    "an xarray.DataArray over (direction, y, x), as fifesim.horizon gives it",
    lambda value: _is_raster(value) and "direction" in value.dims,
)
LEAF = Kind(
    "a fifesim.Leaf, {band: (reflectance, transmittance)}, or a pair of them for all bands",
    lambda value: (
        is_a(value, "Leaf")
        or isinstance(value, Mapping)
        or (isinstance(value, list | tuple | np.ndarray) and len(value) == 2)
    ),
)
INTERVAL = Kind("'native', or metres between pixels, down and across", lambda v: isinstance(v, str) or _is_pair(v))
TWO = Kind(
    "two numbers, or two lists of them, such as (0.5, 0.0)",
    lambda value: isinstance(value, list | tuple | np.ndarray) and len(value) == 2,
)
DISTRIBUTION = Kind(
    "the name of a treatment, the path of a CSV file or a frozen scipy distribution",
    lambda value: _is_path(value) or hasattr(value, "ppf"),
)
LEAF_ANGLES = Kind(
    "a name such as 'planophile', or the fractions of classes such as {30: 0.5, 60: 0.5}",
    lambda value: _is_plain(value) or (isinstance(value, np.ndarray) and value.ndim == 1),
)
MAPPING = Kind("a mapping of names", _is_mapping)
ANYTHING = Kind("a number, a mapping, a description or a raster", lambda value: True)
PLAIN = Kind("a name, a mapping or a description, and no raster", _is_plain)


def _of(kind, names):
    return dict.fromkeys(names.split(), kind)


KINDS = (
    _of(NUMBER, "arp height width west north altitude hotspot fpar_inf min_valid nadir_offset heading level increment")
    | _of(
        NUMBER, "bandwidth points reach extinction latitude longitude margin fill resolution directions min_count slope"
    )
    | _of(
        NUMBER, "cell scale_height sza saa vza vaa earth_sun_distance thermal shot detectors gain_spread offset_spread"
    )
    | _of(NUMBER, "visibility aot h2o o3 residual_deviation realisations spacing seed")
    | _of(NUMBERS, "radiance")
    | _of(Kind("a number, or a list of them", lambda value: _are_numbers(value) and np.ndim(value) < 2), "frequency")
    | _of(NUMBER, "pixel")
    | _of(INTERVAL, "interval")
    | _of(ANYTHING, "background surroundings")
    | _of(LEAF, "leaf_optics")
    | _of(HORIZON, "horizon")
    | _of(FLAG, "upwelling exact assume adjacency quantise allow_remote")
    | _of(TEXT, "pair quantity method datum vertical_units engine profile along band")
    | _of(NAMES, "bands noise engines")
    | _of(PATH, "path")
    | _of(FILE_OR_RASTER, "path_or_raster")
    | _of(RASTER, "dem elevation beside truth ndvi variable lai")
    | _of(GRID, "grid onto")
    | _of(INSTRUMENT, "instrument")
    | _of(INSTRUMENTS, "instruments")
    | _of(CHUNKS, "chunks")
    | _of(GEOMETRY, "geometry")
    | _of(ATMOSPHERE, "atmosphere")
    | _of(SETUP, "setup")
    | _of(TRACK, "track")
    | _of(REGRESSION, "fit")
    | _of(SCENARIO, "scenario")
    | _of(SPREAD, "lsf")
    | _of(FUNCTION, "algorithm")
    | _of(PLAIN, "noise_models aerosol axes")
    | _of(DISTRIBUTION, "distribution")
    | _of(LEAF_ANGLES, "leaf_angles")
)
"""What an argument may be, by its name, which means the same everywhere."""

OF_FUNCTION = {
    "arp_for_length": _of(NUMBER, "length"),
    "sense": _of(TWO, "offset"),
    "read_aerosol": _of(TWO, "layer")
    | _of(Kind("the path of a file, or an xarray.Dataset", lambda v: _is_path(v) or is_a(v, "Dataset")), "source"),
    "compare": _of(MAPPING, "bands"),
    "lai_distribution": _of(DISTRIBUTION, "source"),
    "grid_at": _of(PAIR, "cell") | _of(Kind("a CRS, such as 'EPSG:26914'", _is_crs), "crs"),
    "regress": _of(RASTER, "x"),
    "share_kept": _of(RASTER, "cells"),
    "scale_bias": _of(RASTER, "array"),
    "compare_engines": _of(NUMBERS, "reflectance"),
    "instrument": _of(INSTRUMENT, "name"),
    "sun_position": _of(NUMBERS, "latitude longitude altitude"),
    "budget": _of(NUMBER, "cells"),
}
"""The same of single functions, where it is another."""


def check(name, value, kind):
    """
    Refuse what an argument cannot be.

    Parameters
    ----------
    name : str
    value : object
    kind : Kind

    Raises
    ------
    TypeError
        If it is of another kind.
    ValueError
        If it is a raster without cells, or without rows and columns.

    Examples
    --------
    >>> check("hotspot", 0.1, NUMBER)
    """
    if not kind.fits(value):
        raise TypeError(f"{name} must be {kind.words}, got {described(value)}{_cure(value, kind)}")
    if kind in (RASTER, FILE_OR_RASTER) or (kind is ANYTHING and is_a(value, "DataArray") and value.ndim > 1):
        _check_cells(name, value)


def checked(function, methods_of=()):
    """
    A public function that looks at its arguments first.

    Parameters
    ----------
    function : callable
    methods_of : sequence of str, optional
        Classes of xarray that its first argument may be of, where it is a method of theirs.

    Returns
    -------
    function : callable
        The same name, documentation and signature. What an argument is by default, it may always be.
    """
    signature = inspect.signature(function)
    kinds = {name: kind for name, kind in KINDS.items() if name in signature.parameters}
    kinds |= OF_FUNCTION.get(function.__name__, {})
    if methods_of:
        words = " or ".join(f"an xarray.{each}" for each in methods_of)
        words = {"an xarray.DataArray": RASTER.words}.get(words, words)
        first = next(iter(signature.parameters))
        kinds[first] = Kind(words, lambda value: is_a(value, *methods_of))

    @wraps(function)
    def checking(*args, **options):
        try:
            given = signature.bind(*args, **options).arguments
        except TypeError as error:
            raise TypeError(f"{function.__name__}: {error}") from None
        for name, kind in kinds.items():
            if name in given and given[name] is not signature.parameters[name].default:
                check(name, given[name], kind)
                if methods_of and name == first:
                    _check_cells(name, given[name])
        return function(*args, **options)

    return checking


def check_fields(description, *names):
    """
    Refuse what a field of a description cannot be.

    Parameters
    ----------
    description : object
        Its fields are attributes.
    *names : str
        Fields to look at, among `KINDS`; what one is by default passes.

    Raises
    ------
    TypeError
        If one is of another kind.
    """
    for name in names:
        value = getattr(description, name)
        if value is not type(description).__dataclass_fields__[name].default:
            check(name, value, KINDS[name])


def _check_cells(name, raster):
    """Refuse a raster without cells, or without rows and columns; what else they are called is told later."""
    if not is_a(raster, "DataArray"):
        return
    if raster.ndim < 2:
        dims = ", ".join(map(str, raster.dims))
        raise ValueError(f"{name} must have dimensions y and x, got ({dims}): select with .isel(x=[0]), not .isel(x=0)")
    if not raster.size:
        sizes = ", ".join(f"{dim}: {size}" for dim, size in raster.sizes.items())
        raise ValueError(f"{name} has no cells, its sizes are {sizes}: does the window that was cut out overlap it?")


def _cure(value, kind):
    """What to type instead, where that can be told."""
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
        return ": open it with fifesim.open_image or rioxarray.open_rasterio"
    if kind is NUMBER and is_a(value, "DataArray", "ndarray"):
        return ", where one is for all cells"
    if kind is GRID and is_a(value, "DataArray"):
        return ": type raster.odc.geobox"
    return ""
