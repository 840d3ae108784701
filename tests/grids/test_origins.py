"""Rasters know what they are made of until something is done to them."""

import gc
import pickle

import dask.array as da
import numpy as np
import xarray as xr

from fifesim.grids.windows import _ORIGINS, made_of, origin_of


def raster(chunks):
    return xr.DataArray(da.zeros((4, 6), chunks=chunks), dims=("y", "x"))


def test_an_origin_stays_with_the_values():
    made = made_of(raster(2), "leaves")
    assert origin_of(made) == "leaves"
    assert origin_of(made.assign_coords(sza=30.0).rename("other")) == "leaves"
    assert origin_of(made + 1) is None and origin_of(made[1:]) is None and origin_of(made.persist()) is None


def test_rasters_in_memory_have_none():
    assert origin_of(xr.DataArray(np.zeros((4, 6)), dims=("y", "x"))) is None


def test_an_origin_does_not_travel():
    made = made_of(raster(2), lambda: "nothing that pickle takes")
    other = pickle.loads(pickle.dumps(made))
    assert origin_of(other) is None
    np.testing.assert_array_equal(other, made)


def test_an_origin_is_forgotten_with_its_raster():
    made = made_of(raster(2), "leaves")
    key = id(made.data.dask), made.data.name
    assert key in _ORIGINS
    del made
    gc.collect()
    assert key not in _ORIGINS
