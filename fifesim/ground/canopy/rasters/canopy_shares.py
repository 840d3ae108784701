"""Shares that a canopy has in each cell, as numbers or on labelled rasters: of dead leaves, and of crowns."""

import numpy as np
import xarray as xr

from fifesim.ground.canopy.ranges import check_share
from fifesim.rasters import cf
from fifesim.rasters.axes import north_up
from fifesim.rasters.crs import with_crs_of
from fifesim.rasters.packed import unpacked


def share(name, given, lai):
    """
    A share as the kernels take it.

    Parameters
    ----------
    name : str
        Of the argument: a key of `cf.QUANTITIES`.
    given : float or xarray.DataArray, dims (y, x)
        [1]
    lai : xarray.DataArray, dims (y, x)
        Whose CRS a raster has where it lost its own.

    Returns
    -------
    share : float or xarray.DataArray, dims (y, x)
        Rows from north to south, without coordinates of its own beside y and x. [1]

    Raises
    ------
    ValueError
        If a number is outside 0 to 1; if a raster has other dimensions, or units.
    """
    if not isinstance(given, xr.DataArray):
        if np.isnan(given):
            raise ValueError(f"{name} must be in [0, 1], got nan: of a raster it is a hole, of a number a mistake")
        return float(check_share(name, given))
    if set(given.dims) != {"y", "x"}:
        raise ValueError(f"{name} must be a number, or a raster over (y, x), got dimensions {given.dims}")
    cf.check_units(given, name)
    raster = unpacked(with_crs_of(north_up(given), lai)).rename(name)
    return raster.drop_vars(set(raster.coords) - {"y", "x", "spatial_ref"})


def with_shares(kernel, shares):
    """
    A kernel that takes rasters of shares as arguments after its own, and numbers as they are.

    Parameters
    ----------
    kernel : callable
        Takes shares by name.
    shares : dict of str to float or xarray.DataArray

    Returns
    -------
    kernel : callable
    rasters : list of xarray.DataArray
        Its last arguments.
    """
    names = [name for name, value in shares.items() if isinstance(value, xr.DataArray)]
    numbers = {name: value for name, value in shares.items() if name not in names}

    def of_rasters(*blocks, **parameters):
        own = len(blocks) - len(names)
        return kernel(*blocks[:own], **dict(zip(names, blocks[own:], strict=True)), **numbers, **parameters)

    return of_rasters, [shares[name] for name in names]


def in_words(shares):
    """
    Shares that are not the defaults, for a line of the history.

    Parameters
    ----------
    shares : dict of str to float or xarray.DataArray

    Returns
    -------
    text : str
        Ends in a comma and a space, if it is not empty.

    Examples
    --------
    >>> in_words({"brown": 0.25, "dissociation": 0.5, "crown_cover": 1.0})
    'brown 0.25, dissociation 0.5, '
    """
    defaults = {"brown": 0.0, "dissociation": 0.0, "crown_cover": 1.0}
    said = {name: "by cell" if isinstance(value, xr.DataArray) else f"{value:g}" for name, value in shares.items()}
    return "".join(
        f"{name} {text}, " for name, text in said.items() if text == "by cell" or float(text) != defaults[name]
    )
