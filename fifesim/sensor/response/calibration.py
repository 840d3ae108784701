"""Calibration between digital numbers, radiance and reflectance, and the scaling of agencies' products."""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage


def gain_offset(full_scale_radiance, min_radiance, bits):
    r"""
    Gain and offset of a linear calibration.

    .. math:: g = \frac{L_\mathrm{max} - L_\mathrm{min}}{2^b - 1}, \qquad o = L_\mathrm{min}

    Parameters
    ----------
    full_scale_radiance : array
        Radiance of the largest digital number, one per band. [W m-2 sr-1 um-1]
    min_radiance : array
        Radiance of digital number 0. [W m-2 sr-1 um-1]
    bits : int
        Number of radiometric bits, 2 to 16.

    Returns
    -------
    gain : array
        [W m-2 sr-1 um-1 per count]
    offset : array
        [W m-2 sr-1 um-1]

    References
    ----------
    [Chander2009]_, Eq. 1, with the calibrated counts 0 to :math:`2^b - 1`; [Friedl1995]_, Table 1
    """
    full, low = np.asarray(full_scale_radiance, float), np.asarray(min_radiance, float)
    return (full - low) / (2**bits - 1), np.broadcast_to(low, np.broadcast_shapes(full.shape, low.shape))


def radiance_to_dn(radiance, gain, offset, bits, compression=0):
    r"""
    Digital numbers recorded by an instrument.

    .. math:: DN = \mathrm{round}(x), \qquad x = \frac{L - o}{g}, \qquad 1 \le DN \le 2^b - 1

    on a linear scale. On one of square roots, which meets the linear one at 0 and at its count c, with finer steps up
    to a quarter of c,

    .. math:: DN = \mathrm{round}(\sqrt{c \, x})

    Halves go to the even number. Radiance below or above the range is clipped, never wrapped.

    Parameters
    ----------
    radiance : array
        [W m-2 sr-1 um-1]
    gain, offset : array, broadcastable
        Such as shape (band, 1, 1) for (band, y, x), from `gain_offset`.
    bits : int
        Number of radiometric bits, 2 to 16.
    compression : array, broadcastable, optional
        Count c of a scale of square roots, :math:`2^b - 1`; 0 for a linear scale. [1]

    Returns
    -------
    dn : array of uint8 up to 8 bits, else of uint16
        0 is no data, from NaN. [1]

    References
    ----------
    [Chander2009]_, Eq. 1, solved for the counts
    """
    largest = 2**bits - 1
    counts = (np.asarray(radiance, float) - offset) / gain
    if np.any(compression):
        counts = np.where(compression, np.sqrt(np.maximum(counts, 0.0) * compression), counts)
    counts = np.rint(counts)
    # NaN has no integer: it is replaced before the cast, whose result would depend on the machine.
    counts = np.where(np.isnan(counts), 0.0, np.clip(counts, 1, largest))
    return counts.astype(np.uint8 if largest < 256 else np.uint16)


def dn_to_radiance(dn, gain, offset, compression=0, saturated=0):
    r"""
    Radiance of digital numbers.

    .. math:: L = o + g \, DN, \qquad L = o + g \, \frac{DN^2 + 1/4}{c}

    on a linear scale, and on one of square roots: in the middle of the radiances that the number stands for.

    Parameters
    ----------
    dn : array of unsigned integers
        0 is no data. [1]
    gain, offset : array, broadcastable
        Such as shape (band, 1, 1) for (band, y, x), from `gain_offset`.
    compression : array, broadcastable, optional
        Count c of a scale of square roots; 0 for a linear scale. [1]
    saturated : int, optional
        Digital number from which a pixel is saturated, so that its radiance is only a lower limit; 0 if none is. [1]

    Returns
    -------
    radiance : array of float64
        NaN where there are no data or the pixel is saturated. [W m-2 sr-1 um-1]

    References
    ----------
    [Chander2009]_, Eq. 1
    """
    dn = np.asarray(dn)
    counts = dn
    if np.any(compression):
        squares = (dn.astype(float) ** 2 + 0.25) / np.where(compression, compression, 1)
        counts = np.where(compression, squares, dn)
    unknown = (dn == 0) | (dn >= saturated) if saturated else dn == 0
    return np.where(unknown, np.nan, counts * np.asarray(gain, float) + offset)


def digital_step(radiance, gain, offset, compression=0):
    r"""
    Radiance between two digital numbers.

    .. math:: \Delta = g, \qquad \Delta = 2 g \sqrt{\frac{L - o}{g \, c}}

    on a linear scale, and on one of square roots, :math:`L = o + g \, DN^2 / c`.

    Parameters
    ----------
    radiance : array
        [W m-2 sr-1 um-1]
    gain, offset, compression : float
        As in `dn_to_radiance`.

    Returns
    -------
    step : array, shape of radiance
        NaN where the radiance is. [W m-2 sr-1 um-1]
    """
    radiance = np.asarray(radiance, float)
    if compression:
        return 2 * gain * np.sqrt(np.maximum(radiance - offset, 0.0) / (gain * compression))
    return np.where(np.isnan(radiance), np.nan, gain)


def reflectance_to_radiance(reflectance, solar_irradiance, mu_s, earth_sun_distance=1.0):
    r"""
    Radiance of a planetary reflectance.

    .. math:: L = \frac{\rho \, E_s \, \mu_s}{\pi \, d^2}

    Parameters
    ----------
    reflectance : array
        Reflectance at the top of the atmosphere, with the cosine of the solar zenith divided out. [1]
    solar_irradiance : array, broadcastable
        Extraterrestrial, at one astronomical unit. [W m-2 um-1]
    mu_s : array, broadcastable
        Cosine of the solar zenith angle, above 0. [1]
    earth_sun_distance : float, optional
        [astronomical unit]

    Returns
    -------
    radiance : array
        [W m-2 sr-1 um-1]

    References
    ----------
    [Chander2009]_, Eq. 2, solved for the radiance
    """
    return np.asarray(reflectance) * _white_radiance(solar_irradiance, mu_s, earth_sun_distance)


def radiance_to_reflectance(radiance, solar_irradiance, mu_s, earth_sun_distance=1.0):
    r"""
    Planetary reflectance of a radiance.

    .. math:: \rho = \frac{\pi \, L \, d^2}{E_s \, \mu_s}

    Parameters
    ----------
    radiance : array
        At the top of the atmosphere. [W m-2 sr-1 um-1]
    solar_irradiance : array, broadcastable
        Extraterrestrial, at one astronomical unit. [W m-2 um-1]
    mu_s : array, broadcastable
        Cosine of the solar zenith angle, above 0. [1]
    earth_sun_distance : float, optional
        [astronomical unit]

    Returns
    -------
    reflectance : array
        With the cosine of the solar zenith divided out. [1]

    References
    ----------
    [Chander2009]_, Eq. 2
    """
    return np.asarray(radiance) / _white_radiance(solar_irradiance, mu_s, earth_sun_distance)


def _white_radiance(solar_irradiance, mu_s, earth_sun_distance):
    """Radiance of a planetary reflectance of 1. [W m-2 sr-1 um-1]"""
    _check_positive(solar_irradiance, "solar_irradiance", "in W m-2 um-1")
    _check_positive(mu_s, "mu_s", "the cosine of a solar zenith angle below 90 degrees")
    _check_positive(earth_sun_distance, "earth_sun_distance", "in astronomical units")
    distance = np.asarray(earth_sun_distance, float)
    return np.asarray(solar_irradiance, float) * mu_s / (np.pi * distance**2)


def _check_positive(values, name, meaning):
    values = np.asarray(values, float)
    if np.any(values <= 0):
        raise ValueError(f"{name} must be positive, got {values[values <= 0].flat[0]:g}: it is {meaning}")


def product_gain_offset(gain, offset, solar_irradiance, mu_s, earth_sun_distance=1.0):
    r"""
    Gain and offset in radiance of digital numbers that are scaled by reflectance.

    .. math:: L = \frac{E_s \, \mu_s}{\pi \, d^2} \, (g \, DN + o)

    Parameters
    ----------
    gain, offset : float
        Reflectance of one count and of digital number 0. [1]
    solar_irradiance : array
        Extraterrestrial, at one astronomical unit, by band. [W m-2 um-1]
    mu_s : float
        Cosine of the solar zenith angle that the reflectance has divided out; 1 where it has not. [1]
    earth_sun_distance : float, optional
        [astronomical unit]

    Returns
    -------
    gain, offset : array
        Radiance of one count and of digital number 0. [W m-2 sr-1 um-1]

    References
    ----------
    USGS, Landsat 8-9 Collection 2 Level-1 data format control book (LSDS-1822); ESA, Sentinel-2 products specification
    document (S2-PDGS-TAS-DI-PSD); [Chander2009]_, Eq. 2
    """
    radiances = [reflectance_to_radiance(each, solar_irradiance, mu_s, earth_sun_distance) for each in (gain, offset)]
    return np.asarray(radiances[0]), np.asarray(radiances[1])


@dataclass(frozen=True)
class ProductBand:
    """Band of a product."""

    name: str  # of the band of the instrument, such as "TM3"
    file: str  # path below the folder of the metadata
    gain: float  # reflectance of one count [1]
    offset: float  # reflectance of digital number 0 [1]
    largest: int  # digital number of saturation
    solar_irradiance: float | None  # behind the scale, at one astronomical unit; None if unknown [W m-2 um-1]
    flag: int = 0  # bit of the band in the raster of saturation; 0 where it has none


def product_reflectance(dn, gain, offset, largest, flag=0, flags=0, mu_s=1.0):
    r"""
    Reflectance of the digital numbers of a product.

    .. math:: \rho = \frac{g \, DN + o}{\mu_s}

    Parameters
    ----------
    dn : array of unsigned integers
        0 is no data. [1]
    gain, offset : array, broadcastable
        Reflectance of one count and of digital number 0. [1]
    largest : array, broadcastable
        Digital number of saturated pixels. [1]
    flag : array of unsigned integers, broadcastable, optional
        Bit that says in ``flags`` that the band is saturated.
    flags : array of unsigned integers, broadcastable, optional
    mu_s : array, broadcastable, optional
        Cosine of the solar zenith angle, where the product has it still in its reflectance. [1]

    Returns
    -------
    reflectance : array of float32
        NaN where there are no data, where the band is saturated, and where the sun is down. [1]

    References
    ----------
    USGS, Landsat 8-9 Collection 2 Level-1 data format control book (LSDS-1822), and Using the USGS Landsat Level-1
    data product; ESA, Sentinel-2 products specification document (S2-PDGS-TAS-DI-PSD), radiometric offset
    """
    dn = np.asarray(dn)
    usable = (dn != 0) & (dn < largest) & (np.bitwise_and(flags, flag) == 0)
    mu_s = np.where(np.asarray(mu_s) > 0, mu_s, np.nan)
    return np.where(usable, (dn * np.asarray(gain, float) + offset) / mu_s, np.nan).astype(np.float32)


def mask_bits(*masks):
    """Masks as the bits of one uint8, the first as bit 0."""
    return sum((np.asarray(mask) != 0).astype(np.uint8) << bit for bit, mask in enumerate(masks)).astype(np.uint8)


def hundredths(angle, fill, turns=False):
    """Angle from hundredths of a degree, NaN for no data, azimuths in 0 to 360. [degree]"""
    degrees = np.asarray(angle) / 100.0
    return np.where(fill, np.nan, degrees % 360.0 if turns else degrees)


def direction_vectors(zenith, azimuth):
    """Unit vectors toward directions, components north, east and up, shape (3, ...). [1]"""
    zenith, azimuth = np.radians(zenith), np.radians(azimuth)
    return np.stack([np.sin(zenith) * np.cos(azimuth), np.sin(zenith) * np.sin(azimuth), np.cos(zenith)])


def direction_angles(vectors):
    """Zenith and azimuth of vectors of any length, the azimuth in 0 to 360. [degree]"""
    north, east, up = vectors
    return np.degrees(np.arctan2(np.hypot(north, east), up)), np.degrees(np.arctan2(east, north)) % 360.0


def mean_direction(zenith, azimuth):
    """Mean vector of the known directions, NaN if none is known, shape (3, ...). [1]"""
    vectors = direction_vectors(zenith, azimuth)
    known = np.isfinite(vectors).all(axis=0)
    total, count = np.where(known, vectors, 0.0).sum(axis=1), known.sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def filled(vectors):
    """Vectors on a coarse grid with gaps filled by the nearest vector, shape (3, n, m)."""
    missing = ~np.isfinite(vectors).all(axis=0)
    if missing.all():
        raise ValueError("the metadata have no direction of the view: open it with angles='centre'")
    nearest = ndimage.distance_transform_edt(missing, return_distances=False, return_indices=True)
    return vectors[:, *nearest]


def between_nodes(vectors, rows, columns):
    """
    Zenith and azimuth between nodes of a coarse grid, by bilinear interpolation of vectors, shape (r, c). [degree]
    """
    i, down = _nodes(rows, vectors.shape[1])
    j, right = _nodes(columns, vectors.shape[2])
    across = vectors[:, :, j] * (1 - right) + vectors[:, :, j + 1] * right
    down = down[:, None]
    return direction_angles([part[i] * (1 - down) + part[i + 1] * down for part in across])


def _nodes(places, count):
    """Index of the node before each place, and the weight of the next."""
    places = np.clip(np.asarray(places, float), 0, count - 1)
    before = np.minimum(places.astype(int), count - 2)
    return before, places - before
