"""What raster functions take for an elevation model: its grid, its unit, and how finely it was known."""

import numpy as np
import xarray as xr

from fifesim.base.warned import warn
from fifesim.ground.terrain.rasters.source import check_heights
from fifesim.rasters import cf
from fifesim.rasters import grid as grids

REFERENCE = "Dozier and Frew (1990), doi:10.1109/36.58986"

# Where a model does not say at what distance its elevations are independent. [m]
_SOURCE_RESOLUTION = 30.0

# [m]
_FOOT = 0.3048
# Elevations that lie all so far from the altitude of the atmosphere are another place's, or another unit's.
_APART = 500.0
# So far above it they may be feet of it: 150 m are 492 feet.
_NOT_FEET = 150.0


def elevation_grid(dem):
    """
    Grid of an elevation model.

    Parameters
    ----------
    dem : xarray.DataArray, dims (y, x)
        [m]

    Returns
    -------
    grid : odc.geo.geobox.GeoBox

    Raises
    ------
    ValueError
        If its units are not metres, it marks missing cells by a number, land does not have its elevations in memory, or
        it does not lie north up in a projected CRS in metres.
    TypeError
        If it is no DataArray.
    """
    if not isinstance(dem, xr.DataArray):
        raise TypeError(
            f"a dem is an xarray.DataArray, got {type(dem).__name__}: bring it onto the grid with fifesim.fine_dem"
        )
    cf.check_units(dem, "dem")
    if dem.chunks is None:
        check_heights("the dem", dem.values)
    grid = grids.geobox(dem)
    nodata = dem.rio.nodata
    if nodata is not None and np.isfinite(nodata):
        raise ValueError(
            f"the dem marks missing cells as {nodata:g}, which would be taken for an elevation: "
            "open it with masked=True, or bring it onto the grid with fifesim.fine_dem"
        )
    return grid


def beside_altitude(dem, altitude):
    """
    An elevation model that warns where its numbers are not those of the atmosphere's altitude.

    Parameters
    ----------
    dem : xarray.DataArray, dims (y, x)
        [m]
    altitude : float
        Of the atmosphere. [km]

    Returns
    -------
    dem : xarray.DataArray, dims (y, x)
        The same; where it is lazy, it warns when it computes, of the first such block.

    Warns
    -----
    UserWarning
        If all of it lies over 500 m above or below the altitude, or over 150 m above it where numbers in feet would
        not.
    """
    if dem.chunks is None:
        look_at_altitude(dem.values, altitude)
        return dem
    told = []
    data = dem.data.map_blocks(look_at_altitude, altitude, told, dtype=dem.dtype, meta=np.empty((0, 0), dem.dtype))
    return dem.copy(data=data)


def look_at_altitude(cells, altitude, told=()):
    """
    Elevation after a warning where it lies elsewhere than the atmosphere.

    Parameters
    ----------
    cells : array
        [m]
    altitude : float
        [km]
    told : list, optional
        Empty as long as nobody has been warned: one block in a process warns for all.

    Returns
    -------
    cells : array
        The same. [m]

    Warns
    -----
    UserWarning
        As in `beside_altitude`.
    """
    low, high, at = np.fmin.reduce(cells, axis=None), np.fmax.reduce(cells, axis=None), 1000 * altitude
    in_feet = low > at + _NOT_FEET and _FOOT * low - _APART / 5 < at < _FOOT * high + _APART / 5
    if not told and (in_feet or low > at + _APART or high < at - _APART):
        told += [True] if isinstance(told, list) else ()
        feet = (
            "where they are feet, take dem * 0.3048 (vertical_units = 'ft' of a file); where metres, "
            if in_feet
            else ""
        )
        warn(
            f"the dem has elevations of {low:.0f} to {high:.0f} m beside an altitude of the atmosphere of {altitude:g} "
            f"km: {feet}give fifesim.Atmosphere(altitude={np.clip((low + high) / 2000, 0, None):.1f})"
        )
    return cells


def source_resolution(dem, given=None):
    """
    Distance from which on elevations are independent.

    Parameters
    ----------
    dem : xarray.DataArray
    given : float, optional
        Wins over the attribute ``source_resolution``, without which it is 30 m. [m]

    Returns
    -------
    resolution : float
        [m]

    Raises
    ------
    ValueError
        If it is not positive.
    """
    found = float(dem.attrs.get("source_resolution", _SOURCE_RESOLUTION) if given is None else given)
    if not 0 < found < np.inf:
        raise ValueError(f"the resolution of an elevation's source must be positive metres, got {found:g}")
    return found
