"""Digital numbers without metadata as a calibrated image."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal, TypeAlias

import numpy as np
import xarray as xr

from fifesim.base.annotations import NumberByBand, Time
from fifesim.base.digital_numbers import counts
from fifesim.base.kinds import UNCHECKED
from fifesim.rasters import cf, chunks, directions
from fifesim.rasters import grid as grids
from fifesim.rasters.axes import north_up
from fifesim.rasters.dates import by_date
from fifesim.rasters.directions import Directions
from fifesim.sensor.description.annotations import InstrumentLike
from fifesim.sensor.description.instruments import instrument as find_instrument
from fifesim.sensor.description.rasters.carried import attributes_of
from fifesim.sensor.response.rasters import digital_numbers
from fifesim.sensor.response.rasters.matching import matching_bands

_CURE = (
    "give nodata=, or gain= and offset= for scaled numbers; products of agencies open with fifesim.open_landsat and "
    "fifesim.open_sentinel2"
)

# Reflectance under an overhead sun at which an imager saturates, with a wide margin: Landsat, Sentinel-2 and the
# instruments of this package have 0.24 to 2.7.
_DIMMEST, _BRIGHTEST = 0.02, 20.0

# The digital number of saturated pixels; None where no number marks them.
Saturation: TypeAlias = Annotated[int | Literal["largest"] | None, UNCHECKED]


@by_date
def calibrate(
    dn: xr.DataArray,
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
    Make an image of digital numbers, with calibration, wavelengths and sun, in the form that `sense` gives.

    Parameters
    ----------
    dn : xarray.DataArray of whole numbers, dims ([band], y, x)
        Has a coordinate ``band`` of the instrument's names, or ``wavelength`` [um]. NaN is no data. [1]
    instrument : str or Instrument
    time : str or datetime, optional
        Time of the image, UTC without a time zone. The sun is that over the middle of the grid, and the view is from
        nadir. By default the raster's coordinate ``time``.
    geometry : Geometry or xarray.Dataset, optional
        Sun and view, which replace the sun of the time. Without both, the raster's coordinates count.
    gain, offset : float, sequence over the bands, or mapping of band name to float, optional
        Radiance of one count, and of digital number 0: RADIANCE_MULT and RADIANCE_ADD of Landsat's metadata. By default
        those of the instrument's description, with its scale of square roots if it has one. [W m-2 sr-1 um-1]
    nodata : int, optional
        Digital number of no data.
    saturated : int, "largest" or None, optional
        Digital number of saturated pixels, which become no data, as in `open_landsat`. By default the largest number
        of the instrument's bits, such as 255 for TM; with `gain` and `offset`, 255 for instruments of up to 8 bits and
        rasters of one byte, 65535 otherwise. None keeps saturated pixels: their radiance is a lower limit.

    Returns
    -------
    image : xarray.DataArray of unsigned integers, dims (band, y, x)
        Input of ``to_radiance``, ``to_reflectance``, ``to_surface`` and ``ndvi``, which give NaN for 0, the number of
        no data and saturation. Lazy where the input is.

    Raises
    ------
    ValueError
        If the bands, the sun, or one of gain and offset are unknown, gain and offset are not those of radiance in W m-2
        sr-1 um-1, or the instrument cannot record a number. On lazy data, numbers are checked when they compute.
    TypeError
        If `dn` is no DataArray.

    See Also
    --------
    fifesim.base.digital_numbers.counts

    Examples
    --------
    Counts of an image that has lost its calibration:

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
    if not isinstance(dn, xr.DataArray):
        raise TypeError(f"dn must be an xarray.DataArray of digital numbers, got {type(dn).__name__}")
    if "gain" in dn.coords:
        raise ValueError("the raster carries a calibration already: drop it with .drop_vars(['gain', 'offset'])")
    description = find_instrument(instrument)
    dn = north_up(dn if "band" in dn.dims else dn.expand_dims("band")).transpose("band", "y", "x")
    bands = matching_bands(dn, description)
    # A geometry that is given wins over the sun of a time that is given, which is the image's all the same.
    geometry = directions.given_geometry(geometry, dn, time if geometry is None else None)
    time = directions.dated(dn, time).coords.get("time")
    if (gain is None) != (offset is None):
        raise ValueError("gain and offset make radiance of a digital number together: give both, or neither")
    compression = [0]
    if gain is None:
        gain, offset, bits = digital_numbers.scale(description, bands)
        compression = [band.compressed_count(bits) for band in bands]
        full = bits
    else:
        gain, offset = (_by_band(given, bands, name) for name, given in (("gain", gain), ("offset", offset)))
        bits = 16 if dn.dtype.itemsize > 1 else 8
        # Products of instruments of up to 8 bits have 8, also where they are stored in wider numbers.
        full = 8 if description.bits <= 8 else bits
        if not np.all(gain > 0):
            raise ValueError(f"gain must be above 0 W m-2 sr-1 um-1 per count, got {np.min(gain):g}")
        _check_scale(gain * (2**full - 1) + offset, bands)
    saturated = _saturation(saturated, 2**full - 1, 2**bits - 1)
    known = {"nodata": nodata, "largest": 2**bits - 1, "cure": _CURE, "saturated": saturated}
    plain = dn.drop_vars("band", errors="ignore")
    out = chunks.pointwise(counts, plain, dtype=np.uint8 if bits <= 8 else np.uint16, **known)
    along_band = {"band": [band.name for band in bands], "wavelength": [band.wavelength for band in bands]}
    along_band |= {"gain": gain, "offset": offset, "solar_irradiance": [band.solar_irradiance for band in bands]}
    along_band |= {"compression": compression} if any(compression) else {}
    out = directions.with_geometry(grids.place(out, grids.geobox(dn)), geometry).assign_coords(
        cf.band_coordinates(**along_band)
    )
    out = out if time is None or time.ndim else out.assign_coords(time=((), time.values, cf.TIME))
    history = f"calibrate: {description.name}"
    image = cf.label(out, "dn", source=dn, history=history, **attributes_of(description))
    image.attrs["_FillValue"] = image.dtype.type(0)
    return image


def _check_scale(radiance, bands):
    """Raise ValueError if the radiance of the largest digital number is far from any that the Sun can cause."""
    for largest, band in zip(radiance, bands, strict=True):
        reflectance = np.pi * largest / band.solar_irradiance
        if not _DIMMEST <= reflectance <= _BRIGHTEST:
            raise ValueError(
                f"gain and offset give {band.name} a radiance of {largest:.3g} W m-2 sr-1 um-1 at the largest digital "
                f"number, a reflectance of {reflectance:.2g} under an overhead sun: give those of radiance in this "
                "unit. Convert scaled reflectance by dn * gain + offset instead, and do not calibrate it"
            )


def _saturation(given, full, largest):
    """Digital number of saturated pixels, None where they are kept."""
    if given is None or (isinstance(given, str) and given == "largest"):
        return None if given is None else full
    if isinstance(given, bool | str) or not 0 < given <= largest:
        raise ValueError(f"saturated must be 'largest', None, or a digital number from 1 to {largest}, got {given!r}")
    return given


def _by_band(given, bands, name):
    """A number for each band."""
    if isinstance(given, Mapping):
        missing = [band.name for band in bands if band.name not in given]
        if missing:
            raise ValueError(f"{name} has no number for {', '.join(missing)}: it has {', '.join(map(str, given))}")
        given = [given[band.name] for band in bands]
    values = np.asarray(given, float)
    if values.shape not in ((), (len(bands),)) or not np.isfinite(values).all():
        raise ValueError(f"{name} must be a number, or one for each of {len(bands)} bands, got {given!r}")
    return np.broadcast_to(values, (len(bands),))
