"""Public names of ``fifesim.scaling``, as in ``fifesim/__init__.pyi``."""

# Analysis
from .analysis.regression_labels import relative_equivalent_noise as relative_equivalent_noise  # method
from .analysis.scaling_labels import autocovariance as autocovariance  # method
from .analysis.scaling_labels import density as density  # method
from .analysis.scaling_labels import fpar_bias as fpar_bias  # method
from .analysis.scaling_labels import ndvi_bias as ndvi_bias  # method
from .analysis.scaling_labels import ndvi_linearity as ndvi_linearity  # method
from .analysis.scaling_labels import regularized_variance as regularized_variance  # method
from .analysis.scaling_labels import scale_bias as scale_bias
from .analysis.scaling_labels import share_kept as share_kept  # method
from .analysis.scaling_labels import variogram as variogram  # method
from .chain.corrections import brdf_normalise as brdf_normalise  # method, of a Dataset too
from .chain.corrections import topographic_correction as topographic_correction  # method, of a Dataset too
