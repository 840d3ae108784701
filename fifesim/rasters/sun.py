"""Where the sun stands: at one time and place, or at many."""

from __future__ import annotations

import numpy as np
import xarray as xr

from fifesim.base import geometry
from fifesim.base.annotations import Numbers, Times
from fifesim.base.kinds import described
from fifesim.rasters import cf


def sun_position(
    time: Times, latitude: Numbers, longitude: Numbers, altitude: Numbers = 0.0
) -> geometry.Geometry | xr.Dataset:
    """
    Sun at a time and place, or at many.

    Parameters
    ----------
    time : str, datetime, or sequence of them
        Taken as UTC where it names no time zone.
    latitude, longitude : float, or sequence of float
        One place, or one for each time. [degree north, degree east]
    altitude : float, or sequence of float, optional
        [m]

    Returns
    -------
    sun : Geometry, or xarray.Dataset, dims (time,)
        Of one time the geometry with a nadir view. Of a sequence ``sza``, ``saa`` and ``earth_sun_distance`` along
        ``time``; a zenith beyond 90 is a sun below the horizon. [degree, degree, astronomical unit]

    Raises
    ------
    ValueError
        If it is no time, there is not one place for each, or the sun of a single time is below the horizon.

    References
    ----------
    NREL solar position algorithm, as implemented in pvlib; true (not refracted) zenith

    See Also
    --------
    fifesim.base.geometry.sun_position, fifesim.base.geometry.sun_positions

    Examples
    --------
    >>> from fifesim import sun_position
    >>> season = sun_position(["1987-06-06T16:35Z", "1987-12-06T16:35Z"], 39.06, -96.54)
    >>> season["sza"].round(1).values.tolist()
    [28.5, 66.0]
    """
    values = time.values if isinstance(time, xr.DataArray) else time
    if isinstance(values, xr.Dataset) or np.ndim(values) > 1 or (np.ndim(values) and not len(values)):
        raise ValueError(f"time must be one time, or a list such as ['1987-06-06T16:35Z'], got {described(time)}")
    if not np.ndim(values) and not any(np.ndim(each) for each in (latitude, longitude, altitude)):
        return geometry.sun_position(values, latitude, longitude, altitude)
    places = [np.asarray(each, float) for each in (latitude, longitude, altitude)]
    times = list(values) if np.ndim(values) else [values] * max(each.size for each in places)
    utc, *found = geometry.sun_positions(times, *places)
    names = "sza", "saa", "earth_sun_distance"
    data = {name: ("time", each, cf.attributes(name)) for name, each in zip(names, found, strict=True)}
    return xr.Dataset(data, {"time": ("time", utc, cf.TIME)})


def check_same_sun(geometry, array):
    """
    Refuse a solar zenith angle that differs from the one for which fifesim made a raster.

    Parameters
    ----------
    geometry : Geometry, Dataset or None
    array : xarray.DataArray
        Reflectance at the top of the atmosphere.

    Raises
    ------
    ValueError
        If both are numbers and differ by more than 0.01 degree.
    """
    if geometry is None or "atmosphere" not in array.attrs or "sza" not in array.coords:
        return
    carried, given = array["sza"], geometry.sza
    if carried.ndim == 0 and np.ndim(given) == 0 and abs(float(carried) - float(given)) > 0.01:
        raise ValueError(
            f"{array.name or 'the raster'} was made for sza={float(carried):.2f}, got geometry with "
            f"sza={float(given):.2f}: leave geometry out, or drop the coordinate with .drop_vars('sza')"
        )
