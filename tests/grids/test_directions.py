"""Directions of the sun and sensor, and dates: carried as coordinates, by cell, and processed date by date."""

import numpy as np
import pytest
import xarray as xr
from lazy import in_chunks, no_compute

import fifesim
from fifesim.base.geometry import Geometry, fife_geometry
from fifesim.grids import cf, directions
from fifesim.grids import grid as grids
from fifesim.grids.dates import epoch, joined

SUN = Geometry(sza=28.5, saa=117.0, vza=3.0, vaa=-80.0, earth_sun_distance=1.0147)


def raster(**attrs):
    return xr.DataArray(np.ones((2, 3)), dims=("y", "x"), name="mine", attrs=attrs)


def ramp(low, high):
    """A raster on the cells that increases to the east."""
    return raster().copy(data=np.broadcast_to(np.linspace(low, high, 3), (2, 3)))


def test_uniform_directions_are_scalar_coordinates():
    with no_compute():
        carried = directions.with_geometry(in_chunks(raster(), {"y": 1}), SUN)
    assert directions.geometry_of(carried) == SUN
    assert carried["sza"].attrs == cf.attributes("sza")
    assert directions.geometry_of(raster()) is None
    by_cell = directions.checked_geometry(xr.Dataset({"sza": ramp(0.0, 60.0), "saa": 0.0}))
    np.testing.assert_allclose(directions.mu_s(by_cell)[0, [0, -1]], [1.0, 0.5], atol=1e-15)


def test_azimuths_count_from_grid_north():
    """East of the central meridian, grid north lies east of true north, increasingly so toward the pole."""
    east, west = (grids.grid_at("EPSG:26914", x, 4.33e6, 900, 900, 30) for x in (708000, 292000))
    turned = [directions.from_grid_north(SUN, grid) for grid in (east, west)]
    assert 1 < SUN.saa - turned[0].saa < 2 and 1 < turned[1].saa - SUN.saa < 2
    assert SUN.vaa - turned[0].vaa == pytest.approx(SUN.saa - turned[0].saa, abs=1e-12)
    assert (turned[0].sza, turned[0].vza, turned[0].earth_sun_distance) == (28.5, 3.0, 1.0147)
    # Beyond a whole turn, azimuths begin again.
    whole = directions.from_grid_north(Geometry(28.5, 359.9, 3.0, -359.9), west), directions.from_grid_north(SUN, west)
    assert whole[0].saa == pytest.approx(359.9 + whole[1].saa - SUN.saa - 360, abs=1e-9)
    east_of = directions.from_grid_north(Geometry(28.5, 359.9, 3.0, -359.9), east).vaa
    assert east_of == pytest.approx(-359.9 + turned[0].saa - SUN.saa + 360, abs=1e-9)


def test_angles_by_cell_are_a_dataset_and_are_carried():
    scan = xr.Dataset({"sza": 40.0, "saa": 120.0, "vza": ramp(0.0, 30.0), "vaa": 280.0})
    found = directions.checked_geometry(scan)
    assert directions.varying(found) == ("vza",) and float(found["earth_sun_distance"]) == 1.0
    again = directions.geometry_of(directions.with_geometry(raster(), found))
    xr.testing.assert_equal(again, found)
    assert again["vza"].attrs["standard_name"] == "sensor_zenith_angle"
    with pytest.raises(ValueError, match="the test needs one direction of sun and sensor, got rasters of vza"):
        directions.uniform_geometry(found, "the test")
    assert directions.uniform_geometry(SUN, "the test") == SUN


CAPE = fifesim.grid_at("EPSG:32734", 261000.0, 6244000.0, 300.0, 300.0, 30.0)  # near Cape Town
NOON = "2022-12-21T10:45Z"


def cape_raster(**coordinates):
    cells = xr.DataArray(np.ones(CAPE.shape), dims=("y", "x"), name="mine")
    return grids.place(cells.assign_coords(coordinates), CAPE)


def test_sun_position_follows_time_and_location():
    """Near noon at the solstice, the solar zenith angle is latitude plus obliquity of the ecliptic."""
    of_data = directions.given_geometry(None, cape_raster(time=np.datetime64("2022-12-21T10:45")))
    assert of_data.sza == pytest.approx(33.92 - 23.44, abs=0.15)
    assert min(of_data.saa, 360 - of_data.saa) < 15, "the sun is in the north there"
    assert of_data.earth_sun_distance == pytest.approx(0.9838, abs=2e-4)
    assert directions.given_geometry(None, cape_raster(), NOON) == directions.sun_over(CAPE, NOON) == of_data
    # Carried angles have the Earth-Sun distance of their time.
    known = cape_raster(sza=20.0, saa=30.0, time=np.datetime64("2022-01-04T10:00"))
    assert directions.geometry_of(known).earth_sun_distance == pytest.approx(0.9833, abs=2e-4)
    assert directions.geometry_of(known.drop_vars("time")).earth_sun_distance == 1.0


def test_given_directions_override_carried_directions_and_the_papers(lai):
    other = Geometry(30.0, 100.0)
    carried = directions.with_geometry(cape_raster(time=np.datetime64("2022-06-01T10:45")), other)
    assert directions.given_geometry(SUN, carried) == SUN
    assert directions.given_geometry(None, carried) == other
    assert directions.given_geometry(None, carried, NOON) == directions.sun_over(CAPE, NOON)
    assert directions.given_geometry(None, lai) == fife_geometry()
    with pytest.raises(ValueError, match="geometry and time both determine the sun"):
        directions.given_geometry(SUN, carried, NOON)


def test_given_time_is_stored_on_the_raster(lai):
    """Otherwise a file would hold one date and the sun of another."""
    then = np.datetime64("2022-07-03T17:00")
    made = lai.assign_coords(time=np.datetime64("2022-01-03T17:00"))
    rho = made.fifesim.surface_reflectance("TM", bands=["TM3"], time="2022-07-03T17:00Z")
    assert all(
        each["time"].values == then for each in (rho, rho.fifesim.to_toa(), rho.fifesim.to_toa().fifesim.sense())
    )
    later = rho.drop_vars("sza").fifesim.to_toa(time="2022-08-03T17:00Z")
    assert later["time"].values == np.datetime64("2022-08-03T17:00") and later["sza"] > rho["sza"]


DATES = ["1987-06-06T16:35Z", "1987-08-15T11:40-05:00", "1987-10-10T17:00"]
FIFE = {"latitude": 39.06, "longitude": -96.54}


def test_sun_of_several_times_and_places_equals_each_alone():
    season = fifesim.sun_position(DATES, **FIFE, altitude=400.0)
    times = season["time"].values.astype("datetime64[m]").astype(str).tolist()
    assert times == ["1987-06-06T16:35", "1987-08-15T16:40", "1987-10-10T17:00"]
    for number, date in enumerate(DATES):
        alone = fifesim.sun_position(date, **FIFE, altitude=400.0)
        for name in ("sza", "saa", "earth_sun_distance"):
            assert float(season[name][number]) == pytest.approx(getattr(alone, name), abs=1e-9)
    expected = fifesim.sun_position(DATES[0], **FIFE).sza
    both = fifesim.sun_position(DATES[:2], latitude=[39.06, -33.0], longitude=[-96.54, 150.0])
    assert float(both["sza"][0]) == pytest.approx(expected, abs=1e-9)
    assert float(both["sza"][1]) > 90  # night in Australia is returned, not rejected
    many = fifesim.sun_position(DATES[0], latitude=[39.06, 0.0, 39.06], longitude=-96.54)
    assert many.sizes == {"time": 3} and float(many["sza"][0]) == float(many["sza"][2]) != float(many["sza"][1])


TIMES = np.array(["2022-05-01T17:00", "2022-06-01T17:00", "2022-07-01T16:50"], "M8[ns]")
NOISE = {"noise": "thermal", "noise_models": fifesim.NoiseModel(shot=0.0, thermal=0.5), "quantise": False}


@pytest.fixture(scope="module")
def season(lai_values):
    """Leaf area at three dates on the same cells."""
    dates = [(lai_values * share).assign_coords(time=time) for share, time in zip((0.4, 1.0, 1.4), TIMES, strict=True)]
    return joined(dates)


def run_chain(lai):
    toa = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"]).fifesim.to_toa()
    image = toa.fifesim.sense()
    noisy = toa.fifesim.sense(seed=3, **NOISE)
    of_image = image, noisy, image.fifesim.ndvi(), image.fifesim.to_surface()
    return toa, *of_image, lai.fifesim.fpar(), lai.fifesim.aggregate(30)


def test_each_date_equals_the_date_processed_alone(season):
    """A stack in chunks stays lazy, and each date has its own position of the sun."""
    together = run_chain(season)
    with no_compute():
        lazy = run_chain(in_chunks(season, {"y": 20, "x": 27}))
    for made, known in zip(lazy, together, strict=True):
        np.testing.assert_array_equal(made.compute(), known)
    toa = together[0]
    assert toa["sza"].dims == ("time",) and toa["vza"].dims == () and toa.odc.crs == season.odc.crs
    for number, time in enumerate(TIMES):
        assert toa["sza"][number] == pytest.approx(directions.sun_over(season.odc.geobox, time).sza, abs=1e-9)
        for stack, alone in zip(together, run_chain(season.isel(time=number)), strict=True):
            assert stack.dims[0] == "time"
            xr.testing.assert_equal(stack.isel(time=number), alone)


def test_noise_differs_between_dates_and_the_fixed_pattern_does_not(season):
    toa = joined([season.isel(time=0).assign_coords(time=time) for time in TIMES[:2]])
    toa = toa.fifesim.surface_reflectance("TM", bands=["TM3"], geometry=fifesim.fife_geometry()).fifesim.to_toa()
    one, other = toa.fifesim.sense(**NOISE)
    assert not np.any(one.values == other.values)
    model = fifesim.NoiseModel(shot=0.0, thermal=0.5, gain_spread=0.01, offset_spread=0.1, detectors=16)
    one, other = toa.fifesim.sense(noise="fixed-pattern", noise_models=model, quantise=False)
    np.testing.assert_array_equal(one, other)


def test_arguments_and_their_parts_may_have_the_same_dates(season):
    season = season[:, :9, :9]
    background = xr.zeros_like(season) + xr.DataArray([0.1, 0.2, 0.3], dims="time")
    content = background.drop_attrs(deep=False) * 200

    def of_dates(at):
        leaf = fifesim.Leaf(chlorophyll=content[at])
        return fifesim.Canopy(background={"TM3": background[at]}, leaf_optics=leaf)

    rho = season.fifesim.surface_reflectance("TM", bands=["TM3"], canopy=of_dates(slice(None)))
    expected = season[1].fifesim.surface_reflectance("TM", bands=["TM3"], canopy=of_dates(1))
    np.testing.assert_array_equal(rho[1], expected)
    with pytest.raises(ValueError, match=r"the times of .* differ from the times of the raster"):
        season.fifesim.surface_reflectance("TM", canopy=fifesim.Canopy(background=background[:2]))
    with pytest.raises(ValueError, match="background has dates and the raster of surface_reflectance has none"):
        season[0].fifesim.surface_reflectance("TM", canopy=fifesim.Canopy(background=season / 30))
    with pytest.raises(ValueError, match="the raster has a dimension time: leave time= out"):
        season.fifesim.surface_reflectance("TM", time="2022-05-01T17:00Z")


def test_epochs_are_seconds():
    """Images one second apart draw different noise; an image without a time uses epoch 0."""
    assert epoch(xr.DataArray(1.0)) == 0
    days = (np.datetime64("2022-05-01") - np.datetime64("0001-01-01")).astype(int)
    for unit in ("s", "us", "ns"):
        time = np.datetime64("2022-05-01T17:00:01").astype(f"M8[{unit}]")
        assert epoch(xr.DataArray(1.0, coords={"time": time})) == days * 86400 + 17 * 3600 + 1
    others = {epoch(xr.DataArray(1.0, coords={"time": label})) for label in (0, 1, "May")}
    assert len(others) == 3 and 0 not in others
