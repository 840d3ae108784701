"""Cells below pixels: means to rounding, semivariograms inside and across borders, and pixels without leaves."""

from math import factorial

import numpy as np
import pytest
from oracles_field import covariances
from scipy import stats

from fifesim.ground.landscape.autoregression import periodic_field
from fifesim.ground.landscape.coarse_lattice import deviation_table, kept_variance, level_deviations
from fifesim.ground.landscape.distribution import lai_distribution, quantile_map, quantile_table
from fifesim.ground.landscape.downscaling import (
    Kriging,
    LogNormal,
    Marginal,
    by_pixel,
    downscaled,
    fife_variation,
    kriging_block_means,
    map_trend,
)

RATIO, SHAPE = (3, 3), (60, 60)
CELLS = (180, 180)


def log_normal(arp, cv, trend=0.0):
    """Filters, transform and deviation of cells with a coefficient of variation within pixels."""
    return Kriging.of(arp, trend, RATIO, SHAPE), LogNormal(), float(np.interp(cv, *deviation_table(arp, RATIO)))


def of_distribution(arp, name):
    transform = Marginal.of(lai_distribution(name), kept_variance(arp, RATIO))
    return Kriging.of(arp, 0.0, RATIO, SHAPE), transform, 1.0


def semivariances(cells):
    """Over one and two cells along rows and columns, of pairs in a pixel and of pairs in two."""
    found = []
    for lag in (1, 2):
        inside = np.arange(cells.shape[0]) % RATIO[0] + lag < RATIO[0]
        along = [(np.roll(each, -lag, axis=0) - each) ** 2 / 2 for each in (cells, cells.T)]
        found += [np.mean([each[pairs].mean() for each in along]) for pairs in (inside, ~inside)]
    return np.array(found)


def theory(cells, arp):
    """Semivariances of a function of the process, by its Hermite polynomials."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(100)
    values, weights = cells(nodes), weights / np.sqrt(2 * np.pi)
    orders = np.arange(1, 25)
    polynomials = [np.polynomial.hermite_e.hermeval(nodes, [0] * order + [1]) for order in orders]
    power = [
        np.sum(weights * values * each) ** 2 / factorial(order) for order, each in zip(orders, polynomials, strict=True)
    ]
    correlation = covariances(arp)[0] / covariances(arp)[0, 0]
    one, two = (np.sum(power * (1 - correlation[lag] ** orders)) for lag in (1, 2))
    return np.array([one, one, two, two])


def model_of_variation(arp, cv):
    """Log-normal cells whose variance within pixels is cv**2 of the square of their mean, on average."""
    deviation = log_normal(arp, cv)[2]
    return lambda field: np.exp(deviation * field)


def of_quantiles(arp, name):
    table = quantile_table(lai_distribution(name))
    return lambda field: quantile_map(field, table)


CASES = {
    "cv 0.4": (0.05, model_of_variation, log_normal, 0.4),
    "cv 0.4, arp 0.24": (0.24, model_of_variation, log_normal, 0.4),
    "cv 0.1": (0.15, model_of_variation, log_normal, 0.1),
    "burned-grazed, arp 0.05": (0.05, of_quantiles, of_distribution, "burned-grazed"),
    "burned-grazed": (0.15, of_quantiles, of_distribution, "burned-grazed"),
    "burned-grazed, arp 0.24": (0.24, of_quantiles, of_distribution, "burned-grazed"),
    "unburned-ungrazed": (0.24, of_quantiles, of_distribution, "unburned-ungrazed"),
}


@pytest.mark.parametrize("name", CASES)
def test_cells_of_a_map_of_the_model_vary_as_it_does_inside_of_pixels_and_across_borders(name):
    """
    Of maps that are means of other scenes of the model, within 3 standard errors.

    Beside the scene that the map is of, whose sampling errors are partly the same.
    """
    arp, model, options, value = CASES[name]
    model, (_, transform, deviation) = model(arp, value), options(arp, value)
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
    expected = theory(model, arp)
    error = np.std(found, axis=0) / np.sqrt(len(found) - 1)
    assert np.all(error < 0.007 * expected)
    assert np.all(np.abs(np.mean(found, axis=0)) < 3 * error)
    np.testing.assert_allclose(np.mean(ground, axis=0), expected, rtol=0.03)


def test_variation_within_pixels_is_as_asked():
    kriging, transform, deviation = log_normal(0.15, 0.3)
    model, pixels = model_of_variation(0.15, 0.3), []
    for seed in range(6):
        means = kriging_block_means(model(periodic_field(100 + seed, 0.15, CELLS)), RATIO)
        cells = downscaled(means, periodic_field(seed, 0.15, CELLS), kriging, transform, deviation)
        pixels.append(np.ravel(kriging_block_means(cells**2, RATIO) / means**2 - 1))
    squared = np.concatenate(pixels)
    error = squared.std() / np.sqrt(squared.size)
    assert abs(squared.mean() - 0.3**2) < 0.005 * 0.3**2 + 3 * error


def test_map_beside_the_model_keeps_its_means_and_has_no_seams():
    """Slow hills of LAI from 0.3 to 6: neighbours across borders differ no more than those in a pixel."""
    y, x = np.mgrid[:60, :60] / 60
    pixels = 2 ** (0.4 + 2.2 * np.sin(2 * np.pi * (x + y)) * np.cos(2 * np.pi * y))
    trend = map_trend(np.log(pixels), pixels > 0, log_normal(0.05, 0.1)[2], 0.05, RATIO)
    kriging, transform, deviation = log_normal(0.05, 0.1, trend)
    cells = downscaled(pixels, periodic_field(1, 0.05, CELLS), kriging, transform, deviation)
    np.testing.assert_allclose(kriging_block_means(cells, RATIO), pixels, rtol=1e-12)
    logarithm = np.log(cells)
    for axis in (0, 1):
        squared = np.moveaxis((np.roll(logarithm, -1, axis) - logarithm) ** 2, axis, 0)
        across, inside = squared[2::3].mean(), (squared[::3].mean() + squared[1::3].mean()) / 2
        assert 0.8 < across / inside < 1.05


def test_no_variation_is_a_smooth_map_of_the_same_means():
    y, x = np.mgrid[:60, :60] / 60
    pixels = 2.0 + np.sin(2 * np.pi * x) * np.cos(2 * np.pi * y)
    kriging = Kriging.of(0.15, np.inf, RATIO, SHAPE)
    cells = downscaled(pixels, periodic_field(1, 0.15, CELLS), kriging, LogNormal(), 0.0)
    y, x = (np.mgrid[:180, :180] + 0.5) / 180 - 0.5 / 60
    np.testing.assert_allclose(cells, 2.0 + np.sin(2 * np.pi * x) * np.cos(2 * np.pi * y), atol=5e-3)


def test_pixels_without_leaves_or_data_have_such_cells_and_disturb_few():
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
    # Cells do not fall to the pixels of 0 beside them.
    nearest, further = cells[60:72, 89].mean(), cells[60:72, 87].mean()
    assert nearest / further == pytest.approx(whole[60:72, 89].mean() / whole[60:72, 87].mean(), rel=0.1)


def test_map_without_leaves_has_none():
    pixels = np.zeros(SHAPE)
    pixels[0, 0] = np.nan
    kriging, transform, deviation = log_normal(0.15, 0.3)
    cells = downscaled(pixels, periodic_field(1, 0.15, CELLS), kriging, transform, deviation)
    np.testing.assert_array_equal(cells, by_pixel(pixels, RATIO))


def test_variation_may_differ_from_pixel_to_pixel():
    pixels = np.full(SHAPE, 2.0)
    kriging, transform, _ = log_normal(0.0, 0.3)
    deviation = np.where(np.arange(60) < 30, 0.1, 0.4) * np.ones(SHAPE)
    cells = downscaled(pixels, periodic_field(1, 0.0, CELLS), kriging, transform, deviation)
    spread = np.log(cells).std(axis=0)
    # Residuals of white noise from pixels that are known: 8/9 of the variance.
    np.testing.assert_allclose(spread[[30, 60]], 0.1 * np.sqrt(8 / 9), rtol=0.2)
    np.testing.assert_allclose(spread[[120, 150]], 0.4 * np.sqrt(8 / 9), rtol=0.2)
    # The centres of the pixels at the border are at columns 88 and 91; between them it is a share of both.
    np.testing.assert_allclose(spread[88:92], np.linspace(0.1, 0.4, 4) * np.sqrt(8 / 9), rtol=0.2)


def test_level_of_a_skewed_distribution_is_that_of_cells_around_it():
    density = lai_distribution("burned-grazed")
    cells = 0.4 + np.sqrt(0.7) * np.random.default_rng(1).standard_normal(200000)
    mean = density.ppf(stats.norm.cdf(cells)).mean()
    # The standard error of the mean is 0.001, a level rises by 2 for a mean of 1.
    assert Marginal.of(density, 0.3).level(mean) == pytest.approx(0.4, abs=0.006)


@pytest.mark.parametrize("mean", [0.4, 2.4])
def test_mean_that_the_distribution_has_not_is_refused(mean):
    kriging, transform, deviation = of_distribution(0.15, "burned-ungrazed")
    pixels = np.full(SHAPE, 1.5)
    pixels[3, 4] = mean
    with pytest.raises(
        ValueError, match=rf"mean LAI {mean}, which cells .* from 0.475 to 2.345 cannot have: give .* cv="
    ):
        downscaled(pixels, np.zeros(CELLS), kriging, transform, deviation)


def test_means_near_the_ends_of_a_distribution_are_met():
    kriging, transform, deviation = of_distribution(0.15, "burned-grazed")
    pixels = np.random.default_rng(1).choice([0.01, 0.7, 2.17], SHAPE)
    cells = downscaled(pixels, periodic_field(1, 0.15, CELLS), kriging, transform, deviation)
    np.testing.assert_allclose(kriging_block_means(cells, RATIO), pixels, rtol=1e-12)
    assert cells.min() >= 0 and cells.max() < 2.2 * 1.0015


def test_levels_of_a_distribution_are_those_of_its_mean():
    """Of a normal distribution the mean of a pixel is linear in its level."""
    marginal = Marginal.of(stats.norm(10.0, 0.5), 0.3)
    np.testing.assert_allclose(marginal.level(np.array([9.0, 10.0, 10.5])), [-2.0, 0.0, 1.0], atol=1e-4)


def test_grass_of_fife_varies_as_its_table_says():
    """The three treatments at arp 0.15 in pixels of 3 x 3 cells: on average within a tenth."""
    inside = np.sqrt(1 - kept_variance(0.15, (3, 3)))
    densities = [lai_distribution(name) for name in ("burned-grazed", "burned-ungrazed", "unburned-ungrazed")]
    deviations = [inside * each.std() for each in densities]
    assert np.mean(deviations) == pytest.approx(0.4, rel=0.1)
    assert max(inside * each.std() / each.mean() for each in densities) == pytest.approx(0.6, rel=0.1)
    np.testing.assert_allclose(fife_variation(np.array([0.2, 4.0])), [0.6, 0.1])
