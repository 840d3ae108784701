"""Variance within pixels: beside sums over pairs, and a pixel of two cells that is an integral."""

import numpy as np
import pytest
from oracles_field import covariances
from scipy import stats

from fifesim.ground.landscape.autoregression import streaming_field
from fifesim.ground.landscape.coarse_lattice import (
    deviation_table,
    kept_variance,
    level_deviations,
    pair_correlations,
    pixel_sample,
)
from fifesim.ground.landscape.downscaling import LogNormal, Marginal, kriging_block_means


@pytest.mark.parametrize("arp, ratio", [(0.0, (3, 3)), (0.15, (3, 3)), (0.24, (2, 5))])
def test_means_over_pixels_keep_the_mean_correlation_of_all_pairs(arp, ratio):
    correlation = covariances(arp) / covariances(arp)[0, 0]
    places = list(np.ndindex(*ratio))
    pairs = [correlation[abs(i - k), abs(j - m)] for i, j in places for k, m in places]
    assert kept_variance(arp, ratio) == pytest.approx(np.mean(pairs), rel=1e-10)
    assert pair_correlations(arp, ratio)[1].sum() == pytest.approx(1.0, rel=1e-14)


def test_means_over_pixels_of_a_field_keep_this_share():
    field = streaming_field(3, 0.15, 0, 0, (1008, 1008))
    kept = kriging_block_means(field, (3, 3)).var() / field.var()
    # 113000 pixels, hardly correlated.
    assert kept == pytest.approx(kept_variance(0.15, (3, 3)), rel=4 * np.sqrt(2 * 1.2 / 113000))


def test_sample_has_the_variances_of_the_process():
    sample = pixel_sample(0.2, (3, 4))
    assert sample.shape == (168 * 126, 12)
    assert sample.mean(axis=1).var() == pytest.approx(kept_variance(0.2, (3, 4)), rel=1e-12)
    assert (sample**2).mean() == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("arp", [0.0, 0.2])
def test_variation_of_two_cells_is_an_integral(arp):
    """The square of tanh(s d / 2), for d the difference of two cells: over its normal distribution, by quadrature."""
    variations, deviations = deviation_table(arp, (1, 2))
    nodes, weights = np.polynomial.hermite_e.hermegauss(80)
    spread = np.sqrt(2 * (1 - covariances(arp)[0, 1] / covariances(arp)[0, 0]))
    squared = np.tanh(deviations[:, None] * spread * nodes / 2) ** 2 @ weights / np.sqrt(2 * np.pi)
    # The sample of 127000 pixels has its variance right; what is left is that of its fourth moment.
    np.testing.assert_allclose(variations, np.sqrt(squared), rtol=5e-3, atol=1e-12)


def test_variation_in_large_pixels_is_that_of_the_log_normal_distribution():
    variations, deviations = deviation_table(0.0, (60, 60))
    expected = np.sqrt(np.expm1(0.3**2))
    assert np.interp(0.3, deviations, variations) == pytest.approx(expected, rel=5e-3)


def test_levels_of_a_normal_distribution_vary_as_its_field():
    normal = Marginal.of(stats.norm(10.0, 0.5), kept_variance(0.15, (3, 3)))
    np.testing.assert_allclose(level_deviations(normal, [0.5, 1.0], 0.15, (3, 3)), [0.5, 1.0], rtol=1e-4)


def test_levels_of_two_log_normal_cells_vary_by_what_moves_within_them():
    """ln m = y + ln cosh a of independent y and a, whose variances add."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(80)
    inside = np.log(np.cosh(0.8 * np.sqrt(0.5) * nodes))
    weights = weights / weights.sum()
    variance = 0.8**2 / 2 + weights @ inside**2 - (weights @ inside) ** 2
    found = level_deviations(LogNormal(), [0.8], 0.0, (1, 2))
    # 127000 pixels, whose means have their variance right.
    np.testing.assert_allclose(found, np.sqrt(2 * variance), rtol=2e-3)
    assert found > 0.81
