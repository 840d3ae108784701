"""Digital numbers, radiance and planetary reflectance."""

import numpy as np
import pytest

from fifesim.sensor.response.calibration import (
    dn_to_radiance,
    gain_offset,
    radiance_to_dn,
    radiance_to_reflectance,
    reflectance_to_radiance,
)

FULL, LOW = np.array([204.3, 206.2])[:, None], np.array([-1.2, -1.5])[:, None]


def test_count_of_tm_is_the_range_over_255():
    """Radiance per count that follows from Table 1 by hand: 205.5 / 255 and 207.7 / 255."""
    gain, offset = gain_offset([204.3, 206.2], [-1.2, -1.5], 8)
    np.testing.assert_allclose(gain, [0.805882, 0.814510], atol=5e-7)
    np.testing.assert_array_equal(offset, [-1.2, -1.5])


@pytest.mark.parametrize("bits", [4, 8, 10, 12, 16])
def test_radiance_returns_within_half_a_count(bits):
    gain, offset = gain_offset(FULL, LOW, bits)
    radiance = offset + gain * np.linspace(0.5, 2**bits - 0.5, 9973)
    again = dn_to_radiance(radiance_to_dn(radiance, gain, offset, bits), gain, offset)
    assert np.max(np.abs(again - radiance) / gain) <= 0.5 + 1e-9


@pytest.mark.parametrize(("bits", "dtype"), [(2, np.uint8), (8, np.uint8), (9, np.uint16), (16, np.uint16)])
def test_every_valid_count_returns_to_itself(bits, dtype):
    gain, offset = gain_offset(FULL, LOW, bits)
    counts = np.broadcast_to(np.arange(2**bits), (2, 2**bits)).astype(dtype)
    dn = radiance_to_dn(dn_to_radiance(counts, gain, offset), gain, offset, bits)
    assert dn.dtype == dtype
    np.testing.assert_array_equal(dn, counts)


@pytest.mark.parametrize("bits", [8, 10, 16])
def test_out_of_range_is_clipped_and_never_wraps(bits):
    gain, offset = gain_offset(204.3, -1.2, bits)
    radiance = [-np.inf, -1e9, -1.2, 204.3, 204.3 + 2 * gain, 1e9, np.inf]
    largest = 2**bits - 1
    expected = [1, 1, 1, largest, largest, largest, largest]
    assert radiance_to_dn(radiance, gain, offset, bits).tolist() == expected


def test_missing_is_zero_and_zero_is_missing():
    gain, offset = gain_offset(204.3, -1.2, 8)
    dn = radiance_to_dn([np.nan, 50.0], gain, offset, 8)
    assert dn[0] == 0
    assert dn[1] != 0
    np.testing.assert_array_equal(np.isnan(dn_to_radiance(dn, gain, offset)), [True, False])


def test_halves_go_to_the_even_count():
    assert radiance_to_dn([2.5, 3.5, 4.5], 1.0, 0.0, 8).tolist() == [2, 4, 4]


def test_bands_broadcast():
    gain, offset = gain_offset(FULL[..., None], LOW[..., None], 8)
    radiance = np.full((2, 3, 4), 50.0)
    dn = radiance_to_dn(radiance, gain, offset, 8)
    assert dn.shape == (2, 3, 4)
    # (50 + 1.2) / 0.805882 = 63.53, (50 + 1.5) / 0.814510 = 63.23
    assert dn[:, 0, 0].tolist() == [64, 63]


def test_planetary_reflectance_of_a_worked_case():
    """pi 50 1.0148^2 / (1536 cos 28.5 degrees) = 161.763 / 1349.86, by hand."""
    mu_s = np.cos(np.radians(28.5))
    np.testing.assert_allclose(radiance_to_reflectance(50.0, 1536.0, mu_s, 1.0148), 0.11984, atol=5e-6)


def test_reflectance_and_radiance_are_inverse():
    reflectance = np.random.default_rng(5).random((2, 7, 9))
    irradiance = np.array([1536.0, 1031.0])[:, None, None]
    radiance = reflectance_to_radiance(reflectance, irradiance, 0.88, 1.0148)
    np.testing.assert_allclose(radiance_to_reflectance(radiance, irradiance, 0.88, 1.0148), reflectance, rtol=1e-14)


def test_radiance_falls_with_the_square_of_the_distance():
    near, far = (reflectance_to_radiance(0.3, 1031.0, 0.9, d) for d in (0.983, 1.017))
    np.testing.assert_allclose(near / far, (1.017 / 0.983) ** 2, rtol=1e-14)


def test_mistakes_are_named():
    with pytest.raises(ValueError, match="above min_radiance"):
        gain_offset([204.3, -1.5], [-1.2, -1.5], 8)
    for bits in (1, 17):
        with pytest.raises(ValueError, match="bits must be in 2 to 16"):
            gain_offset(204.3, -1.2, bits)
    with pytest.raises(TypeError, match="bits must be an integer"):
        radiance_to_dn(50.0, 0.8, -1.2, 8.5)
    with pytest.raises(ValueError, match="gain must be positive, got 0"):
        radiance_to_dn(50.0, [0.8, 0.0], -1.2, 8)
    with pytest.raises(ValueError, match="mu_s must be positive"):
        reflectance_to_radiance(0.3, 1536.0, -0.1)
    with pytest.raises(ValueError, match="earth_sun_distance"):
        radiance_to_reflectance(50.0, 1536.0, 0.9, 0.0)


# ------------------------------------------------------------------------------------------ a scale of square roots


def test_square_roots_by_hand():
    """Range 0 to 63 in 6 bits: 63 sqrt(x / 63) for x = 1, 7, 28 and 63 is 7.94, 21, 42 and 63."""
    assert radiance_to_dn([1.0, 7.0, 28.0, 63.0], 1.0, 0.0, 6, 63).tolist() == [8, 21, 42, 63]
    np.testing.assert_allclose(dn_to_radiance([21, 42], 1.0, 0.0, 63), [7 + 0.25 / 63, 28 + 0.25 / 63], rtol=1e-14)


def test_every_compressed_count_returns_to_itself_and_the_ends_are_the_linear_ones():
    gain, offset = gain_offset(FULL, LOW, 6)
    counts = np.broadcast_to(np.arange(1, 64), (2, 63)).astype(np.uint8)
    radiance = dn_to_radiance(counts, gain, offset, 63)
    np.testing.assert_array_equal(radiance_to_dn(radiance, gain, offset, 6, 63), counts)
    np.testing.assert_allclose(radiance[:, -1:], FULL, atol=0.005 * gain.max())
    assert np.isnan(dn_to_radiance([0], 1.0, 0.0, 63)).all()


def test_radiance_of_a_compressed_count_lies_in_the_middle_of_those_it_stands_for():
    """Edges of count n, found by search: half of their sum is what it decodes to."""
    fine = np.linspace(0.0, 63.0, 2_000_001)
    dn = radiance_to_dn(fine, 1.0, 0.0, 6, 63)
    for count in (2, 10, 31, 62):
        seen = fine[dn == count]
        np.testing.assert_allclose(dn_to_radiance(count, 1.0, 0.0, 63), (seen[0] + seen[-1]) / 2, atol=1e-4)


def test_compression_is_finer_than_the_linear_scale_in_the_dark_and_coarser_in_the_light():
    radiance = np.linspace(2.0, 63.0, 50_001)
    off = {c: np.abs(dn_to_radiance(radiance_to_dn(radiance, 1.0, 0.0, 6, c), 1.0, 0.0, c) - radiance) for c in (0, 63)}
    dark, light = radiance < 63 / 4.5, radiance > 63 / 3.5
    assert off[63][dark].max() < off[0][dark].max() and off[63][light].max() > off[0][light].max()


def test_scale_is_by_band_and_a_linear_one_keeps_its_bits():
    gain, offset = gain_offset(FULL[..., None], LOW[..., None], 6)
    radiance = np.random.default_rng(3).uniform(-2, 210, (2, 30, 40))
    mixed = radiance_to_dn(radiance, gain, offset, 6, np.array([63, 0])[:, None, None])
    linear = radiance_to_dn(radiance, gain, offset, 6)
    np.testing.assert_array_equal(mixed[1], linear[1])
    np.testing.assert_array_equal(mixed[0], radiance_to_dn(radiance, gain, offset, 6, 63)[0])
    assert (mixed[0] > linear[0]).mean() > 0.9
    decoded = dn_to_radiance(mixed, gain, offset, np.array([63, 0])[:, None, None])
    np.testing.assert_array_equal(decoded[1], dn_to_radiance(linear, gain, offset)[1])


def test_what_is_beyond_a_compressed_range_is_clipped():
    assert radiance_to_dn([-np.inf, -5.0, 0.0, 1e9, np.inf, np.nan], 1.0, 0.0, 6, 63).tolist() == [1, 1, 1, 63, 63, 0]
