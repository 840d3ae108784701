"""Lookup tables of terms that vary by cell, and single scattering by the aerosol."""

import dataclasses

import numpy as np
import pytest

from fifesim.atmosphere import lookup
from fifesim.atmosphere.coupling import apparent_reflectance
from fifesim.atmosphere.engines import band_terms
from fifesim.atmosphere.lookup import varying_reflectance
from fifesim.atmosphere.models import Atmosphere
from fifesim.base.bands import Band
from fifesim.base.geometry import relative_azimuth, scattering_angle_cosine

BANDS = (Band("blue", (0.45, 0.52), (1, 1)), Band("red", (0.63, 0.69), (1, 1)), Band("nir", (0.76, 0.9), (1, 1)))


def cells(count, top, seed=3):
    """Random reflectance, altitude, sza, saa, vza, vaa of cells."""
    random = np.random.default_rng(seed)
    angles = (random.uniform(0, high, count) for high in (top, 360, top, 360))
    return random.uniform(0, 0.5, (count, len(BANDS))), random.uniform(0, 2, count), *angles


def one_by_one(atmosphere, reflectance, altitude, sza, saa, vza, vaa):
    """Apparent reflectance of each cell without a lookup table."""
    places = zip(reflectance, altitude, sza, vza, relative_azimuth(saa, vaa), strict=True)
    found = [
        apparent_reflectance(
            rho, **band_terms(dataclasses.replace(atmosphere, altitude=z), BANDS, sun, view, azimuth).uniform
        )
        for rho, z, sun, view, azimuth in places
    ]
    return np.array(found).T


@pytest.mark.parametrize("toward", ["anywhere", "backscatter"])
def test_interpolated_terms_agree_with_exact_terms_per_cell(toward):
    """
    Cubic steps of 2.5 and 5 degrees, 0.5 km in altitude, and single scattering per cell: 3e-5 up to 70 degrees.

    Near backscatter the phase function curves within one step. Linear interpolation in altitude adds another 3e-5.
    """
    atmosphere = Atmosphere(visibility=23)
    rho, altitude, sza, saa, vza, vaa = cells(40, 70)
    if toward == "backscatter":
        vza, vaa = np.clip(sza + (vza - 35) / 20, 0, 70), saa + (vaa - 180) / 90
    scene = rho, altitude, sza, saa, vza, vaa
    table = varying_reflectance(*scene, atmosphere=atmosphere, bands=BANDS)
    np.testing.assert_allclose(table, one_by_one(atmosphere, *scene), rtol=0, atol=6e-5)


def test_molecules_above_the_aerosol_dim_what_it_scatters_once():
    """At nodes of the table, terms of successive orders are those of one cell."""
    atmosphere = Atmosphere(visibility=10, engine="successive-orders")
    rho, places = np.full((2, len(BANDS)), 0.1), (0.5, 40.0, 0.0, [20.0, 25.0], 60.0)
    table = varying_reflectance(rho, *map(np.array, places), atmosphere=atmosphere, bands=BANDS)
    np.testing.assert_allclose(table, one_by_one(atmosphere, rho, *np.broadcast_arrays(*places)), rtol=1e-11)


def test_user_columns_decrease_with_elevation_like_the_profile():
    """A column is given above the altitude of the atmosphere; higher ground has a smaller column."""
    rho = np.full((1, len(BANDS)), 0.3)
    places = [np.array(value) for value in (30.0, 0.0, 0.0, 0.0)]
    own = Atmosphere(altitude=0.0, h2o=Atmosphere(altitude=0.0).water_vapour, o3=Atmosphere(altitude=0.0).ozone)
    for high in (0.0, 1.5, 3.0):
        found, profile = (
            varying_reflectance(rho, np.array([high]), *places, atmosphere=air, bands=BANDS)
            for air in (own, Atmosphere(altitude=0.0))
        )
        np.testing.assert_allclose(found, profile, rtol=1e-12)


def test_single_geometry_is_exact():
    atmosphere, rho = Atmosphere(), cells(5, 70)[0]
    places = [np.array(value) for value in (0.4, 33.3, 120.0, 12.1, 200.0)]
    table = varying_reflectance(rho, *places, atmosphere=atmosphere, bands=BANDS)
    exact = apparent_reflectance(rho, **band_terms(atmosphere, BANDS, 33.3, 12.1, 80.0).uniform)
    np.testing.assert_allclose(table, exact.T, rtol=1e-13)


def test_subset_of_cells_gives_bitwise_equal_results():
    """The nodes do not depend on the angles of the scene."""
    scene = cells(700, 60)
    whole = varying_reflectance(*scene, atmosphere=Atmosphere(), bands=BANDS)
    for part in (slice(0, 7), slice(7, 8), slice(250, 700)):
        cut = varying_reflectance(*(values[part] for values in scene), atmosphere=Atmosphere(), bands=BANDS)
        np.testing.assert_array_equal(cut, whole[:, part])


def test_missing_angle_gives_missing_reflectance():
    rho, altitude, sza, saa, vza, vaa = cells(3, 60)
    sza[1] = np.nan
    rho[2, 0] = np.nan
    toa = varying_reflectance(rho, altitude, sza, saa, vza, vaa, atmosphere=Atmosphere(), bands=BANDS)
    np.testing.assert_array_equal(np.isnan(toa), [[False, True, True], [False, True, False], [False, True, False]])


@pytest.mark.parametrize(
    "index, value, message",
    [
        (2, 80.0, "sza must be from 0 to 75"),
        (1, -0.1, "altitude must"),
        # Above a reflectance of 1/S the formula gives finite but meaningless values.
        (0, 30.0, r"below 1 in every cell, got a reflectance of .*not a percentage"),
    ],
)
def test_cell_out_of_range_raises(index, value, message):
    scene = cells(4, 60)
    scene[index][2] = value
    with pytest.raises(ValueError, match=message):
        varying_reflectance(*scene, atmosphere=Atmosphere(), bands=BANDS)


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
