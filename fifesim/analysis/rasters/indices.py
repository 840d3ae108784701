"""Vegetation indices of labelled reflectance."""

import numpy as np

from fifesim.analysis import indices
from fifesim.base.bands import NEAR_INFRARED, RED, nearest
from fifesim.rasters import cf, chunks
from fifesim.rasters import grid as grids


def ndvi(reflectance):
    """
    Normalized difference vegetation index.

    Parameters
    ----------
    reflectance : xarray.DataArray, dims (band, y, x)
        With a coordinate ``wavelength`` along band, which tells red (0.60-0.70 um) and near infrared (0.75-1.00 um).

    Returns
    -------
    ndvi : xarray.DataArray, dims (y, x)
        [1]

    Raises
    ------
    ValueError
        If there is no red or no near infrared band, or the units are not those of a reflectance.

    References
    ----------
    [Rouse1974]_; [Friedl1995]_

    See Also
    --------
    fifesim.analysis.indices.normalized_difference
    """
    red, nir = red_and_nir(reflectance)
    out = grids.place(chunks.pointwise(indices.normalized_difference, nir, red), grids.geobox(reflectance))
    return cf.label(out, "ndvi", source=reflectance, history="ndvi")


def red_and_nir(reflectance):
    """
    The red and the near infrared band of a raster.

    Parameters
    ----------
    reflectance : xarray.DataArray, dims (band, y, x)
        As `ndvi` takes it.

    Returns
    -------
    red, nir : xarray.DataArray, dims (y, x)
        Without the coordinates along band.

    Raises
    ------
    ValueError
        As in `ndvi`.
    """
    cf.check_quantity(reflectance, "toa_reflectance", "surface_reflectance")
    numbers = [_nearest_band(reflectance, window) for window in (RED, NEAR_INFRARED)]
    per_band = [name for name, value in reflectance.coords.items() if "band" in value.dims]
    return tuple(reflectance.isel(band=k).drop_vars([*per_band, "band"], errors="ignore") for k in numbers)


def _nearest_band(reflectance, window):
    if "band" not in reflectance.dims:
        raise ValueError("ndvi needs a red and a near infrared band along band, got a raster of one band")
    if "wavelength" not in reflectance.coords:
        raise ValueError("the raster has no coordinate 'wavelength' [um] along band: assign it with .assign_coords")
    wavelengths = np.atleast_1d(reflectance["wavelength"].values)
    number = nearest(wavelengths, window)
    if number is None:
        found = ", ".join(f"{value:.3f}" for value in wavelengths)
        raise ValueError(
            f"no {window.name} band between {window.low:g} and {window.high:g} um: the raster has {found} um"
        )
    return number
