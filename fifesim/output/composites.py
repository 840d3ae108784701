"""Three bands as a colour picture, and a part of the pixels of a raster that is too large to be drawn whole."""

from __future__ import annotations

from functools import partial
from typing import Annotated, Literal, TypeAlias

import numpy as np
import xarray as xr

from fifesim.base.bands import COMPOSITES
from fifesim.base.bands import composite as composite_numbers
from fifesim.base.kinds import NAMES, Kind
from fifesim.output.colours import dark_and_bright, percentile_limits
from fifesim.rasters import chunks, swaths
from fifesim.rasters.reductions import computed

# Pixels along a side from which the limits of a stretch are taken.
_SAMPLE = 1000

Composite: TypeAlias = Annotated[
    Literal["false colour", "natural colour"] | tuple[str, str, str],
    Kind("'false colour', 'natural colour', or the names of three bands", NAMES.fits),
]


def rgb(
    image: xr.DataArray,
    composite: Composite = "false colour",
    *,
    stretch: tuple[float, float] | None = None,
) -> xr.DataArray:
    """
    Colours of an image, which ``.plot.imshow()`` shows.

    Parameters
    ----------
    image : xarray.DataArray, dims (band, y, x)
        Digital numbers, radiance or reflectance.
    composite : {"false colour", "natural colour"} or (str, str, str), optional
        Near infrared, red and green as red, green and blue; red, green and blue; or three bands by name. An image
        without green shows its red twice.
    stretch : (float, float), optional
        Percentiles of a band that become dark and bright; they are computed, from a million pixels at most. By default
        somewhat beyond the first and the last, so that colours are those of a picture and not of a map. [%]

    Returns
    -------
    colours : xarray.DataArray of float32, dims (y, x, rgb)
        From 0 to 1, NaN where a band has no data; lazy where the image is. [1]

    Raises
    ------
    ValueError
        If a band is missing, or the percentiles are none.

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> image = lai.fifesim.surface_reflectance("TM", bands=["TM2", "TM3", "TM4"])
    >>> image.fifesim.rgb().shape
    (90, 90, 3)
    """
    names = composite_bands(image, composite)
    limits_of = dark_and_bright if stretch is None else partial(percentile_limits, percentiles=_percentiles(stretch))
    have = [str(name) for name in image["band"].values]
    layers = [valid(image.isel(band=have.index(name))) for name in names]
    limits = map(limits_of, computed(*(thinned(each, _SAMPLE) for each in layers)))
    stretched = [
        chunks.pointwise(_stretched, layer, dtype=np.float32, low=start, high=stop)
        for layer, (start, stop) in zip(layers, limits, strict=True)
    ]
    # A scalar such as the distance of the sun would be the title that xarray gives a picture.
    place = [*swaths.DIMS, "y", "x", "latitude", "longitude", "spatial_ref", "time"]
    plain = [layer.drop_vars(set(layer.coords) - set(place)) for layer in stretched]
    out = xr.concat(plain, xr.IndexVariable("rgb", ["red", "green", "blue"])).transpose(..., "rgb")
    # One band without data leaves no colour that means anything.
    out = out.where(out.notnull().all("rgb"))
    kept = {name: image.attrs[name] for name in ("instrument", "history") if name in image.attrs}
    out.attrs = {"long_name": f"{', '.join(names)} as red, green, blue", "units": "1"} | kept
    out.encoding = {"grid_mapping": "spatial_ref"}
    return out.rename("colours")


def composite_bands(image, composite="false colour"):
    """
    Names of the bands that become red, green and blue.

    Parameters
    ----------
    image, composite
        As in `rgb`.

    Returns
    -------
    names : list of str

    Raises
    ------
    ValueError
        If it has none of them.
    """
    if "band" not in image.dims:
        raise ValueError(f"colours are of several bands along a dimension band, got {image.dims}: draw it with .plot()")
    have = [str(name) for name in image["band"].values] if "band" in image.coords else []
    if not isinstance(composite, str):
        missing = [str(name) for name in composite if str(name) not in have]
        if missing or len(composite) != 3:
            raise ValueError(f"a composite is of three of the bands {', '.join(have)}, got {tuple(composite)}")
        return [str(name) for name in composite]
    if composite not in COMPOSITES:
        raise ValueError(
            f"composite must be {' or '.join(map(repr, COMPOSITES))}, or the names of three bands, got {composite!r}"
        )
    if "wavelength" not in image.coords:
        three = tuple(have[-1:-4:-1]) if len(have) > 2 else ("B5", "B4", "B3")
        raise ValueError(f"the image has no wavelength [um] along band: name three bands, composite={three}")
    numbers = composite_numbers(image["wavelength"].values, composite)
    if None in numbers:
        lacks = [window.name for window, number in zip(COMPOSITES[composite], numbers, strict=True) if number is None]
        raise ValueError(f"{composite} needs a {' and a '.join(lacks)} band, the image has {', '.join(have)}")
    return [have[number] for number in numbers]


def false_colour_names(image):
    """
    Names of the bands of a picture in false colours.

    Parameters
    ----------
    image : xarray.DataArray with a ``wavelength`` along band

    Returns
    -------
    names : list of str
        Near infrared, red and green; none where one is missing.
    """
    numbers = composite_numbers(image["wavelength"].values)
    return [str(image["band"].values[number]) for number in numbers] if len({*numbers} - {None}) == 3 else []


def valid(layer):
    """
    A band with NaN where it has no data.

    Parameters
    ----------
    layer : xarray.DataArray
        In digital numbers 0 is no data, or what ``_FillValue`` says.

    Returns
    -------
    layer : xarray.DataArray
    """
    if layer.dtype.kind == "f":
        return layer
    missing = layer.attrs.get("_FillValue", layer.encoding.get("_FillValue", 0))
    return layer.where(layer != missing)


def thinned(array, size):
    """
    Every n-th pixel of a raster, from the middle of each n by n.

    Parameters
    ----------
    array : xarray.DataArray, dims (..., y, x) or (..., line, sample)
    size : int
        Pixels along the longer side at most.

    Returns
    -------
    array : xarray.DataArray
        The same where it is no larger.
    """
    axes = swaths.DIMS if set(swaths.DIMS) <= set(array.dims) else ("y", "x")
    step = -(-max(array.sizes[axis] for axis in axes) // size)
    starts = {axis: min(step // 2, array.sizes[axis] - 1) for axis in axes}
    return array if step == 1 else array.isel({axis: slice(start, None, step) for axis, start in starts.items()})


def _stretched(values, low, high):
    span = high - low
    return np.clip((values - low) / span, 0, 1) if span > 0 else np.where(np.isnan(values), np.nan, 0.5)


def _percentiles(stretch):
    low, high = stretch
    if not 0 <= low < high <= 100:
        raise ValueError(f"stretch must be two percentiles from 0 to 100, such as (2, 98), got {stretch}")
    return low, high
