"""Line spread functions: of one unit in all, and with the modulation that their Fourier transform gives."""

import numpy as np
import pytest
from scipy.integrate import quad

from fifesim.base.line_spread import Boxcar


def test_uniform_response_grows_evenly_from_edge_to_edge():
    spread = Boxcar(30.0)
    assert spread.half_width == 15.0
    np.testing.assert_allclose(spread.cumulative([-99.0, -15.0, -7.5, 0.0, 15.0, 99.0]), [0, 0, 0.25, 0.5, 1, 1])


@pytest.mark.parametrize("frequency", [0.0, 0.01, 0.05, 0.2])
def test_uniform_transfer_is_the_transform_of_its_response(frequency):
    transform, _ = quad(lambda x: np.cos(2 * np.pi * frequency * x) / 30.0, -15.0, 15.0)
    np.testing.assert_allclose(Boxcar(30.0).mtf(frequency), transform, atol=1e-12)


@pytest.mark.parametrize("width", [0.0, -30.0, np.inf, np.nan])
def test_width_is_positive(width):
    with pytest.raises(ValueError, match=f"must be positive metres, got {width}"):
        Boxcar(width)
