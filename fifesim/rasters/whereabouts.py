"""Where on the Earth grids and files lie, as numbers and in words."""

from functools import lru_cache

import numpy as np
import pyproj
from odc.geo.crs import CRS

from fifesim.rasters import proj_objects, projection


def middle(grid):
    """
    Longitude and latitude of the middle of a grid.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox

    Returns
    -------
    longitude, latitude : float
        East of Greenwich, and north; a datum, 100 m, does not matter here. [degree]
    """
    x, y = projection.transform_points(grid.affine, grid.shape.x / 2, grid.shape.y / 2)
    return degrees_at(_wkt(str(grid.crs)), float(x), float(y))


@lru_cache(maxsize=64)
def _wkt(crs):
    """A CRS in full: it takes longer to write than all else that a small scene asks of its place."""
    return CRS(crs).to_wkt()


@lru_cache(maxsize=256)
def degrees_at(crs, x, y):
    """
    Longitude and latitude of a place.

    Parameters
    ----------
    crs : pyproj.CRS or str
    x, y : float

    Returns
    -------
    longitude, latitude : float
        As of `middle`; infinite where the CRS does not reach. [degree]
    """
    return tuple(float(each) for each in proj_objects.transformer(crs, 4326).transform(x, y))


def place_in_words(longitude, latitude):
    """
    A place as messages name it.

    Parameters
    ----------
    longitude, latitude : float
        [degree]

    Returns
    -------
    text : str

    Examples
    --------
    >>> place_in_words(28.2, -25.125)
    'latitude -25.12, longitude 28.20'
    """
    return f"latitude {latitude:.2f}, longitude {longitude:.2f}"


def lies_in_words(affine, shape, crs):
    """
    Where rows and columns of a file lie, as messages say it.

    Parameters
    ----------
    affine : affine.Affine
    shape : (int, int)
        Rows and columns.
    crs : pyproj.CRS, or what it takes

    Returns
    -------
    text : str
    """
    crs = pyproj.CRS.from_user_input(crs)
    rows, columns = np.meshgrid([0, shape[0]], [0, shape[1]])
    x, y = projection.transform_points(affine, columns, rows)
    digits = 4 if crs.is_geographic else 0
    found = f"{x.min():.{digits}f} to {x.max():.{digits}f} E and {y.min():.{digits}f} to {y.max():.{digits}f} N"
    found += f" in {projection.name_of(crs)}"
    place = degrees_at(crs, x.mean(), y.mean())
    return found if crs.is_geographic or not np.isfinite(place).all() else f"{found} ({place_in_words(*place)})"
