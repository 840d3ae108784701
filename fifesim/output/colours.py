"""Colours of quantities, and the values between which they run."""

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import ListedColormap, to_hex

from fifesim.rasters import cf

LAND = ListedColormap(colormaps["gist_earth"](np.linspace(0.3, 0.95, 256)), name="land")
"""Colour map of elevation: that of matplotlib without the blue of its seas."""

NO_DATA = "#d9d9d9"
"""Colour of what has no data."""

LINE, BAND = "#b2182b", "#f4a582"
"""Colours of a regression line and of its prediction interval."""

PERCENTILES = 1, 99
"""Percentiles between which colours run by default. [%]"""

# The dark end of a band in a colour composite is this share of its low percentile, and the bright end is beyond its
# high one by the other share of their distance: bands that vary against each other, as red and near infrared do,
# would else leave pure colours. [1]
_DARK, _BEYOND = 0.7, 0.1

_STOPS = 9

_UNKNOWN = cf.Quantity("1", "", "values")


def colours_of(name):
    """
    Colour map of a quantity.

    Parameters
    ----------
    name : str
        A key of `fifesim.rasters.cf.QUANTITIES`; other names have the colours of an unknown quantity.

    Returns
    -------
    colours : matplotlib.colors.Colormap
    middle : float or None
        Value about which they diverge.
    """
    quantity = cf.QUANTITIES.get(name, _UNKNOWN)
    return LAND if quantity.colours == LAND.name else colormaps[quantity.colours], quantity.middle


def stops_of(colours):
    """
    Colours at equal steps of a colour map, from which a ramp is drawn.

    Parameters
    ----------
    colours : matplotlib.colors.Colormap

    Returns
    -------
    stops : list of str, length 9
        Such as ``#ffffe5``.
    """
    return [to_hex(colours(share)) for share in np.linspace(0, 1, _STOPS)]


def finite(values):
    """
    Finite values of an array or a raster.

    Parameters
    ----------
    values : array or xarray.DataArray

    Returns
    -------
    values : array, shape (n,)
    """
    values = np.asarray(values, float).ravel()
    return values[np.isfinite(values)]


def percentile_limits(values, percentiles=PERCENTILES, middle=None):
    """
    Values of the first and the last colour.

    Parameters
    ----------
    values : array or xarray.DataArray
        NaN is passed over.
    percentiles : (float, float), optional
        [%]
    middle : float, optional
        Value from which the colours diverge to both sides.

    Returns
    -------
    low, high : float
        0 and 1 where there are no values.

    Examples
    --------
    >>> percentile_limits(np.linspace(0.1, 0.2, 101), (0, 100))
    (0.1, 0.2)
    >>> percentile_limits([0.8, 1.5], (0, 100), middle=1.0)
    (0.5, 1.5)
    """
    values = finite(values)
    low, high = (float(each) for each in np.percentile(values, percentiles)) if values.size else (0.0, 1.0)
    if middle is not None:
        half = max(abs(low - middle), abs(high - middle), 1e-6)
        low, high = middle - half, middle + half
    return low, high


def dark_and_bright(values):
    """
    Values of a band that become dark and bright in a colour composite, beyond the percentiles on both sides.

    Parameters
    ----------
    values : array or xarray.DataArray
        NaN is passed over.

    Returns
    -------
    dark, bright : float

    Examples
    --------
    >>> dark, bright = dark_and_bright(np.linspace(0.1, 0.2, 101))
    >>> round(dark, 4), round(bright, 4)
    (0.0707, 0.2118)
    """
    low, high = percentile_limits(values)
    if low == high:
        return low, high
    dark = min(_DARK * low, low)
    return dark, high + _BEYOND * (high - dark)
