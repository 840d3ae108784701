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
    "Atmosphere": "atmosphere.models",
    "Background": "ground.spectra",
    "Band": "bands",
    "Geometry": "geometry",
    "Instrument": "sensor.instruments",
    "Leaf": "ground.prospect",
    "NoiseModel": "sensor.noise",
    "Regression": "analysis.regression",
    "Scenario": "scenario",
    "Track": "sensor.scan",
    "aggregate": "analysis.raster",
    "arp_for_length": "ground.random_field",
    "aspect": "ground.terrain_raster",
    "autocovariance": "analysis.variogram_raster",
    "budget": "experiments.scatter",
    "compare": "comparison",
    "correlation_length": "ground.random_field",
    "density": "analysis.scaling_raster",
    "fife_geometry": "geometry",
    "fife_site": "sites",
    "fine_dem": "ground.dem_raster",
    "flint_hills": "ground.flint_hills_raster",
    "fpar": "ground.raster",
    "fpar_bias": "analysis.scaling_raster",
    "grid_at": "grid",
    "horizon": "ground.sky_raster",
    "illumination": "ground.terrain_raster",
    "instrument": "sensor.instruments",
    "instrument_names": "sensor.instruments",
    "inversion_error": "analysis.inversion_raster",
    "invert": "analysis.inversion_raster",
    "kt": "chain",
    "lai_distribution": "ground.distribution",
    "lai_scene": "ground.raster",
    "mtf": "sensor.response_raster",
    "ndvi": "chain",
    "ndvi_bias": "analysis.scaling_raster",
    "ndvi_linearity": "analysis.scaling_raster",
    "noise_equivalent_radiance": "sensor.signal_to_noise",
    "open_image": "export",
    "open_lai": "ground.raster",
    "psf": "sensor.response_raster",
    "read_instrument": "sensor.instruments",
    "read_scenario": "scenario_file",
    "regress": "analysis.raster",
    "regularized_variance": "analysis.variogram_raster",
    "relative_equivalent_noise": "analysis.uncertainty_raster",
    "scale_bias": "analysis.scaling_raster",
    "scan_geometry": "sensor.scan_raster",
    "sense": "sensor.raster",
    "sense_swath": "sensor.swath_raster",
    "shadow": "ground.terrain_raster",
    "share_kept": "analysis.scaling_raster",
    "simulate": "simulation",
    "source_dem": "ground.dem_raster",
    "snr": "sensor.signal_to_noise",
    "sky_view": "ground.terrain_raster",
    "slope": "ground.terrain_raster",
    "sun_position": "geometry",
    "surface_reflectance": "chain",
    "sweep": "sweeps",
    "terrain_view": "ground.terrain_raster",
    "to_geotiff": "export",
    "to_radiance": "sensor.raster",
    "to_reflectance": "sensor.raster",
    "to_surface": "chain",
    "to_toa": "chain",
    "treatments": "ground.distribution",
    "variogram": "analysis.variogram_raster",
    "verify": "verification.areas",
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
