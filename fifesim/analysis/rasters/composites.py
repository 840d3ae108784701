"""Composites of labelled images of many dates."""

from __future__ import annotations

from functools import partial
from typing import Literal

import numpy as np
import xarray as xr

from fifesim.analysis.compositing import date_of_maximum, values_of_date
from fifesim.analysis.rasters.indices import ndvi
from fifesim.base.geometry import ANGLES
from fifesim.rasters import cf, chunks
from fifesim.rasters import grid as grids
from fifesim.rasters.crs import with_crs_of

_METHODS = {"maximum-value": date_of_maximum}
_REFERENCE = "Holben (1986), doi:10.1080/01431168608948945"


def composite(
    images: xr.DataArray, method: Literal["maximum-value"] = "maximum-value", *, by: xr.DataArray | None = None
) -> xr.DataArray:
    """
    One image of many dates: at each cell that of the date with the largest NDVI, which clouds and haze lower.

    Parameters
    ----------
    images : xarray.DataArray, dims (time, y, x) or (time, band, y, x)
        NDVI, or reflectance in bands with a coordinate ``wavelength``.
    method : {"maximum-value"}, optional
    by : xarray.DataArray, dims (time, y, x), optional
        What is largest on the date that is kept; by default the images themselves where they have no bands, else their
        NDVI. Images of anything else than reflectance need it.

    Returns
    -------
    composite : xarray.DataArray, dims (y, x) or (band, y, x)
        With ``date``, that of each cell, as coordinate over (y, x), and so the angles of sun and view where they differ
        among the dates. The distance of the sun is none of a composite. NaN where no date has data. Lazy where the
        images are.

    Raises
    ------
    ValueError
        If there is no dimension time, no such method, or ``by`` has other dates or cells.

    Notes
    -----
    The largest of many values with errors is too large: see `fifesim.analysis.compositing.date_of_maximum`.

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
    >>> bool((best.date == dates[1]).all())
    True
    """
    if method not in _METHODS:
        raise ValueError(f"method must be one of {', '.join(_METHODS)}, got {method!r}")
    if images.dtype.kind != "f" or cf.QUANTITIES["toa_radiance"].units == images.attrs.get("units"):
        raise ValueError(
            "a composite is made of reflectance or NDVI: digital numbers and radiance have another sun at each date, "
            "take .fifesim.to_reflectance() of them first"
        )
    if "time" not in images.dims:
        raise ValueError(
            f"a composite is made of images along time, got dimensions {images.dims}: join dates with "
            "xarray.concat([...], dim='time')"
        )
    grid = grids.geobox(images.isel(time=0))
    index = _index(images) if by is None else _checked(by, images)
    chosen = _along_time(_METHODS[method], index.drop_vars(list(index.coords)), dtype=np.int64)
    plain = images.drop_vars(list(images.coords))
    out = _along_time(values_of_date, plain, chosen, dtype=images.dtype, missing=np.nan)
    out = out.transpose(*(name for name in images.dims if name != "time"))
    kept = {name: value for name, value in images.coords.items() if not {"time", "y", "x"} & set(value.dims)}
    out = grids.place(out.assign_coords(kept), grid).assign_coords(_of_date(images, chosen))
    history = f"composite: {method} of {images.sizes['time']} dates"
    out.attrs = dict(images.attrs) | {"composite": method, "references": _REFERENCE}
    out.attrs["history"] = "\n".join(filter(None, [images.attrs.get("history", ""), history]))
    return out.rename(images.name)


def _index(images):
    """What is largest on the date that is kept."""
    if "band" not in images.dims:
        cf.check_quantity(images, "ndvi")
        return images.transpose("time", "y", "x")
    dates = [ndvi(images.isel(time=number, drop=True)) for number in range(images.sizes["time"])]
    # The angles of each date would have to agree.
    return xr.concat([each.drop_vars(list(each.coords)) for each in dates], "time")


def _checked(by, images):
    """What is largest, of the dates and cells of the images."""
    if by.dims != ("time", "y", "x") or by.sizes["time"] != images.sizes["time"]:
        raise ValueError(f"by has dimensions (time, y, x) with the dates of the images, got {dict(by.sizes)}")
    if {"time"} <= set(by.coords) & set(images.coords) and not np.array_equal(by["time"], images["time"]):
        raise ValueError("by has other dates than the images, or in another order: sort both with .sortby('time')")
    one = images.isel(time=0, drop=True)
    chunks.aligned([one, with_crs_of(by.isel(time=0, drop=True), one).rename("by")])
    return by


def _of_date(images, chosen):
    """Coordinates that each cell has of its date."""
    named = {"date": images["time"]}
    angles = {name: images[name] for name in ANGLES if name in images.coords and "time" in images[name].dims}
    named |= {name: values for name, values in angles.items() if values.dims == ("time",)}
    found = {}
    for name in set(angles) - set(named):
        plain = angles[name].drop_vars(list(angles[name].coords))
        found[name] = _along_time(values_of_date, plain, chosen, dtype=plain.dtype, missing=np.nan)
        found[name].attrs = cf.attributes(name)
    for name, values in named.items():
        dated = values.dtype.kind == "M"
        dates = values.variable.values if dated else values.variable.values.astype(float)
        look_up = partial(_looked_up, dates, np.datetime64("NaT") if dated else np.nan)
        attrs = cf.attributes(name) if name in ANGLES else {"long_name": "date of the image that is kept"}
        found[name] = _along_time(look_up, chosen, dtype=dates.dtype)
        # xarray may keep the attributes of the index here.
        found[name].attrs = attrs
    return found


def _looked_up(values, missing, chosen):
    return np.where(chosen < 0, np.asarray(missing, values.dtype), values[np.maximum(chosen, 0)])


def _along_time(kernel, *arrays, dtype, **parameters):
    """Apply a kernel that has all dates of a cell along its last axis."""
    core = [["time"] if "time" in each.dims else [] for each in arrays]
    return xr.apply_ufunc(
        kernel, *arrays, input_core_dims=core, join="exact", dask="parallelized", output_dtypes=[dtype],
        kwargs=parameters, dask_gufunc_kwargs={"allow_rechunk": True},
    )  # fmt: skip
