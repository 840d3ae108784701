"""A raster as its owner has it, made one that the stages take: bands in order, north up, in its physical unit."""

import re

import numpy as np
import xarray as xr

from fifesim.base.bands import LONGEST
from fifesim.base.warned import warn
from fifesim.rasters import cf, chunks
from fifesim.rasters import grid as grids
from fifesim.rasters.axes import check_axes, is_scan, north_up
from fifesim.rasters.origins import origin_of
from fifesim.rasters.packed import STORAGE, has_no_data, scale_and_offset, unpacked

# A reflectance factor beyond these is none: glint, snow and slopes in low sun stay within. [1]
LOWEST, HIGHEST = -0.5, 5.0

# Distance of the rows in which the scale of a raster from fifesim is checked. [row]
SAMPLED_ROWS = 16

PER_MICROMETRE = dict.fromkeys(
    ("um", "µm", "μm", "micrometer", "micrometers", "micrometre", "micrometres", "micron", "microns"), 1.0
) | dict.fromkeys(("nm", "nanometer", "nanometers", "nanometre", "nanometres"), 1000.0)
"""Spellings of units of wavelengths, in lower case, and how many of them are a micrometre."""


def incoming(raster, name):
    """
    A raster of one's own as the stages take it.

    Parameters
    ----------
    raster : xarray.DataArray, or xarray.Dataset of bands over (y, x)
        Whole numbers say their scale by ``scale_factor`` and ``add_offset``, cells without data by ``_FillValue`` or
        ``nodata``; bands have names as coordinates or in ``long_name``; ``wavelength`` is in um, or in nm where its
        units say so; rows may run from south to north.
    name : str
        The reflectance that it is: a key of `cf.QUANTITIES`.

    Returns
    -------
    raster : xarray.DataArray, dims ([band], y, x)
        Lazy where it was; a reflectance beyond -0.5 to 5 is refused when it is computed. Rows of a raster from fifesim
        are sampled, because arithmetic keeps its attributes. [1]

    Raises
    ------
    ValueError
        If whole numbers say no scale, it is not said whether a scale was applied, wavelengths have another unit, or the
        dimensions are others.
    TypeError
        If it is no raster.
    """
    array = _bands_as_one(raster, name)
    if "gain" in array.coords:
        return array
    array = in_micrometres(_named(north_up(array)))
    if "atmosphere" in array.attrs and array.dtype.kind == "f":
        # A lazy raster with an origin is as fifesim made it.
        known = origin_of(array) is not None
        return array if known else chunks.pointwise(check_scale, array, dtype=array.dtype)
    return _physical(array, name)


def in_micrometres(array):
    """
    A raster with its wavelengths in micrometres.

    Parameters
    ----------
    array : xarray.DataArray
        With a coordinate ``wavelength``, or without.

    Returns
    -------
    array : xarray.DataArray

    Raises
    ------
    ValueError
        If they have no unit and are too long to be in micrometres, or have another unit.
    """
    if "wavelength" not in array.coords:
        return array
    given = array.coords["wavelength"]
    found = xr.Variable(given.dims, micrometres(given), cf.attributes("wavelength"))
    return grids.with_coordinates(array, {"wavelength": found})


def micrometres(wavelength):
    """
    Wavelengths in micrometres.

    Parameters
    ----------
    wavelength : xarray.DataArray
        In um, or in the unit that its attribute ``units`` states.

    Returns
    -------
    values : array
        [um]

    Raises
    ------
    ValueError
        If they have no unit and are too long to be in micrometres, or have another unit.
    """
    unit = str(wavelength.attrs.get("units", "um")).strip()
    if unit.lower() not in PER_MICROMETRE:
        raise ValueError(f"wavelength has units {unit!r}: they are to be um or nm")
    values = np.asarray(wavelength.values, float) / PER_MICROMETRE[unit.lower()]
    if values.size and not np.max(values) <= LONGEST:
        raise ValueError(
            f"wavelength reaches {np.max(values):g} um: where these are nanometres, say so by "
            "raster.wavelength.attrs['units'] = 'nm'"
        )
    return values


def check_reflectance(values):
    """
    Refuse what cannot be a reflectance.

    Parameters
    ----------
    values : array
        [1]

    Returns
    -------
    values : array
        The same.

    Raises
    ------
    ValueError
        If a value is below -0.5 or beyond 5.

    Warns
    -----
    UserWarning
        If most are above 1.

    Examples
    --------
    >>> float(check_reflectance(np.array([0.2, np.nan]))[0])
    0.2
    """
    wrong = (values < LOWEST) | (values > HIGHEST)
    if np.any(wrong):
        raise ValueError(
            f"reflectance of {values[wrong].flat[0]:g}: it is a fraction, and {LOWEST:g} to {HIGHEST:g} is allowed. "
            "Mask no data with .where(raster != nodata), multiply scaled values by their scale (0.01 for percent, "
            "0.0001 where 1 is written 10000), and calibrate digital numbers with fifesim.calibrate"
        )
    if values.size and np.mean(values > 1) > 0.5:
        warn(
            "most values of a block are reflectances above 1, as no ground has: where they are percent, divide them by "
            "100, and where they are scaled, multiply them by their scale"
        )
    return values


def check_scale(values):
    """
    Refuse a raster from fifesim that was multiplied by 100 or 10000 afterwards.

    Parameters
    ----------
    values : array, shape (..., y, x)
        [1]

    Returns
    -------
    values : array
        The same.

    Raises
    ------
    ValueError
        As in `check_reflectance`.

    Warns
    -----
    UserWarning
        As in `check_reflectance`.

    Examples
    --------
    >>> check_scale(np.array([[0.2, 0.3]])).shape
    (1, 2)
    """
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
    # What is said of all of them, a band may say otherwise.
    shared = {key: raster.attrs[key] for key in STORAGE if key in raster.attrs}
    own = [raster[key].assign_attrs(shared | raster[key].attrs) for key in bands]
    said = {repr([each.attrs.get(key) for key in STORAGE]) for each in own}
    parts = own if len(said) == 1 else [_physical(each, name) for each in own]
    index = xr.DataArray([_called(each) for each in own], dims="band", name="band")
    joined = xr.concat(parts, dim=index, combine_attrs="drop_conflicts", coords="minimal", compat="override")
    return joined.transpose(..., "band", "y", "x").rename(name)


def _called(band):
    """Name of a variable, or of what it says that it is where rioxarray has counted it."""
    said = band.attrs.get("long_name")
    return said if re.fullmatch(r"band_\d+", str(band.name)) and isinstance(said, str) and said else str(band.name)


def _named(array):
    """Bands by the names in ``long_name``, where the coordinate has none but numbers, which count the names from 1."""
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
    """Values in their unit, NaN where there are no data; looked at when they are computed."""
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
            f"{array.name or 'the raster'} says no value for cells without data: where there are any, such as 0, add "
            ".assign_attrs(_FillValue=0), else they count as reflectance"
        )
    plain = unpacked(array)
    out = chunks.pointwise(check_reflectance, plain, dtype=np.float32 if plain.dtype == np.float32 else float)
    out.attrs = dict(plain.attrs)
    return out
