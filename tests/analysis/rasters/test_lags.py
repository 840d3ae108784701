"""Variograms of rasters: blocks, chunks, and the exact covariance of the autoregressive process."""

import numpy as np
import pytest
import xarray as xr
from lazy import CHUNKS, ODD_CHUNKS, in_chunks

import fifesim
from fifesim.analysis import scaling_labels as variogram_raster
from fifesim.ground.landscape import autoregression
from fifesim.ground.landscape.autoregression import streaming_field

CELL = 30 / 9


def test_blocks_add_up_to_the_whole(monkeypatch, lai_with_hole):
    whole = fifesim.autocovariance(lai_with_hole, 30.0)
    monkeypatch.setattr(variogram_raster, "_LAG_BLOCK", 16)
    parts = fifesim.autocovariance(lai_with_hole, 30.0)
    np.testing.assert_array_equal(parts["count"], whole["count"])
    np.testing.assert_allclose(parts["covariance"], whole["covariance"], atol=1e-13)
    np.testing.assert_allclose(parts["semivariance"], whole["semivariance"], atol=1e-13)


def test_chunks_change_no_bit(monkeypatch, lai_with_hole):
    monkeypatch.setattr(variogram_raster, "_LAG_BLOCK", 16)
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


def test_values_that_do_not_vary_have_no_covariance(lai):
    """They are no missing ones."""
    found = fifesim.autocovariance(lai * 0 + 0.25, 30.0)
    assert int(found["count"].max()) == lai.size
    np.testing.assert_allclose(found["covariance"], 0, atol=1e-15)
    np.testing.assert_allclose(found["semivariance"], 0, atol=1e-15)


def test_values_that_do_not_vary_have_no_correlation(lai):
    with pytest.raises(ValueError, match="needs values that vary"):
        fifesim.variogram(lai * 0 + 0.3, 20)
