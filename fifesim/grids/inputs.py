"""Rasters given by the user: their types, packing, band order, orientation and units."""

import re
from typing import Annotated, Any, TypeAlias, TypeVar

import numpy as np
import rioxarray  # noqa: F401  registers .rio
import xarray as xr

from fifesim.base.arguments import RASTER, FilePath, Kind, with_parts
from fifesim.base.bands import PER_MICROMETRE, check_micrometres
from fifesim.base.messages import warn
from fifesim.grids import cf, chunks
from fifesim.grids import grid as grids
from fifesim.grids.grid import check_axes, is_scan, north_up
from fifesim.grids.windows import origin_of

RASTER_OR_DATASET = Kind("an xarray.DataArray or an xarray.Dataset", dimensions=2)
MASKS_TOO = RASTER_OR_DATASET._replace(numbers="iufb")

# The same kind goes in and comes out.
Raster = TypeVar("Raster", xr.DataArray, xr.Dataset)
RasterOrDataset: TypeAlias = Annotated[xr.DataArray | xr.Dataset, RASTER_OR_DATASET]
# A raster along any dimensions.
AnyDimensions: TypeAlias = Annotated[xr.DataArray, RASTER._replace(dimensions=0)]
FileOrRaster: TypeAlias = Annotated[
    FilePath | xr.DataArray, Kind("the path of a file, or an xarray.DataArray", dimensions=2)
]
# Elevation of the horizon, as `fifesim.horizon` gives it.
Horizon: TypeAlias = Annotated[
    xr.DataArray,
    Kind(
        "an xarray.DataArray over (direction, y, x), as fifesim.horizon gives it",
        lambda value: isinstance(value, xr.DataArray) and "direction" in value.dims,
    ),
]
# An image with several resolutions is an xarray.DataTree; Any keeps type checkers from requiring a test for it.
Image: TypeAlias = xr.DataArray | Any


NO_DATA_ATTRIBUTES = ("_FillValue", "missing_value", "nodata")
"""Attributes with the value for no data."""

# rioxarray has scales and offsets where they differ among bands.
_SCALES = {"scale_factor": "scales", "add_offset": "offsets"}

STORAGE = (*_SCALES, *_SCALES.values(), *NO_DATA_ATTRIBUTES, "valid_range", "valid_min", "valid_max")
"""Attributes of the storage of values."""

# Attributes of codes, which are no numbers in a unit.
_CODES = {"flag_values", "flag_masks", "flag_meanings"}

# Key of the encoding: dtype in which values were stored, and whether they had a scale and a value for no data.
_STORED = "stored"


def opened(value):
    """Argument of a public function whose rasters have values in their unit, and NaN for no data."""
    # Packing is applied here alone, for all public functions. Images and codes stay whole numbers.
    if isinstance(value, xr.DataArray):
        return value if cf.is_counts(value) or _CODES & value.attrs.keys() else unpacked(value)
    if isinstance(value, xr.Dataset):
        # Attributes of a variable have precedence over attributes of the Dataset.
        shared = {key: value.attrs[key] for key in STORAGE if key in value.attrs}
        own = {key: each for key, each in value.data_vars.items() if each.ndim >= 2}
        own = {key: each.assign_attrs(shared | each.attrs) if shared else each for key, each in own.items()}
        changed = {key: found for key, each in own.items() if (found := opened(each)) is not each}
        return value.assign(changed).drop_attrs(deep=False).assign_attrs(value.attrs) if changed else value
    return value if isinstance(value, xr.DataTree) else with_parts(value, opened)


def unpacked(raster, packing=None):
    """Values of a raster in their unit, NaN for no data, without attributes of packing, or by the packing of a file."""
    stored = packing or storage(raster)
    if not stored.keys() & set(STORAGE):
        return raster
    scale, offset = scale_and_offset(raster, packing)
    scaled = bool(np.any(scale != 1.0) or np.any(offset != 0.0))
    if scaled and raster.dtype.kind == "f" and not packing:
        given = ", ".join(f"{key} {stored[key]}" for key in (*_SCALES, *_SCALES.values()) if key in stored)
        raise ValueError(
            f"{raster.name or 'the raster'} has fractions but also {given}: "
            "if they were applied, remove them from .attrs; otherwise open the file with mask_and_scale=True"
        )
    marks = [mark for mark in sorted(set(map(float, _marks(stored)))) if not np.isnan(mark)]
    lowest, highest = _valid_range(stored) if raster.dtype.kind in "iu" else (-np.inf, np.inf)
    bounded = np.isfinite([lowest, highest]).any()
    if not (scaled or marks or bounded):
        return raster
    cells = raster if raster.dtype.kind == "f" else raster.astype(float)
    for mark in marks:
        cells = cells.where(raster != mark)
    cells = cells.where((raster >= lowest) & (raster <= highest)) if bounded else cells
    cells = cells * scale + offset if scaled else cells
    kept = {name: value for name, value in raster.attrs.items() if name not in STORAGE}
    cells = cells.drop_attrs(deep=False).assign_attrs(kept).rename(raster.name)
    whole = raster.dtype.kind in "iu"
    cells.encoding = {_STORED: (raster.dtype, scaled, bool(marks or bounded))} if whole else {}
    return cells


def storage_of(raster):
    """Dtype in which the values of a raster were stored, and whether they had a scale and a value for no data."""
    return raster.encoding.get(_STORED, (raster.dtype, raster.dtype.kind == "f", raster.dtype.kind == "f"))


def scale_and_offset(raster, packing=None):
    """Scale and offset from stored values to their unit, 1 and 0 by default; along band where they differ."""
    if packing is None and cf.is_counts(raster):
        # A GIS has no square-root scale.
        return (1.0, 0.0) if "compression" in raster.coords else (raster.coords["gain"], raster.coords["offset"])
    stored = packing or storage(raster)
    named = zip(_SCALES.items(), (1.0, 0.0), strict=True)
    return tuple(_numbers(raster, one, stored.get(one, stored.get(several, by))) for (one, several), by in named)


def _numbers(raster, name, given):
    """A number, or the numbers of the bands of a raster."""
    values, band = np.ravel(given), raster.coords.get("band")
    if values.dtype.kind in "iuf" and np.isfinite(values).all() and (name != "scale_factor" or values.all()):
        if values.size == 1:
            return float(values[0])
        if band is not None and band.dtype.kind in "iu" and band.min() > 0 and band.max() <= values.size:
            return xr.DataArray(values[band.values - 1], dims=band.dims)
    raise ValueError(
        f"{raster.name or 'the raster'} has {name} {given!r}: it must be a finite number, or one for each numbered "
        f"band; correct .attrs[{name!r}]"
    )


def _marks(stored):
    """Values for no data."""
    given = [each for name in NO_DATA_ATTRIBUTES for each in np.ravel(stored.get(name, []))]
    marks = [each for each in given if each is not None]
    if wrong := [each for each in marks if np.asarray(each).dtype.kind not in "iuf"]:
        raise ValueError(f"a raster has {wrong[0]!r} for no data: it must be a number; correct .attrs['_FillValue']")
    return marks


def _valid_range(stored):
    """Smallest and largest valid number that is stored; CF takes others as no data."""
    low, high = stored.get("valid_range", (-np.inf, np.inf))
    return float(stored.get("valid_min", low)), float(stored.get("valid_max", high))


def no_data_of(raster):
    """Value for no data in a file: from the attributes, else 0 for digital numbers, NaN for fractions, or None."""
    marks = [np.asarray(mark).item() for mark in _marks(storage(raster))]
    if raster.dtype.kind in "iu":
        limits = np.iinfo(raster.dtype)
        marks = [mark for mark in marks if limits.min <= mark <= limits.max]
    return marks[0] if marks else 0 if "gain" in raster.coords else None if raster.dtype.kind != "f" else np.nan


def storage(raster):
    """Attributes, and for stored numbers also the encoding from the file."""
    return {**raster.attrs, **raster.encoding} if raster.dtype.kind in "iu" else raster.attrs


LOWEST, HIGHEST = cf.QUANTITIES["surface_reflectance"].lowest, cf.QUANTITIES["surface_reflectance"].highest
"""Range of reflectance factors. [1]"""

# Distance of the rows in which the scale of a raster from fifesim is checked. [row]
SAMPLED_ROWS = 16


def incoming(raster, name):
    """User-supplied raster in the form of the stages, dims ([band], y, x), lazy where it was."""
    # Reflectance beyond -0.5 to 5 raises ValueError when it is computed. Rows of rasters from fifesim are sampled.
    array = _bands_as_one(raster, name)
    if cf.is_counts(array):
        return array
    _check_stored(array, name)
    array = in_micrometres(with_band_names(north_up(array)))
    if "atmosphere" in array.attrs and array.dtype.kind == "f":
        if isinstance(array.data, np.ndarray) and array.dims[-2:] in (("y", "x"), ("line", "sample")):
            check_scale(array.values)
            return array
        # A lazy raster with an origin is unchanged since fifesim made it.
        return array if origin_of(array) is not None else chunks.pointwise(check_scale, array, dtype=array.dtype)
    out = chunks.pointwise(check_reflectance, array, dtype=np.float32 if array.dtype == np.float32 else float)
    out.attrs = dict(array.attrs)
    return out


def in_micrometres(array):
    """Raster with its wavelengths in micrometres."""
    given = array.coords.variables.get("wavelength")
    if given is None:
        return array
    values = micrometres(given)
    if given.dtype == float and given.attrs == cf.attributes("wavelength"):
        return array
    found = xr.Variable(given.dims, values, cf.attributes("wavelength"))
    return grids.with_coordinates(array, {"wavelength": found})


def micrometres(wavelength):
    """Wavelengths in micrometres, from the unit in their attribute. [um]"""
    values = np.asarray(wavelength.values, float) / per_micrometre(wavelength)
    if values.size:
        check_micrometres("wavelengths", values)
    return values


def per_micrometre(coordinate):
    """Number of units of wavelengths or widths in a micrometre, from the unit in their attribute, um by default."""
    unit = str(coordinate.attrs.get("units", "")).strip() or "um"
    if unit.lower() not in PER_MICROMETRE:
        raise ValueError(f"wavelengths are in {unit!r}: convert them to 'um' or 'nm', then set .attrs['units']")
    return PER_MICROMETRE[unit.lower()]


def check_reflectance(values):
    """Raise ValueError for impossible reflectance, and warn if most of a block or band is implausible."""
    # A quarter of the time of comparisons with the limits.
    ends = [each.reduce(values, axis=None) for each in (np.fmin, np.fmax)] if values.size else [0.0, 0.0]
    for end in ends:
        if end < LOWEST or end > HIGHEST:
            raise ValueError(
                f"reflectance of {end:g}: it is a fraction, and {LOWEST:g} to {HIGHEST:g} is allowed. Mask no data "
                "with .where(raster != nodata), multiply scaled values by their scale (0.01 for percent, 0.0001 where "
                "1 is written 10000), and calibrate digital numbers with fifesim.calibrate"
            )
    of_band = tuple(range(max(values.ndim - 2, 0), values.ndim))
    # Snow, glint and white slopes exceed 1.5 in parts of a scene, and dark water is slightly negative.
    if ends[1] > 1 and (_are_most(values > 1, values) or _are_most(values > 1.5, values, of_band)):
        warn(
            "most values of a block are reflectances above 1, or of a band above 1.5, which is implausible: if they "
            "are percent, divide by 100; if they are scaled, multiply them by their scale"
        )
    if ends[0] < -0.01 and _are_most(values < -0.01, values, of_band):
        warn(
            f"most values of a band are negative reflectances, down to {ends[0]:g}: check that its offset "
            "(add_offset, such as -0.1 of Sentinel-2) and scale (scale_factor) are right and applied once"
        )
    return values


def _are_most(found, values, axis=None):
    """Whether more than half of the known values, of the block or of a band, are found."""
    return np.any(2 * np.count_nonzero(found, axis) > np.count_nonzero(~np.isnan(values), axis))


def check_scale(values):
    """Raise ValueError if a raster from fifesim was multiplied by 100 or 10000."""
    # A scale concerns all rows: a sample of them takes 1/16 of the time.
    check_reflectance(values[..., ::SAMPLED_ROWS, :])
    return values


def _bands_as_one(raster, name):
    """Variables of a Dataset as bands."""
    if not isinstance(raster, xr.Dataset):
        if not is_scan(raster):
            check_axes(raster)
        return raster
    bands = [key for key, value in raster.data_vars.items() if value.ndim >= 2]
    if not bands:
        raise ValueError(f"the Dataset has no variables over (y, x): {', '.join(map(str, raster.data_vars)) or 'none'}")
    for key in bands:
        check_axes(raster[key])
    own = [_check_stored(raster[key], name) for key in bands]
    index = xr.DataArray([_called(each) for each in own], dims="band", name="band")
    joined = xr.concat(own, dim=index, combine_attrs="drop_conflicts", coords="minimal", compat="override")
    return joined.transpose(..., "band", "y", "x").rename(name)


def _called(band):
    """Name of a variable, or its long name if rioxarray has numbered it."""
    long_name = band.attrs.get("long_name")
    numbered = re.fullmatch(r"band_\d+", str(band.name)) is not None
    return long_name if numbered and isinstance(long_name, str) and long_name else str(band.name)


def with_band_names(array):
    """Name bands by ``long_name`` if the coordinate has only numbers, which count the names from 1."""
    names = array.attrs.get("long_name")
    if isinstance(names, str) or not names or "band" not in array.coords or array["band"].dtype.kind not in "iu":
        return array
    numbers = array["band"].values
    if np.min(numbers) < 1 or np.max(numbers) > len(names):
        return array
    attrs = {key: value for key, value in array.attrs.items() if key != "long_name"}
    called = np.asarray([str(each) for each in names])[numbers - 1]
    return array.assign_coords(band=(array["band"].dims, called)).drop_attrs(deep=False).assign_attrs(attrs)


def _check_stored(array, name):
    """Raise ValueError for whole numbers without a scale, and warn of numbers without a value for no data."""
    dtype, scaled, filled = storage_of(array)
    if "FIFESIM" in array.attrs and dtype.kind != "f":
        raise ValueError(
            f"{array.name or 'the raster'} is an image that fifesim wrote, without its calibration: open its file "
            "with fifesim.open_image, which brings it back"
        )
    if not scaled:
        nodata = "" if filled else ", _FillValue=0"
        scale = f"for scaled reflectance type .assign_attrs(scale_factor=0.0001{nodata}), as its product says"
        counts = "calibrate digital numbers with fifesim.calibrate"
        cures = f"{counts}; {scale}" if dtype.itemsize < 2 else f"{scale}; {counts}"
        raise ValueError(
            f"{array.name or 'the raster'} holds whole numbers ({dtype}) without a scale, where "
            f"{cf.QUANTITIES[name].long_name} is needed: {cures}"
        )
    if not filled:
        warn(
            f"{array.name or 'the raster'} has no value for no data: if there is one, such as 0, add "
            ".assign_attrs(_FillValue=0), otherwise it is used as reflectance"
        )
    return array
