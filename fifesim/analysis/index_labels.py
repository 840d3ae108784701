"""Spectral indices and composites of labelled images."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
import xarray as xr

from fifesim.analysis import indices
from fifesim.analysis.indices import date_of_maximum, date_of_median, values_of_date
from fifesim.analysis.regression_labels import sound_cells
from fifesim.base.bands import BLUE, COMMON_NAMES, GREEN, NEAR_INFRARED, RED, SHORTWAVE_INFRARED, nearest_band
from fifesim.base.geometry import ANGLES
from fifesim.base.messages import warn
from fifesim.grids import cf, chunks, swaths
from fifesim.grids import grid as grids
from fifesim.grids.grid import with_crs_of
from fifesim.grids.inputs import MASKS_TOO

# Kernel of each index, and its bands. Names are from the spyndex catalogue.
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


def reflectance_index(reflectance, name, source=None, history=""):
    """Spectral index of a labelled reflectance, dims (y, x). [1]"""
    known = {index.lower(): index for index in INDICES}
    if str(name).lower() not in known:
        raise ValueError(f"there is no index {name!r}: type one of {', '.join(INDICES)}")
    name = known[name.lower()]
    kernel, windows = INDICES[name]
    out = swaths.placed_as(chunks.pointwise(kernel, *_bands(reflectance, windows, name)), reflectance)
    steps = "\n".join(filter(None, [history, name.lower()]))
    return cf.label(out, name.lower(), source=reflectance if source is None else source, history=steps)


def reflectance_ndvi(reflectance):
    """Labelled NDVI of a reflectance, dims (y, x) [Rouse1974]_ [Friedl1995]_. [1]"""
    return reflectance_index(reflectance, "NDVI")


def red_and_nir(reflectance):
    """Red and near infrared band of a reflectance, without the coordinates along band."""
    return _bands(reflectance, (RED, NEAR_INFRARED), "ndvi")


def _bands(reflectance, windows, what):
    """Bands nearest to some spectral windows, without the coordinates along band."""
    cf.check_quantity(reflectance, "toa_reflectance", "surface_reflectance")
    numbers, values = band_numbers(reflectance, windows, what), reflectance.variable
    parts = reflectance.coords.variables, reflectance.xindexes, reflectance.name
    return tuple(grids.raster_of(values.isel(band=k), *parts) for k in numbers)


def band_numbers(reflectance, windows, what):
    """Places along band of the bands nearest to some spectral windows."""
    if "band" not in reflectance.dims:
        raise ValueError(f"{what} needs a {windows[0].name} and other bands along band, got a raster of one band")
    wavelengths = _wavelengths(reflectance)
    numbers = [nearest_band(wavelengths, window) for window in windows]
    for window, number in zip(windows, numbers, strict=True):
        if number is None:
            found = ", ".join(f"{value:.3f}" for value in wavelengths)
            raise ValueError(
                f"no {window.name} band between {window.low:g} and {window.high:g} um: the raster has {found} um"
            )
    return numbers


def _wavelengths(reflectance):
    """Wavelengths of the bands, or the usual wavelengths of common band names. [um]"""
    if "wavelength" in reflectance.coords:
        return np.atleast_1d(reflectance.coords.variables["wavelength"].values)
    names = [str(name).lower() for name in reflectance["band"].values] if "band" in reflectance.coords else []
    if names and set(names) <= set(COMMON_NAMES):
        return np.array([COMMON_NAMES[name].best for name in names])
    raise ValueError(
        "the raster has no coordinate 'wavelength' [um] along band: assign it with .assign_coords, or call its bands "
        "'red', 'nir' and the like"
    )


_REFERENCE = "Holben (1986), doi:10.1080/01431168608948945"


def composite(
    images: xr.DataArray,
    method: Literal["maximum-value", "median", "nadir-most", "mean-of-clear"] = "maximum-value",
    *,
    by: xr.DataArray | None = None,
    clear: Annotated[xr.DataArray, MASKS_TOO] | None = None,
) -> xr.DataArray:
    """
    Composite images of several dates, by default by the maximum NDVI of each cell, which avoids clouds and haze.

    Parameters
    ----------
    images : xarray.DataArray, dims (time, y, x) or (time, band, y, x)
        NDVI, or reflectance in bands with a coordinate ``wavelength``.
    method : {"maximum-value", "median", "nadir-most", "mean-of-clear"}, optional
        The date of the largest NDVI, of the median NDVI (the lower of two), or of the smallest ``vza``; or the mean of
        the clear dates.
    by : xarray.DataArray, dims (time, y, x), optional
        Index whose maximum or median selects the date; by default the images if they have no bands, else their NDVI. It
        is required unless the images are NDVI or reflectance.
    clear : xarray.DataArray, dims (time, y, x), optional
        True, or 1, where an image is clear; other pixels count as missing. "mean-of-clear" needs it.

    Returns
    -------
    composite : xarray.DataArray, dims (y, x) or (band, y, x)
        Values of the selected date; NaN if no date has data. Coordinates over (y, x) are ``date`` and, if they differ
        between dates, the angles of sun and view. A mean has ``dates`` instead, the number of clear dates. The distance
        to the sun is dropped. Lazy if the images are.

    Raises
    ------
    ValueError
        If there is no dimension time, the method is unknown, ``by`` or ``clear`` has other dates or cells, or the
        method needs views or clear dates that are not given.

    Notes
    -----
    The maximum of noisy values is biased high: see `fifesim.analysis.indices.maximum_of_normals`.

    References
    ----------
    [Holben1986]_

    Examples
    --------
    >>> import fifesim
    >>> import numpy as np
    >>> import xarray as xr
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    >>> image = rho.fifesim.to_toa().fifesim.sense("TM")
    >>> clear = image.fifesim.to_reflectance()
    >>> dates = np.array(["1987-06-06T16:35", "1987-06-22T16:35"], "datetime64[ns]")
    >>> time = xr.DataArray(dates, dims="time", name="time")
    >>> stack = xr.concat([0.5 * clear + 0.1, clear], time)
    >>> best = stack.fifesim.composite()
    >>> bool((best.date == dates[1])[1:-1, 1:-1].all())
    True
    """
    if images.dtype.kind != "f" or cf.QUANTITIES["toa_radiance"].units == images.attrs.get("units"):
        raise ValueError(
            "a composite needs reflectance or NDVI, as digital numbers and radiance depend on the sun of each date: "
            "convert them with .fifesim.to_reflectance() first"
        )
    if "time" not in images.dims:
        raise ValueError(
            f"a composite is made of images along time, got dimensions {images.dims}: join dates with "
            "xarray.concat([...], dim='time')"
        )
    if "time" in images.coords:
        times, counts = np.unique(images["time"].values, return_counts=True)
        if (counts > 1).any():
            warn(
                f"the images have {times[counts > 1][0]} {counts.max()} times, so that a median or mean counts it more "
                "than once: keep one image of each date with .drop_duplicates('time')"
            )
    images = sound_cells(images)
    grid = grids.geobox(images.isel(time=0))
    if clear is not None:
        clear = _checked(clear, images, "clear")
        clear = xr.apply_ufunc(_checked_mask, clear, dask="parallelized", output_dtypes=[clear.dtype])
        images = images.where(clear.drop_vars(list(clear.coords)) == 1)
    plain = images.drop_vars(list(images.coords))
    if method == "mean-of-clear":
        if clear is None:
            raise ValueError("mean-of-clear needs to know where the images are clear: give clear=, 1 where they are")
        known = plain.isel(band=0) if "band" in plain.dims else plain
        out, about = plain.mean("time"), {"dates": known.notnull().sum("time")}
        about["dates"].attrs = {"long_name": "number of clear dates"}
    else:
        index = _nearness(images) if method == "nadir-most" else _index(images) if by is None else _checked(by, images)
        index = index.drop_vars(list(index.coords))
        index = index if clear is None else index.where(clear.drop_vars(list(clear.coords)) == 1)
        chosen = _along_time(date_of_median if method == "median" else date_of_maximum, index, dtype=np.int64)
        out = _along_time(values_of_date, plain, chosen, dtype=images.dtype, missing=np.nan)
        about = _of_date(images, chosen)
    out = out.transpose(*(name for name in images.dims if name != "time"))
    kept = {name: value for name, value in images.coords.items() if not {"time", "y", "x"} & set(value.dims)}
    out = grids.place(out.assign_coords(kept), grid).assign_coords(about)
    history = f"composite: {method} of {images.sizes['time']} dates"
    # The number of saturated pixels may be of one date only.
    kept = {name: value for name, value in images.attrs.items() if name != "saturated_pixels"}
    out.attrs = kept | {"composite": method, "references": _REFERENCE}
    out.attrs["history"] = "\n".join(filter(None, [images.attrs.get("history", ""), history]))
    return out.rename(images.name)


def _checked_mask(clear):
    """Check that a mask has no other values than 0, 1 and NaN."""
    other = (clear != 0) & (clear != 1) & (clear == clear)
    if np.any(other):
        raise ValueError(
            f"clear is 1 where an image is clear and 0 elsewhere, got {clear[other].flat[0]:g}: give a comparison, "
            "such as share > 0.5"
        )
    return clear


def _index(images):
    """Index whose maximum selects the date: NDVI of the images, or the images themselves if they have no bands."""
    if "band" not in images.dims:
        cf.check_quantity(images, "ndvi")
        return images.transpose("time", "y", "x")
    dates = [reflectance_ndvi(images.isel(time=number, drop=True)) for number in range(images.sizes["time"])]
    # The angles of each date would have to agree.
    return xr.concat([each.drop_vars(list(each.coords)) for each in dates], "time")


def _nearness(images):
    """Absolute view zenith angle with a negative sign, NaN where a date has no data, dims (time, y, x). [degree]"""
    if "vza" not in images.coords or "time" not in images["vza"].dims:
        raise ValueError(
            "nadir-most needs the view of each date: assign a coordinate vza [degree] along time, such as "
            ".assign_coords(vza=('time', [12.0, 40.0]))"
        )
    plain = images.drop_vars(list(images.coords))
    known = plain.notnull().any("band") if "band" in images.dims else plain.notnull()
    return xr.DataArray(-abs(images["vza"].variable.to_base_variable())).where(known).transpose("time", "y", "x")


def _checked(by, images, name="by"):
    """Check that a raster has the dates and cells of the images, and align it."""
    if by.dims != ("time", "y", "x") or by.sizes["time"] != images.sizes["time"]:
        raise ValueError(f"{name} has dimensions (time, y, x) with the dates of the images, got {dict(by.sizes)}")
    if {"time"} <= set(by.coords) & set(images.coords) and not np.array_equal(by["time"], images["time"]):
        raise ValueError(f"{name} has other dates than the images, or in another order: sort both with .sortby('time')")
    one = images.isel(time=0, drop=True)
    chunks.aligned([one, with_crs_of(by.isel(time=0, drop=True), one).rename(name)])
    return by


def _of_date(images, chosen):
    """Coordinates of the chosen date in each cell."""
    angles = {name: images[name] for name in ANGLES if name in images.coords and "time" in images[name].dims}
    found = {}
    for name, values in ({"date": images["time"]} | angles).items():
        plain, missing = xr.DataArray(values.variable.to_base_variable()), np.nan
        if plain.dtype.kind == "M":
            missing = np.datetime64("NaT")
        elif plain.ndim == 1:
            plain = plain.astype(float)
        found[name] = _along_time(values_of_date, plain, chosen, dtype=plain.dtype, missing=missing)
        # xarray may keep the attributes of the index here.
        found[name].attrs = cf.attributes(name) if name in ANGLES else {"long_name": "date of the selected image"}
    return found


def _along_time(kernel, *arrays, dtype, **parameters):
    """Apply a kernel to arrays whose last axis is time."""
    core = [["time"] if "time" in each.dims else [] for each in arrays]
    return xr.apply_ufunc(
        kernel, *arrays, input_core_dims=core, join="exact", dask="parallelized", output_dtypes=[dtype],
        kwargs=parameters, dask_gufunc_kwargs={"allow_rechunk": True},
    )  # fmt: skip
