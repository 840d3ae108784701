"""Tests of cells within pixels: means, semivariograms, variance, trends, kriging, residuals, pixels without leaves."""

import numpy as np
import pytest
from scipy import stats

from fifesim.ground.landscape.autoregression import pair_correlations, periodic_field, response
from fifesim.ground.landscape.distribution import lai_distribution, quantile_map, quantile_table
from fifesim.ground.landscape.downscaling import (
    Kriging,
    LogNormal,
    Marginal,
    by_pixel,
    deviation_table,
    downscaled,
    fife_variation,
    kept_variance,
    kriged,
    kriging_block_means,
    kriging_filter,
    level_deviations,
    map_trend,
    pixel_sample,
    residual_shift,
    weighed,
)

RATIO, SHAPE = (3, 3), (60, 60)
CELLS = (180, 180)


def covariances(arp, size=512):
    """Covariances by lag from the two-dimensional spectrum on a torus that is many correlation lengths wide."""
    u = 2 * np.pi * np.fft.fftfreq(size)
    return np.fft.ifft2(response(arp, u[:, None], u) ** 2).real


def log_normal(arp, cv, trend=0.0):
    """Filters, transform and deviation of log-normal cells with a coefficient of variation within pixels."""
    return Kriging.of(arp, trend, RATIO, SHAPE), LogNormal(), float(np.interp(cv, *deviation_table(arp, RATIO)))


def of_distribution(arp, name):
    transform = Marginal.of(lai_distribution(name), kept_variance(arp, RATIO))
    return Kriging.of(arp, 0.0, RATIO, SHAPE), transform, 1.0


def semivariances(cells):
    """Semivariances at lags of one and two cells, for pairs within a pixel and for pairs in two pixels."""
    found = []
    for lag in (1, 2):
        inside = np.arange(cells.shape[0]) % RATIO[0] + lag < RATIO[0]
        along = [(np.roll(each, -lag, axis=0) - each) ** 2 / 2 for each in (cells, cells.T)]
        found += [np.mean([each[pairs].mean() for each in along]) for pairs in (inside, ~inside)]
    return np.array(found)


CASES = {
    "cv 0.4": (0.05, log_normal, 0.4),
    "cv 0.4, arp 0.24": (0.24, log_normal, 0.4),
    "burned-grazed": (0.24, of_distribution, "burned-grazed"),
    "unburned-ungrazed": (0.24, of_distribution, "unburned-ungrazed"),
}


@pytest.mark.parametrize("name", CASES)
def test_downscaled_cells_have_the_semivariogram_of_the_model(name):
    """The map is the mean over pixels of a scene of the model; both semivariances agree within 3 standard errors."""
    arp, options, value = CASES[name]
    _, transform, deviation = options(arp, value)
    table = quantile_table(lai_distribution(value)) if options is of_distribution else None

    def model(field):
        return np.exp(deviation * field) if table is None else quantile_map(field, table)

    # Differences from the scene have a smaller sampling error, since both semivariances share a part of it.
    of_levels = level_deviations(transform, [deviation], arp, RATIO)[0]
    shape, cells = (112, 112), (336, 336)
    ground, found = [], []
    for seed in range(20):
        truth = model(periodic_field(100 + seed, arp, cells))
        pixels = kriging_block_means(truth, RATIO)
        trend = map_trend(transform.level(pixels), pixels > 0, of_levels, arp, RATIO)
        field = periodic_field(seed, arp, cells).astype(np.float32)
        drawn = downscaled(pixels, field, Kriging.of(arp, trend, RATIO, shape), transform, deviation)
        np.testing.assert_allclose(kriging_block_means(drawn, RATIO), pixels, rtol=1e-12)
        ground.append(semivariances(truth))
        found.append(semivariances(drawn) - ground[-1])
    error, expected = np.std(found, axis=0) / np.sqrt(len(found) - 1), np.mean(ground, axis=0)
    assert np.all(error < 0.007 * expected)
    assert np.all(np.abs(np.mean(found, axis=0)) < 3 * error)


def test_pixels_without_leaves_or_data_affect_only_nearby_cells():
    kriging, transform, deviation = log_normal(0.15, 0.3)
    pixels = kriging_block_means(np.exp(0.35 * periodic_field(9, 0.15, CELLS)), RATIO)
    field = periodic_field(2, 0.15, CELLS)
    whole = downscaled(pixels, field, kriging, transform, deviation)
    holed = pixels.copy()
    holed[20:24, 30], holed[40, 10:13] = 0.0, np.nan
    cells = downscaled(holed, field, kriging, transform, deviation)
    assert np.all(cells[by_pixel(holed == 0, RATIO)] == 0)
    np.testing.assert_array_equal(np.isnan(cells), np.isnan(by_pixel(holed, RATIO)))
    known = holed > 0
    np.testing.assert_allclose(kriging_block_means(np.nan_to_num(cells), RATIO)[known], pixels[known], rtol=1e-12)
    changed = np.abs(np.log(cells / np.where(cells > 0, whole, np.nan)))
    rows, columns = np.nonzero(changed > 1e-3)
    far = [np.min(np.hypot(*(np.argwhere(~known) - (r // 3, c // 3)).T)) for r, c in zip(rows, columns, strict=True)]
    assert max(far) < 6
    # Cells do not decrease toward neighbouring pixels of 0.
    nearest, further = cells[60:72, 89].mean(), cells[60:72, 87].mean()
    assert nearest / further == pytest.approx(whole[60:72, 89].mean() / whole[60:72, 87].mean(), rel=0.1)


def test_variation_may_differ_between_pixels():
    pixels = np.full(SHAPE, 2.0)
    kriging, transform, _ = log_normal(0.0, 0.3)
    deviation = np.where(np.arange(60) < 30, 0.1, 0.4) * np.ones(SHAPE)
    cells = downscaled(pixels, periodic_field(1, 0.0, CELLS), kriging, transform, deviation)
    spread = np.log(cells).std(axis=0)
    # Residuals of white noise have 8/9 of the variance where the mean of 9 cells is known.
    np.testing.assert_allclose(spread[[30, 60]], 0.1 * np.sqrt(8 / 9), rtol=0.2)
    np.testing.assert_allclose(spread[[120, 150]], 0.4 * np.sqrt(8 / 9), rtol=0.2)
    # The deviation is linear between the centres of the pixels on both sides of the step, at columns 88 and 91.
    np.testing.assert_allclose(spread[88:92], np.linspace(0.1, 0.4, 4) * np.sqrt(8 / 9), rtol=0.2)


def test_level_of_a_skewed_distribution_inverts_the_mean_of_cells():
    density = lai_distribution("burned-grazed")
    cells = 0.4 + np.sqrt(0.7) * np.random.default_rng(1).standard_normal(200000)
    mean = density.ppf(stats.norm.cdf(cells)).mean()
    # The standard error of the mean is 0.001, and the derivative of the level by the mean is 2.
    assert Marginal.of(density, 0.3).level(mean) == pytest.approx(0.4, abs=0.006)


def test_means_near_the_limits_of_a_distribution_are_exact():
    kriging, transform, deviation = of_distribution(0.15, "burned-grazed")
    pixels = np.random.default_rng(1).choice([0.01, 0.7, 2.17], SHAPE)
    cells = downscaled(pixels, periodic_field(1, 0.15, CELLS), kriging, transform, deviation)
    np.testing.assert_allclose(kriging_block_means(cells, RATIO), pixels, rtol=1e-12)
    assert cells.min() >= 0 and cells.max() < 2.2 * 1.0015


def on_torus(row):
    """Covariance matrix of all cells of a torus, from covariances by lag."""
    rows, columns = row.shape
    i, j = np.divmod(np.arange(row.size), columns)
    return row[(i[:, None] - i) % rows, (j[:, None] - j) % columns]


def averaging(shape, ratio):
    """Matrix of means over pixels."""
    cells = np.arange(np.prod(shape) * np.prod(ratio)).reshape(shape[0] * ratio[0], shape[1] * ratio[1])
    matrix = np.zeros((np.prod(shape), cells.size))
    for pixel, (i, j) in enumerate(np.ndindex(*shape)):
        inside = cells[i * ratio[0] : (i + 1) * ratio[0], j * ratio[1] : (j + 1) * ratio[1]]
        matrix[pixel, inside.ravel()] = 1 / inside.size
    return matrix


def slow(shape, ratio):
    """Covariances by lag of a trend with density 1 and without mean, from its spectrum."""
    u, v = (2 * np.pi * np.fft.fftfreq(size * number) for size, number in zip(shape, ratio, strict=True))
    squared = (2 * ratio[0] * np.sin(u[:, None] / 2)) ** 2 + (2 * ratio[1] * np.sin(v / 2)) ** 2
    squared[0, 0] = np.inf
    return np.fft.ifft2(np.prod(ratio) / squared**2).real


def weights(arp, trend, ratio, shape):
    """Matrix of the kriging filter, from its responses to single pixels."""
    response = kriging_filter(arp, trend, ratio, shape)
    pixels = np.eye(np.prod(shape)).reshape(-1, *shape)
    return np.array([kriged(each, response, ratio).ravel() for each in pixels]).T


def test_block_means_and_by_pixel():
    cells, means = np.arange(24.0).reshape(4, 6), [[4.0, 7.0], [16.0, 19.0]]
    np.testing.assert_array_equal(kriging_block_means(cells, (2, 3)), means)
    np.testing.assert_array_equal(by_pixel(np.array(means), (2, 3))[:3, 2:4], [[4.0, 7.0], [4.0, 7.0], [16.0, 19.0]])


@pytest.mark.parametrize(
    "arp, trend, ratio", [(0.0, 0.3, (3, 3)), (0.15, 0.75, (3, 2)), (0.2, 0.2, (2, 4)), (0.24, 0.0, (3, 3))]
)
def test_kriging_filter_is_the_best_linear_estimate(arp, trend, ratio):
    """Compare with C B' (B C B')^-1 by matrices; the filter has single precision."""
    shape = 8, 6
    # A large variance of the mean makes the mean of the trend practically unknown.
    cells = tuple(np.multiply(shape, ratio))
    covariance = on_torus(process(arp, cells) + trend**2 * slow(shape, ratio)) + 1e5
    mean = averaging(shape, ratio)
    best = covariance @ mean.T @ np.linalg.inv(mean @ covariance @ mean.T)
    np.testing.assert_allclose(weights(arp, trend, ratio, shape), best, rtol=0, atol=3e-6)


def process(arp, cells):
    """Covariances of the process with unit variance on a small torus."""
    u, v = (2 * np.pi * np.fft.fftfreq(size) for size in cells)
    wide = covariances(arp)
    spectrum = 1 / (1 - 2 * arp * (np.cos(u[:, None]) + np.cos(v))) ** 2
    return np.fft.ifft2(spectrum).real / wide[0, 0]


@pytest.mark.parametrize("ratio, shape", [((3, 3), (8, 6)), ((2, 5), (5, 4))])
def test_weighed_is_the_transpose_of_kriged(ratio, shape):
    cells = np.random.default_rng(1).standard_normal(np.multiply(shape, ratio))
    found = weighed(cells, kriging_filter(0.2, 0.3, ratio, shape), ratio)
    np.testing.assert_allclose(found.ravel(), weights(0.2, 0.3, ratio, shape).T @ cells.ravel(), rtol=0, atol=2e-5)


@pytest.mark.parametrize("arp, trend", [(0.05, 0.3), (0.15, 0.75), (0.24, 3.0), (0.24, np.inf)])
def test_kriged_waves_have_no_steps_at_pixel_edges(arp, trend):
    ratio, shape = (3, 3), (4, 64)
    centres = (np.arange(64 * 3) + 0.5) / 3
    wave = np.broadcast_to(np.sin(2 * np.pi * centres / 32), (12, 192))
    cells = kriged(kriging_block_means(wave, ratio), kriging_filter(arp, trend, ratio, shape), ratio)
    np.testing.assert_allclose(cells, wave, rtol=0, atol=4e-3)
    steps = np.diff(cells[0], append=cells[0, :1]).reshape(-1, 3)
    inside, across = (steps[:, :2] ** 2).mean(), (steps[:, 2] ** 2).mean()
    assert across == pytest.approx(inside, rel=0.06)


def trend(seed, ratio=RATIO):
    """Cells of a trend with spectral density 1 at one radian per pixel."""
    u, v = (2 * np.pi * np.fft.fftfreq(size) * number for size, number in zip(CELLS, ratio, strict=True))
    squared = u[:, None] ** 2 + v**2
    squared[0, 0] = np.inf
    noise = np.random.default_rng(seed).standard_normal(CELLS)
    return np.fft.ifft2(np.fft.fft2(noise) * np.sqrt(np.prod(ratio)) / squared).real


def known(levels):
    return np.ones(levels.shape, bool)


@pytest.mark.parametrize("ratio", [(3, 3), (2, 4)])
@pytest.mark.parametrize("strength", [4.0, 16.0])
def test_trend_is_estimated_in_the_presence_of_the_process(strength, ratio):
    for seed in range(4):
        levels = kriging_block_means(0.2 * (periodic_field(seed, 0.15, CELLS) + strength * trend(seed, ratio)), ratio)
        assert map_trend(levels, known(levels), 0.2, 0.15, ratio) == strength


def test_trend_of_gentle_hills_is_found_at_long_lags():
    """Second differences of the hills over one pixel are 1 % of the process. Without hills, the trend is small."""
    hills = kriging_block_means(np.broadcast_to(np.sin(2 * np.pi * np.arange(180) / 180), CELLS), RATIO)
    levels = hills + kriging_block_means(0.2 * periodic_field(1, 0.15, CELLS), RATIO)
    assert map_trend(levels, known(levels), 0.2, 0.15, RATIO) >= 0.5
    assert map_trend(levels - hills, known(levels), 0.2, 0.15, RATIO) <= 0.25


def test_steps_and_pixels_without_leaves_do_not_change_the_trend():
    levels = kriging_block_means(0.2 * (periodic_field(3, 0.15, CELLS) + 4.0 * trend(3)), RATIO)
    fenced = levels + np.where(np.arange(60) < 23, 0.0, 5.0)
    holed = known(levels)
    fenced[20:30, 40:50], holed[20:30, 40:50] = -50.0, False
    assert map_trend(fenced, holed, 0.2, 0.15, RATIO) == 4.0
    # Planes have no second differences, hence no trend.
    assert map_trend(np.full((60, 60), 2.0), holed, 0.2, 0.15, RATIO) == 0.0


def test_trend_is_infinite_without_variation_of_the_process():
    levels = np.zeros((8, 8))
    assert map_trend(levels, known(levels), 0.0, 0.15, RATIO) == np.inf
    assert map_trend(1e6 * trend(1)[:8, :8], known(levels), 1.0, 0.15, RATIO) == np.inf


def matrix(function, shape):
    """Matrix of a linear function of arrays of a shape."""
    return np.array([function(each.reshape(shape)).ravel() for each in np.eye(np.prod(shape))]).T


@pytest.mark.parametrize("arp, trend", [(0.0, 0.0), (0.2, 0.0), (0.2, 0.5)])
def test_shift_is_the_gradient_of_the_log_weight(arp, trend):
    """Finite differences of ln w with its determinant, on a small torus, within 2 % for weakly curved functions."""
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
        """Transform x + bend (x**2 / 2 + x**3 / 6)."""

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

    # The gradient is evaluated at half of the residuals.
    wanted = mean @ Bent().cells(estimate @ levels + residual / 2)
    shift = residual_shift(field.reshape(cells), levels.reshape(shape), np.float32(0.0), kriging, Bent(), 1.0)
    gradient = [
        (logarithm(residual / 2 + step * each, wanted) - logarithm(residual / 2 - step * each, wanted)) / (2 * step)
        for each in np.eye(144)
    ]
    # Remove means over pixels from the residuals, before and after the multiplication by the covariance.
    project = np.eye(144) - estimate @ mean
    expected = project @ covariance @ project.T @ gradient
    found = project @ shift.ravel()
    assert np.abs(found - expected).max() < 0.02 * np.abs(expected).max() + 1e-5


def test_linear_transforms_need_no_shift():
    """The means of a normal distribution are independent of residuals; without variation there is nothing to shift."""
    kriging, field = Kriging.of(0.15, 0.0, (3, 3), (20, 20)), np.random.default_rng(1).standard_normal((60, 60))
    known = kriging_block_means(field, (3, 3))
    normal = Marginal.of(stats.norm(10.0, 0.5), 0.3)
    assert np.abs(residual_shift(field, known, np.float32(0.0), kriging, normal, 1.0)).max() < 1e-3
    skewed = Marginal.of(stats.gamma(2.0), 0.3)
    assert np.abs(residual_shift(field, known, np.float32(0.0), kriging, skewed, 1.0)).max() > 0.1
    assert not residual_shift(0 * field, known, np.float32(0.0), kriging, LogNormal(), 0.0).any()


def test_shift_is_limited_to_one_standard_deviation():
    """A map that is impossible for the model; also where the deviation differs between cells."""
    kriging, pixels = Kriging.of(0.15, 0.0, (3, 3), (20, 20)), 9 * np.random.default_rng(1).standard_normal((20, 20))
    deviation = np.where(np.arange(60) < 30, 0.1, 0.4) * np.ones((60, 60))
    field = deviation * np.random.default_rng(2).standard_normal((60, 60))
    shift = np.abs(residual_shift(field, pixels, np.float32(0.0), kriging, LogNormal(), deviation))
    assert np.all(shift <= deviation) and shift[:, :30].max() == pytest.approx(0.1)
    assert np.isfinite(shift).all() and shift[:, 30:].max() > 0.3


@pytest.mark.parametrize("arp, ratio", [(0.0, (3, 3)), (0.15, (3, 3)), (0.24, (2, 5))])
def test_variance_of_means_is_the_mean_correlation_of_all_pairs(arp, ratio):
    correlation = covariances(arp) / covariances(arp)[0, 0]
    places = list(np.ndindex(*ratio))
    pairs = [correlation[abs(i - k), abs(j - m)] for i, j in places for k, m in places]
    assert kept_variance(arp, ratio) == pytest.approx(np.mean(pairs), rel=1e-10)
    assert pair_correlations(arp, ratio)[1].sum() == pytest.approx(1.0, rel=1e-14)
    sample = pixel_sample(arp, ratio)
    assert sample.mean(axis=1).var() == pytest.approx(kept_variance(arp, ratio), rel=1e-12)
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


def test_level_deviations_of_a_normal_distribution_and_limits_of_the_variation_of_fife():
    np.testing.assert_allclose(fife_variation(np.array([0.2, 1.0, 4.0])), [0.6, 0.4, 0.1])
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
