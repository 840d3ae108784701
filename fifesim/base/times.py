"""Date and time of day as people write them, and the time and place of the paper's site."""

import re

import numpy as np
import pandas as pd

from fifesim.base.arguments import described

# A hypothetical overpass: the paper simulates TM for this day (section Data), on which no Landsat passed the FIFE site
# (WRS-2 cycle). It states no time: this is about when one passed on other days.
SITE_TIME = "1987-06-06T16:35:00Z"
SITE_LATITUDE = 39.06  # [degree north]
SITE_LONGITUDE = -96.54  # [degree east]
SITE_ALTITUDE = 400.0  # [m]


# The site is a square, in UTM zone 14. [m]
SITE_SIZE = 15000.0
# FIFE's own corner in NAD27, and the nearest point of the 30 m lattice of today's NAD83 elevation models to the place
# that a Helmert transformation (EPSG:1173, good to 7 m) gives it: 704968 E 4334211 N.
SITE_CORNERS = {"NAD83": ("EPSG:26914", 704970.0, 4334220.0), "NAD27": ("EPSG:26714", 705000.0, 4334000.0)}


# Day and month in another order are another season, and a time alone is today's.
_WRITTEN = re.compile(r"\s*\d{4}-?\d{2}-?\d{2}[T ]\d{2}(:?\d{2}.*)?\s*", re.ASCII)
_YEARS = 1957, 2100  # from the first satellite on


def utc(time, name="time"):
    """Time in UTC, from text after ISO 8601 or a datetime; UTC is assumed if no time zone is given."""
    if isinstance(time, str) and re.fullmatch(r"\s*\d{4}-?\d{2}-?\d{2}\s*", time):
        raise ValueError(f"{name} = {time!r} is a date alone: add the time of day, such as {time.strip()}T17:10Z")
    # A number would be taken for nanoseconds since 1970.
    known = _WRITTEN.fullmatch(time) if isinstance(time, str) else not isinstance(time, int | float | np.number)
    try:
        stamp = pd.Timestamp(time) if known else pd.NaT
    except (TypeError, ValueError):
        stamp = pd.NaT
    if stamp is pd.NaT:
        raise ValueError(
            f"{name} must be a date and time such as 1987-06-06T16:35:00Z, got {described(time)}: the year first, "
            "then month and day, for other orders are read in several ways"
        )
    if not _YEARS[0] <= stamp.year < _YEARS[1]:
        allowed = f"{_YEARS[0]} to {_YEARS[1]}"
        raise ValueError(f"{name} must be of the years {allowed}, in which there are satellites, got {described(time)}")
    return pd.DatetimeIndex([stamp.tz_localize("UTC") if stamp.tzinfo is None else stamp.tz_convert("UTC")])
