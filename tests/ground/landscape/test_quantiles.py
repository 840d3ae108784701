"""The mapping of a field to a distribution."""

import numpy as np
import pytest
from scipy import stats

import fifesim
from fifesim.ground.landscape.autoregression import field_variance, response
from fifesim.ground.landscape.distribution import (
    QUANTILE_NODES,
    lai_distribution,
    quantile_map,
    quantile_map_of_classes,
    quantile_table,
    rank_map,
    rank_quantiles,
)


def kolmogorov_distance(values, distribution):
    """Largest difference of the empirical and the given distribution function."""
    ordered = np.sort(values, axis=None)
    below = distribution.cdf(ordered)
    steps = np.arange(ordered.size + 1) / ordered.size
    return max(np.max(steps[1:] - below), np.max(below - steps[:-1]))


def independent_cells(arp, cells):
    """
    Cells over the sum of their correlations; fewer than the indicators of a threshold have.

    The correlation of two indicators is at most that of the normal values that they come from (all are positive here).
    The sum of the correlations is the spectrum at frequency zero over the variance.
    """
    return cells * field_variance(arp) / response(arp, 0, 0) ** 2


@pytest.mark.parametrize("name", fifesim.treatments())
def test_no_leaf_area_is_negative(name):
    field = np.array([[-40.0, -8.5, -1.0, 0.0, 1.0, 8.5, 40.0]])
    distribution = lai_distribution(name)
    values = quantile_map(field, quantile_table(distribution))
    assert values.min() >= 0
    assert (np.diff(values[0]) >= 0).all()
    # scipy's quantiles near the end of the support are good to a few units in the last place.
    assert values.max() <= distribution.support()[1] * (1 + 4e-15)


@pytest.mark.parametrize(
    "distribution",
    [*map(lai_distribution, fifesim.treatments()), stats.uniform(0.5, 2.0), stats.beta(2, 3, 0, 4)],
    ids=lambda distribution: distribution.dist.name,
)
def test_quantile_map_is_within_its_error_bound(distribution):
    """Linear interpolation: an eighth of the squared step times the largest curvature of the quantile function."""
    deviates = np.linspace(-6, 6, 20_011)
    exact = np.where(
        deviates < 0, distribution.ppf(stats.norm.cdf(deviates)), distribution.isf(stats.norm.sf(deviates))
    )
    curvature = np.abs(np.gradient(np.gradient(exact, deviates), deviates)).max()
    step = 17 / 2**14
    found = quantile_map(deviates[None], quantile_table(distribution))[0]
    assert np.abs(found - exact).max() <= 1.05 * step**2 / 8 * curvature + 1e-14


def test_quantile_map_keeps_nan_by_cell():
    field = np.array([[0.0, np.nan], [np.nan, 1.0]])
    mapped = quantile_map(field, quantile_table(stats.uniform()))
    np.testing.assert_array_equal(np.isnan(mapped), np.isnan(field))
    assert quantile_map(field, quantile_table(stats.uniform()), out=field) is field
    np.testing.assert_array_equal(field, mapped)


def test_each_class_has_the_bits_of_its_own_map():
    """NaN of the field stays where a class has a distribution."""
    rng = np.random.default_rng(2)
    field, numbers = rng.normal(size=(60, 70)), rng.integers(0, 3, (60, 70)).astype(np.int16)
    field[::7, ::5] = np.nan
    tables = np.stack(
        [
            quantile_table(lai_distribution("burned-grazed")),
            np.full(QUANTILE_NODES, 1.1),
            quantile_table(stats.uniform()),
        ]
    )
    out = quantile_map_of_classes(field, numbers, tables)
    for number in (0, 2):
        mine = numbers == number
        np.testing.assert_array_equal(out[mine], quantile_map(field[mine], tables[number]))
    assert (out[numbers == 1] == 1.1).all()


@pytest.mark.parametrize("name", fifesim.treatments())
def test_ranks_reproduce_the_distribution_exactly(name):
    """Every quantile (k + 1/2) / n once: the Kolmogorov distance is the least that n values can have."""
    field = np.random.default_rng(1).normal(size=(40, 50))
    distribution = lai_distribution(name)
    values = rank_map(field, distribution)
    np.testing.assert_array_equal(np.argsort(values, axis=None), np.argsort(field, axis=None))
    np.testing.assert_array_equal(np.sort(values, axis=None), distribution.ppf((np.arange(2000) + 0.5) / 2000))
    assert kolmogorov_distance(values, distribution) == pytest.approx(0.5 / 2000, rel=1e-9)


@pytest.mark.parametrize("arp", [0.05, 0.15, 0.24])
def test_streaming_scene_has_the_distribution_within_sampling_error(arp):
    """1.95 / sqrt(n) is exceeded in one of a thousand samples of n independent values (Kolmogorov)."""
    lai = fifesim.lai_scene(fifesim.fife_site(30 / 9, window=((0, 1000), (0, 1000))), arp=arp, seed=7)
    distance = kolmogorov_distance(lai.values, lai_distribution("burned-grazed"))
    assert distance < 1.95 / np.sqrt(independent_cells(arp, lai.size))


@pytest.mark.slow
def test_whole_site_has_the_distribution_within_a_thousandth():
    lai = fifesim.lai_scene(fifesim.fife_site(30 / 9), arp=0.15, seed=7)
    assert kolmogorov_distance(lai.values, lai_distribution("burned-grazed")) < 1e-3


@pytest.mark.parametrize("arp", [0.15, 0.24])
def test_periodic_scene_has_the_distribution_exactly(arp):
    lai = fifesim.lai_scene(fifesim.fife_site(30 / 9, window=((0, 300), (0, 200))), arp=arp, method="periodic")
    assert kolmogorov_distance(lai.values, lai_distribution("burned-grazed")) == pytest.approx(0.5 / lai.size, rel=1e-6)


def test_quantiles_of_few_ranks_are_kept_and_of_many_let_go():
    """Pieces of a large scene ask again for the same; those of a whole one would stay in memory."""
    distribution = stats.uniform(0, 3)
    assert rank_quantiles(distribution, 1000) is rank_quantiles(distribution, 1000)
    assert rank_quantiles(distribution, 2**20) is not rank_quantiles(distribution, 2**20)
