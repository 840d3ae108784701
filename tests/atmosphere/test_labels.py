"""Atmosphere on labelled rasters, with fixed and varying geometry, and its spectrum."""

import dataclasses

import numpy as np
import pytest
import xarray as xr
from lazy import check_raster_function, in_chunks

import fifesim
from fifesim.atmosphere import coupling, engines, lookup
from fifesim.atmosphere.engines import band_terms
from fifesim.atmosphere.labels import surface_from_toa, toa_from_surface
from fifesim.base.bands import Band
from fifesim.base.geometry import ANGLES, Geometry
from fifesim.grids import directions
from fifesim.sensor.description.instruments import instrument

AIR = fifesim.Atmosphere(visibility=23.0)
SUN = Geometry(40.0, 120.0, 5.0, 200.0)
BANDS = tuple(band.response for band in instrument("TM").select(["TM3", "TM4"]))
TERMS = engines.band_terms(AIR, BANDS, SUN.sza, SUN.vza, SUN.raa)
FACTORS = [
    getattr(TERMS, name)[:, None, None]
    for name in ("path_reflectance", "transmittance_down", "transmittance_up", "spherical_albedo", "gas_transmittance")
]


@pytest.fixture
def ground(lai_with_hole):
    return fifesim.surface_reflectance(lai_with_hole, bands=["TM3", "TM4"], atmosphere=AIR, geometry=SUN)


def upward(array, **options):
    return toa_from_surface(array, AIR, BANDS, SUN, **options)


def downward(array):
    return surface_from_toa(array, AIR, BANDS, SUN)


def test_to_toa_follows_the_raster_rules_and_equals_the_kernel(ground):
    result = check_raster_function(upward, ground, quantity="toa_reflectance")
    np.testing.assert_array_equal(result, coupling.apparent_reflectance(ground.values, *FACTORS))
    np.testing.assert_array_equal(np.isnan(result), np.isnan(ground))
    assert result["band"].values.tolist() == ["TM3", "TM4"]
    assert "wavelength" in result.coords
    assert directions.geometry_of(result) == SUN
    assert fifesim.Atmosphere.parse(result.attrs["atmosphere"]) == AIR


def test_to_surface_follows_the_raster_rules_and_equals_the_kernel(ground):
    toa = upward(ground)
    result = check_raster_function(downward, toa, quantity="surface_reflectance")
    np.testing.assert_array_equal(result, coupling.corrected_reflectance(toa.values, *FACTORS))


# ------------------------------------------------------------------------------------------ varying geometry


def ramp(ground, low, high):
    """Raster on the grid of the ground that increases to the east."""
    flat = ground.isel(band=0, drop=True).drop_vars([*ANGLES, "earth_sun_distance"])
    return flat.copy(data=np.broadcast_to(np.linspace(low, high, flat.sizes["x"]), flat.shape)).drop_attrs(deep=False)


def by_cell(sza, saa, vza, vaa):
    """Geometry with some angles as rasters."""
    return directions.checked_geometry(xr.Dataset({"sza": sza, "saa": saa, "vza": vza, "vaa": vaa}))


@pytest.fixture
def swath(ground):
    return by_cell(ramp(ground, 38.0, 42.0), 120.0, ramp(ground, 0.0, 55.0), 200.0)


def test_swath_follows_the_raster_rules_and_equals_the_lookup_table(ground, swath):
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


def test_round_trip_with_swath_and_relief(ground, swath):
    """Also with the angles and the instrument in the attributes of the image."""
    np.testing.assert_allclose(
        toa_from_surface(ground, AIR, BANDS, swath).fifesim.to_surface(), ground, rtol=0, atol=1e-12
    )
    bare = ground.drop_attrs(deep=False).assign_attrs(units="1").fifesim.to_toa(AIR, geometry=SUN, instrument="TM")
    np.testing.assert_allclose(bare.fifesim.to_surface(), ground, rtol=0, atol=1e-12)
    relief = ramp(ground, 0.0, 900.0).assign_attrs(units="m")
    toa = toa_from_surface(ground, AIR, BANDS, swath, elevation=relief)
    np.testing.assert_allclose(surface_from_toa(toa, AIR, BANDS, swath, elevation=relief), ground, rtol=0, atol=1e-12)


def test_relief_sets_the_altitude_of_each_cell(ground):
    relief = ramp(ground, 0.0, 1500.0).assign_attrs(units="m")
    toa = toa_from_surface(ground, AIR, BANDS, SUN, elevation=relief)
    for column in (0, 17, ground.sizes["x"] - 1):
        there = dataclasses.replace(AIR, altitude=float(relief[0, column]) / 1000)
        own = toa_from_surface(ground, there, BANDS, SUN)
        np.testing.assert_allclose(toa[..., column], own[..., column], rtol=0, atol=3e-5)


def test_adjacency_follows_the_raster_rules_and_is_invertible(ground):
    toa = check_raster_function(lambda each: upward(each, adjacency=True), ground, quantity="toa_reflectance")
    assert "with adjacency" in toa.attrs["history"]
    back = surface_from_toa(toa, AIR, BANDS, SUN, adjacency=True)
    np.testing.assert_allclose(back, ground, rtol=0, atol=1e-4)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda rho, swath: upward(rho.assign_attrs(units="percent")), "has units 'percent'"),
        (lambda rho, swath: downward(rho.drop_attrs().assign_attrs(units="percent")), "has units 'percent'"),
        (lambda rho, swath: upward(rho.assign_attrs(units="W m-2 sr-1 um-1")), "surface_reflectance needs '1'"),
        (lambda rho, swath: upward(rho, adjacency=True, elevation=ramp(rho, 0, 9)), "single geometry.*got elevation"),
        (
            lambda rho, swath: toa_from_surface(rho, AIR, BANDS, swath, adjacency=True),
            "adjacency needs a single geometry and altitude, got rasters of sza, vza",
        ),
        (
            lambda rho, swath: rho.fifesim.to_toa(
                AIR, geometry=swath.assign(vza=swath.vza.assign_attrs(units="radian"))
            ),
            "has units 'radian', vza needs 'degree'",
        ),
    ],
)
def test_wrong_units_and_incompatible_options_raise(ground, swath, call, message):
    with pytest.raises(ValueError, match=message):
        call(ground, swath)


# ------------------------------------------------------------------------------------------ spectrum


def test_spectrum_agrees_with_narrow_bands():
    """Terms of a band as narrow as one step of the gas table equal the spectral terms at its centre."""
    spectrum = fifesim.atmosphere.spectrum(geometry=SUN)
    assert all({"long_name", "units"} <= set(variable.attrs) for variable in spectrum.data_vars.values())
    assert spectrum["wavelength"].attrs["units"] == "um"
    assert fifesim.Atmosphere.parse(spectrum.attrs["atmosphere"]) == fifesim.Atmosphere()
    for centre in (0.45, 0.65, 0.86, 1.65):
        band = Band("narrow", (centre - 0.0025, centre, centre + 0.0025), (0, 1, 0))
        terms = band_terms(fifesim.Atmosphere(), [band], SUN.sza, SUN.vza, SUN.raa)
        at = spectrum.sel(wavelength=centre, method="nearest")
        for name in ("transmittance_down", "transmittance_up", "spherical_albedo", "direct_transmittance_up"):
            assert float(at[name]) == pytest.approx(getattr(terms, name)[0], rel=1e-4)
