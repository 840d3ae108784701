"""Kernels of a setup beside its labelled steps."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

import fifesim
from fifesim.chain.kernels import Kernels, down, labelled_only
from fifesim.chain.setup import reflectance_of
from fifesim.ground.terrain.rasters.lit_slopes import light_on_slopes
from fifesim.rasters import grid as grids

GRID = fifesim.fife_site(10.0, ((300, 348), (200, 254)))


@pytest.fixture(scope="module")
def lai():
    return fifesim.lai_scene(GRID, arp=0.2, seed=3)


@pytest.fixture(scope="module")
def setup():
    geometry = fifesim.Geometry(35.0, 120.0, 20.0, 80.0, earth_sun_distance=1.01)
    return fifesim.Setup(
        "TM", bands=("TM4", "TM3"), geometry=geometry, canopy=fifesim.Canopy(brown=0.1), atmosphere=fifesim.Atmosphere()
    )


def test_kernels_are_the_labelled_steps_to_the_bit(lai, setup):
    kernels, labelled = Kernels(setup), reflectance_of(setup, lai)
    level = kernels.reflectance(lai.values)
    np.testing.assert_array_equal(level, labelled)
    toa = labelled.fifesim.to_toa()
    np.testing.assert_array_equal(kernels.toa(level), toa)
    np.testing.assert_array_equal(kernels.ndvi(kernels.toa(level)), fifesim.ndvi(toa))
    for leaves in ("all", "green"):
        expected = fifesim.fpar(lai, geometry=setup.geometry, canopy=fifesim.Canopy(brown=0.1), leaves=leaves)
        np.testing.assert_array_equal(kernels.fpar(lai.values, 0.94, leaves), expected)


def test_slopes_are_those_of_the_labelled_steps(lai, setup):
    dem = fifesim.flint_hills(GRID.pad(1), seed=2)
    setup = replace(setup, upwelling=False)
    light = light_on_slopes(dem, grids.geobox(lai), setup.geometry)
    found = Kernels(setup).on_slopes(Kernels(setup).reflectance(lai.values), light)
    np.testing.assert_array_equal(found, reflectance_of(replace(setup, dem=dem), lai))


def test_digital_numbers_lead_back_to_their_reflectance(setup):
    kernels = Kernels(setup)
    reflectance = np.linspace(0.05, 0.3, 60).reshape(2, 5, 6)
    dn = kernels.recorded(kernels.radiance(reflectance))
    assert dn.dtype == np.uint8
    step = kernels.planetary(np.full((2, 1, 1), 2, np.uint8)) - kernels.planetary(np.full((2, 1, 1), 1, np.uint8))
    assert (np.abs(kernels.planetary(dn) - reflectance) <= step / 2 * (1 + 1e-9)).all()
    analogue = Kernels(replace(setup, quantise=False))
    np.testing.assert_allclose(analogue.planetary(analogue.recorded(analogue.radiance(reflectance))), reflectance)


def test_what_arrays_do_not_do_with_is_named(lai, setup):
    with pytest.raises(ValueError, match="do not do with relief, adjacency, brown: take"):
        Kernels(replace(setup, dem=lai, adjacency=True, canopy=fifesim.Canopy(brown=lai)))
    assert labelled_only(replace(setup, offset=(np.zeros(3), 0.0))) == ["a drifting offset"]
    angles = xr.Dataset({"sza": 30.0, "saa": 120.0})
    assert labelled_only(replace(setup, geometry=angles)) == ["angles by cell"]


def test_values_of_bands_stand_before_the_axes_of_cells():
    assert down([1.0, 2.0], 3).shape == (2, 1, 1)
