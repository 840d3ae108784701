"""Rasters given by the user: their types, packing, band order, orientation and units."""

import re
from typing import Annotated, Any, TypeAlias, TypeVar

import numpy as np
import rioxarray  # noqa: F401  registers .rio
import xarray as xr

from fifesim.base.arguments import RASTER, FilePath, Kind
from fifesim.base.bands import LONGEST
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
NumberOrRaster: TypeAlias = float | xr.DataArray
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

STORAGE = ("scale_factor", "add_offset", *NO_DATA_ATTRIBUTES)
"""Attributes of the storage of values."""


def scale_and_offset(raster):
    """Scale and offset from stored values to their unit, 1 and 0 by default."""
    stored = _storage(raster)
    return float(stored.get("scale_factor", 1.0)), float(stored.get("add_offset", 0.0))


def has_no_data(raster):
    """Whether a raster has a value for no data."""
    return any(name in _storage(raster) for name in NO_DATA_ATTRIBUTES)


def no_data_of(raster):
    """Value for no data in a file: from the attributes, else 0 for digital numbers, NaN for fractions, or None."""
    stored = _storage(raster)
    marks = [np.ravel(stored[name])[0].item() for name in NO_DATA_ATTRIBUTES if name in stored]
    if raster.dtype.kind in "iu":
        limits = np.iinfo(raster.dtype)
        marks = [mark for mark in marks if limits.min <= mark <= limits.max]
    return marks[0] if marks else 0 if "gain" in raster.coords else None if raster.dtype.kind != "f" else np.nan


def unpacked(raster):
    """Values of a raster in their unit, NaN for no data, without the attributes of packing."""
    stored, (scale, offset) = _storage(raster), scale_and_offset(raster)
    scaled = (scale, offset) != (1.0, 0.0)
    if scaled and raster.dtype.kind == "f":
        raise ValueError(
            f"{raster.name or 'the raster'} has fractions but also scale_factor {scale:g}, add_offset {offset:g}: "
            "if they were applied, remove them from .attrs; otherwise open the file with mask_and_scale=True"
        )
    if not scaled and not stored.keys() & NO_DATA_ATTRIBUTES:
        return raster
    marks = {float(mark) for name in NO_DATA_ATTRIBUTES if name in stored for mark in np.ravel(stored[name])}
    marks = sorted(mark for mark in marks if not np.isnan(mark))
    if not scaled and not marks:
        return raster
    cells = raster if raster.dtype.kind == "f" else raster.astype(float)
    for mark in marks:
        cells = cells.where(raster != mark)
    cells = cells * scale + offset if scaled else cells
    kept = {name: value for name, value in raster.attrs.items() if name not in STORAGE}
    cells = cells.drop_attrs(deep=False).assign_attrs(kept).rename(raster.name)
    cells.encoding = {}
    return cells


def _storage(raster):
    """Attributes, and for stored numbers also the encoding from the file."""
    return {**raster.attrs, **raster.encoding} if raster.dtype.kind in "iu" else raster.attrs


# Range of reflectance factors; glint, snow and slopes in low sun stay within. [1]
LOWEST, HIGHEST = -0.5, 5.0

# Distance of the rows in which the scale of a raster from fifesim is checked. [row]
SAMPLED_ROWS = 16

PER_MICROMETRE = dict.fromkeys(
    ("um", "µm", "μm", "micrometer", "micrometers", "micrometre", "micrometres", "micron", "microns"), 1.0
) | dict.fromkeys(("nm", "nanometer", "nanometers", "nanometre", "nanometres"), 1000.0)
"""Spellings of units of wavelengths, in lower case, and how many of them are a micrometre."""


def incoming(raster, name):
    """User-supplied raster in the form of the stages, dims ([band], y, x), lazy where it was."""
    # Reflectance beyond -0.5 to 5 raises ValueError when it is computed. Rows of rasters from fifesim are sampled.
    array = _bands_as_one(raster, name)
    if "gain" in array.coords:
        return array
    array = in_micrometres(_named(north_up(array)))
    if "atmosphere" in array.attrs and array.dtype.kind == "f":
        if array.chunks is None and array.dims[-2:] in (("y", "x"), ("line", "sample")):
            check_scale(array.values)
            return array
        # A lazy raster with an origin is unchanged since fifesim made it.
        return array if origin_of(array) is not None else chunks.pointwise(check_scale, array, dtype=array.dtype)
    return _physical(array, name)


def in_micrometres(array):
    """Raster with its wavelengths in micrometres."""
    given = array.coords.variables.get("wavelength")
    if given is None:
        return array
    found = xr.Variable(given.dims, micrometres(given), cf.attributes("wavelength"))
    return grids.with_coordinates(array, {"wavelength": found})


def micrometres(wavelength):
    """Wavelengths in micrometres, from the unit in their attribute. [um]"""
    unit = str(wavelength.attrs.get("units", "um")).strip()
    if unit.lower() not in PER_MICROMETRE:
        raise ValueError(f"wavelength has units {unit!r}: they are to be um or nm")
    values = np.asarray(wavelength.values, float) / PER_MICROMETRE[unit.lower()]
    if values.size and not np.max(values) <= LONGEST:
        raise ValueError(
            f"wavelength reaches {np.max(values):g} um: if these are nanometres, set "
            "raster.wavelength.attrs['units'] = 'nm'"
        )
    return values


def check_reflectance(values):
    """Raise ValueError for impossible reflectance."""
    wrong = (values < LOWEST) | (values > HIGHEST)
    if np.any(wrong):
        raise ValueError(
            f"reflectance of {values[wrong].flat[0]:g}: it is a fraction, and {LOWEST:g} to {HIGHEST:g} is allowed. "
            "Mask no data with .where(raster != nodata), multiply scaled values by their scale (0.01 for percent, "
            "0.0001 where 1 is written 10000), and calibrate digital numbers with fifesim.calibrate"
        )
    if values.size and np.mean(values > 1) > 0.5:
        warn(
            "most values of a block are reflectances above 1, which is implausible: if they are percent, divide by "
            "100; if they are scaled, multiply them by their scale"
        )
    return values


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
    # The attributes of a band have precedence over those of the Dataset.
    shared = {key: raster.attrs[key] for key in STORAGE if key in raster.attrs}
    own = [raster[key].assign_attrs(shared | raster[key].attrs) for key in bands]
    kinds = {repr([each.attrs.get(key) for key in STORAGE]) for each in own}
    parts = own if len(kinds) == 1 else [_physical(each, name) for each in own]
    index = xr.DataArray([_called(each) for each in own], dims="band", name="band")
    joined = xr.concat(parts, dim=index, combine_attrs="drop_conflicts", coords="minimal", compat="override")
    return joined.transpose(..., "band", "y", "x").rename(name)


def _called(band):
    """Name of a variable, or its long name if rioxarray has numbered it."""
    long_name = band.attrs.get("long_name")
    numbered = re.fullmatch(r"band_\d+", str(band.name)) is not None
    return long_name if numbered and isinstance(long_name, str) and long_name else str(band.name)


def _named(array):
    """Name bands by ``long_name`` if the coordinate has only numbers, which count the names from 1."""
    names = array.attrs.get("long_name")
    if "band" not in array.coords or array["band"].dtype.kind not in "iu" or isinstance(names, str) or not names:
        return array
    numbers = array["band"].values
    if np.min(numbers) < 1 or np.max(numbers) > len(names):
        return array
    attrs = {key: value for key, value in array.attrs.items() if key != "long_name"}
    called = np.asarray([str(each) for each in names])[numbers - 1]
    return array.assign_coords(band=(array["band"].dims, called)).drop_attrs(deep=False).assign_attrs(attrs)


def _physical(array, name):
    """Values in their unit, NaN for no data, checked when they are computed."""
    if array.dtype.kind in "iub" and scale_and_offset(array) == (1.0, 0.0):
        if "FIFESIM" in array.attrs:
            raise ValueError(
                f"{array.name or 'the raster'} is an image that fifesim wrote, without its calibration: open its file "
                "with fifesim.open_image, which brings it back"
            )
        nodata = "" if has_no_data(array) else ", _FillValue=0"
        scaled = f"for scaled reflectance type .assign_attrs(scale_factor=0.0001{nodata}), as its product says"
        counts = "calibrate digital numbers with fifesim.calibrate"
        cures = f"{counts}; {scaled}" if array.dtype.itemsize < 2 else f"{scaled}; {counts}"
        raise ValueError(
            f"{array.name or 'the raster'} holds whole numbers ({array.dtype}) without a scale, where "
            f"{cf.QUANTITIES[name].long_name} is needed: {cures}"
        )
    if array.dtype.kind in "iu" and not has_no_data(array):
        warn(
            f"{array.name or 'the raster'} has no value for no data: if there is one, such as 0, add "
            ".assign_attrs(_FillValue=0), otherwise it is used as reflectance"
        )
    plain = unpacked(array)
    out = chunks.pointwise(check_reflectance, plain, dtype=np.float32 if plain.dtype == np.float32 else float)
    out.attrs = dict(plain.attrs)
    return out
