"""Study sites with their grids, and the position of the sun there."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

import numpy as np
import xarray as xr
from affine import Affine
from odc.geo.geobox import GeoBox

from fifesim.base import geometry
from fifesim.base.arguments import UNCHECKED, Numbers, Times, described
from fifesim.base.caches import cached
from fifesim.base.times import SITE_CORNERS, SITE_LATITUDE, SITE_LONGITUDE, SITE_SIZE
from fifesim.grids import cf, projection
from fifesim.grids import grid as grids

_NAME = "FIFE"
_FAR = 1.0  # maximum distance from the site [degree]

# First and last-plus-one row, and column.
CellWindow: TypeAlias = Annotated[tuple[tuple[int, int], tuple[int, int]], UNCHECKED]


def fife_site(
    cell: float,
    window: CellWindow | None = None,
    datum: Literal["NAD83", "NAD27"] = "NAD83",
) -> GeoBox:
    """
    Grid of the FIFE site, 15 km x 15 km in UTM zone 14.

    Parameters
    ----------
    cell : float
        Cell size. [m]
    window : ((int, int), (int, int)), optional
        Part of the site as (start, stop) of rows and of columns. [cell]
    datum : {"NAD83", "NAD27"}, optional
        NAD83 has the corner 704970 E 4334220 N, on the 30 m lattice of current elevation models. NAD27 is the datum of
        FIFE, with the corner 705000 E 4334000 N, about 9 m away.

    Returns
    -------
    grid : odc.geo.geobox.GeoBox
        Grid of whole cells.

    Raises
    ------
    ValueError
        If cell, window or datum is invalid.

    Warns
    -----
    UserWarning
        If cells do not fill the site.

    Examples
    --------
    >>> from fifesim import fife_site
    >>> fife_site(30).shape
    Shape2d(x=500, y=500)
    """
    if not 0 < cell <= SITE_SIZE:
        raise ValueError(f"cell must be in (0, {SITE_SIZE:g}] m, got {cell:g}")
    crs, west, north = SITE_CORNERS[datum]
    size = int(SITE_SIZE / cell + 1e-6)
    if window is None:
        grids.whole_shape((SITE_SIZE,) * 2, (cell,) * 2, "take a cell that divides the site")
    site = GeoBox((size, size), Affine(cell, 0.0, west, 0.0, -cell, north), crs)
    return site if window is None else _window(site, window)


def on_fife_site(grid):
    """Whether the middle of a grid is on the FIFE site, where sun and atmosphere of the paper are valid."""
    return _within(*projection.middle(grid))


def made_on_site(grid):
    """Attributes of a scene made on a grid: ``site`` on the FIFE site, where the sun of the paper is the default."""
    return {"site": _NAME} if on_fife_site(grid) else {}


def is_fife(array):
    """Whether a raster originates from a scene made on the FIFE site."""
    if array.attrs.get("site") != _NAME or not {"y", "x"} <= set(array.dims):
        return False
    # Attributes survive arithmetic, so the position is also checked.
    longitude, latitude = projection.middle(grids.geobox(array))
    return max(abs(longitude - SITE_LONGITUDE), abs(latitude - SITE_LATITUDE)) < _FAR


def _window(site, window):
    try:
        (top, bottom), (left, right) = window
    except (TypeError, ValueError):
        raise ValueError(
            f"window must be ((first row, last row), (first column, last column)), got {described(window)}"
        ) from None
    rows, columns = site.shape
    if not (0 <= top < bottom <= rows and 0 <= left < right <= columns):
        raise ValueError(f"window must lie within {rows} rows and {columns} columns, got {window!r}")
    return site[top:bottom, left:right]


@cached(256, "places on the FIFE site")
def _within(longitude, latitude):
    """Whether a place is on the site, cached because grids are checked often and a transformer takes milliseconds."""
    if max(abs(longitude - SITE_LONGITUDE), abs(latitude - SITE_LATITUDE)) > 1:
        return False
    crs, west, north = SITE_CORNERS["NAD83"]
    x, y = projection.transformer(4326, crs).transform(longitude, latitude)
    # The corners in the two datums lie 9 m apart.
    return max(abs(x - west - SITE_SIZE / 2), abs(y - north + SITE_SIZE / 2)) <= SITE_SIZE / 2 + 10


def sun_position(
    time: Times, latitude: Numbers, longitude: Numbers, altitude: Numbers = 0.0
) -> geometry.Geometry | xr.Dataset:
    """
    Position of the sun for one or several times and places.

    Parameters
    ----------
    time : str, datetime, or sequence of them
        Time, in UTC unless it has a time zone.
    latitude, longitude : float, or sequence of float
        One place, or one for each time. [degree north, degree east]
    altitude : float, or sequence of float, optional
        [m]

    Returns
    -------
    sun : Geometry, or xarray.Dataset, dims (time,)
        For one time, a Geometry with a nadir view. For a sequence, ``sza``, ``saa`` and ``earth_sun_distance`` along
        ``time``; the sun is below the horizon if the zenith angle exceeds 90. [degree, degree, astronomical unit]

    Raises
    ------
    ValueError
        If a time or place is invalid, the numbers of times and places differ, or the sun of a single time is below the
        horizon.

    References
    ----------
    NREL solar position algorithm, as implemented in pvlib; true (not refracted) zenith

    See Also
    --------
    fifesim.Geometry, fifesim.sensor.overpasses

    Examples
    --------
    >>> from fifesim import sun_position
    >>> season = sun_position(["1987-06-06T16:35Z", "1987-12-06T16:35Z"], 39.06, -96.54)
    >>> season["sza"].round(1).values.tolist()
    [28.5, 66.0]
    """
    values = one_or_several(time)
    if not np.ndim(values) and not any(np.ndim(each) for each in (latitude, longitude, altitude)):
        return geometry.sun_geometry(values, latitude, longitude, altitude)
    places = [np.asarray(each, float) for each in (latitude, longitude, altitude)]
    times: list = list(values) if np.ndim(values) else [values] * max(each.size for each in places)
    utc, *found = geometry.sun_positions(times, *places)
    names = "sza", "saa", "earth_sun_distance"
    data = {name: ("time", each, cf.attributes(name)) for name, each in zip(names, found, strict=True)}
    return xr.Dataset(data, {"time": ("time", utc, cf.TIME_ATTRIBUTES)})


def one_or_several(time):
    """One time, or a sequence of times, as given by a user."""
    values = time.values if isinstance(time, xr.DataArray) else time
    if isinstance(values, xr.Dataset) or np.ndim(values) > 1 or (np.ndim(values) and not len(values)):
        raise ValueError(f"time must be one time, or a list such as ['1987-06-06T16:35Z'], got {described(time)}")
    return values


def check_same_angles(geometry, array, *names):
    """Raise ValueError for a zenith angle, sza or vza, that differs from the one with which fifesim made a raster."""
    if geometry is None or "atmosphere" not in array.attrs:
        return
    for name in names:
        carried, given = array.coords.variables.get(name), getattr(geometry, name)
        if carried is None:
            continue
        if carried.ndim == 0 and np.ndim(given) == 0 and abs(float(carried) - float(given)) > 0.01:
            raise ValueError(
                f"{array.name or 'the raster'} was made for {name}={float(carried):.2f}, got geometry with "
                f"{name}={float(given):.2f}: leave geometry out, or drop the coordinate with .drop_vars('{name}')"
            )
