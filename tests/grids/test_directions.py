"""Directions are carried as coordinates, either numbers or rasters on the cells."""

import numpy as np
import pytest
import xarray as xr
from lazy import in_chunks, no_compute

import fifesim
from fifesim.base.geometry import Geometry, fife_geometry
from fifesim.grids import cf, directions
from fifesim.grids import grid as grids

SUN = Geometry(sza=28.5, saa=117.0, vza=3.0, vaa=-80.0, earth_sun_distance=1.0147)


def raster(**attrs):
    return xr.DataArray(np.ones((2, 3)), dims=("y", "x"), name="mine", attrs=attrs)


def test_uniform_directions_are_scalar_coordinates():
    with no_compute():
        carried = directions.with_geometry(in_chunks(raster(), {"y": 1}), SUN)
    assert directions.geometry_of(carried) == SUN
    assert carried["sza"].attrs == cf.attributes("sza")
    assert directions.geometry_of(raster()) is None


def test_azimuths_count_from_grid_north():
    """East of the central meridian, grid north lies east of true north, increasingly so toward the pole."""
    east, west = (grids.grid_at("EPSG:26914", x, 4.33e6, 900, 900, 30) for x in (708000, 292000))
    turned = [directions.from_grid_north(SUN, grid) for grid in (east, west)]
    assert 1 < SUN.saa - turned[0].saa < 2 and 1 < turned[1].saa - SUN.saa < 2
    assert SUN.vaa - turned[0].vaa == pytest.approx(SUN.saa - turned[0].saa, abs=1e-12)
    assert (turned[0].sza, turned[0].vza, turned[0].earth_sun_distance) == (28.5, 3.0, 1.0147)


def test_sun_without_azimuth_is_rejected():
    """A default azimuth would light the slopes from the north."""
    for given in (raster().assign_coords(sza=30.0), raster().assign_coords(sza=(("y", "x"), np.full((2, 3), 30.0)))):
        with pytest.raises(ValueError, match=r"zenith angle sza but no azimuth saa.*assign_coords\(saa="):
            directions.geometry_of(given)


def ramp(low, high):
    """A raster on the cells that increases to the east."""
    return raster().copy(data=np.broadcast_to(np.linspace(low, high, 3), (2, 3)))


@pytest.fixture
def scan():
    return xr.Dataset({"sza": 40.0, "saa": 120.0, "vza": ramp(0.0, 30.0), "vaa": 280.0})


def test_angles_by_cell_are_a_dataset_and_are_carried(scan):
    found = directions.checked_geometry(scan)
    assert directions.varying(found) == ("vza",) and float(found["earth_sun_distance"]) == 1.0
    again = directions.geometry_of(directions.with_geometry(raster(), found))
    xr.testing.assert_equal(again, found)
    assert again["vza"].attrs["standard_name"] == "sensor_zenith_angle"


def test_given_angles_override_carried_angles_and_the_papers(lai):
    carried = directions.with_geometry(lai, Geometry(30.0, 100.0))
    assert directions.given_geometry(Geometry(50.0, 90.0), carried) == Geometry(50.0, 90.0)
    assert directions.given_geometry(None, carried) == Geometry(30.0, 100.0)
    assert directions.given_geometry(None, lai) == fife_geometry()


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
    assert directions.given_geometry(None, cape_raster(), NOON) == of_data
    assert directions.sun_over(CAPE, NOON) == of_data


def test_given_time_overrides_carried_angles():
    carried = directions.with_geometry(cape_raster(time=np.datetime64("2022-06-01T10:45")), Geometry(30.0, 100.0))
    assert directions.given_geometry(None, carried) == Geometry(30.0, 100.0)
    assert directions.given_geometry(None, carried, NOON) == directions.sun_over(CAPE, NOON)
    with pytest.raises(ValueError, match="geometry and time both determine the sun"):
        directions.given_geometry(SUN, carried, NOON)


@pytest.mark.parametrize(
    ("given", "kind", "said"),
    [
        (xr.Dataset({"vza": 5.0}), TypeError, "must be a fifesim.Geometry, or an xarray.Dataset with sza"),
        (xr.Dataset({"sza": 95.0, "saa": 0.0}), ValueError, "the sun is below the horizon"),
        (xr.Dataset({"sza": ramp(0.5, 0.6).assign_attrs(units="radian"), "saa": 1.0}), ValueError, "'radian'"),
    ],
)
def test_invalid_directions_are_rejected(given, kind, said):
    with pytest.raises(kind, match=said):
        directions.checked_geometry(given)


def test_rasters_of_angles_are_rejected_where_one_direction_is_needed(scan):
    with pytest.raises(ValueError, match="the test needs one direction of sun and sensor, got rasters of vza"):
        directions.uniform_geometry(directions.checked_geometry(scan), "the test")
    assert directions.uniform_geometry(Geometry(30.0, 0.0), "the test") == Geometry(30.0, 0.0)


def test_cosine_of_the_sun_is_a_number_or_by_cell():
    assert directions.mu_s(Geometry(60.0, 0.0)).item() == pytest.approx(0.5, abs=1e-15)
    by_cell = directions.checked_geometry(xr.Dataset({"sza": ramp(0.0, 60.0), "saa": 0.0}))
    np.testing.assert_allclose(directions.mu_s(by_cell)[0, [0, -1]], [1.0, 0.5], atol=1e-15)


def test_given_time_is_stored_on_the_raster(lai):
    """Otherwise a file would hold one date and the sun of another."""
    then = np.datetime64("2022-07-03T17:00")
    made = lai.assign_coords(time=np.datetime64("2022-01-03T17:00"))
    rho = made.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"], time="2022-07-03T17:00Z")
    images = rho, rho.fifesim.to_toa(), rho.fifesim.to_toa().fifesim.sense()
    assert all(each["time"].values == then for each in images)
    later = rho.drop_vars("sza").fifesim.to_toa(time="2022-08-03T17:00Z")
    assert later["time"].values == np.datetime64("2022-08-03T17:00") and later["sza"] > rho["sza"]
    assert made["time"].values == np.datetime64("2022-01-03T17:00")


def test_carried_sun_has_the_earth_sun_distance_of_its_time():
    known = cape_raster(sza=20.0, saa=30.0, time=np.datetime64("2022-01-04T10:00"))
    assert directions.geometry_of(known).earth_sun_distance == pytest.approx(0.9833, abs=2e-4)
    assert directions.geometry_of(known.drop_vars("time")).earth_sun_distance == 1.0
