"""The sun of a season beside that of each date."""

import datetime

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import fifesim

DATES = ["1987-06-06T16:35Z", "1987-08-15T11:40-05:00", "1987-10-10T17:00"]
FIFE = {"latitude": 39.06, "longitude": -96.54}


def test_season_is_each_date_by_itself():
    season = fifesim.sun_position(DATES, **FIFE, altitude=400.0)
    assert season.sizes == {"time": 3}
    assert season["time"].values.astype("datetime64[m]").astype(str).tolist() == [
        "1987-06-06T16:35", "1987-08-15T16:40", "1987-10-10T17:00",
    ]  # fmt: skip
    for number, date in enumerate(DATES):
        alone = fifesim.sun_position(date, **FIFE, altitude=400.0)
        for name in ("sza", "saa", "earth_sun_distance"):
            assert float(season[name][number]) == pytest.approx(getattr(alone, name), abs=1e-9)


@pytest.mark.parametrize(
    "times",
    [
        pd.to_datetime(DATES[:1]),
        np.array(["1987-06-06T16:35"], "datetime64[m]"),
        [datetime.datetime(1987, 6, 6, 16, 35, tzinfo=datetime.UTC)],
        xr.DataArray(np.array(["1987-06-06T16:35"], "datetime64[ns]"), dims="time"),
    ],
    ids=["index", "numpy", "datetime", "DataArray"],
)
def test_times_of_any_kind(times):
    season = fifesim.sun_position(times, **FIFE)
    assert float(season["sza"][0]) == pytest.approx(fifesim.sun_position(DATES[0], **FIFE).sza, abs=1e-9)


def test_a_place_for_each_time_and_a_time_for_many_places():
    both = fifesim.sun_position(DATES[:2], latitude=[39.06, -33.0], longitude=[-96.54, 150.0])
    assert float(both["sza"][0]) == pytest.approx(fifesim.sun_position(DATES[0], **FIFE).sza, abs=1e-9)
    assert float(both["sza"][1]) > 90  # night in Australia: told, not refused
    many = fifesim.sun_position(DATES[0], latitude=[39.06, 0.0, 39.06], longitude=-96.54)
    assert many.sizes == {"time": 3} and float(many["sza"][0]) == float(many["sza"][2]) != float(many["sza"][1])


@pytest.mark.parametrize(
    ("time", "place", "message"),
    [
        (["noon"], FIFE, r"time must be a date and time such as .*, got 'noon'"),
        ([], FIFE, r"time must be one time, or a list .* got a list of 0"),
        (np.ones((2, 2)), FIFE, "time must be one time, or a list"),
        (None, FIFE, r"time must be a date and time .* got None"),
        (DATES, {"latitude": [1.0, 2.0], "longitude": 3.0}, r"one for each of 3 times, got \(2,\) and \(\) and \(\)"),
        ("1987-06-06T06:00Z", FIFE, "the sun is below the horizon"),
    ],
)
def test_what_is_no_time_or_place_is_one_line(time, place, message):
    with pytest.raises(ValueError, match=message):
        fifesim.sun_position(time, **place)
