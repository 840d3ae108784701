"""Residuals given means of a bent function: beside densities by quadrature and matrices, and where there is no bend."""

import numpy as np
import pytest
from scipy import stats

from fifesim.ground.landscape.downscaling import (
    Kriging,
    LogNormal,
    Marginal,
    by_pixel,
    kriged,
    kriging_block_means,
    residual_shift,
)

RATIO, SHAPE = (1, 2), (60, 60)


def matrix(function, shape):
    """Of a linear function of arrays of a shape."""
    return np.array([function(each.reshape(shape)).ravel() for each in np.eye(np.prod(shape))]).T


def pairs(deviation):
    """Halves of the difference of two independent cells, at evenly spaced quantiles in a random order."""
    ranks = (np.random.default_rng(1).permutation(SHAPE[0] * SHAPE[1]) + 0.5) / (SHAPE[0] * SHAPE[1])
    return deviation / np.sqrt(2) * stats.norm.ppf(ranks).reshape(SHAPE)


@pytest.mark.parametrize("level, ratio", [(-0.15, 0.85), (0.15, 1.11)])
def test_residuals_have_the_density_that_a_known_mean_leaves_them(level, ratio):
    """
    Two independent log-normal cells y + a and y - a of mean m, so that y = ln m - ln cosh a.

    The density of a is the product of those of a and of that y; by quadrature, its variance is 15 % less than without
    m, or 11 % more.
    """
    deviation, own = 0.3, pairs(0.3)
    offset = np.mean(np.log(np.cosh(own)))
    a = np.linspace(-3, 3, 20001)
    density = np.exp(-((a / deviation) ** 2) - ((level + offset - np.log(np.cosh(a))) / deviation) ** 2)
    expected = np.sum(density * a**2) / np.sum(density) / (deviation**2 / 2)
    assert expected == pytest.approx(ratio, abs=0.005)

    # As many pixels of the opposite level, so that the mean in the surroundings is zero.
    sign = np.where(np.add.outer(np.arange(60), np.arange(60)) % 2, -1, 1)
    cells = np.stack([own, -own], axis=-1).reshape(60, 120).astype(np.float32)
    kriging, shift, inside = Kriging.of(0.0, 0.0, RATIO, SHAPE), np.float32(0.0), own
    for _ in range(2):
        known = sign * level + offset - np.log(np.cosh(inside))
        shift = residual_shift(cells, known, shift, kriging, LogNormal(), deviation)
        inside = (cells + shift - by_pixel(kriging_block_means(cells + shift, RATIO), RATIO))[:, ::2]
    found = np.mean(inside[sign == 1] ** 2) / np.mean(own[sign == 1] ** 2)
    # Of third order in the bend; one shift alone is 0.03 off for the lower level.
    assert found == pytest.approx(expected, abs=0.004)


@pytest.mark.parametrize("arp, trend", [(0.0, 0.0), (0.2, 0.0), (0.2, 0.5)])
def test_shift_is_the_gradient_of_the_density_by_matrices(arp, trend):
    """Differences of ln w, with its determinant, on a small torus: of nearly straight functions, to 2 %."""
    ratio, shape, bend, step = (2, 2), (6, 6), 0.02, 1e-4
    kriging, cells = Kriging.of(arp, trend, ratio, shape), (12, 12)
    estimate = matrix(lambda pixels: kriged(pixels, kriging.response, ratio), shape).astype(float)
    mean = matrix(lambda field: kriging_block_means(field, ratio), cells)
    precision = matrix(lambda pixels: np.fft.irfft2(np.fft.rfft2(pixels) * kriging.precision, s=shape), shape)
    covariance = matrix(lambda field: np.fft.irfft2(np.fft.rfft2(field) * kriging.process, s=cells), cells)
    rng = np.random.default_rng(2)
    levels, field = rng.standard_normal(36), rng.standard_normal(144)
    residual = field - estimate @ (mean @ field)

    class Bent:
        """x + bend (x**2 / 2 + x**3 / 6)."""

        def cells(self, x):
            return x + bend * (x**2 / 2 + x**3 / 6)

        def slopes(self, x):
            return 1 + bend * (x + x**2 / 2), bend * (1 + x)

    def logarithm(residual, wanted):
        y = wanted.copy()
        for _ in range(20):
            y -= mean @ Bent().cells(estimate @ y + residual) - wanted
        slopes = mean @ (Bent().slopes(estimate @ y + residual)[0][:, None] * estimate)
        return -0.5 * y @ precision @ y - np.linalg.slogdet(slopes)[1]

    # The gradient is asked at half of the residuals.
    wanted = mean @ Bent().cells(estimate @ levels + residual / 2)
    shift = residual_shift(field.reshape(cells), levels.reshape(shape), np.float32(0.0), kriging, Bent(), 1.0)
    gradient = [
        (logarithm(residual / 2 + step * each, wanted) - logarithm(residual / 2 - step * each, wanted)) / (2 * step)
        for each in np.eye(144)
    ]
    # Means over pixels are no residual, before the covariance and after it.
    project = np.eye(144) - estimate @ mean
    expected = project @ covariance @ project.T @ gradient
    found = project @ shift.ravel()
    assert np.abs(found - expected).max() < 0.02 * np.abs(expected).max() + 1e-5


def test_straight_functions_need_no_shift():
    """Means of a normal distribution say nothing of residuals; nor is there anything to shift without variation."""
    kriging, field = Kriging.of(0.15, 0.0, (3, 3), (20, 20)), np.random.default_rng(1).standard_normal((60, 60))
    known = kriging_block_means(field, (3, 3))
    normal = Marginal.of(stats.norm(10.0, 0.5), 0.3)
    assert np.abs(residual_shift(field, known, np.float32(0.0), kriging, normal, 1.0)).max() < 1e-3
    skewed = Marginal.of(stats.gamma(2.0), 0.3)
    assert np.abs(residual_shift(field, known, np.float32(0.0), kriging, skewed, 1.0)).max() > 0.1
    assert not residual_shift(0 * field, known, np.float32(0.0), kriging, LogNormal(), 0.0).any()


def test_shift_is_one_standard_deviation_at_most():
    """Of a map that the model cannot have; where the deviation differs, by that of each cell."""
    kriging, pixels = Kriging.of(0.15, 0.0, (3, 3), (20, 20)), 9 * np.random.default_rng(1).standard_normal((20, 20))
    deviation = np.where(np.arange(60) < 30, 0.1, 0.4) * np.ones((60, 60))
    field = deviation * np.random.default_rng(2).standard_normal((60, 60))
    shift = np.abs(residual_shift(field, pixels, np.float32(0.0), kriging, LogNormal(), deviation))
    assert np.all(shift <= deviation) and shift[:, :30].max() == pytest.approx(0.1)
    assert np.isfinite(shift).all() and shift[:, 30:].max() > 0.3
