"""Sums by lag beside brute force, and the variance that a footprint leaves of a process."""

import numpy as np
import pytest

from fifesim.analysis import scaling as kernels
from fifesim.base import footprints
from fifesim.base import line_spread as spreads
from fifesim.ground.landscape import autoregression

CELL = 30 / 9
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
    sums = kernels.lag_sums(cells, ((0, 0), (0, 0)), (3, 3), origin=5.0)
    # About the mean, from which the origin was taken.
    found = [array[lag[0], lag[1] + 3] for array in (sums[0], kernels.covariance(sums), kernels.semivariance(sums))]
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
    products = kernels.weight_correlation(axis, 8)
    variance = kernels.footprint_variance(exact_covariance(arp, 8), products, products)
    u = 2 * np.pi * np.fft.fftfreq(1024)
    transfer = np.abs(np.exp(1j * np.outer(u, np.arange(9))).mean(axis=1)) ** 2
    spectrum = autoregression.response(arp, u[:, None], u[None, :]) ** 2
    assert variance == pytest.approx(np.sum(spectrum * np.outer(transfer, transfer)) / spectrum.sum(), rel=1e-10)


def operator(lsf, pixel=9.0):
    return footprints.axis_operator(
        lsf, cell_origin=0.0, cell_size=1.0, n_cells=90, pixel_origin=0.0, pixel_size=pixel, n_pixels=int(90 / pixel)
    )


def test_products_of_weights_are_even_and_sum_to_one():
    """Also of pixels that cut cells, where each has other weights."""
    products = kernels.weight_correlation(operator(spreads.Boxcar(7.3), 7.3), 12)
    np.testing.assert_allclose(products, products[::-1], atol=1e-15)
    assert products.sum() == pytest.approx(1, rel=1e-12)


def test_correlation_that_stays_up_has_no_range():
    assert np.isnan(kernels.crossing(np.arange(3.0), np.array([1.0, 0.9, 0.8])))
    assert kernels.crossing(np.arange(3.0), np.array([1.0, 0.55, -0.45])) == pytest.approx(1.5)


def test_covariance_of_a_wave_is_a_cosine():
    """Of whole periods, about their mean of zero: half of the squared amplitude times the cosine of the lag."""
    wave = np.broadcast_to(np.sin(2 * np.pi * np.arange(64) / 16), (3, 64))
    sums = kernels.lag_sums(np.concatenate([wave, wave[:, :8]], axis=1), ((0, 0), (0, 8)), (0, 8))
    found = kernels.covariance(sums)[0, 8:]
    np.testing.assert_allclose(found, np.cos(2 * np.pi * np.arange(9) / 16) / 2, rtol=0, atol=1e-12)


def test_weights_of_a_pixel_that_overhangs_do_not_count():
    """Two of three pixels of four cells are whole: a triangle."""
    axis = footprints.axis_operator(
        spreads.Boxcar(4), cell_origin=0, cell_size=1, n_cells=10, pixel_origin=-2, pixel_size=4, n_pixels=3
    )
    triangle = np.maximum(4 - np.abs(np.arange(-5, 6)), 0) / 16
    np.testing.assert_allclose(kernels.weight_correlation(axis, 5), triangle, atol=1e-15)
