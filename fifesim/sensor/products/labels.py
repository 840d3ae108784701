"""Product files and plain digital numbers as calibrated, labelled images."""

from __future__ import annotations

import os
from functools import partial
from typing import Annotated, Literal, TypeAlias

import numpy as np
import xarray as xr

from fifesim.base.arguments import RASTER, Kind, NumberByBand, Time
from fifesim.base.bands import counts
from fifesim.base.files import in_a_line
from fifesim.grids import cf, chunks, directions
from fifesim.grids import grid as grids
from fifesim.grids.dates import by_date
from fifesim.grids.directions import Directions
from fifesim.grids.grid import north_up
from fifesim.grids.inputs import no_data_of
from fifesim.grids.opening import check_memory, raster_file, sound_raster, stored_cells
from fifesim.sensor import labels as sensor_labels
from fifesim.sensor.description.instrument_file import InstrumentLike
from fifesim.sensor.description.instruments import instrument as find_instrument
from fifesim.sensor.instrument_labels import attributes_of, coordinates_of_bands, matching_bands
from fifesim.sensor.response.calibration import product_reflectance

# Edge of a chunk by default: whole blocks of the agencies' files. [pixel]
CHUNK = 2048


def open_layer(folder, name, chunks, cure, count=None):
    """File of a product as a layer of integers, dims (y, x), or (band, y, x) with a count."""
    path = folder / name
    if not path.exists():
        raise ValueError(f"{in_a_line(name, 150)} is missing in {in_a_line(folder, 120)}: {cure}")
    file = raster_file(path)
    with sound_raster(file, north_up=True) as (source, crs):
        if source.count != (count or 1) or np.dtype(source.dtypes[0]).kind not in "iu":
            raise ValueError(
                f"{file.name} has {source.count} bands of {source.dtypes[0]}, where a product has {count or 1} of "
                "whole numbers: is it another file?"
            )
        if chunks is None:
            size = source.count * source.height * source.width
            check_memory(size, 12, f"all of {file.name}", "leave chunks out, which reads it by parts")
        layer = stored_cells(file, crs, {"y": CHUNK, "x": CHUNK} if chunks == "auto" else chunks).rename(path.name)
    return layer.drop_vars("band") if count else layer.isel(band=0, drop=True)


def check_same_grid(layer, other):
    """Raise ValueError if layers of one product are on different grids."""
    one, two = grids.geobox(layer), grids.geobox(other)
    if not grids.same_grid(one, two):
        names = " and ".join(os.path.basename(each.name) for each in (layer, other))
        raise ValueError(
            f"{names} have different grids, {grids.in_words(one)} and {grids.in_words(two)}: "
            "open them one at a time with bands="
        )


def reflectance(layers, bands, flags=None, mu_s=1.0):
    """Reflectance of layers of digital numbers on one grid, dims (band, y, x), float32. [1]"""
    for layer in layers[1:]:
        check_same_grid(layer, layers[0])
    grid = grids.geobox(layers[0])
    bare = [layer.drop_vars(["y", "x", "spatial_ref"]).rename(None) for layer in layers]
    stack = grids.place(xr.concat(bare, dim="band"), grid)
    scale = [xr.Variable("band", [getattr(band, name) for band in bands]) for name in ("gain", "offset", "largest")]
    flag = xr.Variable("band", np.array([band.flag for band in bands], np.uint16))
    flags = xr.DataArray(np.uint16(0)) if flags is None else flags
    out = chunks.pointwise(product_reflectance, stack, *scale, flag, flags, xr.DataArray(mu_s), dtype=np.float32)
    return grids.place(out, grid)


def as_image(array, bands, description, *, level, time, geometry, quality, history, reference):
    """Reflectance of a product with the labels and coordinates of images from fifesim."""
    own = description.select([band.name for band in bands])
    irradiance = [
        band.solar_irradiance if given.solar_irradiance is None else given.solar_irradiance
        for band, given in zip(own, bands, strict=True)
    ]
    along_band = coordinates_of_bands(own, solar_irradiance=irradiance)
    array = directions.with_geometry(array.assign_coords(along_band), geometry)
    array = array.assign_coords(time=((), time, cf.TIME_ATTRIBUTES))
    if quality is not None:
        array = array.assign_coords(quality=(("y", "x"), quality.data, quality.attrs))
    name = "toa_reflectance" if level == 1 else "surface_reflectance"
    source = {"references": reference, "recorded_by": description.name}
    return cf.label(array, name, history=history, **source, **attributes_of(description))


_CURE = (
    "give nodata=, or gain= and offset= for scaled numbers; products of agencies open with fifesim.open_landsat and "
    "fifesim.open_sentinel2"
)

# Reflectance under an overhead sun at which an imager saturates, with a wide margin: Landsat, Sentinel-2 and the
# instruments of this package have 0.24 to 2.7.
_DIMMEST, _BRIGHTEST = 0.02, 20.0

# Digital number of saturated pixels; None if there is none.
Saturation: TypeAlias = Annotated[
    int | Literal["largest"] | None,
    Kind(
        "'largest', None, or a digital number", lambda value: value is None or isinstance(value, str | int | np.integer)
    ),
]


@by_date
def calibrate(
    dn: Annotated[xr.DataArray, RASTER._replace(stored=True)],
    instrument: InstrumentLike,
    *,
    time: Time | None = None,
    geometry: Directions | None = None,
    gain: NumberByBand | None = None,
    offset: NumberByBand | None = None,
    nodata: int = 0,
    saturated: Saturation = "largest",
) -> xr.DataArray:
    """
    Create an image from digital numbers, with calibration, wavelengths and sun as from `sense`.

    Parameters
    ----------
    dn : xarray.DataArray of whole numbers, dims ([band], y, x)
        Digital numbers with a coordinate ``band`` of band names, or ``wavelength`` [um]. NaN is no data. [1]
    instrument : str or Instrument
    time : str or datetime, optional
        Time of the image, in UTC unless it has a time zone; by default the coordinate ``time``. The sun is computed for
        the grid centre; the view is nadir.
    geometry : Geometry or xarray.Dataset, optional
        Directions of sun and sensor, instead of ``time``; by default from the coordinates.
    gain, offset : float, sequence over the bands, or mapping of band name to float, optional
        Radiance of one count, and of digital number 0: RADIANCE_MULT and RADIANCE_ADD of Landsat's metadata. By default
        from the description of the instrument, including a square-root scale. [W m-2 sr-1 um-1]
    nodata : int, optional
        Digital number of no data, in addition to the fill value that the raster declares.
    saturated : int, "largest" or None, optional
        Digital number of saturated pixels, which become no data, as in `open_landsat`. By default the largest number of
        the instrument's bits, such as 255 for TM; with `gain` and `offset`, 255 for instruments of up to 8 bits and
        rasters of one byte, 65535 otherwise. None keeps them.

    Returns
    -------
    image : xarray.DataArray of unsigned integers, dims (band, y, x)
        Input of ``to_radiance``, ``to_reflectance``, ``to_surface`` and ``ndvi``, which give NaN for 0, the number of
        no data and saturation. The attribute ``saturated_pixels`` is the number of saturated pixels, unless the input
        is lazy. Lazy where the input is.

    Raises
    ------
    ValueError
        If the bands, the sun, gain or offset are unknown, gain and offset are implausible for W m-2 sr-1 um-1, or a
        number is out of range. Lazy data are checked when they are computed.
    TypeError
        If `dn` is not a DataArray.

    See Also
    --------
    fifesim.open_image, fifesim.to_reflectance, fifesim.sensor.to_radiance

    Examples
    --------
    Restore the calibration of an image:

    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    >>> image = rho.fifesim.to_toa().fifesim.sense("TM")
    >>> counts = image.drop_vars(["gain", "offset"]).drop_attrs()
    >>> counts = counts.rio.write_crs(grid.crs.to_wkt())
    >>> again = counts.fifesim.calibrate("TM", time="1987-06-06T16:35Z")
    >>> bool(abs(again.fifesim.ndvi() - image.fifesim.ndvi()).max() < 1e-3)
    True
    """
    if "gain" in dn.coords:
        raise ValueError("the raster carries a calibration already: drop it with .drop_vars(['gain', 'offset'])")
    description = find_instrument(instrument)
    dn = north_up(dn if "band" in dn.dims else dn.expand_dims("band")).transpose("band", "y", "x")
    declared = no_data_of(dn)
    dn = dn if declared in (None, nodata) or np.isnan(declared) else dn.where(dn != declared, nodata)
    bands = matching_bands(dn, description)
    # A given geometry overrides the sun of a given time, which still becomes the time of the image.
    geometry = directions.given_geometry(geometry, dn, time if geometry is None else None)
    time = directions.dated(dn, time).coords.get("time")
    if (gain is None) != (offset is None):
        raise ValueError("gain and offset make radiance of a digital number together: give both, or neither")
    compression = [0]
    if gain is None:
        gain, offset, bits = sensor_labels.scale(description, bands)
        compression = [band.compressed_count(bits) for band in bands]
        full = bits
    else:
        gain, offset = (
            sensor_labels.numbers_of_bands(given, bands, name) for name, given in (("gain", gain), ("offset", offset))
        )
        bits = 16 if dn.dtype.itemsize > 1 else 8
        # Products of instruments with up to 8 bits have 8 bits, even if stored in a wider type.
        full = 8 if description.bits <= 8 else bits
        if not np.all(gain > 0):  # type: ignore[operator]
            raise ValueError(f"gain must be above 0 W m-2 sr-1 um-1 per count, got {np.min(gain):g}")
        _check_scale(gain * (2**full - 1) + offset, bands)
    saturated = _saturation(saturated, 2**full - 1)
    kernel = partial(counts, nodata=nodata, largest=2**full - 1, cure=_CURE, saturated=saturated)
    plain = dn.drop_vars("band", errors="ignore")
    out = chunks.pointwise(kernel, plain, dtype=np.uint8 if bits <= 8 else np.uint16)
    scales = {"gain": gain, "offset": offset} | ({"compression": compression} if any(compression) else {})
    out = directions.with_geometry(grids.place(out, grids.geobox(dn)), geometry)
    out = out.assign_coords(coordinates_of_bands(bands, scales))
    out = out if time is None or time.ndim else out.assign_coords(time=((), time.values, cf.TIME_ATTRIBUTES))
    found = {} if saturated in (None, nodata) else sensor_labels.number_of_pixels(dn.variable == saturated)  # type: ignore[operator]
    return sensor_labels.labelled(out, dn.assign_attrs(found), description, f"calibrate: {description.name}")


def _check_scale(radiance, bands):
    """Raise ValueError if the radiance of the largest digital number is far from any possible one."""
    for largest, band in zip(radiance, bands, strict=True):
        reflectance = np.pi * largest / band.solar_irradiance
        if not _DIMMEST <= reflectance <= _BRIGHTEST:
            raise ValueError(
                f"gain and offset give {band.name} a radiance of {largest:.3g} W m-2 sr-1 um-1 at the largest digital "
                f"number, a reflectance of {reflectance:.2g} under an overhead sun: give those of radiance in this "
                "unit. Convert scaled reflectance by dn * gain + offset instead, and do not calibrate it"
            )


def _saturation(given, largest):
    """Digital number of saturated pixels, None if they are kept."""
    if given is None:
        return None
    if isinstance(given, str) and given == "largest":
        return largest
    if isinstance(given, bool | str) or not 0 < given <= largest:
        raise ValueError(f"saturated must be 'largest', None, or a digital number from 1 to {largest}, got {given!r}")
    return given
