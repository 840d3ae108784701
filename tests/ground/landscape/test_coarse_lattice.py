"""Tests of fields on a coarser lattice, and of the variance that remains in means over pixels."""

import numpy as np
import pytest
from oracles_field import covariances
from scipy import interpolate, stats

from fifesim.ground.landscape.autoregression import (
    COARSE_TILE,
    coarse_field,
    mixed_field,
    pair_correlations,
    spline_weights,
    streaming_field,
)
from fifesim.ground.landscape.downscaling import (
    LogNormal,
    Marginal,
    deviation_table,
    kept_variance,
    level_deviations,
    pixel_sample,
)


@pytest.mark.parametrize("coarser", [2, 3, 4])
def test_cells_are_splines_of_the_lattice(coarser):
    """Compare with scaled B-splines of scipy, centred on the cells of the lattice."""
    lattice = mixed_field({7: 1.0}, 0.1, -5, -5, (16, 16), tile=COARSE_TILE)
    place = (np.arange(4 * coarser) + 0.5) / coarser - 0.5
    # With these knots, spline k is centred on the cell k - 5.
    basis = interpolate.BSpline(np.arange(-7.0, 13.0), np.eye(16), 3)(place)
    along, factor = spline_weights(0.1, coarser)
    expected = basis @ lattice @ basis.T * np.tile(factor, (4, 4))
    np.testing.assert_allclose(coarse_field(7, 0.1, coarser, 0, 0, expected.shape), expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(along.sum(axis=1), 1.0, rtol=1e-14)


@pytest.mark.parametrize(("arp", "coarser"), [(0.0, 2), (0.05, 4), (0.24, 3)])
def test_variance_is_one_at_every_place_between_lattice_points(arp, coarser):
    """From the covariance of the process, by another Fourier transform than in the package."""
    along, factor = spline_weights(arp, coarser)
    covariance = covariances(arp) / covariances(arp)[0, 0]
    lag = np.subtract.outer(np.arange(4), np.arange(4))
    for p in range(coarser):
        for q in range(coarser):
            weights = np.multiply.outer(along[p], along[q]) * factor[p, q]
            variance = sum(
                weights[a, b] * np.sum(weights * covariance[lag[a]][:, lag[b]]) for a in range(4) for b in range(4)
            )
            assert variance == pytest.approx(1.0, abs=1e-9)


def test_lattice_of_single_cells_is_the_streaming_field():
    np.testing.assert_array_equal(coarse_field(7, 0.2, 1, -3, 5, (9, 8)), streaming_field(7, 0.2, -3, 5, (9, 8)))


@pytest.mark.parametrize("coarser", [2, 3, 5])
def test_coarse_windows_equal_slices_across_tiles(coarser):
    first = COARSE_TILE * coarser - 31
    whole = coarse_field(7, 0.15, coarser, -23, first, (60, 70))
    for row, column, shape in ((0, 0, (1, 1)), (17, 5, (20, 63)), (59, 69, (1, 1)), (22, 28, (8, 9))):
        part = coarse_field(7, 0.15, coarser, row - 23, column + first, shape)
        np.testing.assert_array_equal(part, whole[row : row + shape[0], column : column + shape[1]])
    assert coarse_field(7, 0.15, coarser, 0, 0, (0, 3)).shape == (0, 3)


@pytest.mark.parametrize(
    ("coarser", "error", "message"),
    [
        (0, ValueError, r"coarser must be in \[1, 100\], got 0"),
        (101, ValueError, r"coarser must be in \[1, 100\], got 101"),
        (2.0, TypeError, "coarser must be a whole number, got"),
        (True, TypeError, "whole number"),
    ],
)
def test_invalid_coarsening_factors_are_refused(coarser, error, message):
    with pytest.raises(error, match=message):
        coarse_field(7, 0.1, coarser, 0, 0, (2, 2))


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
