"""Public names of ``fifesim.output``, as in ``fifesim/__init__.pyi``."""

# Pictures
# Files and runs
from .envi import to_envi as to_envi  # method
from .landsat_product import to_landsat_l1 as to_landsat_l1  # method, of a DataTree too
from .maps import write_style as write_style
from .pictures import plot_comparison as plot_comparison  # method of a DataTree
from .pictures import plot_fit as plot_fit
from .pictures import plot_score as plot_score
from .pictures import plot_trade as plot_trade
from .sentinel2_product import to_sentinel2_l1c as to_sentinel2_l1c  # method, of a DataTree too
