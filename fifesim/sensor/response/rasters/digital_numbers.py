"""What a digital number of an image stands for: a count of the detector, or one of the agency's product."""

from functools import partial

import numpy as np
import xarray as xr

from fifesim.base.digital_numbers import check_counts
from fifesim.rasters import cf, chunks, directions
from fifesim.rasters import grid as grids
from fifesim.sensor.response.calibration import dn_to_radiance, gain_offset, radiance_to_dn
from fifesim.sensor.response.product_scaling import product_gain_offset

_CALIBRATE_FIRST = (
    "calibrate with .fifesim.to_radiance() or .fifesim.to_reflectance() before you compute or resample. If the values "
    "are radiance already, type .drop_vars(['gain', 'offset']).assign_attrs(units='W m-2 sr-1 um-1')"
)


def check_scaling(scaling, description, quantise=True):
    """
    Refuse a scaling of digital numbers that is none.

    Parameters
    ----------
    scaling : str
    description : fifesim.sensor.description.instruments.Instrument
    quantise : bool, optional
        Whether there are digital numbers.

    Raises
    ------
    ValueError
        If it is unknown, the instrument's products have none of their own, or there are no digital numbers.
    """
    if scaling not in ("detector", "product"):
        raise ValueError(f"scaling must be 'detector' or 'product', got {scaling!r}")
    if scaling == "product" and not quantise:
        raise ValueError("scaling='product' is one of digital numbers: leave it out, or quantise=False")
    if scaling == "product" and description.product is None:
        raise ValueError(
            f"the description of {description.name} has no product that is scaled by reflectance, as those of OLI, "
            "OLI2, MSI and MSI-B have: leave scaling out, or give [product] in a file of your own"
        )


def scale(description, bands, product_geometry=None):
    """
    Radiance of a count and of digital number 0, and number of bits.

    Parameters
    ----------
    description : fifesim.sensor.description.instruments.Instrument
    bands : sequence of fifesim.sensor.description.band.InstrumentBand
    product_geometry : fifesim.base.geometry.Geometry or xarray.Dataset, optional
        Sun by which the agency's product scales them; the detector's own counts without.

    Returns
    -------
    gain, offset : array, shape (band,)
        [W m-2 sr-1 um-1]
    bits : int

    Raises
    ------
    ValueError
        If the product has the sun's cosine divided out, and the sun varies over the scene.
    """
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
    """
    What an instrument records of a radiance, with the coordinates of its bands.

    Parameters
    ----------
    radiance : xarray.DataArray
        With a dimension band. [W m-2 sr-1 um-1]
    description : fifesim.sensor.description.instruments.Instrument
    bands : sequence of fifesim.sensor.description.band.InstrumentBand
        One for each of the array.
    quantise : bool
        Whether as digital numbers.
    product_geometry : fifesim.base.geometry.Geometry or xarray.Dataset, optional
        Sun by which the agency's product scales them; the detector's own counts without.

    Returns
    -------
    image : xarray.DataArray
        Digital numbers, or the radiance itself.
    """
    along_band = {"band": [band.name for band in bands], "wavelength": [band.wavelength for band in bands]}
    if quantise:
        gain, offset, bits = scale(description, bands, product_geometry)
        scales = [xr.DataArray(each, dims="band") for each in (gain, offset)]
        # A product's numbers are linear, whatever the detector's are.
        compression = [band.compressed_count(bits) if product_geometry is None else 0 for band in bands]
        dtype = np.uint8 if bits <= 8 else np.uint16
        kernel = radiance_to_dn if not any(compression) else _compressed
        scales += [xr.DataArray(compression, dims="band")] if any(compression) else []
        radiance = chunks.pointwise(kernel, radiance, *scales, dtype=dtype, bits=bits)
        along_band |= {"gain": gain, "offset": offset}
        along_band |= {"compression": compression} if any(compression) else {}
    along_band["solar_irradiance"] = [band.solar_irradiance for band in bands]
    return grids.with_coordinates(radiance, cf.band_coordinates(**along_band))


def _compressed(radiance, gain, offset, compression, bits):
    """Digital numbers of bands of which some have a scale of square roots."""
    return radiance_to_dn(radiance, gain, offset, bits, compression)


def radiance_kernel(image):
    """
    Kernel of the radiance of digital numbers, which checks values if their type also holds other values.

    Parameters
    ----------
    image : xarray.DataArray
        Digital numbers. [1]

    Returns
    -------
    kernel : callable
        ``kernel(dn, gain, offset)``, or with the compression as well, gives the radiance. [W m-2 sr-1 um-1]

    Raises
    ------
    ValueError
        If the units are not those of digital numbers, or a value is negative, fractional or above the largest digital
        number; for lazy data, when they are computed.
    """
    units = image.attrs.get("units", "1")
    if units == cf.QUANTITIES["toa_radiance"].units:
        raise ValueError(f"the image has the calibration of digital numbers and units {units!r}: {_CALIBRATE_FIRST}")
    cf.check_units(image, "dn")
    fill = image.attrs.get("_FillValue", image.encoding.get("_FillValue"))
    # The fill value has the type in which the image was recorded.
    recorded = fill.dtype if isinstance(fill, np.generic) and fill.dtype.kind == "u" else None
    if image.dtype.kind == "u" and recorded in (None, image.dtype):
        return dn_to_radiance
    largest = int(np.iinfo(np.uint16 if recorded is None else recorded).max)
    return partial(_checked_radiance, largest)


def _checked_radiance(largest, dn, *scale):
    check_counts(dn, largest, _CALIBRATE_FIRST)
    return dn_to_radiance(dn, *scale)
