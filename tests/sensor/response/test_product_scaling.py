"""Digital numbers scaled by reflectance."""

import numpy as np
import pytest

from fifesim.sensor.response.calibration import product_gain_offset


def test_both_scales_of_a_landsat_8_scene_agree():
    """RADIANCE_MULT and RADIANCE_ADD of LC08_L1TP_047027_20201204_20210313_02_T1, bands 4 and 5, to the digits given.

    The solar irradiances follow from its largest and smallest radiances and reflectances.
    """
    spans = np.array([622.76880 + 51.42845, 381.10345 + 31.47165])
    sun = np.pi * 0.9854607**2 * spans / (1.210700 + 0.099980)
    gain, offset = product_gain_offset(2e-5, -0.1, sun, 1.0, 0.9854607)
    assert (np.abs(gain - [1.0288e-2, 6.2956e-3]) <= [5e-7, 5e-8]).all()
    # Half of the sixth digit of the reflectances, over their span.
    np.testing.assert_allclose(offset, [-51.43874, -31.47794], rtol=1e-6)


def test_the_sun_counts_where_it_is_divided_out():
    high, low = (product_gain_offset(1e-4, -0.1, 1512.06, mu_s) for mu_s in (1.0, 0.25))
    np.testing.assert_allclose(low, np.array(high) / 4, rtol=1e-15)


def test_a_sun_at_the_horizon_has_no_scale():
    with pytest.raises(ValueError, match="mu_s must be positive"):
        product_gain_offset(1e-4, -0.1, 1512.06, 0.0)
