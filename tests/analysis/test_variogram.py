"""Variograms beside brute force and the exact covariance of the autoregressive process."""

import numpy as np
import pytest
import xarray as xr
from lazy import CHUNKS, ODD_CHUNKS, in_chunks

import fifesim
from fifesim.analysis import variogram as kernels
from fifesim.analysis.rasters import lags as variogram_raster
from fifesim.base import footprints
from fifesim.base import line_spread as spreads
from fifesim.ground.landscape import autoregression
from fifesim.ground.landscape.field import streaming_field

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


def test_blocks_add_up_to_the_whole(monkeypatch, lai_with_hole):
    whole = fifesim.autocovariance(lai_with_hole, 30.0)
    monkeypatch.setattr(variogram_raster, "_BLOCK", 16)
    parts = fifesim.autocovariance(lai_with_hole, 30.0)
    np.testing.assert_array_equal(parts["count"], whole["count"])
    np.testing.assert_allclose(parts["covariance"], whole["covariance"], atol=1e-13)
    np.testing.assert_allclose(parts["semivariance"], whole["semivariance"], atol=1e-13)


def test_chunks_change_no_bit(monkeypatch, lai_with_hole):
    monkeypatch.setattr(variogram_raster, "_BLOCK", 16)
    whole = fifesim.variogram(lai_with_hole, 40.0)
    for chunks in (CHUNKS, ODD_CHUNKS):
        xr.testing.assert_identical(fifesim.variogram(in_chunks(lai_with_hole, chunks), 40.0), whole)


@pytest.fixture(scope="module")
def gaussian():
    """An autoregressive field of unit variance at arp 0.24, whose covariance is known: 1.4 km square."""
    grid = fifesim.fife_site(CELL, window=((0, 420), (0, 420)))
    lai = fifesim.lai_scene(grid, arp=0.24, seed=5)
    return lai.copy(data=streaming_field(5, 0.24, 0, 0, (420, 420)))


def test_variogram_of_the_autoregressive_field_is_the_analytic_one(gaussian):
    """
    Correlation and practical range within the sampling error.

    Covariances of a field are uncertain by about sqrt(2 integral scale / cells): the squared correlation adds up to 60
    cells over all lags here, so sqrt(2 x 60 / 176400) = 0.026; four of it.
    """
    found = fifesim.variogram(gaussian, 40.0)
    expected = autoregression.autocorrelation(0.24, np.arange(found.sizes["lag"]))
    np.testing.assert_allclose(found["correlation"], np.broadcast_to(expected, (2, expected.size)), atol=0.1)
    assert found.attrs["variance"] == pytest.approx(1, abs=0.1)
    np.testing.assert_allclose(found["practical_range"], autoregression.correlation_length(0.24, CELL), rtol=0.25)
    np.testing.assert_allclose(found["semivariance"], found.attrs["variance"] * (1 - found["correlation"]), atol=0.03)


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


@pytest.mark.parametrize("lsf", [None, fifesim.instrument("TM").line_spread])
def test_predicted_variance_is_the_simulated_one(gaussian, lsf):
    """The covariance is that of the same scene, so that only its borders differ: 46 pixels along an edge, 2 %."""
    found = fifesim.regularized_variance(gaussian, 30.0, lsf)
    assert float(found["predicted"]) == pytest.approx(float(found["simulated"]), rel=0.05)
    assert float(found["predicted"]) < 0.5 * float(found["cells"])
    assert float(found["cells"]) == pytest.approx(float(gaussian.var()), rel=1e-10)


def test_reach_out_of_the_raster_is_refused(lai):
    with pytest.raises(ValueError, match=r"at most half of the raster \(75 m\), got 100 m"):
        fifesim.autocovariance(lai, 100.0)
    with pytest.raises(ValueError, match="at least a cell"):
        fifesim.autocovariance(lai, 1.0)


def test_empty_raster_is_refused(lai):
    with pytest.raises(ValueError, match="no valid cells"):
        fifesim.autocovariance(lai * np.nan, 30.0)


def test_correlation_that_stays_up_has_no_range():
    assert np.isnan(kernels.crossing(np.arange(3.0), np.array([1.0, 0.9, 0.8])))
    assert kernels.crossing(np.arange(3.0), np.array([1.0, 0.55, -0.45])) == pytest.approx(1.5)


def test_values_that_do_not_vary_have_no_correlation(lai):
    with pytest.raises(ValueError, match="needs values that vary"):
        fifesim.variogram(lai * 0 + 0.3, 20)
