"""Directions of sun and sensor on labelled rasters: numbers, or angles that vary from cell to cell."""

from dataclasses import replace
from typing import Annotated, TypeAlias

import numpy as np
import xarray as xr

from fifesim.base.arguments import Kind
from fifesim.base.geometry import ANGLES, Geometry, earth_sun_distance, fife_geometry, sun_geometry, warn_of_radians
from fifesim.base.messages import warn
from fifesim.base.times import utc
from fifesim.grids import cf, projection
from fifesim.grids import grid as grids
from fifesim.grids.sites import is_fife

_GEOMETRY = (*ANGLES, "earth_sun_distance")

# Tolerated change of convergence, 0.3 % of the illumination of slopes of 5 degrees with the sun at 65. [degree]
_STEADY = 1.0

# Angles of sun and sensor: the same everywhere, or by cell.
Directions: TypeAlias = Annotated[
    Geometry | xr.Dataset,
    Kind(
        "a fifesim.Geometry, or an xarray.Dataset of sza, saa, vza and vaa",
        lambda value: isinstance(value, Geometry) or (isinstance(value, xr.Dataset) and "sza" in value.variables),
    ),
]


def with_geometry(array, geometry, names=_GEOMETRY):
    """Add the directions of sun and sensor as coordinates: numbers, or rasters on the same cells."""
    if geometry is None:
        return array
    carried = coordinates_of(geometry, names)
    return array.assign_coords(carried) if isinstance(array, xr.Dataset) else grids.with_coordinates(array, carried)


def coordinates_of(geometry, names=_GEOMETRY):
    """Coordinates of a raster for the directions of sun and sensor."""
    found = {}
    for name in names:
        angle = getattr(geometry, name)
        found[name] = xr.Variable(getattr(angle, "dims", ()), getattr(angle, "data", angle), cf.attributes(name))
    return found


def geometry_of(array, names=_GEOMETRY):
    """Directions of sun and sensor in the coordinates of an array, None without a solar zenith angle."""
    known = array.coords.variables
    if "sza" not in known:
        return None
    carried = {name: known[name] for name in (*names, "y", "x", "spatial_ref") if name in known}
    time = known.get("time")
    if "earth_sun_distance" not in carried and time is not None and time.ndim == 0 and time.dtype.kind == "M":
        carried["earth_sun_distance"] = xr.Variable((), earth_sun_distance(time.values))
    if "saa" in carried and not any(carried[name].ndim for name in _GEOMETRY if name in carried):
        return Geometry(**{name: float(carried[name]) for name in _GEOMETRY if name in carried})
    return checked_geometry(xr.Dataset(carried).set_coords(["spatial_ref"] if "spatial_ref" in carried else []))


def given_geometry(given, array, time=None):
    """Directions of sun and sensor as in `known_geometry`; unknown ones raise ValueError."""
    geometry = known_geometry(given, array, time)
    if geometry is None:
        raise ValueError(
            f"the position of the sun over {array.name or 'the raster'} is unknown, as it has no sza and no time: give "
            "time='2022-06-03T17:10Z', or geometry=fifesim.Geometry(sza, saa) or fifesim.sun_position(time, latitude, "
            "longitude)"
        )
    return geometry


def known_geometry(given, array, time=None):
    """Directions of sun and sensor as far as known, else None."""
    # In this order: as given, from the coordinates of the array, from its time, or the sun of the paper for a scene
    # made on the FIFE site.
    if given is not None and time is not None:
        raise ValueError("geometry and time both determine the sun: give one of them")
    if given is not None:
        return checked_geometry(given)
    carried = geometry_of(array)
    if time is None and carried is not None:
        return carried
    if time is None and "time" in array.coords and array.coords["time"].ndim == 0:
        time = array.coords["time"].values
    if time is not None:
        # numpy reads dates without a time as midnight.
        if not isinstance(time, str) and utc(time)[0] == utc(time)[0].normalize():
            warn(
                f"time of {array.name or 'the raster'} is midnight in UTC, {utc(time)[0]:%Y-%m-%d}: if it is a date "
                "only, give the time of day, time='2022-06-03T17:10Z'"
            )
        return sun_over(grids.geobox(array), time)
    return fife_geometry() if is_fife(array) else None


def dated(array, time):
    """Raster with the scalar coordinate ``time`` in UTC; None leaves it unchanged."""
    if time is None:
        return array
    return array.assign_coords(time=((), utc(time)[0].tz_localize(None).to_datetime64(), cf.TIME_ATTRIBUTES))


def sun_over(grid, time):
    """Position of the sun over the middle of a grid, with a nadir view."""
    longitude, latitude = projection.middle(grid)
    return sun_geometry(time, latitude, longitude)


def checked_geometry(given):
    """Check directions of sun and sensor; a Dataset without a view has a nadir view."""
    if isinstance(given, Geometry):
        return given
    if not isinstance(given, xr.Dataset) or "sza" not in given.variables:
        raise TypeError(
            f"geometry must be a fifesim.Geometry, or an xarray.Dataset with sza, saa, vza and vaa, got {given!r}: "
            "see fifesim.Geometry"
        )
    values = {name: given[name] for name in _GEOMETRY if name in given.variables}
    if "saa" not in values:
        raise ValueError(
            "the sun has a zenith angle sza but no azimuth saa: add saa, in degrees clockwise from north, such as "
            ".assign_coords(saa=150.0)"
        )
    numbers = {name: float(value) for name, value in values.items() if np.ndim(value) == 0}
    rasters = {name: value for name, value in values.items() if name not in numbers}
    for name, raster in rasters.items():
        cf.check_units(raster, name)
    sun = [values["sza"], values["saa"]]
    if any(angle.ndim for angle in sun) and all(angle.chunks is None and angle.size for angle in sun):
        warn_of_radians(*(float(np.nan_to_num(angle.values).max()) for angle in sun))
    uniform = Geometry(**(numbers | dict.fromkeys(rasters, 0.0)))
    if not rasters:
        return uniform
    plain = {name: raster.drop_vars(set(raster.coords) - {"y", "x", "spatial_ref"}) for name, raster in rasters.items()}
    return xr.Dataset({name: plain.get(name, getattr(uniform, name)) for name in _GEOMETRY})


def varying(geometry):
    """Names of the angles that vary from cell to cell."""
    if isinstance(geometry, Geometry):
        return ()
    return tuple(name for name in _GEOMETRY if np.ndim(getattr(geometry, name)))


def uniform_geometry(geometry, what):
    """Directions, which must be uniform."""
    if names := varying(geometry):
        raise ValueError(
            f"{what} needs one direction of sun and sensor, got rasters of {', '.join(names)}: "
            "give their means as geometry=fifesim.Geometry(sza, saa, vza, vaa)"
        )
    return geometry


def from_grid_north(geometry, grid):
    """Directions with azimuths from grid north, by the convergence at the middle of the grid."""
    # Warns if the convergence at a corner differs by more than 1 degree.
    turn = projection.convergence(grid)
    corners = projection.transform_points(grid.affine, [0, 0, *[grid.shape.x] * 2], [0, grid.shape.y] * 2)
    off = np.abs((projection.convergence_at(grid.crs.to_wkt(), *corners) - turn + 180) % 360 - 180).max()
    if off > _STEADY:
        warn(
            f"grid north rotates by up to {off:.1f} degrees between centre and corners of the scene; light on slopes "
            "uses one direction of the sun: split the scene, or use a local CRS such as its UTM zone"
        )
    # An azimuth of 360 degrees may exceed 360 from grid north.
    return replace(geometry, saa=np.fmod(geometry.saa - turn, 360), vaa=np.fmod(geometry.vaa - turn, 360))


def angles(geometry):
    """Angles of sun and sensor as arrays, each a number or by cell. [degree]"""
    return tuple(_numbers(getattr(geometry, name)) for name in ANGLES)


def mu_s(geometry):
    """Cosine of the solar zenith angle, a number or by cell. [1]"""
    return _numbers(np.cos(np.radians(geometry.sza)))


def _numbers(angle):
    return angle if isinstance(angle, xr.DataArray) else xr.Variable((), angle)
