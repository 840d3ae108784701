"""The accessor forwards, and does nothing else."""

import inspect
import pickle

import numpy as np
import pytest
import xarray as xr

import fifesim
from fifesim import accessor

METHODS = {
    "aggregate": fifesim.aggregate,
    "aspect": fifesim.aspect,
    "autocovariance": fifesim.autocovariance,
    "density": fifesim.density,
    "compare": fifesim.compare,
    "fpar": fifesim.fpar,
    "fpar_bias": fifesim.fpar_bias,
    "horizon": fifesim.horizon,
    "illumination": fifesim.illumination,
    "inversion_error": fifesim.inversion_error,
    "invert": fifesim.invert,
    "kt": fifesim.kt,
    "ndvi": fifesim.ndvi,
    "ndvi_bias": fifesim.ndvi_bias,
    "ndvi_linearity": fifesim.ndvi_linearity,
    "regress": fifesim.regress,
    "regularized_variance": fifesim.regularized_variance,
    "relative_equivalent_noise": fifesim.relative_equivalent_noise,
    "sense": fifesim.sense,
    "sense_swath": fifesim.sense_swath,
    "shadow": fifesim.shadow,
    "share_kept": fifesim.share_kept,
    "sky_view": fifesim.sky_view,
    "slope": fifesim.slope,
    "surface_reflectance": fifesim.surface_reflectance,
    "terrain_view": fifesim.terrain_view,
    "to_geotiff": fifesim.to_geotiff,
    "to_radiance": fifesim.to_radiance,
    "to_reflectance": fifesim.to_reflectance,
    "to_surface": fifesim.to_surface,
    "to_toa": fifesim.to_toa,
    "variogram": fifesim.variogram,
}


@pytest.mark.parametrize("name", METHODS)
def test_method_is_the_function(lai, name):
    method = getattr(lai.fifesim, name)
    assert method.__func__ is METHODS[name]
    assert method.__self__ is lai


def test_every_method_is_listed_here():
    assert {name for name in vars(accessor.DataArrayAccessor) if not name.startswith("_")} == set(METHODS)


def test_method_keeps_documentation_and_signature(lai):
    assert lai.fifesim.sense.__doc__ is fifesim.sense.__doc__
    parameters = list(inspect.signature(fifesim.sense).parameters)
    assert list(inspect.signature(lai.fifesim.sense).parameters) == parameters[1:]


def test_function_is_found_on_the_class():
    assert accessor.DataArrayAccessor.fpar is fifesim.fpar


def test_dataset_is_written_by_the_same_function(lai):
    assert lai.to_dataset(name="lai").fifesim.to_geotiff.__func__ is fifesim.to_geotiff


def test_any_array_has_the_accessor_and_copies_keep_it():
    plain = xr.DataArray(np.zeros(3))
    assert plain.fifesim.fpar.__self__ is plain
    assert pickle.loads(pickle.dumps(plain)).fifesim.fpar.__func__ is fifesim.fpar
    copy = plain.copy()
    assert copy.fifesim.fpar.__self__ is copy


def test_arguments_are_passed_on(lai):
    xr.testing.assert_identical(lai.fifesim.aggregate(30.0, min_valid=0.5), fifesim.aggregate(lai, 30.0, min_valid=0.5))
