"""Tests of the variance that remains in means over pixels."""

import numpy as np
import pytest
from oracles_field import covariances
from scipy import stats

from fifesim.ground.landscape.autoregression import pair_correlations
from fifesim.ground.landscape.downscaling import (
    LogNormal,
    Marginal,
    deviation_table,
    kept_variance,
    level_deviations,
    pixel_sample,
)


@pytest.mark.parametrize("arp, ratio", [(0.0, (3, 3)), (0.15, (3, 3)), (0.24, (2, 5))])
def test_variance_of_means_is_the_mean_correlation_of_all_pairs(arp, ratio):
    correlation = covariances(arp) / covariances(arp)[0, 0]
    places = list(np.ndindex(*ratio))
    pairs = [correlation[abs(i - k), abs(j - m)] for i, j in places for k, m in places]
    assert kept_variance(arp, ratio) == pytest.approx(np.mean(pairs), rel=1e-10)
    assert pair_correlations(arp, ratio)[1].sum() == pytest.approx(1.0, rel=1e-14)


def test_pixel_sample_has_the_variances_of_the_process():
    sample = pixel_sample(0.2, (3, 4))
    assert sample.shape == (168 * 126, 12)
    assert sample.mean(axis=1).var() == pytest.approx(kept_variance(0.2, (3, 4)), rel=1e-12)
    assert (sample**2).mean() == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("arp", [0.0, 0.2])
def test_variation_of_two_cells_equals_quadrature(arp):
    """Mean of tanh(s d / 2)^2 over the normal distribution of the difference d of two cells."""
    variations, deviations = deviation_table(arp, (1, 2))
    nodes, weights = np.polynomial.hermite_e.hermegauss(80)
    spread = np.sqrt(2 * (1 - covariances(arp)[0, 1] / covariances(arp)[0, 0]))
    squared = np.tanh(deviations[:, None] * spread * nodes / 2) ** 2 @ weights / np.sqrt(2 * np.pi)
    # The sample of 127000 pixels has the exact variance; the tolerance covers the sampling error of its fourth moment.
    np.testing.assert_allclose(variations, np.sqrt(squared), rtol=5e-3, atol=1e-12)


def test_level_deviations_of_a_normal_distribution():
    normal = Marginal.of(stats.norm(10.0, 0.5), kept_variance(0.15, (3, 3)))
    np.testing.assert_allclose(level_deviations(normal, [0.5, 1.0], 0.15, (3, 3)), [0.5, 1.0], rtol=1e-4)


def test_level_deviations_of_two_log_normal_cells():
    """ln m = y + ln cosh a with independent y and a, whose variances are summed."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(80)
    inside = np.log(np.cosh(0.8 * np.sqrt(0.5) * nodes))
    weights = weights / weights.sum()
    variance = 0.8**2 / 2 + weights @ inside**2 - (weights @ inside) ** 2
    found = level_deviations(LogNormal(), [0.8], 0.0, (1, 2))
    # The sample of 127000 pixels has the exact variance of means.
    np.testing.assert_allclose(found, np.sqrt(2 * variance), rtol=2e-3)
    assert found > 0.81
