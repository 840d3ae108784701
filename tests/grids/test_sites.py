"""The FIFE site and its sun position."""

import datetime
import warnings

import numpy as np
import odc.geo.xr  # noqa: F401  registers .odc
import pandas as pd
import pytest
import xarray as xr

import fifesim
from fifesim.grids.sites import is_fife, made_on_site, on_fife_site

CELL = 30 / 9


def test_site_is_15_km_wide_and_starts_at_its_corner():
    grid = fifesim.fife_site(CELL)
    assert tuple(grid.shape) == (4500, 4500) and grid.crs.epsg == 26914
    np.testing.assert_allclose(grid.boundingbox.bbox, (704970, 4319220, 719970, 4334220), rtol=0, atol=1e-6)
    own = fifesim.fife_site(30, datum="NAD27")
    assert own.crs.epsg == 26714 and (own.affine.c, own.affine.f) == (705000.0, 4334000.0)


def test_sizes_that_cells_do_not_fill_are_rounded_down_with_a_warning():
    with pytest.warns(UserWarning, match=r"29 x 29 m do not fill height=15000 .* height=14993 and width=14993 m"):
        assert tuple(fifesim.fife_site(29).shape) == (517, 517)
    with pytest.warns(UserWarning, match="height=60 and width=90 m are used; type these") as found:
        grid = fifesim.grid_at("EPSG:32614", 0, 1e6, 100, 70, 30)
    assert tuple(grid.shape) == (2, 3) and len(found) == 1
    with pytest.warns(UserWarning, match="height=15000 and width=990 m are used"):
        assert fifesim.Scenario(grid={"width": 1000, "cell": 30}).geobox().shape.x == 33
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        for cell in (10 / 3, 30 / 9, 2.5, 25, 30):
            fifesim.fife_site(cell)
        fifesim.fife_site(29, window=((0, 10), (0, 10)))
        fifesim.Scenario().geobox()


def test_invalid_site_arguments_are_rejected():
    refused = {
        r"cell must be in \(0, 15000\] m, got 0": {"cell": 0},
        "datum must be 'NAD83' or 'NAD27', got 'WGS84'": {"cell": 30, "datum": "WGS84"},
        "within 500 rows and 500 columns": {"cell": 30, "window": ((0, 10), (0, 501))},
        "within 500 rows": {"cell": 30, "window": ((5, 5), (0, 10))},
        "window must be": {"cell": 30, "window": 10},
    }
    for message, options in refused.items():
        with pytest.raises(ValueError, match=message):
            fifesim.fife_site(**options)


@pytest.mark.parametrize(
    ("east", "north", "inside"),
    [(0, 0, True), (7000, 7000, True), (8500, 0, False), (-8500, 0, False), (0, 8500, False), (0, -8500, False)],
)
def test_scenes_on_the_site_are_marked(east, north, inside):
    """A square of 300 m is shifted from the middle of the site."""
    grid = fifesim.grid_at("EPSG:26914", 712470 + east - 150, 4326720 + north + 150, 300, 300, 30)
    lai = fifesim.lai_scene(grid)
    assert is_fife(lai) == is_fife(fifesim.flint_hills(grid)) == inside
    assert made_on_site(grid) == ({"site": "FIFE"} if inside else {})


@pytest.mark.parametrize("datum", ["NAD83", "NAD27"])
def test_site_is_recognised_in_any_reference_system(datum):
    corner = fifesim.fife_site(30, datum=datum)[:2, :2]
    assert on_fife_site(corner) and not on_fife_site(corner.pad(20)[:3, :3])
    geodetic = fifesim.grid_at("EPSG:5070", -50000.0, 1788000.0, 300.0, 300.0, 30)
    assert on_fife_site(geodetic)
    assert not on_fife_site(fifesim.grid_at("EPSG:32735", 712000.0, 4327000.0 + 1e6, 300.0, 300.0, 30))


def test_site_depends_on_coordinates_as_well_as_attributes(lai):
    """Arithmetic propagates attributes, and coordinates may be changed."""
    assert is_fife(lai) and not is_fife(lai.assign_coords(x=lai.x + 500e3))


DATES = ["1987-06-06T16:35Z", "1987-08-15T11:40-05:00", "1987-10-10T17:00"]
FIFE = {"latitude": 39.06, "longitude": -96.54}


def test_season_equals_each_date_alone():
    season = fifesim.sun_position(DATES, **FIFE, altitude=400.0)
    assert season.sizes == {"time": 3}
    assert season["time"].values.astype("datetime64[m]").astype(str).tolist() == [
        "1987-06-06T16:35", "1987-08-15T16:40", "1987-10-10T17:00",
    ]  # fmt: skip
    for number, date in enumerate(DATES):
        alone = fifesim.sun_position(date, **FIFE, altitude=400.0)
        for name in ("sza", "saa", "earth_sun_distance"):
            assert float(season[name][number]) == pytest.approx(getattr(alone, name), abs=1e-9)


def test_times_of_any_type_are_accepted():
    expected = fifesim.sun_position(DATES[0], **FIFE).sza
    kinds = (
        pd.to_datetime(DATES[:1]),
        np.array(["1987-06-06T16:35"], "datetime64[m]"),
        [datetime.datetime(1987, 6, 6, 16, 35, tzinfo=datetime.UTC)],
        xr.DataArray(np.array(["1987-06-06T16:35"], "datetime64[ns]"), dims="time"),
    )
    for times in kinds:
        assert float(fifesim.sun_position(times, **FIFE)["sza"][0]) == pytest.approx(expected, abs=1e-9)


def test_invalid_times_and_places_give_one_line():
    two = {"latitude": [1.0, 2.0], "longitude": 3.0}
    refused = [
        (["noon"], FIFE, r"time must be a date and time such as .*, got 'noon'"),
        ([], FIFE, r"time must be one time, or a list .* got a list of 0"),
        (np.ones((2, 2)), FIFE, "time must be one time, or a list"),
        (None, FIFE, r"time must be a date and time .* got None"),
        (DATES, two, r"one for each of 3 times, got \(2,\) and \(\) and \(\)"),
    ]
    for time, place, message in refused:
        with pytest.raises(ValueError, match=message):
            fifesim.sun_position(time, **place)


def test_times_and_places_are_broadcast():
    both = fifesim.sun_position(DATES[:2], latitude=[39.06, -33.0], longitude=[-96.54, 150.0])
    assert float(both["sza"][0]) == pytest.approx(fifesim.sun_position(DATES[0], **FIFE).sza, abs=1e-9)
    assert float(both["sza"][1]) > 90  # night in Australia is returned, not rejected
    many = fifesim.sun_position(DATES[0], latitude=[39.06, 0.0, 39.06], longitude=-96.54)
    assert many.sizes == {"time": 3} and float(many["sza"][0]) == float(many["sza"][2]) != float(many["sza"][1])
