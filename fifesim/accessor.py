"""The ``.fifesim`` accessor: every method is the function of the same name with the raster as its first argument."""

from importlib import import_module
from types import MethodType

import xarray as xr


class _Method:
    """
    Forward to a function, found when it is first asked for: importing fifesim stays quick.

    A bound method keeps the function's name, signature and documentation.
    """

    def __init__(self, module):
        self._module = f"fifesim.{module}"

    def __set_name__(self, owner, name):
        self._name = name

    def __get__(self, accessor, owner=None):
        function = getattr(import_module(self._module), self._name)
        return function if accessor is None else MethodType(function, accessor._raster)


@xr.register_dataarray_accessor("fifesim")
class DataArrayAccessor:
    """fifesim on a DataArray."""

    def __init__(self, raster):
        self._raster = raster

    surface_reflectance = _Method("chain")
    fpar = _Method("ground.raster")
    slope = _Method("ground.terrain_raster")
    aspect = _Method("ground.terrain_raster")
    horizon = _Method("ground.sky_raster")
    sky_view = _Method("ground.terrain_raster")
    terrain_view = _Method("ground.terrain_raster")
    illumination = _Method("ground.terrain_raster")
    shadow = _Method("ground.terrain_raster")
    kt = _Method("chain")
    to_toa = _Method("chain")
    to_surface = _Method("chain")
    sense = _Method("sensor.raster")
    sense_swath = _Method("sensor.swath_raster")
    compare = _Method("comparison")
    to_radiance = _Method("sensor.raster")
    to_reflectance = _Method("sensor.raster")
    ndvi = _Method("chain")
    aggregate = _Method("analysis.raster")
    regress = _Method("analysis.raster")
    relative_equivalent_noise = _Method("analysis.uncertainty_raster")
    invert = _Method("analysis.inversion_raster")
    inversion_error = _Method("analysis.inversion_raster")
    ndvi_bias = _Method("analysis.scaling_raster")
    ndvi_linearity = _Method("analysis.scaling_raster")
    fpar_bias = _Method("analysis.scaling_raster")
    share_kept = _Method("analysis.scaling_raster")
    density = _Method("analysis.scaling_raster")
    autocovariance = _Method("analysis.variogram_raster")
    variogram = _Method("analysis.variogram_raster")
    regularized_variance = _Method("analysis.variogram_raster")
    to_geotiff = _Method("export")


@xr.register_dataset_accessor("fifesim")
class DatasetAccessor:
    """fifesim on a Dataset."""

    def __init__(self, raster):
        self._raster = raster

    inversion_error = _Method("analysis.inversion_raster")
    to_geotiff = _Method("export")
