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

    surface_reflectance = _Method("chain.steps")
    fpar = _Method("ground.canopy.raster")
    slope = _Method("ground.terrain.rasters.slopes")
    aspect = _Method("ground.terrain.rasters.slopes")
    horizon = _Method("ground.terrain.rasters.sky")
    sky_view = _Method("ground.terrain.rasters.light")
    terrain_view = _Method("ground.terrain.rasters.light")
    illumination = _Method("ground.terrain.rasters.light")
    shadow = _Method("ground.terrain.rasters.light")
    kt = _Method("chain.steps")
    to_toa = _Method("chain.steps")
    to_surface = _Method("chain.steps")
    sense = _Method("sensor.raster")
    sense_swath = _Method("sensor.scan.rasters.swath")
    compare = _Method("chain.comparison")
    to_radiance = _Method("sensor.raster")
    to_reflectance = _Method("sensor.raster")
    ndvi = _Method("chain.steps")
    aggregate = _Method("analysis.rasters.regression")
    regress = _Method("analysis.rasters.regression")
    relative_equivalent_noise = _Method("analysis.rasters.uncertainty")
    invert = _Method("analysis.rasters.inversion")
    inversion_error = _Method("analysis.rasters.inversion")
    ndvi_bias = _Method("analysis.rasters.scaling")
    ndvi_linearity = _Method("analysis.rasters.scaling")
    fpar_bias = _Method("analysis.rasters.scaling")
    share_kept = _Method("analysis.rasters.scaling")
    density = _Method("analysis.rasters.scaling")
    autocovariance = _Method("analysis.rasters.lags")
    variogram = _Method("analysis.rasters.lags")
    regularized_variance = _Method("analysis.rasters.lags")
    to_geotiff = _Method("rasters.files")


@xr.register_dataset_accessor("fifesim")
class DatasetAccessor:
    """fifesim on a Dataset."""

    def __init__(self, raster):
        self._raster = raster

    inversion_error = _Method("analysis.rasters.inversion")
    to_geotiff = _Method("rasters.files")
