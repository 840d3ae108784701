"""Coordinates from one reference system to another, by operations whose accuracy is known."""

import warnings

import numpy as np
import pyproj
from pyproj.aoi import AreaOfInterest
from pyproj.transformer import TransformerGroup


def operation(source, target, area=None):
    """
    Coordinate operation of known accuracy from one CRS to another.

    Where no direct one is known, the route through WGS 84 is taken if both of its steps are. A change of datum by
    identity of latitude and longitude (PROJ's "ballpark") never is: between NAD27 and NAD83 it is 30 m off in Kansas.

    Parameters
    ----------
    source, target : CRS or str
        Anything that pyproj takes.
    area : (float, float, float, float), optional
        West, south, east, north of the data; picks among regional operations. [degree]

    Returns
    -------
    pipeline : str or None
        PROJ pipeline in the axis order of the two CRSs; None where they are the same.
    accuracy : float
        [m]

    Raises
    ------
    ValueError
        If no operation of known accuracy exists.

    Examples
    --------
    >>> operation("EPSG:26714", "EPSG:26914", (-96.6, 39.0, -96.5, 39.1))[1]
    11.0
    """
    source, target = pyproj.CRS.from_user_input(source), pyproj.CRS.from_user_input(target)
    if source.equals(target, ignore_axis_order=True):
        return None, 0.0
    direct = _best(source, target, area)
    if direct:
        return _pipeline(direct), float(direct.accuracy)
    wgs84 = pyproj.CRS.from_epsg(4326)
    steps = _best(source, wgs84, area), _best(wgs84, target, area)
    if all(steps):
        return _pipeline(*steps), float(sum(step.accuracy for step in steps))
    raise ValueError(
        f"no operation of known accuracy leads from {_name(source)} to {_name(target)}: PROJ would only assume that "
        "both datums agree ('ballpark'), which can be off by 100 m. Name the datum of the data in its CRS, or install "
        "PROJ's grid files (projsync), or reproject the data yourself"
    )


def carry(pipeline, source, target, x, y):
    """
    Apply a coordinate operation to points.

    Parameters
    ----------
    pipeline : str or None
        From `operation`.
    source, target : CRS or str
        The same as there.
    x, y : array
        Easting or longitude, northing or latitude.

    Returns
    -------
    x, y : array
    """
    if pipeline is None:
        return x, y
    first, second = pyproj.Transformer.from_pipeline(pipeline).transform(*((y, x) if _north_first(source) else (x, y)))
    return (second, first) if _north_first(target) else (first, second)


def _best(source, target, area):
    with warnings.catch_warnings():
        # PROJ names a better operation whose grid file is not installed; the accuracy of the one taken is known.
        warnings.filterwarnings("ignore", "Best transformation is not available")
        around = AreaOfInterest(*area) if area else None
        group = TransformerGroup(source, target, area_of_interest=around, allow_ballpark=False)
    known = [found for found in group.transformers if found.accuracy >= 0]
    return min(known, key=lambda found: found.accuracy, default=None)


def _pipeline(*steps):
    """One PROJ pipeline of one or two, whose steps meet in WGS 84."""
    parts = []
    for step in steps:
        words = step.definition.split()
        parts += words[1:] if words[0] == "proj=pipeline" else ["step", *words]
    return " ".join("+" + word for word in ["proj=pipeline", *parts])


def _north_first(crs):
    """Whether a CRS gives northing or latitude before easting or longitude."""
    return pyproj.CRS.from_user_input(crs).axis_info[0].direction == "north"


def _name(crs):
    return f"EPSG:{crs.to_epsg()}" if crs.to_epsg() else crs.name


def degrees(grid):
    """
    Bounds of a grid in degrees, which pick the regional operation; a datum does not matter to that.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox

    Returns
    -------
    area : (float, float, float, float)
        West, south, east, north. [degree]
    """
    to_degrees = pyproj.Transformer.from_crs(grid.crs.to_wkt(), 4326, always_xy=True)
    return to_degrees.transform_bounds(*grid.boundingbox.bbox)


def convergence(grid):
    """
    Angle from true north to the north of a grid, at its middle; positive where grid north lies east of true north.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox

    Returns
    -------
    angle : float
        [degree]
    """
    crs = pyproj.CRS.from_wkt(grid.crs.to_wkt())
    x, y = transform_points(grid.affine, grid.shape.x / 2, grid.shape.y / 2)
    to_degrees = pyproj.Transformer.from_crs(crs, crs.geodetic_crs, always_xy=True)
    return float(pyproj.Proj(crs).get_factors(*to_degrees.transform(x, y)).meridian_convergence)


def transform_points(affine, columns, rows):
    """
    Apply an affine transform to many points.

    Parameters
    ----------
    affine : affine.Affine
    columns, rows : array
        Positions across and down.

    Returns
    -------
    x, y : array
    """
    columns, rows = np.asarray(columns, float), np.asarray(rows, float)
    return affine.a * columns + affine.b * rows + affine.c, affine.d * columns + affine.e * rows + affine.f
