"""Public names of ``fifesim.sensor``, as in ``fifesim/__init__.pyi``."""

# Sensor
from ..base.bands import Band as Band
from ..chain.adjustment import adjust_bands as adjust_bands  # method, of a Dataset too
from ..chain.adjustment import as_seen_by as as_seen_by  # method, of a Dataset too
from ..chain.adjustment import spectral_adjustment as spectral_adjustment
from ..chain.comparison import comparison_table as comparison_table  # method of a DataTree
from ..chain.noise_propagation import noise_std as noise_std  # method
from ..grids.swaths import grid_swath as grid_swath  # method
from .band_labels import to_bands as to_bands  # method
from .description.instruments import instrument_names as instrument_names
from .description.instruments import read_instrument as read_instrument
from .description.instruments import read_responses as read_responses
from .instrument_labels import mtf as mtf
from .instrument_labels import noise_equivalent_radiance as noise_equivalent_radiance
from .instrument_labels import psf as psf
from .instrument_labels import snr as snr
from .labels import to_radiance as to_radiance  # method
from .overpass_labels import overpasses as overpasses
from .overpass_labels import to_gac as to_gac  # method
from .response.scan import Track as Track
from .scan_labels import scan_geometry as scan_geometry
