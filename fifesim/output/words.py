"""What a raster is, in the words of a picture: quantity, unit, instrument, date and place."""

import re

import numpy as np
import pandas as pd

from fifesim.rasters import cf, projection
from fifesim.rasters import grid as grids
from fifesim.sensor.description.instruments import instrument, instrument_names

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def short_name(array):
    """
    A quantity as a colour bar names it.

    Parameters
    ----------
    array : xarray.DataArray

    Returns
    -------
    name : str
    """
    if array.name in cf.QUANTITIES:
        return cf.QUANTITIES[array.name].label
    return str(array.name or array.attrs.get("long_name", "")).replace("_", " ")


def axis_label(name):
    """
    A quantity with its unit, as an axis names it.

    Parameters
    ----------
    name : str
        A key of `fifesim.rasters.cf.QUANTITIES`.

    Returns
    -------
    text : str

    Examples
    --------
    >>> axis_label("lai"), axis_label("fpar")
    ('LAI [m² m⁻²]', 'FPAR')
    """
    quantity = cf.QUANTITIES[name]
    return " ".join(filter(None, [quantity.label, _printed(quantity.shown_units or quantity.units)]))


def long_name(array):
    """
    A quantity as a title names it, with its band.

    Parameters
    ----------
    array : xarray.DataArray

    Returns
    -------
    name : str
    """
    name = str(array.attrs.get("long_name") or short_name(array) or "values")
    band = array.coords.get("band")
    return f"{band.item()}: {name}" if band is not None and band.ndim == 0 else capital(name)


def capital(text):
    """
    A text with its first letter as a capital.

    Parameters
    ----------
    text : str

    Returns
    -------
    text : str
    """
    return text[:1].upper() + text[1:]


def unit(array):
    """
    Unit of a quantity in brackets, with raised exponents.

    Parameters
    ----------
    array : xarray.DataArray

    Returns
    -------
    unit : str
        Empty for a number without one.

    Examples
    --------
    >>> import xarray as xr
    >>> unit(xr.DataArray(0, attrs={"units": "W m-2 sr-1 um-1"}))
    '[W m⁻² sr⁻¹ µm⁻¹]'
    """
    units = str(array.attrs.get("units", ""))
    known = cf.QUANTITIES.get(array.name)
    return _printed((known and known.shown_units) or units)


def _printed(units):
    """Units in brackets with raised exponents, empty for 1."""
    if units in ("", "1"):
        return ""
    text = re.sub(r"\bum\b", "µm", units.replace("um-", "µm-"))
    raised = re.sub(r"(?<=[A-Za-zµ])-?\d+", lambda found: found[0].translate(_RAISED), text)
    return f"[{raised}]"


def subject(array):
    """
    Whose picture it is: the instrument, the day and the place, as far as they are known.

    Parameters
    ----------
    array : xarray.DataArray

    Returns
    -------
    subject : str
    """
    return ", ".join(filter(None, [_instrument(array), _day(array), _place(array)]))


def _instrument(array):
    name = str(array.attrs.get("instrument", ""))
    return instrument(name).title if name in instrument_names() else name


def _day(array):
    time = array.coords.get("time")
    if time is None or time.ndim or not np.issubdtype(time.dtype, np.datetime64):
        return ""
    stamp = pd.Timestamp(time.item() if time.dtype == "datetime64[ns]" else time.values)
    return "" if stamp is pd.NaT else f"{stamp.day} {stamp:%B %Y}"


def _place(array):
    """Latitude and longitude of the middle of a map, or of a scan."""
    if {"latitude", "longitude"} <= set(array.coords) and array["latitude"].ndim == 2:
        latitude, longitude = float(array["latitude"].mean()), float(array["longitude"].mean())
    elif {"y", "x"} <= set(array.dims):
        west, south, east, north = projection.degrees(grids.geobox(array))
        latitude, longitude = (south + north) / 2, (west + east) / 2
    else:
        return ""
    return (
        f"{abs(latitude):.2f}° {'N' if latitude >= 0 else 'S'}, {abs(longitude):.2f}° {'E' if longitude >= 0 else 'W'}"
    )
