"""Coordinate transformations of known accuracy, and the location of grids and files on the Earth."""

import re
import threading
import warnings

import numpy as np
import pyproj
from pyproj.aoi import AreaOfInterest
from pyproj.exceptions import CRSError
from pyproj.transformer import TransformerGroup

from fifesim.base.caches import cached
from fifesim.base.files import in_a_line, shown
from fifesim.base.messages import warn


@cached(32, "coordinate transformers")
def transformer(source, target):
    """Transformer between two CRSs, easting or longitude first; threads may share it."""
    return pyproj.Transformer.from_crs(source, target, always_xy=True)


@cached(64, "projections of threads")
def _projection(crs, own_meridian, thread):
    """Projection of a CRS for one thread, because threads must not share it."""
    found = pyproj.Proj(crs)
    return pyproj.Proj(re.sub(r"\+pm=\S+", "", found.srs)) if own_meridian else found


def projection_of(crs, *, own_meridian=False):
    """Projection of a CRS of this thread, with longitudes from Greenwich or, for factors, from its prime meridian."""
    return _projection(crs, own_meridian, threading.get_ident())


# Maximum scale error of a projection. [1]
_SCALE_BOUND = 0.035
# Scale error that causes a warning; UTM zones and most national grids are within. [1]
_SCALE_WARNED = 0.01
# Tolerance of a forward and backward projection; larger errors are outside the valid area. [m]
_RETURNS = 1.0


# Datums whose latitude and longitude are used as if on WGS 84, from which they differ by 2 m at most.
_LIKE_WGS84 = re.compile(
    "(d )?((world geodetic system (of )?|wgs ?)(19)?84|(european terrestrial reference system (of )?|etrs ?)(19)?89"
    "|(north american (datum )?(of )?|nad ?)(19)?83)( ensemble)?"
)
# Radii of spheres for the Earth. [m]
_EARTH = 6.35e6, 6.38e6


def operation(source, target, area=None):
    """PROJ pipeline of known accuracy between two CRSs, None if they are the same."""
    # Without a direct operation the route through WGS 84 is taken if both of its steps are known. A change of datum by
    # identity of latitude and longitude (PROJ's "ballpark") is used for datums that agree with WGS 84 and for spheres
    # only: between NAD27 and NAD83 it is 30 m off in Kansas.
    source, target = pyproj.CRS.from_user_input(source), pyproj.CRS.from_user_input(target)
    if source.equals(target, ignore_axis_order=True):
        return None
    if stated := [crs for crs in (source, target) if '"semi_major"' in crs.to_wkt()]:
        raise ValueError(
            f"{name_of(stated[0])} states a radius (semi_major) that PROJ does not use, so that places are 20 km off: "
            "state the sphere with gdal_edit.py -a_srs '+proj=sinu +R=6371007.181 +units=m' FILE, or .rio.write_crs"
        )
    if direct := _best(source, target, area):
        return _pipeline(direct)
    steps = _by_wgs84(source, area), _by_wgs84(target, area, back=True)
    if all(steps):
        return _pipeline(*steps)
    raise ValueError(
        f"no operation of known accuracy leads from {name_of(source)} to {name_of(target)}: PROJ would only assume "
        "that both datums agree ('ballpark'), which can be off by 100 m. Name the datum of the data in its CRS "
        "(gdal_edit.py -a_srs EPSG:26914 FILE, or .rio.write_crs), or install PROJ's grid files (projsync), or "
        "reproject the data yourself"
    )


def _by_wgs84(crs, area, *, back=False):
    """Step from a CRS to WGS 84, or back, None if its datum is unknown."""
    base, ends = crs.source_crs if crs.is_bound else crs, (4326, crs) if back else (crs, 4326)
    shift, ellipsoid = crs.is_bound and crs.coordinate_operation.towgs84, base.ellipsoid
    # Maps on a sphere are made with geodetic latitude (MODIS, VIIRS, EASE-Grid), which a geocentric shift would change.
    if ellipsoid.inverse_flattening == 0:
        known = not shift and _EARTH[0] < ellipsoid.semi_major_metre < _EARTH[1]
    else:
        known = shift or _LIKE_WGS84.fullmatch(base.datum.name.replace("_", " ").lower())
    return _best(*ends, area) or (_transformers(*ends, area, ballpark=True)[0] if known else None)


def carry(pipeline, source, target, x, y):
    """Apply a coordinate operation to points."""
    if pipeline is None:
        return x, y
    first, second = pyproj.Transformer.from_pipeline(pipeline).transform(*((y, x) if _north_first(source) else (x, y)))
    return (second, first) if _north_first(target) else (first, second)


def _best(source, target, area):
    known = [found for found in _transformers(source, target, area) if found.accuracy >= 0]
    return min(known, key=lambda found: found.accuracy, default=None)


def _transformers(source, target, area, ballpark=False):
    with warnings.catch_warnings():
        # PROJ names a better operation whose grid file is not installed; the accuracy of the one taken is known.
        warnings.filterwarnings("ignore", "Best transformation is not available")
        around = AreaOfInterest(*area) if area else None
        return TransformerGroup(source, target, area_of_interest=around, allow_ballpark=ballpark).transformers


def _pipeline(*steps):
    """One PROJ pipeline from one or two, whose steps meet in WGS 84."""
    parts = []
    for step in steps:
        words = step.definition.split()
        parts += words[1:] if words[0] == "proj=pipeline" else ["step", *words]
    return " ".join("+" + word for word in ["proj=pipeline", *parts])


def _north_first(crs):
    """Whether a CRS gives northing or latitude before easting or longitude."""
    first, second = pyproj.CRS.from_user_input(crs).axis_info[:2]
    # In polar CRSs both axes point north or both south, so use their names.
    return first.name.startswith("North") if first.direction == second.direction else first.direction == "north"


# By text, because the hash of a CRS takes 50 us.
@cached(128, "horizontal parts of CRSs", lambda crs: (type(crs), str(crs)))
def horizontal(crs):
    """Horizontal part of a CRS."""
    try:
        found = pyproj.CRS.from_user_input(crs)
    except (CRSError, RecursionError):
        raise ValueError(
            f"crs = {shown(crs)}: PROJ knows no such coordinate reference system; type one such as 'EPSG:26914'"
        ) from None
    if len(found.axis_info) < 3 or found.is_geocentric:
        return crs
    flat = found.to_2d()
    return f"EPSG:{flat.to_epsg()}" if flat.to_epsg() else flat.to_wkt()


def check_metres(crs, bounds):
    """Raise ValueError if the coordinates of a CRS are not metres east and north at a place."""
    # The scale is the largest and smallest in any direction (Tissot's), at corners and middle. Both axes of a polar CRS
    # point north, or both south.
    name = name_of(crs)
    if not crs.is_projected:
        raise ValueError(f"the CRS must be projected, {name} is not: reproject, for instance to EPSG:26914")
    if not all(axis.unit_name in ("metre", "meter", "m") for axis in crs.axis_info):
        raise ValueError(f"the CRS must be in metres, {name} is in {crs.axis_info[0].unit_name}: reproject")
    ways = {axis.direction for axis in crs.axis_info}
    if ways not in ({"east", "north"}, {"north"}, {"south"}):
        raise ValueError(
            f"the axes of the CRS must point east and north, the axes of {name} point {' and '.join(ways)}"
        )
    west, south, east, north = bounds
    # Comparing texts is faster than comparing CRSs.
    text, found = _wkt(crs), []
    for x, y in (((west + east) / 2, (south + north) / 2), (west, north), (east, north), (west, south), (east, south)):
        scale, longitude, latitude = _scale(text, x, y)
        if scale is None:
            raise ValueError(
                f"west = {west:.10g}, north = {north:.10g}: the grid is outside the area of {name}{_reach(crs)}; "
                "give its corner and size in metres of the CRS"
            )
        if abs(scale - 1) > _SCALE_BOUND:
            raise ValueError(
                f"the scale of {name} is {scale:.3f} at longitude {longitude:.2f}, latitude {latitude:.2f}: a metre of "
                f"a grid may be {_SCALE_BOUND:.1%} off; use another CRS, such as {undistorted(longitude, latitude)}"
            )
        found.append((scale, longitude, latitude))
    scale, longitude, latitude = max(found, key=lambda each: abs(each[0] - 1))
    if abs(scale - 1) > _SCALE_WARNED:
        _warn_of_scale(name, round(scale, 2), round(longitude), round(latitude))


_wkt = cached(64, "WKT of CRSs", str)(pyproj.CRS.to_wkt)


@cached(1024, "places with a warning about scale")
def _warn_of_scale(name, scale, longitude, latitude):
    """Warn of the scale once for each place, because a chain checks at every step."""
    warn(
        f"the scale of {name} is {scale:.2f} near longitude {longitude}, latitude {latitude}: a cell of 30 m is "
        f"{30 / scale:.1f} m on the ground, where slopes, footprints and distances are taken as if it were 30 m; "
        f"{undistorted(longitude, latitude)} is within 1 %"
    )


@cached(1024, "scales of projections")
def _scale(crs, x, y):
    """Scale farthest from 1 at a point, None outside of the CRS, and longitude and latitude. [degree]"""
    plane = projection_of(crs, own_meridian=True)
    longitude, latitude = plane(x, y, inverse=True, errcheck=False)
    if not np.allclose(plane(longitude, latitude, errcheck=False), (x, y), rtol=0, atol=_RETURNS):
        return None, longitude, latitude
    found = plane.get_factors(longitude, latitude, errcheck=False)
    extremes = found.tissot_semimajor, found.tissot_semiminor
    scale = max(extremes, key=lambda each: abs(each - 1)) if np.all(np.isfinite(extremes)) else None
    return scale, longitude, latitude


def _reach(crs):
    """Text of the valid coordinates of a CRS, if PROJ knows them."""
    if crs.area_of_use is None:
        return ""
    to_plane = pyproj.Transformer.from_crs(crs.geodetic_crs, crs, always_xy=True)
    west, south, east, north = to_plane.transform_bounds(*crs.area_of_use.bounds)
    return f", {west:.0f} to {east:.0f} E and {south:.0f} to {north:.0f} N" if np.isfinite(west + north) else ""


def undistorted(longitude, latitude, datum="WGS 84"):
    """EPSG code of the UTM zone of a place, or of the stereographic projection of its pole."""
    if not -80 <= latitude <= 84:
        return "EPSG:5041" if latitude > 0 else "EPSG:5042"
    zone = int((longitude + 180) // 6) % 60
    if datum == "North American Datum 1983" and zone < 23 and latitude >= 0:
        return f"EPSG:{26901 + zone}"
    return f"EPSG:{32601 + zone + (0 if latitude >= 0 else 100)}"


@cached(128, "names of CRSs", str)
def name_of(crs):
    """Name of a CRS in messages, its code only if the CRS is the one of the code, not just similar."""
    if code := crs.to_epsg(min_confidence=100):
        return f"EPSG:{code}"
    return in_a_line(f"{crs.name} (datum: {crs.datum.name})" if crs.datum else crs.name, 90)


def degrees(grid):
    """West, south, east and north bounds of a grid in degrees, in any datum, to select a regional operation."""
    return transformer(grid.crs.to_wkt(), 4326).transform_bounds(*grid.boundingbox.bbox)


def convergence(grid):
    """Angle from true north to grid north at the middle of a grid, positive eastward. [degree]"""
    return float(convergence_at(grid.crs.to_wkt(), *transform_points(grid.affine, grid.shape.x / 2, grid.shape.y / 2)))


def convergence_at(crs, x, y):
    """Angle from true north to grid north at some places, positive eastward. [degree]"""
    place = transformer(crs, _degrees_of(crs)).transform(x, y)
    return projection_of(crs).get_factors(*place).meridian_convergence


@cached(64, "geodetic CRSs")
def _degrees_of(crs):
    """Geographic CRS of a projected one, as text."""
    return pyproj.CRS.from_wkt(crs).geodetic_crs.to_wkt()


def transform_points(affine, columns, rows):
    """Apply an affine transform to many points."""
    columns, rows = np.asarray(columns, float), np.asarray(rows, float)
    return affine.a * columns + affine.b * rows + affine.c, affine.d * columns + affine.e * rows + affine.f


def warn_of_degrees(west, north):
    """Warn if a corner in metres looks like longitude and latitude."""
    if 0 < abs(west) <= 180 and 0 < abs(north) <= 90:
        warn(
            f"west={west:g} and north={north:g} are used as metres but look like degrees: if they are, convert them "
            "with pyproj.Transformer.from_crs(4326, crs, always_xy=True).transform(longitude, latitude)"
        )


def key_of(grid):
    """Key of a grid in caches; odc-geo hashes the WKT of the CRS, which takes 50 us."""
    return tuple(grid.shape), grid.affine, str(grid.crs)


# Cached, because every step needs the centre of its grid, and the WKT of a CRS takes longer than a small scene.
@cached(256, "longitude and latitude of the middle of grids", key_of)
def middle(grid):
    """Longitude, from Greenwich, and latitude of the middle of a grid, in any datum. [degree]"""
    x, y = transform_points(grid.affine, grid.shape.x / 2, grid.shape.y / 2)
    return degrees_at(grid.crs.to_wkt(), float(x), float(y))


def degrees_at(crs, x, y):
    """Longitude and latitude of a place, infinite outside of the CRS. [degree]"""
    return tuple(float(each) for each in transformer(crs, 4326).transform(x, y))


def place_in_words(longitude, latitude):
    """Text of a place."""
    return f"latitude {latitude:.2f}, longitude {longitude:.2f}"


def lies_in_words(affine, shape, crs):
    """Text of the bounds of a file."""
    crs = pyproj.CRS.from_user_input(crs)
    rows, columns = np.meshgrid([0, shape[0]], [0, shape[1]])
    x, y = transform_points(affine, columns, rows)
    digits = 4 if crs.is_geographic else 0
    bounds = f"{x.min():.{digits}f} to {x.max():.{digits}f} E and {y.min():.{digits}f} to {y.max():.{digits}f} N"
    place = degrees_at(crs, x.mean(), y.mean())
    known = not crs.is_geographic and np.isfinite(place).all()
    return f"{bounds} in {name_of(crs)}" + (f" ({place_in_words(*place)})" if known else "")
