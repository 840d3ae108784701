"""Scales of products."""

import numpy as np
import pytest

from fifesim.sensor.response import calibration


def test_reflectance_is_a_line_over_the_cosine_of_the_sun():
    """By hand: (2.1735e-3 * 57 - 0.004609) / 0.35 of Landsat 5's band 3."""
    found = calibration.product_reflectance(np.uint8(57), 2.1735e-3, -0.004609, 255, mu_s=0.35)
    assert float(found) == pytest.approx(0.340801428, abs=1e-7)
    assert found.dtype == np.float32


@pytest.mark.parametrize(
    ("dn", "flags", "kept"),
    [(0, 0, False), (1, 0, True), (254, 0, True), (255, 0, False), (57, 4, False), (57, 8, True)],
)
def test_no_data_and_saturated_are_nan(dn, flags, kept):
    found = calibration.product_reflectance(np.uint8(dn), 1e-3, 0.0, 255, np.uint16(4), np.uint16(flags))
    assert bool(np.isfinite(found)) == kept


def test_a_sun_that_is_down_or_not_known_leaves_nan():
    found = calibration.product_reflectance(np.uint8(57), 1e-3, 0.0, 255, mu_s=np.array([np.nan, 0.0, -0.1]))
    assert np.isnan(found).all()


def test_angles_are_hundredths_from_0_to_360():
    found = calibration.hundredths(np.array([-7500, 10500, 0], np.int16), np.array([False, False, True]), turns=True)
    np.testing.assert_array_equal(found, [285.0, 105.0, np.nan])
    assert calibration.hundredths(np.int16(-10), False) == -0.1


def test_directions_come_back_from_their_vectors():
    zenith, azimuth = np.meshgrid([0.5, 30.0, 75.0], [0.0, 95.0, 200.0, 359.0])
    found = calibration.direction_angles(3.0 * calibration.direction_vectors(zenith, azimuth))
    np.testing.assert_allclose(found, [zenith, azimuth], rtol=0, atol=1e-10)


def test_mean_of_directions_passes_over_what_is_not_known():
    zenith, azimuth = np.array([[10.0, np.nan], [10.0, np.nan]]), np.array([[350.0, 0.0], [30.0, 0.0]])
    vectors = calibration.mean_direction(zenith, azimuth)
    assert np.isnan(vectors[:, 1]).all()
    assert calibration.direction_angles(vectors[:, 0])[1] == pytest.approx(10.0)


def test_gaps_take_the_nearest_node():
    vectors = calibration.direction_vectors(np.array([[5.0, np.nan, np.nan, 9.0]]), np.full((1, 4), 100.0))
    zenith, _ = calibration.direction_angles(calibration.filled(vectors))
    np.testing.assert_allclose(zenith, [[5.0, 5.0, 9.0, 9.0]])
    with pytest.raises(ValueError, match=r"no direction of the view: .*angles='centre'"):
        calibration.filled(np.full((3, 2, 2), np.nan))


def test_between_nodes_is_bilinear():
    """Zenith angles of one azimuth, small enough that a vector's interpolation is the angle's."""
    nodes = calibration.direction_vectors(np.array([[1.0, 2.0, 4.0], [3.0, 4.0, 6.0]]), np.full((2, 3), 40.0))
    zenith, azimuth = calibration.between_nodes(nodes, [0.0, 0.25, 1.0, 5.0], [0.5, 1.0, 2.0])
    expected = [[1.5, 2.0, 4.0], [2.0, 2.5, 4.5], [3.5, 4.0, 6.0], [3.5, 4.0, 6.0]]
    np.testing.assert_allclose(zenith, expected, rtol=0, atol=2e-3)
    np.testing.assert_allclose(azimuth, 40.0)
