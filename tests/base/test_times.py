from datetime import datetime, timedelta, timezone

import pandas as pd
import pytest

from fifesim.base.times import utc

SUMMER = pd.Timestamp("1987-06-06T16:35Z")


@pytest.mark.parametrize(
    "time",
    [
        *("1987-06-06T16:35:00", "1987-06-06 16:35", "1987-06-06T16:35:00.0Z", "19870606T1635", " 1987-06-06T16:35Z "),
        *("1987-06-06T11:35:00-05:00", "1987-06-06 11:35-05:00", datetime(1987, 6, 6, 16, 35)),
        datetime(1987, 6, 6, 11, 35, tzinfo=timezone(timedelta(hours=-5))),
    ],
)
def test_time_without_zone_is_utc_and_others_are_converted(time):
    assert utc(time).tolist() == [SUMMER]


def test_what_is_no_time_is_refused():
    refused = {
        r"such as 1987-06-06T16:35:00Z, got.*the year first": [
            "3.6.2022 10:00", "03/06/2022 10:00", "13.6.2022 10:00", "10:00", "June 3, 2022 9:00",
        ],
        "add the time of day, such as 1987.*T17:10Z": ["1987-06-06", "19870606"],
        "years 1700 to 2200": ["1699-12-31T23:59", "2200-01-01T00:00", "9999-12-31T23:59"],
        "must be a date and time such as": [
            1987, 0.5, None, "NaT", "1987-06-06T24:00", "1987-06-06T16:35 US/Central",
        ],
    }  # fmt: skip
    for message, times in refused.items():
        for time in times:
            with pytest.raises(ValueError, match=message):
                utc(time)
    # The ends of the years that dates in nanoseconds hold.
    for time in ("1700-01-01T00:00", "2199-12-31T23:59"):
        assert utc(time)[0] == pd.Timestamp(time, tz="UTC")
