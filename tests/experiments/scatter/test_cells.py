"""One stand as arrays, beside the labelled steps."""

from dataclasses import replace

import numpy as np
import pytest

import fifesim
from fifesim.chain import steps as chain
from fifesim.chain.setup import reflectance_of
from fifesim.experiments.scatter.cells import STEP, Stand, arrays_of, tangent
from fifesim.rasters import grid as grids
from fifesim.sensor.description.instruments import instrument

GRID = fifesim.fife_site(10.0, ((300, 348), (200, 254)))


@pytest.fixture(scope="module")
def setup():
    return fifesim.Setup("TM", geometry=fifesim.fife_geometry(), dem=fifesim.flint_hills(GRID.pad(1), seed=2))


@pytest.fixture(scope="module")
def lai():
    return fifesim.lai_scene(GRID, arp=0.2, seed=3)


@pytest.fixture(scope="module")
def stand(setup, lai):
    bands = instrument("TM").select(["TM3", "TM4"])
    chained, slopes = arrays_of(setup, bands, grids.geobox(lai))
    return Stand(chained, slopes, lai.values, np.full(lai.shape, 1.2), 0.94)


def test_light_of_a_stand_is_that_of_the_labelled_steps(stand, setup, lai):
    bands = replace(setup, bands=("TM3", "TM4"))
    on_slopes, level = reflectance_of(bands, lai), reflectance_of(replace(bands, dem=None), lai)
    np.testing.assert_array_equal(stand.light(True, False, False), level)
    np.testing.assert_array_equal(stand.light(True, True, False), on_slopes)
    np.testing.assert_array_equal(stand.light(True, True, True), chain.to_toa(on_slopes))
    np.testing.assert_array_equal(stand.fpar(True), fifesim.fpar(lai))


def test_along_a_tangent_light_goes_straight(stand, lai):
    """Beer's law at the middle, and its slope."""
    extinction = 0.5 / np.cos(np.radians(fifesim.fife_geometry().sza))
    at, slope = 0.94 * (1 - np.exp(-extinction * 1.2)), 0.94 * extinction * np.exp(-extinction * 1.2)
    # A central difference is as near as its step squared.
    found = stand.fpar(False)
    np.testing.assert_allclose(found, at + slope * (lai.values - 1.2), rtol=0, atol=STEP**2 / 10)
    assert np.ptp(np.diff(found.ravel()) / np.diff(lai.values.ravel())) < 1e-8


def test_a_tangent_of_rasters_is_that_of_their_arrays(lai):
    middle = lai.copy(data=np.full(lai.shape, 1.2))
    of_rasters = tangent(np.exp, lai, middle)
    np.testing.assert_array_equal(of_rasters, tangent(np.exp, lai.values, middle.values))
    assert of_rasters.dims == lai.dims


def test_what_is_no_stand_of_numbers_has_no_arrays(setup, lai):
    bands = instrument("TM").select(["TM3", "TM4"])
    assert arrays_of(replace(setup, adjacency=True), bands, grids.geobox(lai)) == (None, None)
    assert arrays_of(replace(setup, dem=None), bands, grids.geobox(lai))[1] is None
