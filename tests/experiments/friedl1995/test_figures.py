"""What Figures 5, 8 and 9 show."""

import numpy as np

from fifesim.experiments.friedl1995 import folder as reproduction
from fifesim.experiments.friedl1995.case import Case


def test_relation_at_the_ground_is_tight_and_scaling_has_the_papers_sign():
    """Fig. 5: BOA R2 near 1. Fig. 8: NDVI of the mean reflectance is slightly below the mean NDVI. Fig. 9: scatter."""
    from_figures = reproduction.figures.pixels(Case(), "burned-grazed", 1)
    for scene in from_figures:
        values = scene["pixels"]
        assert np.corrcoef(values["boa_ndvi"], values["fpar"])[0, 1] ** 2 > 0.99
        assert np.corrcoef(values["boa_ndvi"], values["lai"])[0, 1] ** 2 > 0.95
        difference = values["ndvi_of_mean"] - values["boa_ndvi"]
        assert -0.01 < difference.mean() < 0
        # The atmosphere alone is a line; the image scatters about it.
        assert np.corrcoef(values["boa_red"], values["clear_red"])[0, 1] ** 2 > 0.9999
        assert np.corrcoef(values["boa_red"], values["toa_red"])[0, 1] ** 2 < 0.9
