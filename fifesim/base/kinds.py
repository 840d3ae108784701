"""What arguments may be: numbers, names, rasters and descriptions, in words and as questions."""

import os
import re
from collections.abc import Mapping
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
    several = isinstance(value, list | tuple | np.ndarray)
    return _is_number(value) or (several and np.shape(value) == (2,) and _are_numbers(value))


def _is_plain(value):
    """No array or raster, of which some other thing is made by mistake."""
    return value is not None and not is_a(value, "Dataset", "DataTree", "ndarray", "DataArray", "Array")


def _is_offset(value):
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


def _is_crs(value):
    return isinstance(value, str | int) or hasattr(value, "to_wkt")


def _is_size(value):
    return isinstance(value, str) and re.fullmatch(r"auto|[\d.]+ *[kMGT]?i?B", value) is not None


def _is_raster(value):
    return is_a(value, "DataArray")


NUMBER = Kind("a number", _is_number)
METRES = Kind("a size in metres, such as 30.0", _is_number)
NUMBERS = Kind("a number, or an array of them", _are_numbers)
PAIR = Kind("a number, or two: down and across", _is_pair)
FLAG = Kind("True or False", lambda value: isinstance(value, bool | np.bool_))
TEXT = Kind("a name", lambda value: isinstance(value, str))
NAMES = Kind("a list of names", lambda value: isinstance(value, str) or (_is_plain(value) and np.iterable(value)))
NOISE = Kind("a list of kinds of noise, such as ['shot', 'thermal'], 'all', or () for none", NAMES.fits)
NUMBER_OR_RASTER = Kind(
    "a number, or an xarray.DataArray over (y, x)", lambda value: _is_number(value) or _is_raster(value)
)
PATH = Kind("the path of a file", is_path)
RASTER = Kind("an xarray.DataArray over (y, x)", _is_raster)
REPRODUCED = Kind(
    "an xarray.Dataset, as fifesim.reproduce gives it",
    lambda value: is_a(value, "Dataset") and "paper_slope" in value.variables,
)
LAND = Kind("'flat', 'flint-hills' or the path of a raster file", is_path)
FILES_BY_NAME = Kind("a folder, or a mapping by treatment", lambda value: is_path(value) or _is_mapping(value))
FILE_BY_BAND = Kind("the path of a CSV file, or a mapping by band", lambda value: is_path(value) or _is_mapping(value))
FILE_OR_RASTER = Kind("the path of a file, or an xarray.DataArray", lambda value: is_path(value) or _is_raster(value))
GRID = Kind("an odc.geo.geobox.GeoBox, such as fifesim.grid_at or raster.odc.geobox give", lambda v: is_a(v, "GeoBox"))
INSTRUMENT = Kind(
    "the name of an instrument, such as 'TM', or a fifesim.Instrument",
    lambda value: is_path(value) or is_a(value, "Instrument"),
)
INSTRUMENTS = Kind(
    "a list of instruments, such as ['TM', 'OLI']",
    lambda value: isinstance(value, str) or (_is_plain(value) and np.iterable(value)),
)
CHUNKS = Kind(
    "a number of cells, 'auto', '64MB', None or a mapping such as {'y': 1024, 'x': 1024}",
    lambda value: (
        value is None or _is_number(value) or isinstance(value, tuple) or _is_mapping(value) or _is_size(value)
    ),
)
GEOMETRY = Kind(
    "a fifesim.Geometry, or an xarray.Dataset of sza, saa, vza and vaa",
    lambda value: is_a(value, "Geometry") or (is_a(value, "Dataset") and "sza" in value.variables),
)
ATMOSPHERE = Kind("a fifesim.Atmosphere", lambda value: is_a(value, "Atmosphere"))
CANOPY = Kind("a fifesim.Canopy, such as fifesim.Canopy(brown=0.2)", lambda value: is_a(value, "Canopy"))
SETUP = Kind("a fifesim.Setup", lambda value: is_a(value, "Setup"))
TRACK = Kind("a fifesim.Track", lambda value: is_a(value, "Track"))
REGRESSION = Kind("a fifesim.Regression, as fifesim.regress gives it", lambda value: is_a(value, "Regression"))
SCENARIO = Kind("a fifesim.Scenario, as fifesim.read_scenario gives it", lambda value: is_a(value, "Scenario"))
STUDY = Kind(
    "the path of a study, such as 'study.toml', or a fifesim.Study",
    lambda value: is_path(value) or is_a(value, "Study"),
)
SPREAD = Kind(
    "a line spread function, such as fifesim.instrument('TM').line_spread", lambda value: hasattr(value, "half_width")
)
FUNCTION = Kind("a function", callable)
VARIATION = Kind(
    "a number, or a function of the means of pixels, such as lambda mean: 0.5 / (1 + mean)",
    lambda value: callable(value) or _is_number(value),
)
HORIZON = Kind(
    "an xarray.DataArray over (direction, y, x), as fifesim.horizon gives it",
    lambda value: _is_raster(value) and "direction" in value.dims,
)
LEAF = Kind(
    "a fifesim.Leaf, the path of a CSV file or a Dataset of spectra, {band: (reflectance, transmittance)}, or a pair",
    lambda value: is_a(value, "Leaf", "Dataset") or is_path(value) or _is_mapping(value) or TWO.fits(value),
)
INTERVAL = Kind(
    "'native', or metres between pixels, down and across",
    lambda value: isinstance(value, str) or _is_plain(value) or (isinstance(value, np.ndarray) and value.ndim == 1),
)
TWO = Kind(
    "two numbers, or two lists of them, such as (0.5, 0.0)",
    lambda value: isinstance(value, list | tuple | np.ndarray) and len(value) == 2,
)
DISTRIBUTION = Kind(
    "the name of a treatment, the path of a CSV file or a frozen scipy distribution",
    lambda value: is_path(value) or hasattr(value, "ppf"),
)
LEAF_ANGLES = Kind(
    "a name such as 'planophile', classes such as '30: 0.5, 60: 0.5', or a list of fractions",
    lambda value: not _is_mapping(value) and (_is_plain(value) or (isinstance(value, np.ndarray) and value.ndim == 1)),
)
OFFSET = Kind("two numbers, or two lists of them, such as (0.5, 0.0)", _is_offset)
CRS = Kind("a CRS, such as 'EPSG:26914'", _is_crs)
SURROUNDINGS = Kind("a reflectance, one for each band, or a raster", _are_numbers)
LIST = Kind("a number, or a list of them", lambda value: _are_numbers(value) and np.ndim(value) < 2)
TABLES = Kind("the path of a file, or an xarray.Dataset", lambda value: is_path(value) or is_a(value, "Dataset"))
MAPPING = Kind("a mapping of names", _is_mapping)
ANYTHING = Kind("a number, a mapping, a description or a raster", lambda value: True)
PLAIN = Kind("a name, a mapping or a description, and no raster", _is_plain)
