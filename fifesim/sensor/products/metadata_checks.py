"""Checks of product metadata against each other, against the sun's position, and against what reflectance can be."""

import numpy as np

from fifesim.base.geometry import angle_between, earth_sun_distance, sun_positions

# Largest disagreement of a scale with the reflectance that the same file states, in the range of reflectance. Metadata
# of all instruments agree within 4e-5: gains have five digits, and reflectance has six decimals.
_AGREEMENT = 5e-4

# Reflectance of the smallest and of the largest valid digital number, before division by the sun's cosine. Products of
# Landsat 1 to 9 and Sentinel-2 have -0.2 to 0.02 and 0.3 to 6.6.
_DARKEST = -0.25, 0.1
_BRIGHTEST = 10.0

# Largest angle between the sun of metadata and of the almanac. MSS scenes of 1983 reach 0.3. [degree]
_SUN = 2.0

# Largest difference of Earth-Sun distances. Landsat's differ by 5e-5 from the almanac. [astronomical unit]
_DISTANCE = 1e-3

# Largest ratio of solar irradiances of one band. Solar spectra of the agencies differ by up to 6 %.
_IRRADIANCE = 1.25

CURE = "the metadata were changed, or mix two products; fetch them again"


def check_scale(keys, gain, offset, counts, stated=None, *, brightest=0.1):
    """
    Raise ValueError if a scale gives other values than the file states, or none that reflectance can have.

    Parameters
    ----------
    keys : str
        Keys and values at fault, for the message.
    gain, offset : float
        Reflectance of one count and of digital number 0. [1]
    counts : (int, int)
        Smallest and largest valid digital number. [1]
    stated : (float, float), optional
        Reflectance of both counts according to the same file. [1]
    brightest : float, optional
        Reflectance that the largest digital number must reach: TM band 1 saturates at 0.3 with the sun in the zenith.
        [1]

    Raises
    ------
    ValueError
        The message has the keys, the reflectances and the remedy.
    """
    if not 0 < counts[0] < counts[1]:
        raise ValueError(f"{keys}: counts from {counts[0]:g} to {counts[1]:g}, which must rise from above 0; {CURE}")
    low, high = (gain * count + offset for count in counts)
    found = f"{keys} give values from {low:g} to {high:g} for counts from {counts[0]:g} to {counts[1]:g}"
    if stated is not None and not _agree((low, high), stated):
        raise ValueError(f"{found}, and the same file states {stated[0]:g} to {stated[1]:g}: {CURE}")
    if not (_DARKEST[0] <= low <= _DARKEST[1] and brightest <= high <= _BRIGHTEST):
        raise ValueError(
            f"{found}: reflectance must begin in [{_DARKEST[0]:g}, {_DARKEST[1]:g}] and end in [{brightest:g}, "
            f"{_BRIGHTEST:g}]; {CURE}"
        )


def check_radiance(keys, gain, offset, counts, stated):
    """
    Raise ValueError if a scale of radiance gives other values than the file states.

    Parameters
    ----------
    keys : str
        Keys and values at fault, for the message.
    gain, offset : float
        Radiance of one count and of digital number 0. [W m-2 sr-1 um-1]
    counts : (int, int)
        Smallest and largest valid digital number. [1]
    stated : (float, float)
        Radiance of both counts according to the same file. [W m-2 sr-1 um-1]

    Raises
    ------
    ValueError
        The message has the keys, the radiances and the remedy.
    """
    found = tuple(gain * count + offset for count in counts)
    if not _agree(found, stated):
        raise ValueError(
            f"{keys} give values from {found[0]:g} to {found[1]:g} W m-2 sr-1 um-1, and the same file states "
            f"{stated[0]:g} to {stated[1]:g}: {CURE}"
        )


def _agree(found, stated):
    """Whether two ranges agree within the rounding of metadata."""
    span = stated[1] - stated[0]
    return span > 0 and np.abs(np.subtract(found, stated)).max() <= _AGREEMENT * span


def check_sun(keys, sza, saa, time, place):
    """
    Raise ValueError if the sun stood elsewhere at that time and place.

    Parameters
    ----------
    keys : str
        Keys and values at fault, for the message.
    sza, saa : float
        Solar zenith and azimuth angles. [degree]
    time : numpy.datetime64
        UTC.
    place : (float, float)
        Latitude and longitude of the centre. [degree]

    Raises
    ------
    ValueError
        If the directions differ by more than 2 degrees.
    """
    _, zenith, azimuth, _ = sun_positions([str(time)], *place)
    if not angle_between(sza, saa, zenith[0], azimuth[0]) <= _SUN:
        raise ValueError(
            f"{keys}: at {str(time)[:16]} UTC and {place[0]:.2f} N, {place[1]:.2f} E, the sun had a zenith angle of "
            f"{zenith[0]:.1f} and an azimuth of {azimuth[0]:.1f} degrees. Angles must be in degrees and belong to the "
            f"time; {CURE}"
        )


def check_distance(key, distance, time):
    """
    Raise ValueError if the Earth-Sun distance does not belong to the date.

    Parameters
    ----------
    key : str
        Name of the distance, for the message.
    distance : float
        [astronomical unit]
    time : numpy.datetime64
        UTC.

    Raises
    ------
    ValueError
        If it differs by more than 0.001 astronomical units.
    """
    expected = earth_sun_distance(str(time))
    if not abs(distance - expected) <= _DISTANCE:
        raise ValueError(
            f"{key} = {distance:g} does not belong to the date {str(time)[:10]}, which has {expected:.4f} astronomical "
            f"units: {CURE}"
        )


def check_irradiance(product, bands, description):
    """
    Raise ValueError if a product is scaled by a solar irradiance that its instrument's band cannot have.

    Parameters
    ----------
    product : str
        Name of the product, for the message.
    bands : sequence of fifesim.sensor.products.scaling.ProductBand
    description : fifesim.sensor.description.instrument_file.Instrument
        Instrument of the product.

    Raises
    ------
    ValueError
        If both irradiances of a band differ by more than a quarter.
    """
    known = {band.name: band.solar_irradiance for band in description.bands}
    for band in bands:
        given, own = band.solar_irradiance, known.get(band.name)
        if given is not None and own is not None and not own / _IRRADIANCE <= given <= own * _IRRADIANCE:
            raise ValueError(
                f"{product}: the scale of {band.name} (RADIANCE_MAXIMUM and REFLECTANCE_MAXIMUM of Landsat, "
                f"SOLAR_IRRADIANCE of Sentinel-2) means a solar irradiance of {given:g} W m-2 um-1, which must be in "
                f"[{own / _IRRADIANCE:.0f}, {own * _IRRADIANCE:.0f}]: {CURE}"
            )
