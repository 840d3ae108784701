"""Date and time of day, as people write them."""

import re

import numpy as np
import pandas as pd

from fifesim.base.kinds import described

# Day and month in another order are another season, and a time alone is today's.
_WRITTEN = re.compile(r"\s*\d{4}-?\d{2}-?\d{2}[T ]\d{2}(:?\d{2}.*)?\s*", re.ASCII)
_YEARS = 1700, 2200  # what dates in nanoseconds hold


def utc(time):
    """
    A time in UTC.

    Parameters
    ----------
    time : str or datetime
        Taken as UTC where it names no time zone; a text after ISO 8601, with the time of day.

    Returns
    -------
    time : pandas.DatetimeIndex, shape (1,)

    Raises
    ------
    ValueError
        If it is no time, a date alone, for midnight is another sun, a text in another order, or of another age.
    """
    if isinstance(time, str) and re.fullmatch(r"\s*\d{4}-?\d{2}-?\d{2}\s*", time):
        raise ValueError(f"time = {time!r} is a date alone: add the time of day, such as {time.strip()}T17:10Z")
    if isinstance(time, str) and not _WRITTEN.fullmatch(time):
        raise ValueError(
            f"time must be a date and time such as 1987-06-06T16:35:00Z, got {described(time)}: the year first, "
            "then month and day, for other orders are read in several ways"
        )
    try:
        # A number would be taken for nanoseconds since 1970.
        stamp = pd.NaT if isinstance(time, int | float | np.number) else pd.Timestamp(time)
    except (TypeError, ValueError):
        stamp = pd.NaT
    if stamp is pd.NaT:
        raise ValueError(f"time must be a date and time such as 1987-06-06T16:35:00Z, got {described(time)}")
    if not _YEARS[0] <= stamp.year < _YEARS[1]:
        raise ValueError(f"time must be a date and time of the years {_YEARS[0]} to {_YEARS[1]}, got {described(time)}")
    return pd.DatetimeIndex([stamp.tz_localize("UTC") if stamp.tzinfo is None else stamp.tz_convert("UTC")])
