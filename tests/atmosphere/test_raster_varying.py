"""The atmosphere on rasters whose geometry, altitude or surroundings vary."""

import dataclasses

import numpy as np
import pytest
import xarray as xr
from lazy import check_raster_function, in_chunks

import fifesim
from fifesim.atmosphere import lookup
from fifesim.atmosphere.labels import surface_from_toa, toa_from_surface
from fifesim.base.geometry import ANGLES, Geometry
from fifesim.grids import directions
from fifesim.sensor.description.instruments import instrument

AIR = fifesim.Atmosphere(visibility=23.0)
SUN = Geometry(40.0, 120.0, 5.0, 200.0)
BANDS = tuple(band.response for band in instrument("TM").select(["TM3", "TM4"]))


@pytest.fixture
def ground(lai_with_hole):
    return fifesim.surface_reflectance(lai_with_hole, bands=["TM3", "TM4"], atmosphere=AIR, geometry=SUN)


def ramp(ground, low, high):
    """A raster on the cells of the ground that grows to the east."""
    flat = ground.isel(band=0, drop=True).drop_vars([*ANGLES, "earth_sun_distance"])
    return flat.copy(data=np.broadcast_to(np.linspace(low, high, flat.sizes["x"]), flat.shape)).drop_attrs(deep=False)


def by_cell(sza, saa, vza, vaa):
    """Directions of which some are rasters."""
    return directions.checked_geometry(xr.Dataset({"sza": sza, "saa": saa, "vza": vza, "vaa": vaa}))


@pytest.fixture
def swath(ground):
    return by_cell(ramp(ground, 38.0, 42.0), 120.0, ramp(ground, 0.0, 55.0), 200.0)


def test_swath_keeps_its_word_and_equals_the_table(ground, swath):
    result = check_raster_function(
        lambda array: toa_from_surface(array, AIR, BANDS, swath), ground, quantity="toa_reflectance"
    )
    angles = (np.asarray(getattr(swath, name)) for name in ("sza", "saa", "vza", "vaa"))
    table = lookup.varying_reflectance(
        ground.values.transpose(1, 2, 0), np.array(AIR.altitude), *angles, atmosphere=AIR, bands=BANDS
    )
    np.testing.assert_array_equal(result, table)
    np.testing.assert_array_equal(result["vza"], swath.vza)
    assert directions.varying(directions.geometry_of(result)) == ("sza", "vza")


def test_angles_may_be_lazy(ground, swath):
    lazy = swath.assign(vza=in_chunks(swath.vza, {"y": 10, "x": 13}))
    result = toa_from_surface(in_chunks(ground, {"y": 7, "x": 11}), AIR, BANDS, lazy)
    assert result.chunks is not None
    np.testing.assert_array_equal(result, toa_from_surface(ground, AIR, BANDS, swath))


def test_a_raster_of_one_value_is_that_value(ground):
    """To what the table's cubics leave."""
    level = by_cell(ramp(ground, 40.0, 40.0), 120.0, ramp(ground, 5.0, 5.0), 200.0)
    np.testing.assert_allclose(
        toa_from_surface(ground, AIR, BANDS, level), toa_from_surface(ground, AIR, BANDS, SUN), rtol=0, atol=2e-5
    )


def test_carried_angles_are_used(ground, swath):
    toa = toa_from_surface(ground, AIR, BANDS, swath)
    np.testing.assert_allclose(toa.fifesim.to_surface(), ground, rtol=0, atol=1e-12)


def test_swath_and_relief_there_and_back(ground, swath):
    relief = ramp(ground, 0.0, 900.0).assign_attrs(units="m")
    toa = toa_from_surface(ground, AIR, BANDS, swath, elevation=relief)
    np.testing.assert_allclose(surface_from_toa(toa, AIR, BANDS, swath, elevation=relief), ground, rtol=0, atol=1e-12)


def test_relief_is_altitude_by_cell(ground):
    relief = ramp(ground, 0.0, 1500.0).assign_attrs(units="m")
    toa = toa_from_surface(ground, AIR, BANDS, SUN, elevation=relief)
    for column in (0, 17, ground.sizes["x"] - 1):
        there = dataclasses.replace(AIR, altitude=float(relief[0, column]) / 1000)
        own = toa_from_surface(ground, there, BANDS, SUN)
        np.testing.assert_allclose(toa[..., column], own[..., column], rtol=0, atol=3e-5)


def test_even_ground_has_no_adjacency(ground):
    even = ground.copy(data=np.full(ground.shape, 0.2))
    there = toa_from_surface(even, AIR, BANDS, SUN, adjacency=True)
    np.testing.assert_allclose(there, toa_from_surface(even, AIR, BANDS, SUN), rtol=0, atol=1e-9)


def test_adjacency_keeps_its_word_and_leads_back(ground):
    def upward(array):
        return toa_from_surface(array, AIR, BANDS, SUN, adjacency=True)

    toa = check_raster_function(upward, ground, quantity="toa_reflectance")
    assert "with adjacency" in toa.attrs["history"]
    back = surface_from_toa(toa, AIR, BANDS, SUN, adjacency=True)
    np.testing.assert_allclose(back, ground, rtol=0, atol=1e-4)


def test_bright_surroundings_brighten(ground):
    dark, bright = (toa_from_surface(ground, AIR, BANDS, SUN, adjacency=True, surroundings=rho) for rho in (0.05, 0.5))
    assert bool((bright > dark).where(ground.notnull(), True).all())


@pytest.mark.parametrize(
    "options, message",
    [
        ({"surroundings": 0.2}, "surroundings have an effect only with adjacency=True"),
        ({"adjacency": True, "elevation": True}, "adjacency needs a single geometry and altitude, got elevation"),
    ],
)
def test_options_that_do_not_go_together_are_named(ground, options, message):
    if "elevation" in options:
        options = options | {"elevation": ramp(ground, 0, 100)}
    with pytest.raises(ValueError, match=message):
        toa_from_surface(ground, AIR, BANDS, SUN, **options)


def test_swath_needs_a_table(ground, swath):
    with pytest.raises(ValueError, match="engine='6S' runs for one geometry"):
        toa_from_surface(ground, fifesim.Atmosphere(engine="6S"), BANDS, swath)
    with pytest.raises(ValueError, match="adjacency needs a single geometry and altitude, got rasters of sza, vza"):
        toa_from_surface(ground, AIR, BANDS, swath, adjacency=True)


def test_angle_on_other_cells_is_refused(ground, swath):
    with pytest.raises(ValueError, match="have different grids"):
        toa_from_surface(ground, AIR, BANDS, by_cell(40.0, 120.0, swath.vza[:-1], 200.0))


def test_angles_in_radians_are_refused(ground, swath):
    radians = swath.assign(vza=np.radians(swath.vza).assign_attrs(units="radian"))
    with pytest.raises(ValueError, match="has units 'radian', vza needs 'degree'"):
        ground.fifesim.to_toa(AIR, geometry=radians)


def test_instrument_that_is_given_is_carried(ground):
    bare = ground.drop_attrs(deep=False).assign_attrs(units="1")
    toa = bare.fifesim.to_toa(AIR, geometry=SUN, instrument="TM")
    np.testing.assert_allclose(toa.fifesim.to_surface(), ground, rtol=0, atol=1e-12)
