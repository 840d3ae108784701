"""Sensor on labelled rasters: from light at the top of the atmosphere to digital numbers, and back."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Literal

import numpy as np
import xarray as xr
from odc.geo.geobox import GeoBox

from fifesim.base.arguments import Interval, NoiseKinds, NumberByBand, Offset, Time, WholeNumber, described
from fifesim.base.bands import check_counts
from fifesim.base.geometry import ANGLES
from fifesim.base.lattice import check_seed
from fifesim.base.messages import warn
from fifesim.grids import cf, chunks, directions, swaths, windows
from fifesim.grids import grid as grids
from fifesim.grids.dates import by_date, epoch
from fifesim.grids.directions import Directions
from fifesim.grids.inputs import HIGHEST, LOWEST, SAMPLED_ROWS, Image, RasterOrDataset, incoming
from fifesim.grids.sites import check_same_angles
from fifesim.grids.windows import held
from fifesim.sensor.description.instrument_file import InstrumentLike
from fifesim.sensor.instrument_labels import (
    attributes_of,
    coordinates_of_bands,
    given_instrument,
    is_radiance,
    matching_bands,
    warn_of_others,
)
from fifesim.sensor.pixel_labels import bands_by_grid, directions_on, means_by_band, pixel_grid, warn_of_pixels
from fifesim.sensor.response import calibration
from fifesim.sensor.response.calibration import dn_to_radiance, gain_offset, product_gain_offset, radiance_to_dn
from fifesim.sensor.response.noise import ALL, NoiseModel, NoiseModels, add_noise, check_kinds

_CALIBRATE_FIRST = (
    "calibrate with .fifesim.to_radiance() or .fifesim.to_reflectance() before you compute or resample. If the values "
    "are radiance already, type .drop_vars(['gain', 'offset']).assign_attrs(units='W m-2 sr-1 um-1')"
)


def check_scaling(scaling, description, quantise=True):
    """Raise ValueError for an invalid scaling of digital numbers."""
    if scaling == "product" and not quantise:
        raise ValueError("scaling='product' is one of digital numbers: leave it out, or quantise=False")
    if scaling == "product" and description.product is None:
        raise ValueError(
            f"the description of {description.name} has no product scaled to reflectance, unlike OLI, "
            "OLI2, MSI and MSI-B: leave scaling out, or add [product] to an instrument file"
        )


def scale(description, bands, product_geometry=None):
    """Gain and offset of radiance, shape (band,) [W m-2 sr-1 um-1], and number of bits."""
    if product_geometry is None:
        full_scale, lowest = [band.full_scale_radiance for band in bands], [band.min_radiance for band in bands]
        return *gain_offset(full_scale, lowest, description.bits), description.bits
    product, mu_s = description.product, 1.0
    if product.sun_corrected:
        mu_s = directions.uniform_geometry(product_geometry, f"scaling='product' of {description.name}").mu_s
    irradiance = [band.solar_irradiance for band in bands]
    distance = float(product_geometry.earth_sun_distance)
    return *product_gain_offset(product.gain, product.offset, irradiance, mu_s, distance), product.bits


def recorded(radiance, description, bands, quantise, product_geometry=None):
    """Values that an instrument records for a radiance, and the coordinates of its bands."""
    scales = {}
    if quantise:
        gain, offset, bits = scale(description, bands, product_geometry)
        # Product numbers are linear, even if detector counts are compressed.
        compression = [band.compressed_count(bits) if product_geometry is None else 0 for band in bands]
        scales = {"gain": gain, "offset": offset} | ({"compression": compression} if any(compression) else {})
        along_band = [xr.Variable("band", values) for values in (gain, offset, compression)]
        dtype = np.uint8 if bits <= 8 else np.uint16
        radiance = chunks.pointwise(_counts, radiance, *along_band, dtype=dtype, bits=bits)
    return radiance, coordinates_of_bands(bands, scales)


def _counts(radiance, gain, offset, compression, bits):
    """Digital numbers of bands, some of which have a square-root scale."""
    return radiance_to_dn(radiance, gain, offset, bits, compression)


def radiance_kernel(image):
    """Kernel of the radiance of digital numbers, which checks values if their type allows others. [W m-2 sr-1 um-1]"""
    units = image.attrs.get("units", "1")
    if units == cf.QUANTITIES["toa_radiance"].units:
        raise ValueError(f"the image has the calibration of digital numbers and units {units!r}: {_CALIBRATE_FIRST}")
    cf.check_units(image, "dn")
    known, saturated = _recorded_type(image), saturated_number(image)
    if image.dtype.kind == "u" and known == image.dtype:
        return partial(dn_to_radiance, saturated=saturated)
    return partial(_checked_radiance, int(np.iinfo(known or np.uint16).max), saturated)


def _checked_radiance(largest, saturated, dn, *scale):
    check_counts(dn, largest, _CALIBRATE_FIRST)
    return dn_to_radiance(dn, *scale, saturated=saturated)


def _recorded_type(image):
    """Type in which digital numbers were recorded, which is the type of their fill value; None if unknown."""
    fill = image.attrs.get("_FillValue", image.encoding.get("_FillValue"))
    if isinstance(fill, np.generic) and fill.dtype.kind == "u":
        return fill.dtype
    return image.dtype if image.dtype.kind == "u" else None


def saturated_number(image):
    """Digital number of saturated pixels: as stated, else the largest number of the type; 0 if there is none."""
    known = _recorded_type(image)
    return int(image.attrs.get("saturated", 0 if known is None else np.iinfo(known).max))


def saturated_pixels(image):
    """Number of pixels of an image with a saturated band, as `number_of_pixels`."""
    number = saturated_number(image) if cf.is_counts(image) else 0
    return number_of_pixels(image.variable >= number) if number else {}


def number_of_pixels(saturated):
    """Number of pixels with a saturated band, as attributes; none for a lazy image, or if no pixel is saturated."""
    if not isinstance(saturated.data, np.ndarray):
        return {}
    along = tuple(np.flatnonzero(np.array(saturated.dims) == "band").tolist())
    count = int(np.count_nonzero(saturated.data.any(along)))
    return {"saturated_pixels": count} if count else {}


def noisy(radiance, instrument, bands, kinds, seed, first=(0, 0), given=None):
    """Radiance with the noise of an instrument, dims (band, y, x). [W m-2 sr-1 um-1]"""
    check_seed(seed)
    if not check_kinds(kinds):
        return radiance
    models = noise_models(instrument, bands, kinds, given)
    numbers = [instrument.bands.index(band) for band in bands]
    image = epoch(radiance)

    def kernel(block, starts):
        band, row, column = (start + origin for start, origin in zip(starts, (0, *first), strict=True))
        noise = [
            add_noise(values, *models[k], seed=seed, band=numbers[k], row=row, column=column, epoch=image)
            for k, values in enumerate(block, band)
        ]
        return np.stack(noise)

    return windows.located(kernel, radiance)


def noise_models(instrument, bands, kinds, given=None):
    """Noise model of each band, and the kinds of noise to draw from it."""
    kinds = check_kinds(kinds)
    if isinstance(given, Mapping):
        given = {instrument.select(name)[0].name: model for name, model in given.items()}
    models = []
    for band in bands:
        model = given if isinstance(given, NoiseModel) else (given or {}).get(band.name) or instrument.noise_model(band)
        if kinds != (ALL,) and (absent := [kind for kind in kinds if kind not in model.kinds]):
            known = " and ".join(model.kinds) or "none"
            raise ValueError(
                f"noise = {list(kinds)}: {instrument.name} has no {' and no '.join(absent)} noise for {band.name}, "
                f"only {known}; type noise='all' for the kinds that each band has, or give "
                f"noise_models={{{band.name!r}: fifesim.NoiseModel(...)}}, in a scenario [sensor.noise_model]"
            )
        _warn_of_large_noise(model, kinds if kinds != (ALL,) else model.kinds, band)
        models.append((model, model.kinds if kinds == (ALL,) else kinds))
    return models


# Noise above this share of the largest radiance is probably in another unit; that of MSS, with 6 bits, is 0.02. [1]
_LARGE_NOISE = 0.2


def _warn_of_large_noise(model, kinds, band):
    """Warn if the noise of a band at half of its largest radiance is implausible."""
    noise = float(model.noise_equivalent_radiance(band.full_scale_radiance / 2, kinds))
    if noise > _LARGE_NOISE * band.full_scale_radiance:
        warn(
            f"the noise of {band.name} is {noise:g} W m-2 sr-1 um-1 at half of its largest radiance, "
            f"{band.full_scale_radiance:g}: thermal is a standard deviation in W m-2 sr-1 um-1, shot a variance at a "
            "radiance of 1; convert counts or W m-2 sr-1 nm-1 to it"
        )


# Minimum weight of a footprint on valid cells. The footprint of Table 1, 30.32 m, extends 0.16 m beyond a scene of
# whole 30 m pixels.
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
    gain_drift: NumberByBand = 1.0,
    noise: NoiseKinds = (),
    seed: WholeNumber = 0,
    noise_models: NoiseModels | None = None,
    quantise: bool = True,
    scaling: Literal["detector", "product"] = "detector",
    min_valid: float = MIN_VALID,
    geometry: Directions | None = None,
    time: Time | None = None,
) -> Image:
    """
    Simulate the image recorded by an instrument: spatial response, noise and digitisation.

    Parameters
    ----------
    toa : xarray.DataArray, dims (band, y, x)
        Reflectance or radiance of the cells at the top of the atmosphere. Bands are matched with the instrument by
        name, or by ``wavelength``. [1 or W m-2 sr-1 um-1]
    instrument : str or fifesim.sensor.description.instruments.Instrument, optional
        Instrument; by default from the array.
    onto : odc.geo.geobox.GeoBox, optional
        North-up grid of pixels in the CRS of the scene, of any size and offset. By default the instrument's gridded
        product, with the upper left corner of the scene.
    interval : "native", float or (float, float), optional
        Distance between pixels, instead of the gridded product: "native" for the sampling interval at nadir, or metres,
        down and across. It changes the coordinates, but not the footprints. [m]
    offset : (float or array, float or array), optional
        Registration error southward and eastward, as numbers, or as a drift with one value per row and per column.
        Arrays over ``time`` have an error for each date. Footprints are shifted; coordinates stay nominal. [pixel]
    gain_drift : float or xarray.DataArray, optional
        Response of the detectors relative to their calibration, as a number for all bands, one for each band, or an
        array over ``time``, ``band`` or both. The recorded radiance is multiplied by it; gains stay nominal. [1]
    noise : str or sequence of str, optional
        Noise components: "shot", "thermal" and "fixed-pattern", or "all" components known for the instrument. Unknown
        components raise an error.
    seed : int, optional
        Seed of the noise generator.
    noise_models : fifesim.sensor.response.noise.NoiseModel, or mapping of str to NoiseModel, optional
        Noise model for all bands, or by band name, instead of the description of the instrument.
    quantise : bool, optional
        If False, return radiance.
    scaling : "detector" or "product", optional
        Scaling of digital numbers: counts of the detector over its range of radiance, or numbers of the Level-1
        product, which are scaled to reflectance (OLI, OLI2; MSI and MSI-B with the offset of processing baseline
        04.00).
    min_valid : float, optional
        Minimum fraction of the footprint on valid cells; below it the pixel is no data. [1]
    geometry : fifesim.base.geometry.Geometry or xarray.Dataset, optional
        Directions of sun and sensor; by default from the coordinates of the array, else from its time and place. Not
        needed for radiance.
    time : str or datetime, optional
        Time for the position of the sun, instead of ``geometry``.

    Returns
    -------
    image : xarray.DataArray of unsigned integers, dims (band, y, x)
        Digital numbers from 1; 0 is no data, and the attribute ``saturated`` the largest number, which later steps
        treat as no data. ``gain``, ``offset``, ``wavelength`` and ``solar_irradiance`` are
        coordinates along band, and ``compression`` if a band has a square-root scale. With ``quantise=False``, radiance
        with ``wavelength`` and ``solar_irradiance``. For bands of several resolutions, an `xarray.DataTree` with one
        node per resolution, such as ``/10m``, which has ``dn`` or ``toa_radiance``. [1 or W m-2 sr-1 um-1]

    Raises
    ------
    ValueError
        If the instrument, its bands, noise or scaling are unknown; ``onto`` has another CRS or does not overlap the
        scene; a point spread is wider than the scene; or `to_toa` used another sun.

    Warns
    -----
    UserWarning
        If pixels are smaller than 0.8 or larger than 1.25 of the instrument's own, because its blur stays.

    See Also
    --------
    fifesim.sense_swath, fifesim.sensor.noise_std, fifesim.sensor.psf

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    >>> image = rho.fifesim.to_toa().fifesim.sense("TM")
    >>> image.shape, image.dtype
    ((2, 10, 10), dtype('uint8'))
    >>> image.where(image > 0).mean(["y", "x"]).round(1).values
    array([51.6, 73.4], dtype=float32)
    """
    return sensed(
        toa, instrument, onto=onto, interval=interval, offset=offset, gain_drift=gain_drift, noise=noise, seed=seed,
        noise_models=noise_models, quantise=quantise, scaling=scaling, min_valid=min_valid, geometry=geometry,
        time=time,
    )  # fmt: skip


def sensed(
    toa, instrument, *, onto, interval=None, offset=(0.0, 0.0), gain_drift=1.0, noise, seed, noise_models=None,
    quantise=True, scaling="detector", min_valid=MIN_VALID, geometry, time=None, line_spreads=None,
):  # fmt: skip
    """Image as from `sense`, with other line spread functions by band if they are given."""
    toa, description, bands = by_bands(toa, instrument)
    check_scaling(scaling, description, quantise)
    line_spreads = line_spreads or description.line_spreads
    # Radiance is recorded independently of the sun.
    needed = not is_radiance(toa) or scaling == "product"
    geometry = (directions.given_geometry if needed else directions.known_geometry)(geometry, toa, time)
    check_same_angles(geometry, toa, "sza")
    toa = directions.dated(toa, time)
    groups = bands_by_grid(description, bands, onto, interval)

    def image_of(toa, bands):
        pixels = pixel_grid(grids.geobox(toa), description, bands, onto, interval)
        warn_of_pixels(description, bands, grids.cell_size(pixels))
        light = None if geometry is None else directions_on(pixels, geometry)
        scene = toa.drop_vars(ANGLES, errors="ignore") if light is None else toa
        means = means_by_band(
            scene, description, bands, pixels, offset=offset, min_valid=min_valid, line_spreads=line_spreads
        )
        # Lines are counted from the origin of the CRS, so that a window has the same noise as the whole image.
        first = grids.lattice_position(pixels)
        radiance = drifted(as_radiance(means, bands, light), bands, gain_drift)
        radiance = noisy(radiance, description, bands, noise, seed, first, noise_models)
        image, carried = recorded(radiance, description, bands, quantise, light if scaling == "product" else None)
        carried |= {} if light is None else directions.coordinates_of(light)
        image = grids.place(image, pixels, carried)
        image.data = held(image.data)
        history = _history(description, interval, offset, gain_drift, noise, seed, quantise, scaling)
        bits = description.bits if scaling == "detector" else description.product.bits
        return labelled(image, toa, description, history, 2**bits - 1)

    if len(groups) == 1:
        return image_of(toa, bands)
    images = {}
    for size, numbers in groups.items():
        images[f"/{size}"] = image_of(toa.isel(band=numbers), [bands[number] for number in numbers]).to_dataset()
    return xr.DataTree.from_dict(images)


def by_bands(toa, instrument):
    """Input of an instrument with a band dimension, its description, and its bands."""
    if "composite" in toa.attrs:
        raise ValueError("a composite is of many dates, and nothing records it: sense each date, and composite those")
    if not is_radiance(toa):
        toa = incoming(toa, "toa_reflectance")
    cf.check_quantity(toa, "toa_reflectance", "toa_radiance")
    description = given_instrument(instrument, toa)
    toa = toa if "band" in toa.dims else toa.expand_dims("band")
    bands = matching_bands(toa, description)
    warn_of_others(toa, description, bands)
    return toa, description, bands


def labelled(image, toa, description, history, saturated=0):
    """Image with labels: digital numbers, with the number of saturated pixels, if it holds integers, else radiance."""
    name = "dn" if image.dtype.kind == "u" else "toa_radiance"
    own = attributes_of(description) | {"recorded_by": description.name}
    image = cf.label(image, name, source=toa, history=history, **own)
    if name == "dn":
        image.attrs |= {"_FillValue": image.dtype.type(0), "saturated": int(saturated)}
    return image


def _history(description, interval, offset, gain_drift, noise, seed, quantise, scaling):
    """Text of the settings that differ from the defaults, for the history."""
    kinds = check_kinds(noise)
    bits = description.bits if scaling == "detector" else description.product.bits
    parts = [
        f"sense: {description.name}, {bits} bits" if quantise else f"sense: {description.name}, radiance",
        f"scaling {scaling}" if scaling != "detector" else "",
        f"interval {interval}" if interval is not None else "",
        "offset" if any(np.any(np.asarray(each) != 0) for each in offset) else "",
        "gain drift" if isinstance(gain_drift, Mapping) or np.any(np.asarray(gain_drift) != 1) else "",
        f"noise {' '.join(kinds)}, seed {seed}" if kinds else "",
    ]
    return ", ".join(filter(None, parts))


def numbers_of_bands(given, bands, name):
    """One number for each band, from one for all, one for each, or a mapping or raster by names of bands."""
    names = [band.name for band in bands]
    if isinstance(given, xr.DataArray) and "band" in given.dims:
        given = dict(zip(given["band"].values.tolist(), given.values, strict=True))
    if isinstance(given, Mapping):
        if missing := [each for each in names if each not in given]:
            raise ValueError(f"{name} has no number for {', '.join(missing)}: it has {', '.join(map(str, given))}")
        given = [given[each] for each in names]
    values = np.asarray(given, float)
    if values.shape not in ((), (len(names),)) or not np.isfinite(values).all():
        raise ValueError(f"{name} must be a number, or one for each of {len(names)} bands, got {described(given)}")
    return np.broadcast_to(values, len(names))


def drifted(radiance, bands, gain_drift):
    """Radiance as detectors record it whose response has drifted since the calibration. [W m-2 sr-1 um-1]"""
    factors = numbers_of_bands(gain_drift, bands, "gain_drift")
    if not np.all((factors >= 0.1) & (factors <= 10)):
        wrong = factors[(factors < 0.1) | (factors > 10)][0]
        raise ValueError(f"gain_drift must be a factor from 0.1 to 10, got {wrong:g}: 0.98 is a loss of 2 percent")
    if np.all(factors == 1):
        return radiance
    factors = xr.Variable("band", factors)
    return radiance.copy(data=(radiance.variable * factors).transpose(*radiance.dims).astype(radiance.dtype).data)


@by_date
def to_radiance(image: xr.DataArray) -> xr.DataArray:
    """
    Radiance of an image of digital numbers.

    Parameters
    ----------
    image : xarray.DataArray of unsigned integers, dims (band, y, x)
        With coordinates ``gain`` and ``offset``, and ``compression`` if applicable, as from `sense`.

    Returns
    -------
    radiance : xarray.DataArray, dims (band, y, x)
        Radiance, within half a count; NaN for no data and for saturated pixels, whose radiance is above the range. The
        attribute ``saturated_pixels`` is their number, unless the image is lazy. [W m-2 sr-1 um-1]

    Raises
    ------
    ValueError
        If the image has no calibration, a gain is not above 0, the units are wrong, or a value is negative, fractional
        or above the largest digital number. Lazy data are checked when they are computed.

    See Also
    --------
    fifesim.to_reflectance, fifesim.calibrate

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    >>> image = rho.fifesim.to_toa().fifesim.sense("TM")
    >>> image.fifesim.to_radiance().mean(["y", "x"]).round().values
    array([40., 58.])
    """
    scale = _scale_of(image)
    out = chunks.pointwise(radiance_kernel(image), image, *scale)
    out, found = swaths.placed_as(grids.without(out, _SCALE), image), saturated_pixels(image)
    return cf.label(out, "toa_radiance", source=image, history="to_radiance", **found)


def _scale_of(image):
    """Gain, offset and any compression of an image of digital numbers."""
    known = image.coords.variables
    missing = {"gain", "offset"} - set(known)
    if missing:
        raise ValueError(f"the image has no {' and '.join(sorted(missing))}: open it with fifesim.open_image")
    if not np.all(known["gain"].values > 0):
        raise ValueError(f"gain must be above 0 W m-2 sr-1 um-1 per count, got {np.atleast_1d(known['gain'].values)}")
    return [known[name] for name in _SCALE if name in known]


@by_date
def to_reflectance(image: xr.DataArray) -> xr.DataArray:
    """
    Planetary reflectance of an image.

    Parameters
    ----------
    image : xarray.DataArray, dims (band, y, x)
        Digital numbers or radiance, with the coordinates from `sense`.

    Returns
    -------
    reflectance : xarray.DataArray, dims (band, y, x)
        NaN for no data and for saturated pixels, as in `to_radiance`. [1]

    Raises
    ------
    ValueError
        If calibration, solar irradiance or solar zenith angle are missing or give impossible values, or a value is not
        a valid digital number, as in `to_radiance`.

    See Also
    --------
    fifesim.sensor.to_radiance, fifesim.calibrate

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
    return cf.label(swaths.placed_as(out, image), "toa_reflectance", source=image, history=history, **out.attrs)


def planetary(image):
    """Planetary reflectance of an image [1], whose attributes are the number of saturated pixels, and its history."""
    counts = cf.is_counts(image)
    if not counts:
        cf.check_quantity(image, "toa_radiance")
    scale, radiance = (_scale_of(image), radiance_kernel(image)) if counts else ([], None)
    # Only the sun counts, and the view of a scan is an array.
    geometry = directions.geometry_of(image, ("sza", "saa", "earth_sun_distance"))
    if geometry is None or "solar_irradiance" not in image.coords:
        raise ValueError("the image carries no sza or no solar_irradiance: open it with fifesim.open_image")
    below = image.coords.variables["solar_irradiance"], directions.mu_s(geometry)
    distance = float(geometry.earth_sun_distance)
    out = chunks.pointwise(_reflectance_of, image, *below, *scale, radiance=radiance, earth_sun_distance=distance)
    out.attrs = saturated_pixels(image)
    history = "to_radiance\nto_reflectance" if counts else "to_reflectance"
    return grids.without(out, _SCALE), history


def _reflectance_of(values, solar_irradiance, mu_s, *scale, radiance, earth_sun_distance):
    """Reflectance of radiance, or of digital numbers by the kernel of their radiance. [1]"""
    light = values if radiance is None else radiance(values, *scale)
    out = calibration.radiance_to_reflectance(light, solar_irradiance, mu_s, earth_sun_distance)
    _check_units_of_radiance(out, "gain, offset and solar_irradiance give a reflectance")
    return out


# Largest reflectance of a block that may be of radiance per nanometre; dark water has more in any band. [1]
_DARK = 5e-4


def _check_units_of_radiance(reflectance, what):
    """Raise ValueError for impossible reflectance in half of a sample, and warn of a dark block."""
    sample = reflectance[..., ::SAMPLED_ROWS, :]
    wrong = (sample > HIGHEST) | (sample < LOWEST)
    cure = "check that radiance is in W m-2 sr-1 um-1, solar_irradiance in W m-2 um-1 and sza in degrees"
    if 2 * np.count_nonzero(wrong) > np.count_nonzero(~np.isnan(sample)):
        raise ValueError(f"{what} of {sample[wrong].flat[0]:g}: {cure}")
    largest = np.fmax.reduce(sample, axis=None) if sample.size else np.nan
    if 0 < largest < _DARK:
        warn(f"{what} of {largest:.2g} at most, as of radiance per nanometre: {cure}")


def _in_units(radiance, solar_irradiance):
    """Radiance that is plausible under an overhead sun. [W m-2 sr-1 um-1]"""
    _check_units_of_radiance(np.pi * radiance / solar_irradiance, "radiance has an overhead reflectance")
    return radiance


def as_radiance(array, bands, geometry):
    """Radiance of a reflectance, after regularization, when fewer numbers remain. [W m-2 sr-1 um-1]"""
    if is_radiance(array):
        return chunks.pointwise(_in_units, array, xr.Variable("band", [band.solar_irradiance for band in bands]))
    light = xr.Variable("band", [band.solar_irradiance for band in bands]), directions.mu_s(geometry)
    distance = float(geometry.earth_sun_distance)
    return chunks.pointwise(calibration.reflectance_to_radiance, array, *light, earth_sun_distance=distance)
