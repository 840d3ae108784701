"""Block kriging as a filter: beside the matrices that define it, and what it makes of maps of the model and others."""

import numpy as np
import pytest
from oracles_field import covariances

from fifesim.ground.landscape.downscaling import (
    by_pixel,
    densities_of_means,
    kriged,
    kriging_block_means,
    kriging_filter,
    of_means,
    spectral_densities,
    weighed,
)


def on_torus(row):
    """Covariance matrix of all cells of a torus, from those by lag."""
    rows, columns = row.shape
    i, j = np.divmod(np.arange(row.size), columns)
    return row[(i[:, None] - i) % rows, (j[:, None] - j) % columns]


def averaging(shape, ratio):
    """Matrix of the means over pixels."""
    cells = np.arange(np.prod(shape) * np.prod(ratio)).reshape(shape[0] * ratio[0], shape[1] * ratio[1])
    matrix = np.zeros((np.prod(shape), cells.size))
    for pixel, (i, j) in enumerate(np.ndindex(*shape)):
        inside = cells[i * ratio[0] : (i + 1) * ratio[0], j * ratio[1] : (j + 1) * ratio[1]]
        matrix[pixel, inside.ravel()] = 1 / inside.size
    return matrix


def slow(shape, ratio):
    """Covariances by lag of a trend of one, without its mean, from its spectrum by pixel."""
    u, v = (2 * np.pi * np.fft.fftfreq(size * number) for size, number in zip(shape, ratio, strict=True))
    squared = (2 * ratio[0] * np.sin(u[:, None] / 2)) ** 2 + (2 * ratio[1] * np.sin(v / 2)) ** 2
    squared[0, 0] = np.inf
    return np.fft.ifft2(np.prod(ratio) / squared**2).real


def weights(arp, trend, ratio, shape):
    """Matrix of the filter, of its answers to single pixels."""
    response = kriging_filter(arp, trend, ratio, shape)
    pixels = np.eye(np.prod(shape)).reshape(-1, *shape)
    return np.array([kriged(each, response, ratio).ravel() for each in pixels]).T


def test_pixels_are_means_of_their_cells():
    pixels = np.arange(6.0).reshape(2, 3)
    np.testing.assert_array_equal(kriging_block_means(by_pixel(pixels, (4, 2)), (4, 2)), pixels)
    cells = np.arange(24.0).reshape(4, 6)
    np.testing.assert_array_equal(
        kriging_block_means(cells, (2, 3))[0], [(0 + 1 + 2 + 6 + 7 + 8) / 6, (3 + 4 + 5 + 9 + 10 + 11) / 6]
    )


@pytest.mark.parametrize("arp, trend, ratio", [(0.0, 0.3, (3, 3)), (0.15, 0.75, (3, 2)), (0.2, 0.2, (2, 4))])
def test_filter_is_the_best_linear_estimate(arp, trend, ratio):
    """The definition, C B' (B C B')^-1, with matrices: of single precision where the filter is."""
    shape = 8, 6
    # The mean of the trend is as good as unknown: its variance is large beside all else.
    cells = tuple(np.multiply(shape, ratio))
    covariance = on_torus(process(arp, cells) + trend**2 * slow(shape, ratio)) + 1e5
    mean = averaging(shape, ratio)
    best = covariance @ mean.T @ np.linalg.inv(mean @ covariance @ mean.T)
    np.testing.assert_allclose(weights(arp, trend, ratio, shape), best, rtol=0, atol=3e-6)


def process(arp, cells):
    """Covariances of unit variance of the process on a small torus, where they wrap."""
    u, v = (2 * np.pi * np.fft.fftfreq(size) for size in cells)
    wide = covariances(arp)
    spectrum = 1 / (1 - 2 * arp * (np.cos(u[:, None]) + np.cos(v))) ** 2
    return np.fft.ifft2(spectrum).real / wide[0, 0]


@pytest.mark.parametrize("ratio", [(3, 3), (2, 5), (4, 1)])
def test_densities_of_means_are_sums_over_those_of_cells(ratio):
    *both, mean = spectral_densities(0.2, ratio, (12, 10))
    for each, found in zip(both, densities_of_means(0.2, ratio, (12, 10)), strict=True):
        np.testing.assert_allclose(found, of_means(each, mean, ratio), rtol=1e-13)


@pytest.mark.parametrize("ratio, shape", [((3, 3), (8, 6)), ((2, 5), (5, 4))])
def test_sums_by_the_weights_of_pixels_are_the_transpose_of_the_estimate(ratio, shape):
    cells = np.random.default_rng(1).standard_normal(np.multiply(shape, ratio))
    found = weighed(cells, kriging_filter(0.2, 0.3, ratio, shape), ratio)
    np.testing.assert_allclose(found.ravel(), weights(0.2, 0.3, ratio, shape).T @ cells.ravel(), rtol=0, atol=2e-5)


def test_means_of_the_cells_are_the_pixels():
    ratio, shape = (3, 3), (24, 20)
    pixels = np.random.default_rng(1).standard_normal(shape)
    cells = kriged(pixels, kriging_filter(0.15, 0.3, ratio, shape), ratio)
    np.testing.assert_allclose(kriging_block_means(cells, ratio), pixels, rtol=0, atol=2e-6)


@pytest.mark.parametrize("arp", [0.05, 0.15, 0.24])
def test_field_with_the_means_of_another_has_the_covariance_of_the_process(arp):
    """Of z + K (B z' - B z) with matrices, without drawing: inside of pixels and across their borders, to 0.5 %."""
    ratio, shape = (3, 3), (14, 14)
    covariance = on_torus(process(arp, (42, 42)))
    spread = weights(arp, 0.0, ratio, shape) @ averaging(shape, ratio)
    left = np.eye(len(covariance)) - spread
    found = left @ covariance @ left.T + spread @ covariance @ spread.T
    variances = np.diag(found).reshape(42, 42)[18:24, 18:24]
    np.testing.assert_allclose(variances, covariance[0, 0], rtol=5e-3)
    cells = np.arange(42 * 42).reshape(42, 42)
    for lag in (1, 2, 3, 4):
        one, other = cells[18:21, 18:21].ravel(), cells[18:21, 18 + lag : 21 + lag].ravel()
        half = (found[one, one] + found[other, other]) / 2 - found[one, other]
        np.testing.assert_allclose(half, covariance[0, 0] - covariance[0, lag], rtol=1e-2)


@pytest.mark.parametrize("arp, trend", [(0.05, 0.3), (0.15, 0.75), (0.24, 3.0), (0.24, np.inf)])
def test_slow_waves_have_no_steps_at_borders(arp, trend):
    ratio, shape = (3, 3), (4, 64)
    centres = (np.arange(64 * 3) + 0.5) / 3
    wave = np.broadcast_to(np.sin(2 * np.pi * centres / 32), (12, 192))
    cells = kriged(kriging_block_means(wave, ratio), kriging_filter(arp, trend, ratio, shape), ratio)
    np.testing.assert_allclose(cells, wave, rtol=0, atol=4e-3)
    steps = np.diff(cells[0], append=cells[0, :1]).reshape(-1, 3)
    inside, across = (steps[:, :2] ** 2).mean(), (steps[:, 2] ** 2).mean()
    assert across == pytest.approx(inside, rel=0.06)
