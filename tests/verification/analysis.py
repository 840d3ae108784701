"""Checks of the analysis against numpy, scipy and pandas, brute force and closed forms."""

from functools import partial
from itertools import permutations

import numpy as np
import pandas as pd
from scipy import stats

from fifesim.analysis import regression, scaling, scores
from fifesim.analysis.indices import normalized_difference
from fifesim.analysis.regression import fit, row_sums
from fifesim.base.footprints import Boxcar, axis_operator
from verification.deviations import Deviation, largest

_deviation = partial(Deviation, "analysis")


def _pairs():
    """Values of y and x of one shape, some of them missing, and the valid pairs."""
    rng = np.random.default_rng(8)
    x = rng.uniform(0.3, 0.8, (20, 30))
    y = -1.2 + 3.4 * x + rng.normal(0, 0.2, x.shape)
    x[3, 4], y[5, :2] = np.nan, np.inf
    there = np.isfinite(x) & np.isfinite(y)
    return y, x, y[there], x[there]


def _regression():
    """Check the regression and its interval by the inverse of the normal equations."""
    y, x, paired_y, paired_x = _pairs()
    line = fit(row_sums(y, x, 0.5, 0.6), 0.5, 0.6)
    (slope, intercept), covariance = np.polyfit(paired_x, paired_y, 1, cov=True)
    found = [line.slope, line.intercept, line.slope_error**2, line.intercept_error**2, line.r2, line.n]
    expected = [slope, intercept, *np.diag(covariance), np.corrcoef(paired_x, paired_y)[0, 1] ** 2, paired_x.size]
    worst = largest([*found, line.predict(0.4)], [*expected, intercept + 0.4 * slope], relative=True)
    yield _deviation("least-squares line and its errors", worst, 1e-10, "1", "numpy.polyfit")
    at = np.array([0.1, 0.9])
    own = np.sum((paired_y - intercept - slope * paired_x) ** 2) / (paired_x.size - 2)
    point = np.stack([at, np.ones(2)])
    of_mean = np.einsum("ik,ij,jk->k", point, covariance, point)
    half = stats.t.ppf(0.975, paired_x.size - 2) * np.sqrt([of_mean, of_mean + own])
    found = [line.confidence_interval(at), line.prediction_interval(at)]
    expected = [[intercept + slope * at - each, intercept + slope * at + each] for each in half]
    yield _deviation("intervals of a line", largest(found, expected), 1e-10, "1", "covariance of numpy.polyfit")


def _indices():
    nir, red = np.random.default_rng(0).uniform(0.01, 1, (2, 100))
    worst = largest(normalized_difference(nir, red), np.tanh(np.log(nir / red) / 2))
    yield _deviation("normalized difference", worst, 1e-12, "1", "tanh(log(nir / red) / 2)")


def _increments():
    """Check the relative noise by increments of the true variable, and error, squared error and coverage of a map."""
    y, x, _, _ = _pairs()
    sums = regression.increment_sums(x, y, 6, 0.05, 11, 0.5)
    count, mean, deviation = regression.increment_moments(sums)
    table = pd.DataFrame({"x": x.ravel(), "y": y.ravel()})
    groups = table[np.isfinite(table).all(axis=1)].groupby(lambda k: np.floor(table["x"][k] / 0.05))
    numbers = np.array([*groups.groups]).astype(int) - 6
    found = np.stack([count, mean, deviation, regression.equivalent_noise(deviation, 3.4, mean)])[:, numbers]
    of_x, of_y = groups["x"].mean(), groups["y"].std()
    worst = largest(found, [groups.size(), of_x, of_y, of_y / of_x / 3.4])
    of_index = sums.sum(axis=0).reshape(-1, 4)[numbers, 2]
    worst = np.maximum(worst, largest(of_index, groups["y"].sum() - 0.5 * groups.size()))
    yield _deviation("noise by increments", worst, 1e-11, "1", "groups of pandas")
    low, high = x - 0.1, x + 0.3
    error = (y - x)[np.isfinite(y - x)]
    inside = np.sum((x >= low) & (x <= high) & np.isfinite(y) & (np.abs(x - 0.5) < 0.2))
    covered = (x >= low) & (x <= high) & (np.abs(x - 0.5) < 0.2)
    group, no_rank = np.zeros(x.shape), np.full(x.shape, np.nan)
    sums = scores.grouped_sums(group, no_rank, y - x, covered.astype(float), groups=1, bins=1).sum(axis=0)
    worst = largest(sums[:4], [error.size, error.sum(), np.sum(error**2), inside])
    yield _deviation("errors of a map", worst, 1e-10, "1", "numpy, all at once")


def _lags():
    """Check the lag sums pair by pair, in two blocks with a margin between them."""
    cells = np.random.default_rng(11).normal(5, 1, (17, 13))
    cells[4:7, 3:5] = np.nan
    upper = scaling.lag_sums(cells[:12], ((0, 3), (0, 0)), (3, 3), 5.0)
    sums = upper + scaling.lag_sums(cells[9:], ((0, 0), (0, 0)), (3, 3), 5.0)
    found, expected = [], []
    for down, across in ((0, 0), (0, 1), (0, -3), (2, -1), (3, 3)):
        columns = slice(max(-across, 0), 13 - max(across, 0)), slice(max(across, 0), 13 + min(across, 0))
        one, two = cells[: 17 - down, columns[0]], cells[down:, columns[1]]
        there = np.isfinite(one + two)
        about = (one[there] - np.nanmean(cells)) * (two[there] - np.nanmean(cells))
        expected.append([there.sum(), about.mean(), np.mean((one[there] - two[there]) ** 2) / 2])
        maps = sums[0], scaling.covariance(sums), scaling.semivariance(sums)
        found.append([each[down, across + 3] for each in maps])
    yield _deviation("covariance and semivariance by lag", largest(found, expected), 1e-10, "1", "pairs, one by one")
    lag = 2 * np.arange(10.0)
    found = [scaling.crossing(lag, np.exp(-lag / 4)), scaling.crossing(lag, 1 - lag / 7)]
    worst = largest(found, [4 * np.log(20), 7 * 0.95])
    worst = worst if np.isnan(scaling.crossing(lag, 1 + 0 * lag)) else np.inf
    yield _deviation("practical range", worst, 1e-12, "cell", "exponential, line and constant")


def _footprint_variance():
    """Check the variance of a footprint by all pairs of its cells, for a covariance that decays in both directions."""
    axis = axis_operator(
        Boxcar(7.3), cell_origin=0, cell_size=1, n_cells=30, pixel_origin=2.2, pixel_size=7, n_pixels=1
    )
    weights = axis.weights[0, : axis.count[0]]
    products = scaling.weight_correlation(axis, 9)
    by_lag = np.exp(-np.abs(np.arange(-9, 10)) / 3) * np.exp(-np.arange(10)[:, None] / 2)
    place = np.arange(weights.size)
    apart = np.abs(place[:, None] - place)
    expected = (weights @ np.exp(-apart / 2) @ weights) * (weights @ np.exp(-apart / 3) @ weights)
    found = scaling.footprint_variance(by_lag, products, products)
    yield _deviation("variance that a footprint leaves", largest(found, expected), 1e-12, "1", "all pairs of its cells")


def _scales():
    """Check derivatives by differences, and the second-order bias for normal variables whose means are known."""
    red, nir, h = 0.08, 0.3, 1e-4
    steps = [(a, b) for a in ((h, 0.0), (0.0, h)) for b in ((h, 0.0), (0.0, h))]
    signs = ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))
    differences = [
        sum(k * normalized_difference(nir + s * a[1] + t * b[1], red + s * a[0] + t * b[0]) for s, t, k in signs)
        for a, b in steps
    ]
    worst = largest(scaling.ndvi_hessian(red, nir).ravel(), np.array(differences) / (4 * h * h))
    yield _deviation("second derivatives of NDVI", worst, 1e-4, "1", "differences")
    mean, deviation, extinction = 1.2, 0.05, 0.57
    exact = 0.94 * np.exp(-extinction * mean) * -np.expm1((extinction * deviation) ** 2 / 2)
    worst = largest(scaling.beer_bias(mean, deviation**2, extinction, 0.94), exact, relative=True)
    yield _deviation("FPAR lost by averaging LAI", worst, (extinction * deviation) ** 2 / 3, "1", "normal LAI, exactly")
    covariance = np.array([[2.0, 0.7], [0.7, 3.0]])
    worst = largest(scaling.second_order_bias([[2.0, 1.0], [1.0, -4.0]], covariance), 2.0 + 0.7 - 6.0)
    yield _deviation("bias of a form of second degree", worst, 1e-12, "1", "its mean, exactly")
    of_red, of_nir = np.random.default_rng(1).uniform(0.05, 0.5, (2, 500))
    expected = np.corrcoef(of_nir - of_red, 1 / (of_nir + of_red))[0, 1]
    worst = largest(scaling.linearity_correlation(np.append(of_red, np.nan), np.append(of_nir, 0.3)), expected)
    yield _deviation("linearity of NDVI", worst, 1e-12, "1", "numpy.corrcoef")


def _densities():
    """
    Check kernel densities, whose bandwidth is from quartiles for skewed values and from the deviation for even ones.
    """
    at, rng, found, expected = np.linspace(0, 3, 20), np.random.default_rng(4), [], []
    for kept in (np.exp(rng.normal(size=300)), rng.uniform(0, 3, 200)):
        spread = min(kept.std(ddof=1), stats.iqr(kept) / 1.34)
        factor = 0.9 * spread * kept.size**-0.2 / kept.std(ddof=1)
        expected.append(stats.gaussian_kde(kept, bw_method=factor)(at))
        found.append(scaling.sample_density(np.append(kept, np.nan), at))
    worst = largest(found, expected)
    yield _deviation("kernel density", worst, 1e-12, "1", "scipy.stats, bandwidth by the rule of thumb")


def _causes():
    """Check the shares of three causes by all orders, and the effects with and without each."""
    values = np.random.default_rng(3).normal(size=(2, 2, 2))
    expected = np.zeros(3)
    for order in permutations(range(3)):
        state = [0, 0, 0]
        for cause in order:
            before = values[tuple(state)]
            state[cause] = 1
            expected[cause] += (values[tuple(state)] - before) / 6
    yield _deviation("shares of three causes", largest(scaling.shapley(values, 3), expected), 1e-12, "1", "all orders")
    alone = [values[1, 0, 0], values[0, 1, 0], values[0, 0, 1]] - values[0, 0, 0]
    gone = values[1, 1, 1] - [values[0, 1, 1], values[1, 0, 1], values[1, 1, 0]]
    worst = largest([scaling.by_itself(values, 3), scaling.taken_away(values, 3)], [alone, gone])
    yield _deviation("a cause by itself, and taken away", worst, 1e-12, "1", "two of eight sets")


CHECKS = (_regression, _indices, _increments, _lags, _footprint_variance, _scales, _densities, _causes)
