"""Colours and short names of quantities in pictures."""

import re

import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.colors import ListedColormap, to_hex

from fifesim.grids import cf, projection
from fifesim.grids import grid as grids
from fifesim.sensor.description.instruments import instrument, instrument_names

LAND = ListedColormap(colormaps["gist_earth"](np.linspace(0.3, 0.95, 256)), name="land")
"""Colour map of elevation: matplotlib's terrain colours without blue."""

NO_DATA = "#d9d9d9"
"""Colour of missing data."""

LINE, BAND = "#b2182b", "#f4a582"
"""Colours of a regression line and of its prediction interval."""

PERCENTILES = 1, 99
"""Percentiles between which colours run by default. [%]"""

# The dark end of a band in a colour composite is the first share of its low percentile. The bright end exceeds its high
# percentile by the second share of their distance. Otherwise anticorrelated bands, such as red and near infrared, would
# give pure colours. [1]
_DARK, _BEYOND = 0.7, 0.1

_UNKNOWN = cf.Quantity("1", "", "values")


def colours_of(name):
    """Colour map of a quantity, and the value about which it diverges or None."""
    quantity = cf.QUANTITIES.get(name, _UNKNOWN)
    return LAND if quantity.colours == LAND.name else colormaps[quantity.colours], quantity.middle


def stops_of(colours):
    """Colours at nine equal steps of a colour map, such as ``#ffffe5``."""
    return [to_hex(colours(share)) for share in np.linspace(0, 1, 9)]


def finite(values):
    """Finite values of an array or a raster, shape (n,)."""
    values = np.asarray(values, float).ravel()
    return values[np.isfinite(values)]


def percentile_limits(values, percentiles=PERCENTILES, middle=None):
    """Limits of a colour scale by percentiles, symmetric about `middle` if given; 0 and 1 without values."""
    values = finite(values)
    low, high = np.percentile(values, percentiles).tolist() if values.size else (0.0, 1.0)
    if middle is not None:
        half = max(abs(low - middle), abs(high - middle), 1e-6)
        low, high = middle - half, middle + half
    return low, high


def dark_and_bright(values):
    """Reflectances of a band shown dark and bright in a colour composite, beyond the percentiles on both sides."""
    low, high = percentile_limits(values)
    if low == high:
        return low, high
    dark = min(_DARK * low, low)
    return dark, high + _BEYOND * (high - dark)


def stretched(values, low, high):
    """Brightness of values between dark and bright; 0.5 if all values are equal. [1]"""
    span = high - low
    return np.clip((values - low) / span, 0, 1) if span > 0 else np.where(np.isnan(values), np.nan, 0.5)


def draw_line(axes, fit, span, level=0.95, alpha=0.35):
    """Draw a regression line with its prediction interval over a span of the abscissa."""
    line = np.linspace(*span, 50)
    interval, label = fit.prediction_interval(line, level), f"{100 * level:g} % prediction interval"
    axes.fill_between(line, *interval, color=BAND, alpha=alpha, linewidth=0, label=label)
    axes.plot(line, fit.predict(line), color=LINE, linewidth=2, label="least-squares line")


_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def short_name(array):
    """Short name of a quantity for colour bars."""
    if array.name in cf.QUANTITIES:
        return cf.QUANTITIES[array.name].label
    return str(array.name or array.attrs.get("long_name", "")).replace("_", " ")


def axis_label(name):
    """Name of a quantity with its unit, for an axis."""
    quantity = cf.QUANTITIES[name]
    return f"{quantity.label} {_printed(quantity.shown_units or quantity.units)}".rstrip()


def long_name(array):
    """Name of a quantity with its band, for a title."""
    name = str(array.attrs.get("long_name") or short_name(array) or "values")
    band = array.coords.get("band")
    return f"{band.item()}: {name}" if band is not None and band.ndim == 0 else capital(name)


def capital(text):
    """Capitalize the first letter of a text."""
    return text[:1].upper() + text[1:]


def unit(array):
    """Unit of a quantity in brackets, with raised exponents."""
    units = str(array.attrs.get("units", ""))
    known = cf.QUANTITIES.get(array.name, _UNKNOWN)
    # A flux at one time has other units than the sum of a day.
    return _printed(known.shown_units if known.shown_units and units in ("", known.units) else units)


def _printed(units):
    """Units in brackets with raised exponents, empty for 1."""
    if units in ("", "1"):
        return ""
    text = re.sub(r"\bum\b", "µm", units.replace("um-", "µm-"))
    raised = re.sub(r"(?<=[A-Za-zµ])-?\d+", lambda found: found[0].translate(_RAISED), text)
    return f"[{raised}]"


def subject(array):
    """Instrument, day and place of a picture, as far as known."""
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
    """Position of the middle of a map, or of a scan."""
    if {"latitude", "longitude"} <= set(array.coords) and array["latitude"].ndim == 2:
        return position(float(array["longitude"].mean()), float(array["latitude"].mean()))
    if {"y", "x"} <= set(array.dims):
        west, south, east, north = projection.degrees(grids.geobox(array))
        return position((west + east) / 2, (south + north) / 2)
    return ""


def position(longitude, latitude):
    """Longitude and latitude as text."""
    north, east = "N" if latitude >= 0 else "S", "E" if longitude >= 0 else "W"
    return f"{abs(latitude):.2f}° {north}, {abs(longitude):.2f}° {east}"
