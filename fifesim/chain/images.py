"""What an image of any kind tells: it is brought to planetary reflectance first, as in the paper (Results)."""

from __future__ import annotations

from typing import Annotated, Literal

import xarray as xr

from fifesim.analysis.rasters import indices
from fifesim.base.kinds import UNCHECKED
from fifesim.rasters import cf
from fifesim.rasters.annotations import RasterOrDataset
from fifesim.rasters.dates import by_date
from fifesim.rasters.own_rasters import incoming
from fifesim.sensor import raster as sensor
from fifesim.sensor.response.rasters.matching import check_wavelengths


@by_date
def ndvi(image: RasterOrDataset) -> xr.DataArray:
    """
    Normalized difference vegetation index, from planetary reflectance as in the paper (Results).

    Parameters
    ----------
    image : xarray.DataArray, dims (band, y, x)
        Digital numbers, radiance or reflectance, with a coordinate ``wavelength`` [um] along band.

    Returns
    -------
    ndvi : xarray.DataArray, dims (y, x)
        NaN where there are no data. [1]

    Raises
    ------
    ValueError
        If there is no red or no near infrared band, or no calibration.

    See Also
    --------
    fifesim.analysis.indices.normalized_difference

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    >>> image = rho.fifesim.to_toa().fifesim.sense("TM")
    >>> ndvi = image.fifesim.ndvi()
    >>> round(float(ndvi.mean()), 2)
    0.36
    """
    return _index(image, "NDVI")


@by_date
def index(
    image: xr.DataArray,
    name: Annotated[Literal["NDVI", "EVI", "EVI2", "SAVI", "MSAVI", "NDWI", "NDMI", "NIRv"], UNCHECKED],
) -> xr.DataArray:
    """
    Spectral index of an image.

    Parameters
    ----------
    image : xarray.DataArray, dims (band, y, x)
        Reflectance, of the ground or planetary, with a coordinate ``wavelength`` [um] along band. Digital numbers and
        radiance are brought to planetary reflectance first.
    name : {"NDVI", "EVI", "EVI2", "SAVI", "MSAVI", "NDWI", "NDMI", "NIRv"}
        As in the catalogue of spyndex: NDWI shows open water (green and near infrared), NDMI the water of leaves (near
        and shortwave infrared). EVI is meant for reflectance of the ground: take it after `to_surface`.

    Returns
    -------
    index : xarray.DataArray, dims (y, x)
        NaN where there are no data. [1]

    Raises
    ------
    ValueError
        If there is no such index, the image lacks a band of it, or its calibration.

    References
    ----------
    [Rouse1974]_; [Huete1988]_; [Qi1994]_; [McFeeters1996]_; [Gao1996]_; [Huete2002]_; [Jiang2008]_; [Badgley2017]_

    See Also
    --------
    fifesim.analysis.indices

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM1", "TM3", "TM4"])
    >>> round(float(rho.fifesim.index("EVI").mean()), 2)
    0.27
    """
    return _index(image, name)


def _index(image, name):
    """Spectral index of an image, without labels on the reflectance between."""
    if not _is_recorded(image):
        return indices.index(planetary_reflectance(image), name)
    reflectance, history = sensor.planetary(image)
    check_wavelengths(reflectance)
    return indices.index(reflectance, name, source=image, history=history)


def _is_recorded(image):
    """Whether an image holds digital numbers or radiance."""
    return "gain" in image.coords or image.attrs.get("units") == cf.QUANTITIES["toa_radiance"].units


def planetary_reflectance(image):
    """
    Reflectance of an image, converted where it holds digital numbers or radiance.

    Parameters
    ----------
    image : xarray.DataArray, dims (band, y, x), or xarray.Dataset of bands

    Returns
    -------
    reflectance : xarray.DataArray, dims (band, y, x)
        [1]

    Raises
    ------
    ValueError
        If it carries no calibration, values cannot be a reflectance, or names of bands contradict their wavelengths.
    """
    reflectance = sensor.to_reflectance(image) if _is_recorded(image) else incoming(image, "toa_reflectance")
    check_wavelengths(reflectance)
    return reflectance
