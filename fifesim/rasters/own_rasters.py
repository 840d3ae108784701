"""A raster as its owner has it, made one that the stages take: bands in order, north up, in its physical unit."""

import numpy as np
import xarray as xr

from fifesim.rasters import cf, chunks
from fifesim.rasters.axes import check_axes, is_scan, north_up
from fifesim.rasters.packed import STORAGE, scale_and_offset, unpacked

# A reflectance factor beyond these is none: glint, snow and slopes in low sun stay within. [1]
LOWEST, HIGHEST = -0.5, 5.0

# Wavelengths of light that the Sun sends, in micrometres, end before they would begin in nanometres.
_LONGEST = 100.0
_NANOMETRES = {"nm", "nanometer", "nanometers", "nanometre", "nanometres"}
_MICROMETRES = {"um", "µm", "μm", "micron", "microns", "micrometer", "micrometers", "micrometre", "micrometres"}


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
        Lazy where it was; a reflectance beyond -0.5 to 5 is refused when it is computed. What fifesim made passes as it
        is. [1]

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
        return array
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
    values, unit = np.asarray(given.values, float), str(given.attrs.get("units", "um")).strip()
    if unit in _NANOMETRES:
        values = values / 1000
    elif unit not in _MICROMETRES:
        raise ValueError(f"wavelength has units {unit!r}: they are to be um or nm")
    if values.size and not np.max(values) <= _LONGEST:
        raise ValueError(
            f"wavelength reaches {np.max(values):g} um: where these are nanometres, say so by "
            "raster.wavelength.attrs['units'] = 'nm'"
        )
    return array.assign_coords(wavelength=(given.dims, values, cf.attributes("wavelength")))


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

    Examples
    --------
    >>> float(check_reflectance(np.array([0.2, np.nan]))[0])
    0.2
    """
    wrong = (values < LOWEST) | (values > HIGHEST)
    if np.any(wrong):
        raise ValueError(
            f"reflectance of {values[wrong].flat[0]:g}: it is a fraction, and {LOWEST:g} to {HIGHEST:g} is allowed. "
            "Mask no data with .where(raster != nodata), divide scaled values by their scale, and calibrate digital "
            "numbers with fifesim.calibrate"
        )
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
    said = {repr([raster[key].attrs.get(each) for each in STORAGE]) for key in bands}
    parts = [raster[key] if len(said) == 1 else _physical(raster[key], name) for key in bands]
    index = xr.DataArray([str(key) for key in bands], dims="band", name="band")
    joined = xr.concat(parts, dim=index, combine_attrs="drop_conflicts", coords="minimal", compat="override")
    return joined.transpose(..., "band", "y", "x").rename(name)


def _named(array):
    """Bands by the names in ``long_name``, where the coordinate has none but numbers."""
    names = array.attrs.get("long_name")
    if "band" not in array.dims or isinstance(names, str) or len(names or ()) != array.sizes["band"]:
        return array
    if "band" in array.coords and array["band"].dtype.kind not in "iu":
        return array
    attrs = {key: value for key, value in array.attrs.items() if key != "long_name"}
    return array.assign_coords(band=[str(each) for each in names]).drop_attrs(deep=False).assign_attrs(attrs)


def _physical(array, name):
    """Values in their unit, NaN where there are no data; looked at when they are computed."""
    if array.dtype.kind in "iub" and scale_and_offset(array) == (1.0, 0.0):
        raise ValueError(
            f"{array.name or 'the raster'} holds whole numbers ({array.dtype}) without a scale, where "
            f"{cf.QUANTITIES[name].long_name} is needed: type .assign_attrs(scale_factor=0.0001) for what scales them, "
            "or calibrate digital numbers with fifesim.calibrate"
        )
    plain = unpacked(array)
    out = chunks.pointwise(check_reflectance, plain, dtype=np.float32 if plain.dtype == np.float32 else float)
    out.attrs = dict(plain.attrs)
    return out
