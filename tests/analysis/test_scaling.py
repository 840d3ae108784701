"""Scale invariance against closed forms and quadrature."""

import numpy as np
import pytest

from fifesim.analysis import scaling
from fifesim.analysis.indices import normalized_difference


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
    assert (
        np.isnan(scaling.linearity_correlation(red, 0.4 - red))
        or abs(scaling.linearity_correlation(red, 0.4 - red)) < 1e-6
    )
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
