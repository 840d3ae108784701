"""The sensor on labelled rasters: from light at the top of the atmosphere to digital numbers, and back."""

from __future__ import annotations

from typing import Literal

import numpy as np
import xarray as xr
from odc.geo.geobox import GeoBox

from fifesim.base.annotations import Interval, Noise, Offset, Time, WholeNumber
from fifesim.base.geometry import ANGLES
from fifesim.rasters import cf, chunks, directions, swaths
from fifesim.rasters import grid as grids
from fifesim.rasters.annotations import Image, RasterOrDataset
from fifesim.rasters.dates import by_date
from fifesim.rasters.directions import Directions
from fifesim.rasters.own_rasters import HIGHEST, LOWEST, SAMPLED_ROWS, incoming
from fifesim.rasters.sun import check_same_sun
from fifesim.rasters.windows import held
from fifesim.sensor.description.annotations import InstrumentLike
from fifesim.sensor.description.rasters.carried import attributes_of, given_instrument
from fifesim.sensor.response import calibration
from fifesim.sensor.response.noise import NoiseModels, check_kinds
from fifesim.sensor.response.rasters import digital_numbers
from fifesim.sensor.response.rasters.matching import matching_bands, warn_of_others
from fifesim.sensor.response.rasters.noise import noisy
from fifesim.sensor.response.rasters.pixels import (
    bands_by_grid,
    directions_on,
    means_by_band,
    pixel_grid,
)

# Share of its footprint's weight that a pixel needs on valid cells. The footprint of Table 1, 30.32 m, leaves a
# scene of whole 30 m pixels by 0.16 m.
MIN_VALID = 0.98

# Coordinates that turn digital numbers into radiance.
_SCALE = ("gain", "offset", "compression")


@by_date
def sense(
    toa: RasterOrDataset,
    instrument: InstrumentLike | None = None,
    *,
    onto: GeoBox | None = None,
    interval: Interval | None = None,
    offset: Offset = (0.0, 0.0),
    noise: Noise = (),
    seed: WholeNumber = 0,
    noise_models: NoiseModels | None = None,
    quantise: bool = True,
    scaling: Literal["detector", "product"] = "detector",
    min_valid: float = MIN_VALID,
    geometry: Directions | None = None,
    time: Time | None = None,
) -> Image:
    """
    Image that an instrument records: regularized onto its pixels, with its noise, and digitised.

    Parameters
    ----------
    toa : xarray.DataArray, dims (band, y, x)
        Reflectance or radiance at the top of the atmosphere, by cells. Bands are those of the instrument that have the
        same name, or else whose response is there at their ``wavelength``. [1 or W m-2 sr-1 um-1]
    instrument : str or fifesim.sensor.description.instruments.Instrument, optional
        By default that whose bands the array carries.
    onto : odc.geo.geobox.GeoBox, optional
        North-up grid of pixels in the CRS of the scene, of any size and offset. By default the instrument's gridded
        product, with the upper left corner of the scene.
    interval : "native", float or (float, float), optional
        Distance between pixels instead of that of the gridded product: the instrument's own at nadir, or metres, down
        and across. The coordinates move with it; footprints stay. [m]
    offset : (float or array, float or array), optional
        Registration error southward and eastward, a number or a drift of one for each row and each column. The pixels
        see the ground beside them; the coordinates stay nominal. [pixel]
    noise : str or sequence of str, optional
        Among "shot", "thermal" and "fixed-pattern", or "all" for the kinds that the instrument has. Its description
        has their size; a kind that it lacks is refused.
    seed : int, optional
        Of the noise.
    noise_models : fifesim.sensor.response.noise.NoiseModel, or mapping of str to NoiseModel, optional
        Size of the noise for every band, or by name of a band, where the description lacks it or is not to count.
    quantise : bool, optional
        Whether to digitise; radiance otherwise.
    scaling : "detector" or "product", optional
        What a digital number is: a count of the instrument's own, spread over its radiances; or one of the agency's
        Level-1 product, which is scaled by reflectance (OLI, OLI2; MSI and MSI-B with the offset of processing baseline
        04.00). Those are finer than the detector's, whose steps are not in them.
    min_valid : float, optional
        Share of its footprint that a pixel needs on valid cells; below it is no data. [1]
    geometry : fifesim.base.geometry.Geometry or xarray.Dataset, optional
        By default that which the array carries, else of the sun at its time and place. A radiance needs none.
    time : str or datetime, optional
        In the place of ``geometry``: when the sun stood over the scene.

    Returns
    -------
    image : xarray.DataArray of unsigned integers, dims (band, y, x)
        Digital numbers from 1; 0 is no data. ``gain``, ``offset``, ``wavelength`` and ``solar_irradiance`` are
        coordinates along band, and ``compression`` where a band has a scale of square roots. Without ``quantise``,
        radiance with ``wavelength`` and ``solar_irradiance``. Of bands of several resolutions, an `xarray.DataTree`
        with a node for each, such as ``/10m`` and ``/20m``, that holds its ``dn``, or ``toa_radiance``.
        [1 or W m-2 sr-1 um-1]

    Raises
    ------
    ValueError
        If the instrument is unknown, has none of the bands, no such noise or no such scaling, ``onto`` is no grid of
        the scene's CRS or lies beside the scene, a point spread is wider than the scene, or `to_toa` made the raster
        for another sun.

    See Also
    --------
    fifesim.base.footprints.regularize, fifesim.sensor.response.noise.add_noise,
    fifesim.sensor.response.calibration.radiance_to_dn, fifesim.sensor.response.product_scaling

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    >>> image = rho.fifesim.to_toa().fifesim.sense("TM")
    >>> image.shape, image.dtype
    ((2, 10, 10), dtype('uint8'))
    >>> image.mean(["y", "x"]).round(1).values
    array([51.8, 73.4])
    """
    toa, description, bands = by_bands(toa, instrument)
    digital_numbers.check_scaling(scaling, description, quantise)
    # A radiance is recorded whatever the sun.
    needed = not _is_radiance(toa) or scaling == "product"
    geometry = (directions.given_geometry if needed else directions.known_geometry)(geometry, toa, time)
    check_same_sun(geometry, toa)
    toa = directions.dated(toa, time)
    groups = bands_by_grid(description, bands, onto, interval)
    if len(groups) > 1:
        options = {"offset": offset, "noise": noise, "seed": seed, "noise_models": noise_models, "geometry": geometry}
        options |= {"interval": interval, "quantise": quantise, "scaling": scaling, "min_valid": min_valid}
        images = {size: sense(toa.isel(band=numbers), description, **options) for size, numbers in groups.items()}
        return xr.DataTree.from_dict({f"/{size}": image.to_dataset() for size, image in images.items()})
    pixels = pixel_grid(grids.geobox(toa), description, bands, onto, interval)
    geometry = None if geometry is None else directions_on(pixels, geometry)
    scene = toa.drop_vars(ANGLES, errors="ignore")
    means = means_by_band(scene, description, bands, pixels, offset=offset, min_valid=min_valid)
    # Lines count from the origin of the CRS: a window of an image has the noise of the whole.
    first = grids.lattice_position(pixels)
    radiance = noisy(as_radiance(means, bands, geometry), description, bands, noise, seed, first, noise_models)
    image = digital_numbers.recorded(radiance, description, bands, quantise, geometry if scaling == "product" else None)
    carried = {} if geometry is None else directions.coordinates_of(geometry)
    image = grids.place(image.copy(data=held(image.data)), pixels, carried)
    return labelled(image, toa, description, _history(description, interval, offset, noise, seed, quantise, scaling))


def by_bands(toa, instrument):
    """
    What an instrument looks at, and the bands in which it does.

    Parameters
    ----------
    toa, instrument
        As in `sense`.

    Returns
    -------
    toa : xarray.DataArray, dims (band, y, x)
    description : fifesim.sensor.description.instruments.Instrument
    bands : tuple of fifesim.sensor.description.band.InstrumentBand
        One for each of the array.

    Raises
    ------
    ValueError
        If the array is something else, or the instrument is unknown or has none of the bands.
    """
    if "composite" in toa.attrs:
        raise ValueError("a composite is of many dates, and nothing records it: sense each date, and composite those")
    if not _is_radiance(toa):
        toa = incoming(toa, "toa_reflectance")
    cf.check_quantity(toa, "toa_reflectance", "toa_radiance")
    description = given_instrument(instrument, toa)
    toa = toa if "band" in toa.dims else toa.expand_dims("band")
    bands = matching_bands(toa, description)
    warn_of_others(toa, description, bands)
    return toa, description, bands


def _is_radiance(array):
    return str(array.attrs.get("units", "1")).strip() == cf.QUANTITIES["toa_radiance"].units


def labelled(image, toa, description, history):
    """
    Image with the labels of what it is: digital numbers where it holds whole numbers, else radiance.

    Parameters
    ----------
    image : xarray.DataArray
        From `digital_numbers.recorded`.
    toa : xarray.DataArray
        What it was sensed of.
    description : fifesim.sensor.description.instruments.Instrument
    history : str

    Returns
    -------
    image : xarray.DataArray
    """
    name = "dn" if image.dtype.kind == "u" else "toa_radiance"
    image = cf.label(image, name, source=toa, history=history, **attributes_of(description))
    if name == "dn":
        image.attrs["_FillValue"] = image.dtype.type(0)
    return image


def _history(description, interval, offset, noise, seed, quantise, scaling):
    """What was done, beside the defaults."""
    kinds = check_kinds(noise)
    bits = description.bits if scaling == "detector" else description.product.bits
    parts = [
        f"sense: {description.name}, {bits} bits" if quantise else f"sense: {description.name}, radiance",
        f"scaling {scaling}" if scaling != "detector" else "",
        f"interval {interval}" if interval is not None else "",
        "offset" if any(np.any(np.asarray(each) != 0) for each in offset) else "",
        f"noise {' '.join(kinds)}, seed {seed}" if kinds else "",
    ]
    return ", ".join(filter(None, parts))


@by_date
def to_radiance(image: xr.DataArray) -> xr.DataArray:
    """
    Radiance of an image of digital numbers.

    Parameters
    ----------
    image : xarray.DataArray of unsigned integers, dims (band, y, x)
        With coordinates ``gain`` and ``offset``, and ``compression`` where it has one, as `sense` makes it.

    Returns
    -------
    radiance : xarray.DataArray, dims (band, y, x)
        Within half a count of what was recorded, NaN where there are no data. [W m-2 sr-1 um-1]

    Raises
    ------
    ValueError
        If the image carries no calibration, a gain is not above 0, its units are not those of digital numbers, or a
        value is negative, fractional or above the largest digital number; for lazy data, when they are computed.

    See Also
    --------
    fifesim.sensor.response.calibration.dn_to_radiance

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    >>> image = rho.fifesim.to_toa().fifesim.sense("TM")
    >>> image.fifesim.to_radiance().mean(["y", "x"]).round().values
    array([41., 58.])
    """
    scale = _scale_of(image)
    out = chunks.pointwise(digital_numbers.radiance_kernel(image), image, *scale)
    out = swaths.placed_as(out.drop_vars(_SCALE, errors="ignore"), image)
    return cf.label(out, "toa_radiance", source=image, history="to_radiance")


def _scale_of(image):
    """Gain, offset, and the compression if there is one, of an image of digital numbers."""
    missing = {"gain", "offset"} - set(image.coords)
    if missing:
        raise ValueError(f"the image has no {' and '.join(sorted(missing))}: open it with fifesim.open_image")
    if not np.all(image["gain"].values > 0):
        raise ValueError(f"gain must be above 0 W m-2 sr-1 um-1 per count, got {np.atleast_1d(image['gain'].values)}")
    return [_along_band(image, name) for name in _SCALE if name in image.coords]


@by_date
def to_reflectance(image: xr.DataArray) -> xr.DataArray:
    """
    Planetary reflectance of an image.

    Parameters
    ----------
    image : xarray.DataArray, dims (band, y, x)
        Digital numbers or radiance, with the coordinates that `sense` gives.

    Returns
    -------
    reflectance : xarray.DataArray, dims (band, y, x)
        [1]

    Raises
    ------
    ValueError
        If the image carries no calibration, solar irradiance or solar zenith angle, they give impossible values, or a
        value cannot be a digital number, as in `to_radiance`.

    See Also
    --------
    fifesim.sensor.response.calibration.radiance_to_reflectance

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    >>> image = rho.fifesim.to_toa().fifesim.sense("TM")
    >>> image.fifesim.to_reflectance().mean(["y", "x"]).round(2).values
    array([0.1 , 0.21])
    """
    out, history = planetary(image)
    return cf.label(swaths.placed_as(out, image), "toa_reflectance", source=image, history=history)


def planetary(image):
    """Planetary reflectance of an image [1], with its coordinates and without attributes, and the steps taken."""
    counts = "gain" in image.coords
    if not counts:
        cf.check_quantity(image, "toa_radiance")
    scale, radiance = (_scale_of(image), digital_numbers.radiance_kernel(image)) if counts else ([], None)
    # Only the sun counts, and the view of a scan is an array.
    geometry = directions.geometry_of(image, ("sza", "saa", "earth_sun_distance"))
    if geometry is None or "solar_irradiance" not in image.coords:
        raise ValueError("the image carries no sza or no solar_irradiance: open it with fifesim.open_image")
    below = _along_band(image, "solar_irradiance"), directions.mu_s(geometry)
    distance = float(geometry.earth_sun_distance)
    out = chunks.pointwise(_reflectance_of, image, *below, *scale, radiance=radiance, earth_sun_distance=distance)
    out.attrs = {}
    history = "to_radiance\nto_reflectance" if counts else "to_reflectance"
    return out.drop_vars(_SCALE, errors="ignore"), history


def _reflectance_of(values, solar_irradiance, mu_s, *scale, radiance, earth_sun_distance):
    """Reflectance of digital numbers, by the kernel of their radiance, or of radiance."""
    light = values if radiance is None else radiance(values, *scale)
    return _plausible_reflectance(light, solar_irradiance, mu_s, earth_sun_distance)


def _plausible_reflectance(radiance, solar_irradiance, mu_s, earth_sun_distance):
    """Reflectance of a block, or ValueError if half of a sample of it is impossibly bright or dark [1]."""
    out = calibration.radiance_to_reflectance(radiance, solar_irradiance, mu_s, earth_sun_distance)
    sample = out[..., ::SAMPLED_ROWS, :]
    wrong = (sample > HIGHEST) | (sample < LOWEST)
    if 2 * np.count_nonzero(wrong) > sample.size:
        raise ValueError(
            f"gain, offset and solar_irradiance give a reflectance of {sample[wrong].flat[0]:g}: check that radiance "
            "is in W m-2 sr-1 um-1, solar_irradiance in W m-2 um-1 and sza in degrees"
        )
    return out


def as_radiance(array, bands, geometry):
    """
    Radiance of a reflectance, once it is regularized: that is linear and leaves fewer numbers.

    Parameters
    ----------
    array : xarray.DataArray
        Reflectance, or radiance by its units, with a dimension band.
    bands : sequence of fifesim.sensor.description.band.InstrumentBand
        One for each of the array.
    geometry : fifesim.base.geometry.Geometry or xarray.Dataset

    Returns
    -------
    radiance : xarray.DataArray
        [W m-2 sr-1 um-1]
    """
    if _is_radiance(array):
        return array
    irradiance = xr.DataArray([band.solar_irradiance for band in bands], dims="band")
    plain = array.drop_vars("band", errors="ignore")
    return _by_sun(calibration.reflectance_to_radiance, plain, irradiance, geometry)


def _by_sun(kernel, array, irradiance, geometry):
    """Apply a kernel of calibration to light below a sun."""
    distance = float(geometry.earth_sun_distance)
    return chunks.pointwise(kernel, array, irradiance, directions.mu_s(geometry), earth_sun_distance=distance)


def _along_band(image, name):
    """Coordinate along band without a name that would collide."""
    return xr.DataArray(image[name].values, dims=image[name].dims)
