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
