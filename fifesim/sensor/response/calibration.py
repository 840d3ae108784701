"""Calibration: digital numbers, radiance and planetary reflectance."""

from operator import index

import numpy as np


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

    Raises
    ------
    ValueError
        If the full scale is not above the minimum, or the bits are out of range.

    References
    ----------
    [Chander2009]_, Eq. 1, with the calibrated counts 0 to :math:`2^b - 1`; [Friedl1995]_, Table 1

    Examples
    --------
    >>> gain, offset = gain_offset(250.0, -5.0, 8)
    >>> float(gain), float(offset)
    (1.0, -5.0)
    """
    full, low = np.asarray(full_scale_radiance, float), np.asarray(min_radiance, float)
    if not np.all(full > low):
        raise ValueError(
            f"full_scale_radiance must be above min_radiance in every band, got {full_scale_radiance} "
            f"and {min_radiance} W m-2 sr-1 um-1"
        )
    return (full - low) / _largest_dn(bits), np.broadcast_to(low, np.broadcast_shapes(full.shape, low.shape))


def radiance_to_dn(radiance, gain, offset, bits, compression=0):
    r"""
    Digital numbers that an instrument records.

    .. math:: DN = \mathrm{round}(x), \qquad x = \frac{L - o}{g}, \qquad 1 \le DN \le 2^b - 1

    on a linear scale. On one of square roots, which meets the linear one at 0 and at its count c, with finer steps up
    to a quarter of c,

    .. math:: DN = \mathrm{round}(\sqrt{c \, x})

    Halves go to the even number. What is darker or brighter than the range is clipped, never wrapped.

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

    Raises
    ------
    ValueError
        If a gain is not positive, or the bits are out of range.

    References
    ----------
    [Chander2009]_, Eq. 1, solved for the counts

    Examples
    --------
    >>> radiance_to_dn([-9.0, 100.2, 1e4, float("nan")], 1.0, -5.0, bits=8).tolist()
    [1, 105, 255, 0]

    A quarter of the range is half of the counts where they go with its square root:

    >>> int(radiance_to_dn(15.75, 1.0, 0.0, bits=6)), int(radiance_to_dn(15.75, 1.0, 0.0, bits=6, compression=63))
    (16, 32)
    """
    largest = _largest_dn(bits)
    _check_positive(gain, "gain", "from gain_offset")
    counts = (np.asarray(radiance, float) - offset) / gain
    if np.any(compression):
        counts = np.where(compression, np.sqrt(np.maximum(counts, 0.0) * compression), counts)
    counts = np.rint(counts)
    # NaN has no integer: it is replaced before the cast, whose result would depend on the machine.
    counts = np.where(np.isnan(counts), 0.0, np.clip(counts, 1, largest))
    return counts.astype(np.uint8 if largest < 256 else np.uint16)


def dn_to_radiance(dn, gain, offset, compression=0):
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

    Returns
    -------
    radiance : array of float64
        NaN where there are no data. [W m-2 sr-1 um-1]

    References
    ----------
    [Chander2009]_, Eq. 1

    Examples
    --------
    >>> dn_to_radiance([0, 105], 1.0, -5.0).tolist()
    [nan, 100.0]
    >>> dn_to_radiance([32], 1.0, 0.0, compression=63).round(3).tolist()
    [16.258]
    """
    dn = np.asarray(dn)
    counts = dn
    if np.any(compression):
        squares = (dn.astype(float) ** 2 + 0.25) / np.where(compression, compression, 1)
        counts = np.where(compression, squares, dn)
    return np.where(dn == 0, np.nan, counts * np.asarray(gain, float) + offset)


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

    Raises
    ------
    ValueError
        If the irradiance, ``mu_s`` or the distance is not positive.

    References
    ----------
    [Chander2009]_, Eq. 2, solved for the radiance

    Examples
    --------
    A white Lambertian surface below an overhead sun returns the irradiance:

    >>> round(float(reflectance_to_radiance(1.0, 1536.0, 1.0)) * np.pi, 9)
    1536.0
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

    Raises
    ------
    ValueError
        If the irradiance, ``mu_s`` or the distance is not positive.

    References
    ----------
    [Chander2009]_, Eq. 2

    Examples
    --------
    >>> radiance = reflectance_to_radiance(0.25, 1536.0, 0.5, 1.0148)
    >>> round(float(radiance_to_reflectance(radiance, 1536.0, 0.5, 1.0148)), 12)
    0.25
    """
    return np.asarray(radiance) / _white_radiance(solar_irradiance, mu_s, earth_sun_distance)


def _white_radiance(solar_irradiance, mu_s, earth_sun_distance):
    """Radiance of a planetary reflectance of 1."""
    _check_positive(solar_irradiance, "solar_irradiance", "in W m-2 um-1")
    _check_positive(mu_s, "mu_s", "the cosine of a solar zenith angle below 90 degrees")
    _check_positive(earth_sun_distance, "earth_sun_distance", "in astronomical units")
    distance = np.asarray(earth_sun_distance, float)
    return np.asarray(solar_irradiance, float) * mu_s / (np.pi * distance**2)


def _check_positive(values, name, meaning):
    values = np.asarray(values, float)
    if np.any(values <= 0):
        raise ValueError(f"{name} must be positive, got {values[values <= 0].flat[0]:g}: it is {meaning}")


def _largest_dn(bits):
    try:
        number = index(bits)
    except TypeError:
        raise TypeError(f"bits must be an integer, got {bits!r}: TM has 8") from None
    if not 2 <= number <= 16:
        raise ValueError(f"bits must be in 2 to 16, got {bits}: digital numbers are kept as uint8 or uint16")
    return 2**number - 1
