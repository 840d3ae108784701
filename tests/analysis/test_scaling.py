"""Scale effects against closed forms, quadrature, brute force and scipy; shares of causes."""

from itertools import permutations
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from scipy.stats import qmc

from fifesim.analysis import scaling
from fifesim.analysis.indices import normalized_difference
from fifesim.analysis.scaling import by_itself, shapley, sobol_indices, sobol_points, taken_away
from fifesim.base import footprints
from fifesim.base import line_spread as spreads
from fifesim.ground.landscape import autoregression


@pytest.mark.parametrize(("red", "nir"), [(0.08, 0.3), (0.2, 0.2), (0.3, 0.1)])
def test_hessian_is_the_second_difference(red, nir):
    """Central differences with a step of 1e-4 are good to 1e-8 of derivatives of the order of 1/S^4 = 40 at most."""
    h, found = 1e-4, scaling.ndvi_hessian(red, nir)
    step = {0: (h, 0.0), 1: (0.0, h)}
    for i in range(2):
        for j in range(2):
            (a, b), (c, d) = step[i], step[j]
            difference = sum(
                sign * float(normalized_difference(nir + s * b + t * d, red + s * a + t * c))
                for s, t, sign in ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))
            ) / (4 * h * h)
            assert found[i, j] == pytest.approx(difference, abs=1e-4)


def test_beer_bias_is_the_leading_term_of_the_exact_one():
    """For normal LAI the mean of exp(-K L) is exp(-K m + K^2 s^2 / 2), whose next term is K^2 s^2 / 4 of the first."""
    mean, deviation, extinction, limit = 1.2, 0.1, 0.57, 0.94
    exact = limit * (np.exp(-extinction * mean) - np.exp(-extinction * mean + (extinction * deviation) ** 2 / 2))
    found = scaling.beer_bias(mean, deviation**2, extinction, limit)
    assert found == pytest.approx(exact, rel=(extinction * deviation) ** 2 / 2)
    assert found < 0


def test_ndvi_bias_of_a_mixture_of_two_grounds():
    """Exact sums over two equal halves; the third order vanishes by symmetry, the fourth is of the order (d/S)^2."""
    red, nir, d = np.array([0.10, 0.12]), np.array([0.24, 0.20]), 1.0
    exact = normalized_difference(nir, red).mean() - normalized_difference(nir.mean(), red.mean())
    covariance = np.cov(np.stack([red, nir]), ddof=0) * d
    found = scaling.second_order_bias(scaling.ndvi_hessian(red.mean(), nir.mean()), covariance)
    assert found == pytest.approx(exact, rel=0.02)


def test_linearity_is_zero_where_the_sum_is_constant():
    """Then the denominator does not vary, and NDVI is linear; with a little noise in it the correlation is small."""
    rng = np.random.default_rng(3)
    red = rng.uniform(0.05, 0.15, 4000)
    assert abs(np.nan_to_num(scaling.linearity_correlation(red, 0.4 - red))) < 1e-6
    noise = rng.normal(0, 0.01, red.size)
    # Half of the noise to each band: the difference does not know it. Four standard errors of 1/sqrt(n).
    assert abs(scaling.linearity_correlation(red + noise / 2, 0.4 - red + noise / 2)) < 4 / np.sqrt(red.size)


def test_linearity_agrees_with_numpy():
    red, nir = np.random.default_rng(7).uniform(0.05, 0.4, (2, 300))
    red[3], nir[5] = np.nan, np.inf
    kept = np.isfinite(red) & np.isfinite(nir)
    expected = np.corrcoef((nir - red)[kept], (1 / (nir + red))[kept])[0, 1]
    assert scaling.linearity_correlation(red, nir) == pytest.approx(expected, rel=1e-12)


def test_mean_ndvi_is_that_of_the_mean_where_ndvi_and_brightness_are_uncorrelated():
    """Exactly: the difference is minus their covariance over the mean brightness. Eq. 2 is near to that."""
    red, nir = np.random.default_rng(5).uniform(0.03, 0.4, (2, 1000))
    ratio, total = normalized_difference(nir, red), nir + red
    difference = ratio.mean() - normalized_difference(nir.mean(), red.mean())
    assert abs(difference) > 1e-3
    assert difference == pytest.approx(-np.cov(ratio, total, bias=True)[0, 1] / total.mean(), rel=1e-10)


def test_share_kept_leaves_out_what_is_missing():
    cells = np.array([[0.0, 4.0], [np.nan, 2.0]])
    assert scaling.pixel_shares(np.array([1.0, np.nan, 2.0]), cells) == pytest.approx((0.25, 0.25 / (8 / 3)), rel=1e-12)


# ------------------------------------------------------------------------------------------ variograms


RNG = np.random.default_rng(11)


def brute_force(cells, lag_y, lag_x):
    """Count, covariance about the mean of all and semivariance, pair by pair."""
    mean, pairs = np.nanmean(cells), []
    for i in range(cells.shape[0]):
        for j in range(cells.shape[1]):
            k, m = i + lag_y, j + lag_x
            if 0 <= k < cells.shape[0] and 0 <= m < cells.shape[1] and np.isfinite(cells[i, j] + cells[k, m]):
                pairs.append((cells[i, j], cells[k, m]))
    one, two = np.array(pairs).T
    return len(pairs), np.mean((one - mean) * (two - mean)), np.mean((two - one) ** 2) / 2


@pytest.mark.parametrize("lag", [(0, 0), (0, 1), (0, -3), (2, -1), (3, 3), (3, 0)])
def test_sums_agree_with_brute_force_in_spite_of_holes(lag):
    cells = RNG.normal(5, 1, (17, 13))
    cells[4:7, 3:5] = np.nan
    sums = scaling.lag_sums(cells, ((0, 0), (0, 0)), (3, 3), origin=5.0)
    # About the mean, from which the origin was taken.
    found = [array[lag[0], lag[1] + 3] for array in (sums[0], scaling.covariance(sums), scaling.semivariance(sums))]
    np.testing.assert_allclose(found, brute_force(cells, *lag), rtol=1e-11, atol=1e-13)


def exact_covariance(arp, reach):
    """Covariance map of the process, from its spectrum on a torus 40 decay lengths around."""
    u = 2 * np.pi * np.fft.fftfreq(1024)
    spectrum = autoregression.response(arp, u[:, None], u[None, :]) ** 2
    covariance = np.fft.ifft2(spectrum).real
    covariance /= covariance[0, 0]
    lags = np.arange(-reach, reach + 1)
    return covariance[np.ix_(np.arange(reach + 1), lags)]


@pytest.mark.parametrize("arp", [0.05, 0.15, 0.24])
def test_means_of_blocks_keep_what_the_spectrum_says(arp):
    """The same share by integrating the spectrum times the transfer function of 9 x 9 cells."""
    axis = operator(spreads.Boxcar(9.0))
    products = scaling.weight_correlation(axis, 8)
    variance = scaling.footprint_variance(exact_covariance(arp, 8), products, products)
    u = 2 * np.pi * np.fft.fftfreq(1024)
    transfer = np.abs(np.exp(1j * np.outer(u, np.arange(9))).mean(axis=1)) ** 2
    spectrum = autoregression.response(arp, u[:, None], u[None, :]) ** 2
    assert variance == pytest.approx(np.sum(spectrum * np.outer(transfer, transfer)) / spectrum.sum(), rel=1e-10)


def operator(lsf, pixel=9.0):
    return footprints.axis_operator(
        lsf, cell_origin=0.0, cell_size=1.0, n_cells=90, pixel_origin=0.0, pixel_size=pixel, n_pixels=int(90 / pixel)
    )


def test_correlation_that_stays_up_has_no_range():
    assert np.isnan(scaling.crossing(np.arange(3.0), np.array([1.0, 0.9, 0.8])))
    assert scaling.crossing(np.arange(3.0), np.array([1.0, 0.55, -0.45])) == pytest.approx(1.5)


def test_covariance_of_a_wave_is_a_cosine():
    """Of whole periods, about their mean of zero: half of the squared amplitude times the cosine of the lag."""
    wave = np.broadcast_to(np.sin(2 * np.pi * np.arange(64) / 16), (3, 64))
    sums = scaling.lag_sums(np.concatenate([wave, wave[:, :8]], axis=1), ((0, 0), (0, 8)), (0, 8))
    found = scaling.covariance(sums)[0, 8:]
    np.testing.assert_allclose(found, np.cos(2 * np.pi * np.arange(9) / 16) / 2, rtol=0, atol=1e-12)


def test_weights_of_a_pixel_that_overhangs_do_not_count():
    """Two of three pixels of four cells are whole: a triangle."""
    axis = footprints.axis_operator(
        spreads.Boxcar(4), cell_origin=0, cell_size=1, n_cells=10, pixel_origin=-2, pixel_size=4, n_pixels=3
    )
    triangle = np.maximum(4 - np.abs(np.arange(-5, 6)), 0) / 16
    np.testing.assert_allclose(scaling.weight_correlation(axis, 5), triangle, atol=1e-15)


# ------------------------------------------------------------------------------------------ densities


def test_density_agrees_with_scipy():
    samples = np.random.default_rng(4).gamma(3.0, 0.3, 300)
    at = np.linspace(0, 3, 50)
    theirs = stats.gaussian_kde(samples, bw_method=0.1 / samples.std(ddof=1))
    np.testing.assert_allclose(scaling.gaussian_density(samples, at, 0.1), theirs(at), rtol=1e-10)
    weights = np.random.default_rng(5).integers(1, 9, 300)
    theirs = stats.gaussian_kde(np.repeat(samples, weights), bw_method=0.1 / np.repeat(samples, weights).std(ddof=1))
    np.testing.assert_allclose(scaling.gaussian_density(samples, at, 0.1, weights), theirs(at), rtol=1e-10)


def test_density_of_samples_takes_the_rule_of_thumb():
    samples = np.random.default_rng(6).normal(0, 1, 500)
    spread = min(samples.std(ddof=1), stats.iqr(samples) / 1.34)
    theirs = stats.gaussian_kde(samples, bw_method=0.9 * spread * 500**-0.2 / samples.std(ddof=1))
    at = np.linspace(-3, 3, 40)
    np.testing.assert_allclose(scaling.sample_density(samples, at), theirs(at), rtol=1e-10)


def test_reflected_density_has_all_its_mass_above_zero():
    """That of the samples and their mirror images, twice: scipy's. Without, a part of the mass lies below zero."""
    samples = np.abs(np.random.default_rng(8).normal(0, 1, 400))
    theirs = stats.gaussian_kde(np.r_[samples, -samples], bw_method=0.2 / np.r_[samples, -samples].std(ddof=1))
    at = np.linspace(0, 6, 901)
    found = scaling.gaussian_density(samples, at, 0.2, reflect=True)
    np.testing.assert_allclose(found, 2 * theirs(at), rtol=1e-10)
    assert np.trapezoid(found, at) == pytest.approx(1, abs=1e-6)
    assert np.trapezoid(scaling.gaussian_density(samples, at, 0.2), at) < 0.95
    np.testing.assert_array_equal(scaling.gaussian_density(samples, np.array([-0.1, -1e-9]), 0.2, reflect=True), 0.0)
    with pytest.raises(ValueError, match=r"at least 0 to be reflected there, got -0\.5"):
        scaling.gaussian_density(np.array([1.0, -0.5]), np.array([0.0]), 0.1, reflect=True)
    bandwidth = scaling.silverman_bandwidth(samples.std(ddof=1), stats.iqr(samples), 400)
    mine = scaling.gaussian_density(samples, at, bandwidth, reflect=True)
    np.testing.assert_allclose(scaling.sample_density(samples, at, reflect=True), mine, rtol=1e-12)


def test_parts_of_many_samples_add_up(monkeypatch):
    samples, at = np.random.default_rng(2).normal(size=50), np.linspace(-3, 3, 7)
    whole = scaling.gaussian_density(samples, at, 0.3)
    monkeypatch.setattr(scaling, "_PART", 7)
    np.testing.assert_allclose(scaling.gaussian_density(samples, at, 0.3), whole, rtol=1e-13)


def test_bandwidth_falls_with_the_fifth_root_of_the_number():
    """The narrower of the two spreads counts, and a deviation stands for an empty interquartile range."""
    assert scaling.silverman_bandwidth(1.0, 1.34 * 0.5, 32.0) == pytest.approx(0.9 * 0.5 / 2, rel=1e-12)
    assert scaling.silverman_bandwidth(1.0, 0.0, 1.0) == pytest.approx(0.9, rel=1e-12)


def test_samples_without_a_density_are_refused():
    with pytest.raises(ValueError, match="at least 2 values"):
        scaling.sample_density(np.array([1.0, np.nan]), np.array([0.0]))
    with pytest.raises(ValueError, match="bandwidth must be positive, got 0: do the samples vary"):
        scaling.sample_density(np.array([1.0, 1.0]), np.array([0.0]))


# ------------------------------------------------------------------------------------------ shares of causes


def test_airport_game():
    """Runways that cost 1, 2 and 6, of which the longest asked for is built: 1/3, 1/3 + 1/2, 1/3 + 1/2 + 4."""
    lengths = np.array([1.0, 2.0, 6.0])
    cost = np.array([np.max(lengths * which) for which in np.ndindex(2, 2, 2)])
    np.testing.assert_allclose(shapley(cost.reshape(2, 2, 2), 3), [1 / 3, 5 / 6, 29 / 6], rtol=1e-14)


def test_share_is_the_mean_over_all_orders():
    causes = 5
    values = np.random.default_rng(3).normal(size=(2,) * causes + (2, 4))
    orders, expected = list(permutations(range(causes))), np.zeros((causes, 2, 4))
    for order in orders:
        at_work = [0] * causes
        for cause in order:
            before = values[tuple(at_work)]
            at_work[cause] = 1
            expected[cause] += (values[tuple(at_work)] - before) / len(orders)
    np.testing.assert_allclose(shapley(values, causes), expected, rtol=1e-12, atol=1e-14)


def test_shares_of_effects_that_add_are_the_effects():
    effects = np.array([0.5, -0.25, 2.0, 0.125])
    values = np.tensordot(np.indices((2,) * 4), effects, axes=(0, 0)) + 7.0
    for attribute in (shapley, taken_away, by_itself):
        np.testing.assert_allclose(attribute(values, 4), effects, rtol=1e-13)


def test_cause_that_changes_nothing_has_exactly_nothing():
    values = np.repeat(np.random.default_rng(5).normal(size=(2, 1, 2)), 2, axis=1)
    for attribute in (shapley, taken_away, by_itself):
        assert attribute(values, 3)[1] == 0.0


def test_missing_axis_is_named():
    with pytest.raises(ValueError, match="3 axes of 2 first"):
        shapley(np.zeros((2, 2)), 3)


SOBOL = pd.read_csv(Path(__file__).parents[1] / "data" / "sobol_indices.csv", comment="#")


def ishigami(text, share):
    a, b = (float(each.partition("=")[2]) for each in text.split())
    x = np.pi * (2 * share - 1)
    return np.sin(x[..., 0]) + a * np.sin(x[..., 1]) ** 2 + b * x[..., 2] ** 4 * np.sin(x[..., 0])


def sobol_g(text, share):
    a = np.array([float(each) for each in text.removeprefix("a=").split()])
    return np.prod((np.abs(4 * share - 2) + a) / (1 + a), axis=-1)


@pytest.mark.parametrize("case", SOBOL["case"].unique())
def test_indices_are_those_of_the_closed_form(case):
    rows = SOBOL[SOBOL["case"] == case]
    function = ishigami if case.startswith("ishigami") else sobol_g
    sets = sobol_points(qmc.Sobol(2 * len(rows), seed=1).random_base2(12))
    values = function(rows["parameters"].iloc[0], sets)
    np.testing.assert_allclose(values[:2].var(), rows["variance"].iloc[0], rtol=0.01)
    found = sobol_indices(values)
    for name in ("first", "total"):
        index, error = getattr(found, name), getattr(found, f"{name}_error")
        difference = np.abs(index - rows[name].to_numpy())
        assert (difference < 3 * error).all() and (difference < 0.01).all(), name


def test_indices_are_those_of_salib():
    pytest.importorskip("SALib")
    from SALib.analyze import sobol

    sets = sobol_points(np.random.default_rng(4).random((512, 6)))
    values = ishigami("a=7 b=0.1", sets)
    # SALib has one block of A, A_B of each input and B for each point.
    ordered = np.concatenate([values[:1], values[2:], values[1:2]]).T.ravel()
    problem = {"num_vars": 3, "names": ["a", "b", "c"], "bounds": [[0, 1]] * 3}
    expected = sobol.analyze(problem, ordered, calc_second_order=False, seed=1)
    found = sobol_indices(values)
    np.testing.assert_allclose(found.first, expected["S1"], rtol=1e-9)
    np.testing.assert_allclose(found.total, expected["ST"], rtol=1e-9)


def test_constant_and_undefined_functions_are_refused():
    with pytest.raises(ValueError, match="constant"):
        sobol_indices(np.ones((4, 8)))
    with pytest.raises(ValueError, match="not finite"):
        sobol_indices(np.full((4, 8), np.nan))
