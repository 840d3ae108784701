"""The atmosphere on labelled rasters."""

import numpy as np
import pytest
from lazy import check_raster_function

import fifesim
from fifesim.atmosphere import coupling, engines
from fifesim.atmosphere.labels import surface_from_toa, toa_from_surface
from fifesim.base.geometry import Geometry
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


def upward(array):
    return toa_from_surface(array, AIR, BANDS, SUN)


def downward(array):
    return surface_from_toa(array, AIR, BANDS, SUN)


def test_to_toa_keeps_its_word_and_equals_the_kernel(ground):
    result = check_raster_function(upward, ground, quantity="toa_reflectance")
    np.testing.assert_array_equal(result, coupling.apparent_reflectance(ground.values, *FACTORS))
    np.testing.assert_array_equal(np.isnan(result), np.isnan(ground))
    assert result["band"].values.tolist() == ["TM3", "TM4"]
    assert "wavelength" in result.coords
    assert directions.geometry_of(result) == SUN
    assert fifesim.Atmosphere.parse(result.attrs["atmosphere"]) == AIR


def test_to_surface_keeps_its_word_and_equals_the_kernel(ground):
    toa = upward(ground)
    result = check_raster_function(downward, toa, quantity="surface_reflectance")
    np.testing.assert_array_equal(result, coupling.corrected_reflectance(toa.values, *FACTORS))


def test_there_and_back_is_the_same(ground):
    """Algebra in double precision: a few roundings of numbers below 1."""
    np.testing.assert_allclose(downward(upward(ground)), ground, rtol=0, atol=1e-12)
    np.testing.assert_allclose(upward(downward(upward(ground))), upward(ground), rtol=0, atol=1e-12)


def test_wrong_units_raise(ground):
    ground.attrs["units"] = "percent"
    for function in (upward, downward):
        with pytest.raises(ValueError, match="has units 'percent'"):
            function(ground)


def test_radiance_is_no_surface_reflectance(ground):
    ground.attrs["units"] = "W m-2 sr-1 um-1"
    with pytest.raises(ValueError, match="surface_reflectance needs '1'"):
        upward(ground)
