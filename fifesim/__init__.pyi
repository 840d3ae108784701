"""
Every public name and where it lives, one line each.

The package finds them here when they are first used, the API page lists them, and editors follow them. A name marked as
a method is one of the ``.fifesim`` accessor of a DataArray too, which hands it the raster as first argument.
"""

from . import atmosphere as atmosphere

__version__: str

# Grids and geometry
from .grids.sites import fife_site as fife_site
from .grids.grid import grid_at as grid_at
from .base.geometry import Geometry as Geometry
from .base.geometry import fife_geometry as fife_geometry
from .grids.sites import sun_position as sun_position

# Ground
from .ground.landscape.lai_labels import lai_scene as lai_scene
from .ground.landscape.lai_labels import open_lai as open_lai
from .ground.landscape.lai_labels import phenology as phenology
from .ground.landscape.field_labels import correlated_fields as correlated_fields
from .ground.landscape.downscaling_labels import downscale as downscale  # method
from .ground.landscape.distribution import lai_distribution as lai_distribution
from .ground.landscape.distribution import treatments as treatments
from .ground.landscape.autoregression import correlation_length as correlation_length
from .ground.landscape.autoregression import arp_for_length as arp_for_length
from .ground.landscape.labels import landscape as landscape
from .ground.landscape.learned_labels import Landscape as Landscape
from .chain.landscape_learning import learn_landscape as learn_landscape
from .ground.landscape.learned_labels import compare_landscapes as compare_landscapes
from .ground.landscape.cover import Patches as Patches
from .ground.landscape.classes import CoverClass as CoverClass
from .ground.landscape.classes import fife_classes as fife_classes
from .ground.landscape.classes import Field as Field
from .ground.canopy.description import Canopy as Canopy
from .ground.canopy.prospect import Leaf as Leaf
from .ground.canopy.spectra import Background as Background
from .base.surface_kernels import RossLi as RossLi
from .base.surface_kernels import RPV as RPV
from .chain.steps import surface_reflectance as surface_reflectance  # method, of a Dataset too
from .chain.spectra import canopy_spectra as canopy_spectra
from .chain.absorbed_light import fpar as fpar  # method, of a Dataset too
from .chain.absorbed_light import light as light  # method, of a Dataset too

# Terrain
from .ground.terrain.elevation_labels import fine_dem as fine_dem
from .ground.terrain.elevation_labels import source_dem as source_dem
from .ground.terrain.elevation_labels import flint_hills as flint_hills
from .ground.terrain.labels import slope as slope  # method
from .ground.terrain.labels import aspect as aspect  # method
from .ground.terrain.labels import wetness as wetness  # method
from .ground.terrain.sky_labels import horizon as horizon  # method
from .ground.terrain.labels import sky_view as sky_view  # method
from .ground.terrain.labels import terrain_view as terrain_view  # method
from .ground.terrain.labels import illumination as illumination  # method
from .ground.terrain.labels import shadow as shadow  # method
from .chain.steps import kt as kt  # method

# Atmosphere
from .atmosphere.models import Atmosphere as Atmosphere
from .atmosphere.aerosol_labels import read_aerosol as read_aerosol
from .atmosphere.aerosol_labels import aerosol_tables as aerosol_tables
from .chain.steps import to_toa as to_toa  # method, of a Dataset too
from .chain.steps import to_surface as to_surface  # method, of a Dataset too
from .atmosphere.clouds.labels import cloud_field as cloud_field
from .atmosphere.clouds.labels import cast_clouds as cast_clouds  # method
from .chain.comparison import compare_engines as compare_engines

# Sensor
from .sensor.labels import sense as sense  # method, of a Dataset too
from .sensor.band_labels import to_bands as to_bands  # method
from .sensor.scan_labels import scan_geometry as scan_geometry
from .sensor.response.scan import Track as Track
from .sensor.overpass_labels import overpasses as overpasses
from .sensor.overpass_labels import to_gac as to_gac  # method
from .sensor.scan_labels import sense_swath as sense_swath  # method
from .grids.swaths import grid_swath as grid_swath  # method
from .chain.comparison import compare as compare  # method, of a Dataset too
from .chain.adjustment import as_seen_by as as_seen_by  # method, of a Dataset too
from .chain.adjustment import adjust_bands as adjust_bands  # method, of a Dataset too
from .chain.adjustment import spectral_adjustment as spectral_adjustment
from .chain.comparison import comparison_table as comparison_table  # method of a DataTree
from .sensor.instrument_labels import psf as psf
from .sensor.instrument_labels import mtf as mtf
from .sensor.response.noise import NoiseModel as NoiseModel
from .sensor.instrument_labels import noise_equivalent_radiance as noise_equivalent_radiance
from .sensor.instrument_labels import snr as snr
from .chain.noise_propagation import noise_std as noise_std  # method
from .sensor.labels import to_radiance as to_radiance  # method
from .sensor.labels import to_reflectance as to_reflectance  # method
from .sensor.description.instruments import instrument as instrument
from .sensor.description.instruments import instrument_names as instrument_names
from .sensor.description.instruments import read_instrument as read_instrument
from .sensor.description.instrument_file import Instrument as Instrument
from .base.bands import Band as Band

# Analysis
from .chain.landscapes import aggregate as aggregate  # method, of a Dataset too
from .chain.steps import ndvi as ndvi  # method, of a Dataset too
from .analysis.index_labels import composite as composite  # method
from .analysis.regression_labels import regress as regress  # method
from .analysis.regression import Regression as Regression
from .analysis.regression_labels import relative_equivalent_noise as relative_equivalent_noise  # method
from .analysis.score_labels import score as score  # method, of a Dataset too
from .analysis.scaling_labels import share_kept as share_kept  # method
from .analysis.scaling_labels import density as density  # method
from .analysis.scaling_labels import scale_bias as scale_bias
from .analysis.scaling_labels import ndvi_linearity as ndvi_linearity  # method
from .analysis.scaling_labels import ndvi_bias as ndvi_bias  # method
from .analysis.scaling_labels import fpar_bias as fpar_bias  # method
from .analysis.scaling_labels import autocovariance as autocovariance  # method
from .analysis.scaling_labels import variogram as variogram  # method
from .analysis.scaling_labels import regularized_variance as regularized_variance  # method
from .chain.steps import index as index  # method
from .chain.corrections import topographic_correction as topographic_correction  # method, of a Dataset too
from .chain.corrections import brdf_normalise as brdf_normalise  # method, of a Dataset too

# Retrieval
from .retrieval.training import train as train
from .retrieval.labels import retrieve as retrieve  # method
from .retrieval.description import Retrieval as Retrieval
from .retrieval.description import read_retrieval as read_retrieval

# Models of the land surface
from .models.labels import gpp as gpp  # method, of a Dataset too
from .models.labels import evapotranspiration as evapotranspiration  # method, of a Dataset too
from .models.labels import albedo as albedo  # method, of a Dataset too
from .models.weather import Weather as Weather
from .models.weather import fife_weather as fife_weather

# Pictures
from .output.pictures import plot as plot  # method
from .output.maps import rgb as rgb  # method
from .output.pictures import plot_fit as plot_fit
from .output.pictures import plot_score as plot_score
from .output.pictures import plot_comparison as plot_comparison  # method of a DataTree

# Images of one's own
from .sensor.products.landsat_labels import open_landsat as open_landsat
from .sensor.products.sentinel2_labels import open_sentinel2 as open_sentinel2
from .sensor.products.labels import calibrate as calibrate  # method

# Files and runs
from .grids.files import to_geotiff as to_geotiff  # method, of a Dataset too
from .grids.files import open_image as open_image
from .output.maps import write_style as write_style
from .scenario.simulation import simulate as simulate
from .scenario.sweeps import sweep as sweep
from .output.chips.folder import dataset as dataset
from .experiments.scatter.shares import budget as budget
from .experiments.scatter.study_indices import sensitivity as sensitivity
from .experiments.explorer import explore as explore
from .scenario.scenario import Scenario as Scenario
from .scenario.scenario import default_scenario as default_scenario
from .scenario.scenario import read_scenario as read_scenario
from .scenario.studies import Study as Study
from .scenario.studies import read_study as read_study
from .scenario.chips import chips_of as chips_of
from .experiments.friedl1995.reproduction import reproduce as reproduce
from .experiments.verification import verify as verify
from .chain.setup import Setup as Setup
from .base.caches import clear_caches as clear_caches
