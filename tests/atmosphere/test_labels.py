"""Atmosphere on labelled rasters, with fixed and varying geometry, its lookup tables, and its spectrum."""

import dataclasses

import numpy as np
import pytest
import xarray as xr
from lazy import check_raster_function, in_chunks
from verification.atmosphere import _one_cell

import fifesim
from fifesim.atmosphere import coupling, engines, lookup
from fifesim.atmosphere.engines import band_terms
from fifesim.atmosphere.labels import surface_from_toa, toa_from_surface
from fifesim.atmosphere.lookup import varying_reflectance
from fifesim.base.bands import Band
from fifesim.base.geometry import ANGLES, Geometry, scattering_angle_cosine
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


def test_both_ways_follow_the_raster_rules_and_equal_the_kernels(ground):
    toa = check_raster_function(upward, ground, quantity="toa_reflectance")
    np.testing.assert_array_equal(toa, coupling.apparent_reflectance(ground.values, *FACTORS))
    np.testing.assert_array_equal(np.isnan(toa), np.isnan(ground))
    assert toa["band"].values.tolist() == ["TM3", "TM4"]
    assert "wavelength" in toa.coords
    assert directions.geometry_of(toa) == SUN
    assert fifesim.Atmosphere.parse(toa.attrs["atmosphere"]) == AIR
    result = check_raster_function(downward, toa, quantity="surface_reflectance")
    np.testing.assert_array_equal(result, coupling.corrected_reflectance(toa.values, *FACTORS))


# ------------------------------------------------------------------------------------------ varying geometry


def ramp(ground, low, high):
    """Raster on the grid of the ground that increases to the east."""
    flat = ground.isel(band=0, drop=True).drop_vars([*ANGLES, "earth_sun_distance"])
    return flat.copy(data=np.broadcast_to(np.linspace(low, high, flat.sizes["x"]), flat.shape)).drop_attrs(deep=False)


@pytest.fixture
def swath(ground):
    """Geometry with two angles as rasters."""
    sza, vza = ramp(ground, 38.0, 42.0), ramp(ground, 0.0, 55.0)
    return directions.checked_geometry(xr.Dataset({"sza": sza, "saa": 120.0, "vza": vza, "vaa": 200.0}))


def test_swath_follows_the_raster_rules_and_equals_the_lookup_table(ground, swath):
    """Angles may be lazy."""
    result = check_raster_function(
        lambda array: toa_from_surface(array, AIR, BANDS, swath), ground, quantity="toa_reflectance"
    )
    angles = (np.asarray(getattr(swath, name)) for name in ANGLES)
    table = varying_reflectance(
        ground.values.transpose(1, 2, 0), np.array(AIR.altitude), *angles, atmosphere=AIR, bands=BANDS
    )
    np.testing.assert_array_equal(result, table)
    np.testing.assert_array_equal(result["vza"], swath.vza)
    assert directions.varying(directions.geometry_of(result)) == ("sza", "vza")
    lazy = swath.assign(vza=in_chunks(swath.vza, {"y": 10, "x": 13}))
    result = toa_from_surface(in_chunks(ground, {"y": 7, "x": 11}), AIR, BANDS, lazy)
    assert result.chunks is not None
    np.testing.assert_array_equal(result, table)


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


# ------------------------------------------------------------------------------------------ lookup tables


def cells(count, top, seed=3):
    """Random reflectance, altitude, sza, saa, vza, vaa of cells."""
    random = np.random.default_rng(seed)
    angles = (random.uniform(0, high, count) for high in (top, 360, top, 360))
    return random.uniform(0, 0.5, (count, len(BANDS))), random.uniform(0, 2, count), *angles


def compared(atmosphere, *scene):
    """Apparent reflectance of cells by the lookup table, and without it, cell by cell."""
    exact = [_one_cell(atmosphere, BANDS, *each) for each in zip(*scene, strict=True)]
    return varying_reflectance(*scene, atmosphere=atmosphere, bands=BANDS).T, exact


@pytest.mark.parametrize("toward", ["anywhere", "backscatter"])
def test_interpolated_terms_agree_with_exact_terms_per_cell(toward):
    """
    Cubic steps of 2.5 and 5 degrees, 0.5 km in altitude, and single scattering per cell: 3e-5 up to 70 degrees.

    Near backscatter the phase function curves within one step. Linear interpolation in altitude adds another 3e-5.
    """
    rho, altitude, sza, saa, vza, vaa = cells(40, 70)
    if toward == "backscatter":
        vza, vaa = np.clip(sza + (vza - 35) / 20, 0, 70), saa + (vaa - 180) / 90
    np.testing.assert_allclose(*compared(AIR, rho, altitude, sza, saa, vza, vaa), rtol=0, atol=6e-5)


def test_molecules_above_the_aerosol_dim_what_it_scatters_once():
    """At nodes of the table, terms of successive orders are those of one cell."""
    scene = np.full((2, len(BANDS)), 0.1), *np.broadcast_arrays(0.5, 40.0, 0.0, [20.0, 25.0], 60.0)
    air = fifesim.Atmosphere(visibility=10, engine="successive-orders")
    np.testing.assert_allclose(*compared(air, *scene), rtol=1e-11)


def test_missing_angle_gives_missing_reflectance():
    rho, altitude, sza, saa, vza, vaa = cells(3, 60)
    sza[1] = np.nan
    rho[2, 0] = np.nan
    toa = varying_reflectance(rho, altitude, sza, saa, vza, vaa, atmosphere=AIR, bands=BANDS)
    np.testing.assert_array_equal(np.isnan(toa), [[False, True, True], [False, True, False]])


def test_user_columns_decrease_with_elevation_like_the_profile():
    """A column is given above the altitude of the atmosphere; higher ground has a smaller column."""
    rho = np.full((1, len(BANDS)), 0.3)
    places = [np.array(value) for value in (30.0, 0.0, 0.0, 0.0)]
    sea = fifesim.Atmosphere(altitude=0.0)
    own = fifesim.Atmosphere(altitude=0.0, h2o=sea.water_vapour, o3=sea.ozone)
    for high in (0.0, 1.5, 3.0):
        found, profile = (
            varying_reflectance(rho, np.array([high]), *places, atmosphere=air, bands=BANDS) for air in (own, sea)
        )
        np.testing.assert_allclose(found, profile, rtol=1e-12)


def test_polynomials_give_the_functions_of_numpy():
    """Within 1e-10 of a step of the phase function, except next to both poles, where rounding of the cosine counts."""
    random = np.random.default_rng(1)
    sza, vza, raa = (random.uniform(0, high, 5000) for high in (75, 75, 180))
    sza[:3], vza[:3], raa[:3] = [0, 40, 75], [0, 40, 75], [0, 0, 180]
    air_mass, turned, place = np.empty((3, sza.size))
    lookup._scattering(sza, vza, raa, air_mass, turned, place)
    mu_s, mu_v = np.cos(np.radians([sza, vza]))
    np.testing.assert_allclose(air_mass, 1 / mu_s + 1 / mu_v, rtol=2e-15)
    np.testing.assert_allclose(turned, 1 / (4 * (mu_s + mu_v)), rtol=2e-15)
    angle = np.degrees(np.arccos(np.clip(scattering_angle_cosine(sza, vza, raa), -1, 1)))
    assert angle[:2] == pytest.approx(180, abs=1e-5)
    error = np.abs(place - angle / lookup.ANGLE_STEP)
    assert error[angle < 179].max() < 1e-10
    assert error.max() < 1e-5
