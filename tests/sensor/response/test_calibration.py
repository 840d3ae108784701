"""Digital numbers, radiance, reflectance and noise of images; scales and angles of products."""

import numpy as np
import pytest

from fifesim.sensor.response import calibration
from fifesim.sensor.response.calibration import (
    dn_to_radiance,
    gain_offset,
    product_gain_offset,
    radiance_to_dn,
)
from fifesim.sensor.response.noise import NoiseModel, add_noise, radiance_std

FULL, LOW = np.array([204.3, 206.2])[:, None], np.array([-1.2, -1.5])[:, None]


@pytest.mark.parametrize(("bits", "dtype"), [(2, np.uint8), (8, np.uint8), (9, np.uint16), (16, "u2")])
def test_counts_round_trip_and_radiance_is_within_half_a_count(bits, dtype):
    gain, offset = gain_offset(FULL, LOW, bits)
    counts = np.broadcast_to(np.arange(2**bits), (2, 2**bits)).astype(dtype)
    dn = radiance_to_dn(dn_to_radiance(counts, gain, offset), gain, offset, bits)
    assert dn.dtype == dtype
    np.testing.assert_array_equal(dn, counts)
    radiance = offset + gain * np.linspace(0.5, 2**bits - 0.5, 9973)
    again = dn_to_radiance(radiance_to_dn(radiance, gain, offset, bits), gain, offset)
    assert np.max(np.abs(again - radiance) / gain) <= 0.5 + 1e-9


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("compression", [0, 1])
def test_out_of_range_radiance_is_clipped_and_missing_is_zero(bits, compression):
    gain, offset = gain_offset(204.3, -1.2, bits)
    largest = 2**bits - 1
    radiance = [-np.inf, -1e9, -1.2, 204.3, 204.3 + 2 * gain, 1e9, np.inf, np.nan]
    dn = radiance_to_dn(radiance, gain, offset, bits, compression * largest)
    assert dn.tolist() == [1, 1, 1, largest, largest, largest, largest, 0]
    np.testing.assert_array_equal(np.isnan(dn_to_radiance(dn, gain, offset, compression * largest)), dn == 0)
    # Halves round to even.
    assert radiance_to_dn([2.5, 3.5, 4.5], 1.0, 0.0, bits).tolist() == [2, 4, 4]


# ------------------------------------------------------------------------------------------ square-root scale


def test_square_root_scale_by_hand():
    """Range 0 to 63 in 6 bits: 63 sqrt(x / 63) for x = 1, 7, 28 and 63 is 7.94, 21, 42 and 63."""
    assert radiance_to_dn([1.0, 7.0, 28.0, 63.0], 1.0, 0.0, 6, 63).tolist() == [8, 21, 42, 63]
    np.testing.assert_allclose(dn_to_radiance([21, 42], 1.0, 0.0, 63), [7 + 0.25 / 63, 28 + 0.25 / 63], rtol=1e-14)
    gain, offset = gain_offset(FULL, LOW, 6)
    counts = np.broadcast_to(np.arange(1, 64), (2, 63)).astype(np.uint8)
    radiance = dn_to_radiance(counts, gain, offset, 63)
    np.testing.assert_array_equal(radiance_to_dn(radiance, gain, offset, 6, 63), counts)
    np.testing.assert_allclose(radiance[:, -1:], FULL, atol=0.005 * gain.max())


def test_compressed_count_decodes_to_the_centre_of_its_interval():
    """The edges of count n are found by search; their distance is the digital step."""
    fine = np.linspace(0.0, 63.0, 2_000_001)
    dn = radiance_to_dn(fine, 1.0, 0.0, 6, 63)
    for count in (2, 10, 31, 62):
        seen = fine[dn == count]
        middle = (seen[0] + seen[-1]) / 2
        np.testing.assert_allclose(dn_to_radiance(count, 1.0, 0.0, 63), middle, atol=1e-4)
        step = calibration.digital_step(count**2 / 63, 1.0, 0.0, 63)
        np.testing.assert_allclose(step, seen[-1] - seen[0], atol=1e-4)


# ------------------------------------------------------------------------------------------ products


def test_both_scales_of_a_landsat_8_scene_agree():
    """
    RADIANCE_MULT and RADIANCE_ADD of LC08_L1TP_047027_20201204_20210313_02_T1, bands 4 and 5, to the stated digits.

    The solar irradiances follow from the largest and smallest radiances and reflectances.
    """
    spans = np.array([622.76880 + 51.42845, 381.10345 + 31.47165])
    sun = np.pi * 0.9854607**2 * spans / (1.210700 + 0.099980)
    gain, offset = product_gain_offset(2e-5, -0.1, sun, 1.0, 0.9854607)
    assert (np.abs(gain - [1.0288e-2, 6.2956e-3]) <= [5e-7, 5e-8]).all()
    # Half of the sixth digit of the reflectances, divided by their span.
    np.testing.assert_allclose(offset, [-51.43874, -31.47794], rtol=1e-6)
    low = product_gain_offset(2e-5, -0.1, sun, 0.25, 0.9854607)
    np.testing.assert_allclose(low, np.array([gain, offset]) / 4, rtol=1e-15)


def test_product_reflectance_is_divided_by_the_solar_cosine():
    """Band 3 of Landsat 5 by hand: (2.1735e-3 * 57 - 0.004609) / 0.35. NaN for a sun at or below the horizon."""
    mu_s = np.array([0.35, np.nan, 0.0, -0.1])
    found = calibration.product_reflectance(np.uint8(57), 2.1735e-3, -0.004609, 255, mu_s=mu_s)
    np.testing.assert_allclose(found, [0.340801428, np.nan, np.nan, np.nan], atol=1e-7)
    assert found.dtype == np.float32
    # No data, the largest number and flagged pixels are NaN.
    dn, flags = np.array([0, 1, 254, 255, 57, 57], np.uint8), np.array([0, 0, 0, 0, 4, 8], np.uint16)
    kept = np.isfinite(calibration.product_reflectance(dn, 1e-3, 0.0, 255, np.uint16(4), flags))
    assert kept.tolist() == [False, True, True, False, False, True]


def test_direction_vectors_round_trip_and_average():
    zenith, azimuth = np.meshgrid([0.5, 30.0, 75.0], [0.0, 95.0, 200.0, 359.0])
    found = calibration.direction_angles(3.0 * calibration.direction_vectors(zenith, azimuth))
    np.testing.assert_allclose(found, [zenith, azimuth], rtol=0, atol=1e-10)
    zenith, azimuth = np.array([[10.0, np.nan], [10.0, np.nan]]), np.array([[350.0, 0.0], [30.0, 0.0]])
    vectors = calibration.mean_direction(zenith, azimuth)
    assert np.isnan(vectors[:, 1]).all() and calibration.direction_angles(vectors[:, 0])[1] == pytest.approx(10.0)


def test_direction_grids_are_filled_and_interpolated():
    """For small zenith angles at one azimuth, interpolating vectors equals interpolating angles."""
    vectors = calibration.direction_vectors(np.array([[5.0, np.nan, np.nan, 9.0]]), np.full((1, 4), 100.0))
    np.testing.assert_allclose(calibration.direction_angles(calibration.filled(vectors))[0], [[5.0, 5.0, 9.0, 9.0]])
    nodes = calibration.direction_vectors(np.array([[1.0, 2.0, 4.0], [3.0, 4.0, 6.0]]), np.full((2, 3), 40.0))
    zenith, azimuth = calibration.between_nodes(nodes, [0.0, 0.25, 1.0, 5.0], [0.5, 1.0, 2.0])
    expected = [[1.5, 2.0, 4.0], [2.0, 2.5, 4.5], [3.5, 4.0, 6.0], [3.5, 4.0, 6.0]]
    np.testing.assert_allclose(zenith, expected, rtol=0, atol=2e-3)
    np.testing.assert_allclose(azimuth, 40.0)


# ------------------------------------------------------------------------------------------ noise


MODEL = NoiseModel(0.4, 0.01, detectors=16, gain_spread=0.004, offset_spread=0.2)
ALL = ("shot", "thermal", "fixed-pattern")


@pytest.mark.parametrize("radiance", [2.0, 40.0, 300.0])
def test_propagated_noise_agrees_with_a_sample_of_detectors(radiance):
    """1 %: the standard error of 90,000 detectors is 0.24 %, after rounding to digital steps."""
    model = NoiseModel(0.3, 0.01, detectors=90_000, gain_spread=0.02, offset_spread=0.2, along="columns")
    measured = add_noise(np.full((1, 90_000), radiance), model, ALL, seed=4, band=1)
    expected = np.sqrt(np.mean((np.rint(measured / 0.5) * 0.5 - radiance) ** 2))
    assert radiance_std(radiance, model, ALL, 0.5) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("place", [(-40, -1500), (144_000, 23_566)])
def test_noise_does_not_depend_on_the_window(place):
    """Also across the tiles of 1024 pixels in which a line is drawn, and on both sides of the origin."""
    row, column = place
    scene = np.random.default_rng(0).uniform(10, 90, (50, 1200))
    scene[14, 30] = np.nan
    whole = add_noise(scene, MODEL, ALL, seed=5, band=2, row=row, column=column)
    np.testing.assert_array_equal(np.isnan(whole), np.isnan(scene))
    np.testing.assert_array_equal(add_noise(scene, MODEL, (), seed=1, band=0), scene)
    for y, x, height, width in ((0, 0, 7, 1200), (13, 1, 20, 40), (49, 990, 1, 210)):
        window = np.s_[y : y + height, x : x + width]
        found = add_noise(scene[window], MODEL, ALL, seed=5, band=2, row=row + y, column=column + x)
        np.testing.assert_array_equal(found, whole[window])
