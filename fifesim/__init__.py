"""
Simulate what a satellite would have seen.

Ground scene, canopy reflectance, atmosphere and sensor on georeferenced rasters, after Friedl, Davis, Michaelsen and
Moritz (1995). Importing this package registers the ``.fifesim`` accessor of xarray.
"""

from importlib import import_module
from importlib.metadata import version

from fifesim import accessor  # noqa: F401  registers .fifesim

__version__ = version("fifesim")

# Where each public name lives. They are imported when first used, so that the command line answers at once.
_PUBLIC = {
    "Atmosphere": "atmosphere.air.models",
    "Background": "ground.canopy.spectra",
    "Band": "base.bands",
    "Geometry": "base.geometry",
    "Instrument": "sensor.description.instruments",
    "Leaf": "ground.canopy.prospect",
    "NoiseModel": "sensor.response.noise",
    "Regression": "analysis.regression",
    "Scenario": "scenario.scenario",
    "Track": "sensor.scan.track",
    "aggregate": "analysis.rasters.regression",
    "arp_for_length": "ground.landscape.autoregression",
    "aspect": "ground.terrain.rasters.slopes",
    "autocovariance": "analysis.rasters.lags",
    "budget": "experiments.scatter.shares",
    "compare": "chain.comparison",
    "correlation_length": "ground.landscape.autoregression",
    "density": "analysis.rasters.scaling",
    "fife_geometry": "base.geometry",
    "fife_site": "rasters.sites",
    "fine_dem": "ground.terrain.rasters.elevation",
    "flint_hills": "ground.terrain.rasters.hills",
    "fpar": "ground.canopy.raster",
    "fpar_bias": "analysis.rasters.scaling",
    "grid_at": "rasters.grid",
    "horizon": "ground.terrain.rasters.sky",
    "illumination": "ground.terrain.rasters.light",
    "instrument": "sensor.description.instruments",
    "instrument_names": "sensor.description.instruments",
    "inversion_error": "analysis.rasters.inversion",
    "invert": "analysis.rasters.inversion",
    "kt": "chain.steps",
    "lai_distribution": "ground.landscape.distribution",
    "lai_scene": "ground.landscape.raster",
    "mtf": "sensor.response.rasters.spread",
    "ndvi": "chain.steps",
    "ndvi_bias": "analysis.rasters.scaling",
    "ndvi_linearity": "analysis.rasters.scaling",
    "noise_equivalent_radiance": "sensor.response.signal_to_noise",
    "open_image": "rasters.files",
    "open_lai": "ground.landscape.raster",
    "psf": "sensor.response.rasters.spread",
    "read_instrument": "sensor.description.instruments",
    "read_scenario": "scenario.toml",
    "regress": "analysis.rasters.regression",
    "regularized_variance": "analysis.rasters.lags",
    "relative_equivalent_noise": "analysis.rasters.uncertainty",
    "scale_bias": "analysis.rasters.scaling",
    "scan_geometry": "sensor.scan.rasters.view",
    "sense": "sensor.raster",
    "sense_swath": "sensor.scan.rasters.swath",
    "shadow": "ground.terrain.rasters.light",
    "share_kept": "analysis.rasters.scaling",
    "simulate": "scenario.simulation",
    "source_dem": "ground.terrain.rasters.elevation",
    "snr": "sensor.response.signal_to_noise",
    "sky_view": "ground.terrain.rasters.light",
    "slope": "ground.terrain.rasters.slopes",
    "sun_position": "base.geometry",
    "surface_reflectance": "chain.steps",
    "sweep": "scenario.sweeps",
    "terrain_view": "ground.terrain.rasters.light",
    "to_geotiff": "rasters.files",
    "to_radiance": "sensor.raster",
    "to_reflectance": "sensor.raster",
    "to_surface": "chain.steps",
    "to_toa": "chain.steps",
    "treatments": "ground.landscape.distribution",
    "variogram": "analysis.rasters.lags",
    "verify": "experiments.verification.areas",
}

__all__ = ["__version__", *_PUBLIC]


def __getattr__(name):
    if name == "atmosphere":
        return import_module("fifesim.atmosphere")
    if name not in _PUBLIC:
        raise AttributeError(f"module 'fifesim' has no attribute {name!r}")
    found = getattr(import_module(f"fifesim.{_PUBLIC[name]}"), name)
    globals()[name] = found
    return found


def __dir__():
    return __all__
