"""
Every public name and where it lives, one line each.

The package finds them here when they are first used, the API page lists them, and editors follow them. A name marked as
a method is one of the ``.fifesim`` accessor of a DataArray too, which hands it the raster as first argument.
"""

from . import atmosphere as atmosphere
from . import experiments as experiments
from . import ground as ground
from . import models as models
from . import output as output
from . import retrieval as retrieval
from . import scaling as scaling
from . import scenario as scenario
from . import sensor as sensor
from . import terrain as terrain

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
from .ground.landscape.labels import landscape as landscape
from .chain.landscape_learning import learn_landscape as learn_landscape  # method
from .ground.landscape.classes import CoverClass as CoverClass
from .ground.canopy.description import Canopy as Canopy
from .ground.canopy.prospect import Leaf as Leaf
from .ground.canopy.spectra import Background as Background
from .chain.steps import surface_reflectance as surface_reflectance  # method, of a Dataset too
from .chain.absorbed_light import fpar as fpar  # method, of a Dataset too
from .chain.absorbed_light import light as light  # method, of a Dataset too

# Terrain
from .ground.terrain.elevation_labels import fine_dem as fine_dem
from .ground.terrain.elevation_labels import flint_hills as flint_hills
from .ground.terrain.sky_labels import horizon as horizon  # method
from .chain.steps import kt as kt  # method

# Atmosphere
from .atmosphere.models import Atmosphere as Atmosphere
from .chain.steps import to_toa as to_toa  # method, of a Dataset too
from .chain.steps import to_surface as to_surface  # method, of a Dataset too
from .atmosphere.clouds.labels import cloud_field as cloud_field

# Sensor
from .sensor.labels import sense as sense  # method, of a Dataset too
from .sensor.scan_labels import sense_swath as sense_swath  # method
from .chain.comparison import compare as compare  # method, of a Dataset too
from .sensor.response.noise import NoiseModel as NoiseModel
from .sensor.labels import to_reflectance as to_reflectance  # method
from .sensor.description.instruments import instrument as instrument
from .sensor.description.instrument_file import Instrument as Instrument

# Analysis
from .chain.landscapes import aggregate as aggregate  # method, of a Dataset too
from .chain.steps import ndvi as ndvi  # method, of a Dataset too
from .analysis.index_labels import composite as composite  # method
from .analysis.regression_labels import regress as regress  # method
from .analysis.regression import Regression as Regression
from .analysis.score_labels import score as score  # method, of a Dataset too
from .output.examination import exam as exam
from .chain.steps import index as index  # method

# Retrieval
from .retrieval.training import train as train
from .retrieval.labels import retrieve as retrieve  # method
from .retrieval.description import Retrieval as Retrieval

# Models of the land surface
from .models.labels import gpp as gpp  # method, of a Dataset too
from .models.labels import evapotranspiration as evapotranspiration  # method, of a Dataset too

# Pictures
from .output.pictures import plot as plot  # method
from .output.maps import rgb as rgb  # method

# Images of one's own
from .sensor.products.landsat_labels import open_landsat as open_landsat
from .sensor.products.sentinel2_labels import open_sentinel2 as open_sentinel2
from .sensor.products.labels import calibrate as calibrate  # method

# Files and runs
from .grids.files import to_geotiff as to_geotiff  # method, of a Dataset too
from .grids.files import open_image as open_image
from .scenario.simulation import simulate as simulate
from .output.chips.folder import dataset as dataset
from .experiments.scatter.shares import budget as budget
from .experiments.designs import trade as trade
from .scenario.scenario import Scenario as Scenario
from .scenario.studies import Study as Study
from .experiments.friedl1995.reproduction import reproduce as reproduce
from .chain.setup import Setup as Setup
from .base.caches import clear_caches as clear_caches
