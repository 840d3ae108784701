"""Public names of ``fifesim.ground``, as in ``fifesim/__init__.pyi``."""

# Ground
from ..base.surface_kernels import RPV as RPV
from ..base.surface_kernels import RossLi as RossLi
from ..chain.spectra import canopy_spectra as canopy_spectra
from .landscape.autoregression import arp_for_length as arp_for_length
from .landscape.autoregression import correlation_length as correlation_length
from .landscape.classes import Field as Field
from .landscape.classes import fife_classes as fife_classes
from .landscape.cover import Patches as Patches
from .landscape.distribution import lai_distribution as lai_distribution
from .landscape.distribution import treatments as treatments
from .landscape.downscaling_labels import downscale as downscale  # method
from .landscape.lai_labels import phenology as phenology
from .landscape.learned_labels import Landscape as Landscape
from .landscape.learned_labels import compare_landscapes as compare_landscapes  # method
