"""Arguments of public functions: of the kind that their names say, or refused in a line that names them."""

import inspect
from collections.abc import Mapping
from functools import wraps

import numpy as np

from fifesim.base.kinds import (
    ANYTHING,
    ATMOSPHERE,
    CANOPY,
    CHUNKS,
    CRS,
    DISTRIBUTION,
    FILE_BY_BAND,
    FILE_OR_RASTER,
    FILES_BY_NAME,
    FLAG,
    FUNCTION,
    GEOMETRY,
    GRID,
    HORIZON,
    INSTRUMENT,
    INSTRUMENTS,
    INTERVAL,
    LAND,
    LEAF,
    LEAF_ANGLES,
    LIST,
    MAPPING,
    METRES,
    NAMES,
    NOISE,
    NUMBER,
    NUMBER_OR_RASTER,
    NUMBERS,
    OFFSET,
    PAIR,
    PATH,
    PLAIN,
    RASTER,
    REGRESSION,
    REPRODUCED,
    SCENARIO,
    SETUP,
    SPREAD,
    STUDY,
    SURROUNDINGS,
    TABLES,
    TEXT,
    TRACK,
    TWO,
    VARIATION,
    Kind,
    described,
    is_a,
)
from fifesim.base.spelling import unknown_argument


def _of(kind, names):
    return dict.fromkeys(names.split(), kind)


KINDS = (
    _of(NUMBER, "arp height width west north altitude fpar_inf min_valid nadir_offset heading level increment")
    | _of(NUMBER, "bandwidth points reach extinction latitude longitude margin fill resolution directions min_count")
    | _of(NUMBER, "cell scale_height sza saa vza vaa earth_sun_distance thermal shot detectors gain_spread slope")
    | _of(NUMBER, "visibility aot h2o o3 residual_deviation realisations spacing offset_spread")
    | _of(NUMBER, "uncertainty min_coverage view_tolerance")
    | _of(NUMBERS, "radiance")
    | _of(LIST, "frequency")
    | _of(METRES, "pixel")
    | _of(INTERVAL, "interval")
    | _of(SURROUNDINGS, "surroundings")
    | _of(HORIZON, "horizon")
    | _of(FLAG, "upwelling exact assume adjacency quantise allow_remote overwrite quality reflect")
    | _of(FLAG, "resume complete")
    | _of(TEXT, "angles scaling pair quantity method datum vertical_units engine profile along band leaves")
    | _of(NAMES, "bands engines")
    | _of(NOISE, "noise")
    | _of(MAPPING, "arps correlations covariates reference tags")
    | _of(PATH, "path folder")
    | _of(STUDY, "study")
    | _of(FILE_OR_RASTER, "path_or_raster")
    | _of(RASTER, "dem elevation beside truth ndvi variable lai")
    | _of(GRID, "grid onto")
    | _of(INSTRUMENT, "instrument")
    | _of(INSTRUMENTS, "instruments")
    | _of(CHUNKS, "chunks")
    | _of(GEOMETRY, "geometry")
    | _of(ATMOSPHERE, "atmosphere")
    | _of(SETUP, "setup")
    | _of(CANOPY, "canopy")
    | _of(TRACK, "track")
    | _of(REGRESSION, "fit")
    | _of(SCENARIO, "scenario")
    | _of(SPREAD, "lsf")
    | _of(FUNCTION, "algorithm")
    | _of(PLAIN, "noise_models aerosol axes")
    | _of(DISTRIBUTION, "distribution")
    | _of(VARIATION, "cv")
)
"""What an argument may be, by its name, which means the same everywhere."""

OF_FUNCTION = {
    "landscape": _of(FILE_OR_RASTER, "lai") | _of(ANYTHING, "brown crown_cover soil moisture"),
    "arp_for_length": _of(NUMBER, "length"),
    "sense": _of(OFFSET, "offset"),
    "read_aerosol": _of(TWO, "layer") | _of(TABLES, "source"),
    "compare": _of(MAPPING, "bands"),
    "lai_distribution": _of(DISTRIBUTION, "source"),
    "grid_at": _of(PAIR, "cell") | _of(CRS, "crs"),
    "regress": _of(RASTER, "x"),
    "share_kept": _of(RASTER, "cells"),
    "scale_bias": _of(RASTER, "array"),
    "compare_engines": _of(NUMBERS, "reflectance"),
    "instrument": _of(INSTRUMENT, "name"),
    "sun_position": _of(NUMBERS, "latitude longitude altitude"),
    "budget": _of(NUMBER, "cells"),
    "reproduce": _of(NUMBER, "cells")
    | _of(LAND, "dem")
    | _of(FILES_BY_NAME, "densities")
    | _of(FILE_BY_BAND, "optics background")
    | _of(PATH, "sensor")
    | _of(TEXT, "reading"),
    "dataset": _of(NUMBER, "n"),
    "chips_of": _of(NUMBER, "n") | _of(ANYTHING, "study"),
    "plot_reproduction": _of(NUMBER, "number") | _of(REPRODUCED, "found") | _of(TEXT, "reading"),
}
"""The same of single functions, where it is another."""


# Take values along any dimensions.
_ANY_DIMENSIONS = {"density", "share_kept", "to_bands"}

# Average a mask of True and False to a share.
_TAKE_MASKS = {"aggregate"}

# Arguments that are no rasters of a quantity: dates, and results that hold masks.
_NO_QUANTITIES = {"time", "found"}

# Kinds of numpy's dtypes: integers and floating-point numbers.
_REAL = "iuf"
_NOT_REAL = {
    "b": "a mask, type .astype(float) if 0 and 1 are its values",
    "c": "complex numbers, type .real or abs(...)",
    "M": "dates, take the variable that holds the quantity",
    "m": "durations, take the variable that holds the quantity",
}


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
    if kind in (RASTER, FILE_OR_RASTER) or (
        kind in (ANYTHING, SURROUNDINGS) and is_a(value, "DataArray") and value.ndim > 1
    ):
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
        The same name, documentation and signature. What an argument is by default, it may always be. It raises
        TypeError for an argument of another kind, or for a raster whose cells are not real numbers.
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
            wrong = unknown_argument(function.__name__, signature, options)
            raise TypeError(wrong or f"{function.__name__}: {error}") from None
        for name, kind in kinds.items():
            if name in given and given[name] is not signature.parameters[name].default:
                check(name, given[name], kind)
                if methods_of and name == first:
                    _check_cells(name, given[name], 0 if function.__name__ in _ANY_DIMENSIONS else 2)
        for name, value in given.items():
            if name in _NO_QUANTITIES:
                continue
            _check_numbers(name, value, _REAL + "b" if function.__name__ in _TAKE_MASKS else _REAL)
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


def _check_cells(name, raster, dimensions=2):
    """Refuse a raster without cells, or without rows and columns; what else they are called is told later."""
    if not is_a(raster, "DataArray"):
        return
    if raster.ndim < dimensions:
        dims = ", ".join(map(str, raster.dims))
        raise ValueError(f"{name} must have dimensions y and x, got ({dims}): select with .isel(x=[0]), not .isel(x=0)")
    if not raster.size:
        sizes = ", ".join(f"{dim}: {size}" for dim, size in raster.sizes.items())
        raise ValueError(f"{name} has no cells, its sizes are {sizes}: does the window that was cut out overlap it?")


def _check_numbers(name, value, allowed):
    """Raise TypeError if the cells or wavelengths of the rasters in an argument are not real numbers."""
    for raster in _rasters(value):
        wavelength = (raster.coords["wavelength"],) if "wavelength" in raster.coords else ()
        for what, each in ((name, raster), *((f"wavelength of {name}", each) for each in wavelength)):
            if each.dtype.kind not in allowed:
                cure = _NOT_REAL.get(each.dtype.kind, "text or objects, type .astype(float) if they stand for numbers")
                raise TypeError(f"{what} must hold real numbers, got {each.dtype}: it holds {cure}")


def _rasters(value):
    """Rasters in an argument: itself, or those in a Dataset, a mapping, a pair, a Leaf or a Setup."""
    if is_a(value, "DataArray"):
        return [value]
    if is_a(value, "Dataset"):
        return [each for each in value.data_vars.values() if each.ndim >= 2]
    if isinstance(value, Mapping):
        parts = value.values()
    elif isinstance(value, list | tuple) and len(value) == 2:
        parts = value
    else:
        parts = vars(value).values() if is_a(value, "Leaf", "Setup", "Canopy") else ()
    return [raster for part in parts for raster in _rasters(part)]


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
        return ": open it with fifesim.open_image, rioxarray.open_rasterio, or onto a grid with fine_dem or open_lai"
    if kind is NUMBER and is_a(value, "DataArray", "ndarray"):
        return ", where one is for all cells"
    if kind is GRID and is_a(value, "DataArray"):
        return ": type raster.odc.geobox"
    return ""
