"""Directions of sun and sensor on labelled rasters: numbers, or angles that differ from cell to cell."""

import numpy as np
import xarray as xr

from fifesim.base.geometry import ANGLES, Geometry, fife_geometry
from fifesim.rasters import cf

_GEOMETRY = (*ANGLES, "earth_sun_distance")


def with_geometry(array, geometry, names=_GEOMETRY):
    """
    Carry the directions of sun and sensor as coordinates: numbers, or rasters on the same cells.

    Parameters
    ----------
    array : xarray.DataArray or xarray.Dataset
    geometry : fifesim.base.geometry.Geometry or xarray.Dataset
        From `checked_geometry`.
    names : sequence of str, optional
        Which of them; all by default.

    Returns
    -------
    array : xarray.DataArray or xarray.Dataset
    """
    angles = {name: _angle(geometry, name) for name in names}
    return array.assign_coords(
        {name: xr.Variable(angle.dims, angle.data, cf.attributes(name)) for name, angle in angles.items()}
    )


def geometry_of(array):
    """
    Directions of sun and sensor that an array carries.

    Parameters
    ----------
    array : xarray.DataArray

    Returns
    -------
    geometry : fifesim.base.geometry.Geometry, xarray.Dataset or None
        As `checked_geometry` gives it; None where it carries no solar zenith angle.
    """
    if "sza" not in array.coords:
        return None
    names = [name for name in (*_GEOMETRY, "y", "x", "spatial_ref") if name in array.coords]
    carried = {name: array.coords[name].variable for name in names}
    return checked_geometry(xr.Dataset(carried).set_coords(["spatial_ref"] if "spatial_ref" in carried else []))


def given_geometry(given, array):
    """
    Directions of sun and sensor: as given, else as an array carries them, else the paper's.

    Parameters
    ----------
    given : fifesim.base.geometry.Geometry, xarray.Dataset or None
    array : xarray.DataArray

    Returns
    -------
    geometry : Geometry or Dataset
        As `checked_geometry` gives it.

    Raises
    ------
    ValueError, TypeError
        As in `checked_geometry`.
    """
    return checked_geometry(given) if given is not None else geometry_of(array) or fife_geometry()


def checked_geometry(given):
    """
    Directions of sun and sensor as the package takes them.

    Parameters
    ----------
    given : fifesim.base.geometry.Geometry, or xarray.Dataset of ``sza`` and perhaps ``saa``, ``vza``, ``vaa``, \
            ``earth_sun_distance``
        In a Dataset an angle is a number or a raster over (y, x). [degree]

    Returns
    -------
    geometry : Geometry, or Dataset with all of these where an angle varies
        Angles that a Dataset does not have are 0.

    Raises
    ------
    ValueError
        If a number is no direction, or units are not degrees; in a raster, when it is used.
    TypeError
        If it is neither.
    """
    if isinstance(given, Geometry):
        return given
    if not isinstance(given, xr.Dataset) or "sza" not in given.variables:
        raise TypeError(
            f"geometry must be a fifesim.Geometry, or an xarray.Dataset with sza, saa, vza and vaa, got {given!r}: "
            "see fifesim.Geometry"
        )
    values = {"saa": 0.0} | {name: given[name] for name in _GEOMETRY if name in given.variables}
    numbers = {name: float(value) for name, value in values.items() if np.ndim(value) == 0}
    rasters = {name: value for name, value in values.items() if name not in numbers}
    for name, raster in rasters.items():
        cf.check_units(raster, name)
    uniform = Geometry(**(numbers | dict.fromkeys(rasters, 0.0)))
    if not rasters:
        return uniform
    plain = {name: raster.drop_vars(set(raster.coords) - {"y", "x", "spatial_ref"}) for name, raster in rasters.items()}
    return xr.Dataset({name: plain.get(name, getattr(uniform, name)) for name in _GEOMETRY})


def varying(geometry):
    """
    Names of the angles that differ from cell to cell.

    Parameters
    ----------
    geometry : fifesim.base.geometry.Geometry or xarray.Dataset

    Returns
    -------
    names : tuple of str
    """
    return tuple(name for name in _GEOMETRY if _angle(geometry, name).ndim)


def uniform_geometry(geometry, what):
    """
    Directions, where one of sun and sensor is needed.

    Parameters
    ----------
    geometry : fifesim.base.geometry.Geometry or xarray.Dataset
    what : str
        What needs it.

    Returns
    -------
    geometry : fifesim.base.geometry.Geometry

    Raises
    ------
    ValueError
        If an angle varies over the scene.
    """
    if names := varying(geometry):
        raise ValueError(
            f"{what} needs one direction of sun and sensor, got rasters of {', '.join(names)}: "
            "give their means as geometry=fifesim.Geometry(sza, saa, vza, vaa)"
        )
    return geometry


def angles(geometry):
    """
    Angles of sun and sensor as arrays, each a number or by cell.

    Parameters
    ----------
    geometry : fifesim.base.geometry.Geometry or xarray.Dataset

    Returns
    -------
    sza, saa, vza, vaa : xarray.DataArray
        [degree]
    """
    return tuple(_angle(geometry, name) for name in ANGLES)


def mu_s(geometry):
    """
    Cosine of the solar zenith angle, a number or by cell.

    Parameters
    ----------
    geometry : fifesim.base.geometry.Geometry or xarray.Dataset

    Returns
    -------
    mu_s : xarray.DataArray
        [1]
    """
    return np.cos(np.radians(_angle(geometry, "sza")))


def _angle(geometry, name):
    return xr.DataArray(getattr(geometry, name))
