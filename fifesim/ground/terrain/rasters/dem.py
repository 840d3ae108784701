"""What raster functions take for an elevation model: its grid, its unit, and how finely it was known."""

import numpy as np
import xarray as xr

from fifesim.rasters import cf
from fifesim.rasters import grid as grids

REFERENCE = "Dozier and Frew (1990), doi:10.1109/36.58986"

# Where a model does not say at what distance its elevations are independent. [m]
_SOURCE_RESOLUTION = 30.0


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
        If its units are not metres, it marks missing cells by a number, or it does not lie north up in a projected CRS
        in metres.
    TypeError
        If it is no DataArray.
    """
    if not isinstance(dem, xr.DataArray):
        raise TypeError(f"a dem is an xarray.DataArray, got {dem!r}: bring it onto the grid with fifesim.fine_dem")
    cf.check_units(dem, "dem")
    grid = grids.geobox(dem)
    nodata = dem.rio.nodata
    if nodata is not None and np.isfinite(nodata):
        raise ValueError(
            f"the dem marks missing cells as {nodata:g}, which would be taken for an elevation: "
            "open it with masked=True, or bring it onto the grid with fifesim.fine_dem"
        )
    return grid


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
