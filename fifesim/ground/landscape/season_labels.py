"""Growth of leaf area over a season."""

from __future__ import annotations

import numpy as np
import xarray as xr

from fifesim.base.annotations import Times
from fifesim.base.times import utc
from fifesim.grids import cf
from fifesim.grids.sites import one_or_several


def double_logistic(day, green_up, senescence, width):
    r"""
    Relative leaf area over a season.

    .. math:: f = \frac{1}{1 + e^{-(t - s) / w}} + \frac{1}{1 + e^{(t - e) / w}} - 1

    Parameters
    ----------
    day : array
        Day of the year, :math:`t`. [day]
    green_up, senescence : float
        Days of half of the growth and half of the decline, :math:`s, e`. [day]
    width : float
        Time constant of both, :math:`w`. [day]

    Returns
    -------
    growth : array, shape of day
        0 in winter, almost 1 in summer. [1]

    References
    ----------
    [Beck2006]_, Eq. 3

    Examples
    --------
    >>> double_logistic(np.array([0.0, 130.0, 205.0, 280.0]), 130.0, 280.0, 10.0).round(2).tolist()
    [0.0, 0.5, 1.0, 0.5]
    """
    day = np.asarray(day, float)
    return 1 / (1 + np.exp(-(day - green_up) / width)) + 1 / (1 + np.exp((day - senescence) / width)) - 1


def phenology(
    time: Times, *, green_up: float, senescence: float, width: float = 10.0, winter: float = 0.0
) -> xr.DataArray:
    """
    Growth by date, to be multiplied with a raster of the largest leaf area.

    Parameters
    ----------
    time : sequence of str or datetime
        Dates.
    green_up, senescence : float
        Days of the year of half of the growth and of half of the decline. [day]
    width : float, optional
        Time constant of both. [day]
    winter : float, optional
        Growth outside of the season, 0 to 1. [1]

    Returns
    -------
    growth : xarray.DataArray, dims (time)
        From ``winter`` to 1. [1]

    Raises
    ------
    ValueError
        If senescence is not after green-up, the width is not positive, or winter is out of range.

    See Also
    --------
    fifesim.ground.landscape.season_labels.double_logistic

    Examples
    --------
    >>> import fifesim
    >>> dates = ["1987-03-01T16:35Z", "1987-07-10T16:35Z"]
    >>> fifesim.phenology(dates, green_up=125, senescence=280, winter=0.1).values.round(2).tolist()
    [0.1, 1.0]
    """
    if not senescence > green_up:
        raise ValueError(
            f"senescence must be after green_up, got {senescence:g} and {green_up:g}: give days of the year"
        )
    if not (width > 0 and 0 <= winter <= 1):
        raise ValueError(f"width must be above 0 and winter from 0 to 1, got {width:g} and {winter:g}")
    times = one_or_several(time)
    stamps = [utc(one)[0] for one in (times if np.ndim(times) else [times])]
    day = np.array([stamp.dayofyear + stamp.hour / 24 for stamp in stamps])
    values = winter + (1 - winter) * double_logistic(day, green_up, senescence, width)
    dates = np.array([stamp.tz_localize(None).to_datetime64() for stamp in stamps])
    return xr.DataArray(
        values, {"time": ("time", dates, cf.TIME_ATTRIBUTES)}, ("time",), "growth",
        {"long_name": "growth of leaf area", "units": "1"},
    )  # fmt: skip
