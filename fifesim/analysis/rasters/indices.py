"""Spectral indices of labelled reflectance."""

import numpy as np

from fifesim.analysis import indices
from fifesim.base.bands import BLUE, COMMON_NAMES, GREEN, NEAR_INFRARED, RED, SHORTWAVE_INFRARED, nearest
from fifesim.rasters import cf, chunks, swaths

# The kernel of each index, and the bands that it takes. Names are those of the spyndex catalogue.
INDICES = {
    "NDVI": (indices.normalized_difference, (NEAR_INFRARED, RED)),
    "EVI": (indices.enhanced, (NEAR_INFRARED, RED, BLUE)),
    "EVI2": (indices.enhanced_of_two_bands, (NEAR_INFRARED, RED)),
    "SAVI": (indices.soil_adjusted, (NEAR_INFRARED, RED)),
    "MSAVI": (indices.modified_soil_adjusted, (NEAR_INFRARED, RED)),
    "NDWI": (indices.normalized_difference, (GREEN, NEAR_INFRARED)),
    "NDMI": (indices.normalized_difference, (NEAR_INFRARED, SHORTWAVE_INFRARED)),
    "NIRv": (indices.near_infrared_of_vegetation, (NEAR_INFRARED, RED)),
}


def index(reflectance, name, source=None, history=""):
    """
    Spectral index of a reflectance.

    Parameters
    ----------
    reflectance : xarray.DataArray, dims (band, y, x)
        With a coordinate ``wavelength`` along band, which tells blue (0.45-0.52 um), green (0.50-0.60 um), red
        (0.60-0.70 um), near infrared (0.75-1.00 um) and shortwave infrared (1.53-1.75 um).
    name : str
        A key of `INDICES`.
    source : xarray.DataArray, optional
        Raster whose history and provenance the index carries on; by default the reflectance.
    history : str, optional
        Steps from that raster to the reflectance.

    Returns
    -------
    index : xarray.DataArray, dims (y, x)
        [1]

    Raises
    ------
    ValueError
        If there is no such index, a band of it is missing, or the units are not those of a reflectance.

    See Also
    --------
    fifesim.analysis.indices
    """
    known = {each.lower(): each for each in INDICES}
    if str(name).lower() not in known:
        raise ValueError(f"there is no index {name!r}: type one of {', '.join(INDICES)}")
    name = known[name.lower()]
    kernel, windows = INDICES[name]
    out = swaths.placed_as(chunks.pointwise(kernel, *_bands(reflectance, windows, name)), reflectance)
    steps = "\n".join(filter(None, [history, name.lower()]))
    return cf.label(out, name.lower(), source=reflectance if source is None else source, history=steps)


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
        As in `index`.

    References
    ----------
    [Rouse1974]_; [Friedl1995]_

    See Also
    --------
    fifesim.analysis.indices.normalized_difference
    """
    return index(reflectance, "NDVI")


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
    return _bands(reflectance, (RED, NEAR_INFRARED), "ndvi")


def _bands(reflectance, windows, what):
    """The bands of a raster that lie best in some windows, without the coordinates along band."""
    cf.check_quantity(reflectance, "toa_reflectance", "surface_reflectance")
    numbers = [_nearest_band(reflectance, window, what) for window in windows]
    per_band = [name for name, value in reflectance.coords.items() if "band" in value.dims]
    return tuple(reflectance.isel(band=k).drop_vars([*per_band, "band"], errors="ignore") for k in numbers)


def _wavelengths(reflectance):
    """Wavelengths of the bands, or where bands of their common names lie. [um]"""
    if "wavelength" in reflectance.coords:
        return np.atleast_1d(reflectance["wavelength"].values)
    names = [str(name).lower() for name in reflectance["band"].values] if "band" in reflectance.coords else []
    if names and set(names) <= set(COMMON_NAMES):
        return np.array([COMMON_NAMES[name].best for name in names])
    raise ValueError(
        "the raster has no coordinate 'wavelength' [um] along band: assign it with .assign_coords, or call its bands "
        "'red', 'nir' and the like"
    )


def _nearest_band(reflectance, window, what):
    if "band" not in reflectance.dims:
        raise ValueError(f"{what} needs a {window.name} and other bands along band, got a raster of one band")
    wavelengths = _wavelengths(reflectance)
    number = nearest(wavelengths, window)
    if number is None:
        found = ", ".join(f"{value:.3f}" for value in wavelengths)
        raise ValueError(
            f"no {window.name} band between {window.low:g} and {window.high:g} um: the raster has {found} um"
        )
    return number
