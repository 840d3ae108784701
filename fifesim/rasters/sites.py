"""Study sites: their grids, and which scenes were made on them."""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated, Literal, TypeAlias

from affine import Affine
from odc.geo.geobox import GeoBox

from fifesim.base import fife
from fifesim.base.kinds import UNCHECKED, described
from fifesim.rasters import grid as grids
from fifesim.rasters import proj_objects, whereabouts

_NAME = "FIFE"
_FAR = 1.0  # from the site a scene is another place [degree]

# First and last-plus-one row, and column.
Window: TypeAlias = Annotated[tuple[tuple[int, int], tuple[int, int]], UNCHECKED]


def fife_site(
    cell: float,
    window: Window | None = None,
    datum: Literal["NAD83", "NAD27"] = "NAD83",
) -> GeoBox:
    """
    Grid of the FIFE site, 15 km x 15 km in UTM zone 14.

    Parameters
    ----------
    cell : float
        Cell size. [m]
    window : ((int, int), (int, int)), optional
        First and last-plus-one row, and column, of a part of the site. [cell]
    datum : {"NAD83", "NAD27"}, optional
        NAD83 has its corner at 704970 E 4334220 N, on the 30 m lattice of today's elevation models;
        NAD27 is FIFE's own, with its corner at 705000 E 4334000 N, about 9 m from there.

    Returns
    -------
    grid : odc.geo.geobox.GeoBox
        As many whole cells as fit.

    Raises
    ------
    ValueError
        If cell, window or datum make no grid.

    Examples
    --------
    >>> from fifesim import fife_site
    >>> fife_site(30).shape
    Shape2d(x=500, y=500)
    """
    if datum not in fife.CORNERS:
        raise ValueError(f"datum must be one of {', '.join(fife.CORNERS)}, got {datum!r}")
    if not 0 < cell <= fife.SIZE:
        raise ValueError(f"cell must be in (0, {fife.SIZE:g}] m, got {cell:g}")
    crs, west, north = fife.CORNERS[datum]
    size = int(fife.SIZE / cell + 1e-6)
    site = GeoBox((size, size), Affine(cell, 0.0, west, 0.0, -cell, north), crs)
    return site if window is None else _window(site, window)


def on_fife_site(grid):
    """
    Whether the middle of a grid lies on the FIFE site, where the paper's sun and air hold.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox

    Returns
    -------
    answer : bool

    Examples
    --------
    >>> on_fife_site(fife_site(300.0)), on_fife_site(fife_site(300.0).pad(50)[:50, :50])
    (True, False)
    """
    return _within(*whereabouts.middle(grid))


def made_on_site(grid):
    """
    Attributes of a scene that is made on a grid.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox

    Returns
    -------
    attributes : dict of str
        ``site`` where it is the FIFE site: a scene that is made there has the paper's sun by default.
    """
    return {"site": _NAME} if on_fife_site(grid) else {}


def is_fife(array):
    """
    Whether a raster comes of a scene that was made on the FIFE site.

    Parameters
    ----------
    array : xarray.DataArray

    Returns
    -------
    made : bool
    """
    if array.attrs.get("site") != _NAME or not {"y", "x"} <= set(array.dims):
        return False
    # Arithmetic spreads attributes, so that the place counts too.
    longitude, latitude = whereabouts.middle(grids.geobox(array))
    return max(abs(longitude - fife.LONGITUDE), abs(latitude - fife.LATITUDE)) < _FAR


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


@lru_cache(maxsize=256)
def _within(longitude, latitude):
    """Whether a place lies on the site: it is asked of one grid many times, and a transformer takes milliseconds."""
    if max(abs(longitude - fife.LONGITUDE), abs(latitude - fife.LATITUDE)) > 1:
        return False
    crs, west, north = fife.CORNERS["NAD83"]
    x, y = proj_objects.transformer(4326, crs).transform(longitude, latitude)
    # The corner of one datum is 9 m from that of the other.
    return max(abs(x - west - fife.SIZE / 2), abs(y - north + fife.SIZE / 2)) <= fife.SIZE / 2 + 10
