"""Metadata of images: text and XML of bounded size, the times in them, and checks of their values."""

import re
from contextlib import contextmanager
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from fifesim.base.files import in_a_line, read_bounded, shown
from fifesim.base.geometry import angle_between, earth_sun_distance, sun_positions

# Larger than the metadata of any image. [byte]
_LARGEST = 20_000_000

# Landsat 1.
_FIRST_LAUNCH = "1972-07-23"


def read_metadata(path):
    """Text of a metadata file."""
    try:
        return read_bounded(path, _LARGEST, "metadata").decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError(f"{in_a_line(Path(path).name)} is no text: is it another file?") from None


def read_xml(path):
    """Root of an XML metadata file; a document type, which could name other files, raises ValueError."""
    text, name = read_metadata(path), in_a_line(Path(path).name)
    # Entities, which may name files or grow without end, are declared in a document type. In UTF-8, which is what it
    # is read as here, nothing else begins so.
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ValueError(f"{name} declares a document type, which metadata of images do not: it is not read")
    try:
        return ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, RecursionError) as error:
        raise ValueError(in_a_line(f"{name} is not valid XML: {error}")) from None


@contextmanager
def naming(path):
    """Context that puts the file name before the message of a ValueError."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{in_a_line(Path(path).name, 100)}: {error}") from None


def utc_time(text, key, launch=_FIRST_LAUNCH):
    """UTC time from metadata, not before the launch."""
    match = re.fullmatch(r"(\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d{1,9})?)Z?", text)
    try:
        # Nanoseconds end in 2262, beyond which numpy wraps around without an error.
        seconds = np.datetime64(match[1][:19] if match else "none", "s")
    except ValueError:
        raise ValueError(f"{key} must be a date and time such as 1987-06-06T16:35:00Z, got {shown(text)}") from None
    # The computer clock may be a day behind.
    today = np.datetime64("now", "s")
    if not np.datetime64(launch, "s") <= seconds <= today + np.timedelta64(1, "D"):
        raise ValueError(
            f"{key} must lie between the launch of the satellite, {launch}, and today, {today.astype('M8[D]')}, got "
            f"{shown(text)}: the date was changed, so fetch the product's metadata again"
        )
    return np.datetime64(match[1], "ns")


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

REFETCH = "the metadata were changed, or mix two products; fetch them again"


def unique(pairs, what):
    """Dict of pairs; ValueError for a repeated key."""
    found = {}
    for key, value in pairs:
        if key in found:
            raise ValueError(f"{what} {in_a_line(str(key), 60)} stands twice: {REFETCH}")
        found[key] = value
    return found


def stated_number(text, key):
    """Number from the text of a key."""
    try:
        number = float(text)
    except (TypeError, ValueError):
        number = np.nan
    if not np.isfinite(number):
        raise ValueError(f"{key} must be a number, got {shown((text or '').strip())}")
    return number


def check_product_scale(keys, gain, offset, counts, stated=None, *, brightest=0.1):
    """Raise ValueError if a scale contradicts the range in the file, or gives impossible reflectance."""
    if not 0 < counts[0] < counts[1]:
        raise ValueError(f"{keys}: counts from {counts[0]:g} to {counts[1]:g}, which must rise from above 0; {REFETCH}")
    low, high = (gain * count + offset for count in counts)
    found = f"{keys} give values from {low:g} to {high:g} for counts from {counts[0]:g} to {counts[1]:g}"
    if stated is not None and not _agree((low, high), stated):
        raise ValueError(f"{found}, and the same file states {stated[0]:g} to {stated[1]:g}: {REFETCH}")
    if not (_DARKEST[0] <= low <= _DARKEST[1] and brightest <= high <= _BRIGHTEST):
        raise ValueError(
            f"{found}: reflectance must begin in [{_DARKEST[0]:g}, {_DARKEST[1]:g}] and end in [{brightest:g}, "
            f"{_BRIGHTEST:g}]; {REFETCH}"
        )


def check_radiance(keys, gain, offset, counts, stated):
    """Raise ValueError if a scale of radiance contradicts the range in the file."""
    found = tuple(gain * count + offset for count in counts)
    if not _agree(found, stated):
        raise ValueError(
            f"{keys} give values from {found[0]:g} to {found[1]:g} W m-2 sr-1 um-1, and the same file states "
            f"{stated[0]:g} to {stated[1]:g}: {REFETCH}"
        )


def _agree(found, stated):
    """Whether two ranges agree within the rounding of metadata."""
    span = stated[1] - stated[0]
    return span > 0 and np.abs(np.subtract(found, stated)).max() <= _AGREEMENT * span


def check_sun(keys, sza, saa, time, place):
    """Raise ValueError if the sun was elsewhere at a time and place."""
    _, zenith, azimuth, _ = sun_positions([str(time)], *place)
    if not angle_between(sza, saa, zenith[0], azimuth[0]) <= _SUN:
        raise ValueError(
            f"{keys}: at {str(time)[:16]} UTC and {place[0]:.2f} N, {place[1]:.2f} E, the sun had a zenith angle of "
            f"{zenith[0]:.1f} and an azimuth of {azimuth[0]:.1f} degrees. Angles must be in degrees and belong to the "
            f"time; {REFETCH}"
        )


def check_distance(key, distance, time):
    """Raise ValueError if the Earth-Sun distance contradicts the date."""
    expected = earth_sun_distance(str(time))
    if not abs(distance - expected) <= _DISTANCE:
        raise ValueError(
            f"{key} = {distance:g} does not belong to the date {str(time)[:10]}, which has {expected:.4f} astronomical "
            f"units: {REFETCH}"
        )


def check_irradiance(product, bands, description):
    """Raise ValueError if a product is scaled by an impossible solar irradiance for the band."""
    known = {band.name: band.solar_irradiance for band in description.bands}
    for band in bands:
        given, own = band.solar_irradiance, known.get(band.name)
        if given is not None and own is not None and not own / _IRRADIANCE <= given <= own * _IRRADIANCE:
            raise ValueError(
                f"{product}: the scale of {band.name} (RADIANCE_MAXIMUM and REFLECTANCE_MAXIMUM of Landsat, "
                f"SOLAR_IRRADIANCE of Sentinel-2) means a solar irradiance of {given:g} W m-2 um-1, which must be in "
                f"[{own / _IRRADIANCE:.0f}, {own * _IRRADIANCE:.0f}]: {REFETCH}"
            )
