"""True means of labelled rasters over blocks."""

import numpy as np
import pytest
import xarray as xr
from lazy import ODD_CHUNKS, check_place, check_raster_function, in_chunks, no_compute

import fifesim
from fifesim.grids import grid as grids

CELL = 30 / 9


def test_aggregate_is_the_mean_of_blocks(lai):
    """Cells of 30/9 m: 81 in a pixel, no cell cut."""
    truth = check_raster_function(lambda lai: fifesim.aggregate(lai, 30.0), lai, quantity="lai")
    expected = lai.values.reshape(5, 9, 6, 9).mean(axis=(1, 3))
    np.testing.assert_allclose(truth, expected, rtol=1e-14)
    assert grids.same_grid(grids.geobox(truth), grids.aligned_grid(grids.geobox(lai), 30.0))


def test_mean_of_the_scene_is_the_mean_of_its_aggregates(lai):
    assert float(fifesim.aggregate(lai, 30.0).mean()) == pytest.approx(float(lai.mean()), rel=1e-14)


def test_blocks_that_cut_cells_share_them(lai):
    """Brute force: every cell split into a hundred parts."""
    truth = fifesim.aggregate(lai, 25.0)
    parts = np.repeat(np.repeat(lai.values, 10, axis=0), 10, axis=1)
    expected = parts[: 5 * 75, : 7 * 75].reshape(5, 75, 7, 75).mean(axis=(1, 3))
    np.testing.assert_allclose(truth[:5, :7], expected, rtol=1e-12)


def test_block_with_too_few_valid_cells_is_missing(lai):
    lai[0:9, 0:2] = np.nan
    lai[9, 9] = np.nan
    truth = fifesim.aggregate(lai, 30.0)
    assert np.isnan(truth[0, 0]) and int(np.isnan(truth).sum()) == 1
    block = lai.values[9:18, 9:18]
    assert float(truth[1, 1]) == pytest.approx(np.nanmean(block), rel=1e-14)
    assert np.isfinite(fifesim.aggregate(lai, 30.0, min_valid=0.5)).all()


def test_blocks_may_be_weighted_by_a_line_spread(lai):
    """A matrix of the instrument's weights for each axis, without the package's operators."""
    lsf = fifesim.instrument("TM", response="paper").line_spread
    weights = [
        [[lsf.cumulative(CELL * (j + 1) - 30 * (i + 0.5)) - lsf.cumulative(CELL * j - 30 * (i + 0.5)) for j in range(n)]
         for i in range(n // 9)]
        for n in lai.shape
    ]  # fmt: skip
    rows, columns = (np.array(each) / np.sum(each, axis=1, keepdims=True) for each in weights)
    found = fifesim.aggregate(lai, 30.0, lsf=lsf)
    np.testing.assert_allclose(found, rows @ lai.values @ columns.T, rtol=1e-12)


def test_block_larger_than_the_scene_is_refused(lai):
    with pytest.raises(ValueError, match="no pixel of 500 x 500 m fits"):
        fifesim.aggregate(lai, 500.0)


def test_aggregates_of_bands_keep_them(lai):
    bands = (lai * xr.DataArray(np.linspace(0.1, 0.6, 4), dims="band")).transpose("band", "y", "x")
    cube = grids.place(bands, grids.geobox(lai))
    with no_compute():
        truth = fifesim.aggregate(in_chunks(cube, ODD_CHUNKS), 30.0)
    assert truth.sizes == {"band": 4, "y": 5, "x": 6}
    check_place(truth, grids.geobox(lai).crs)
    np.testing.assert_array_equal(truth.isel(band=1), fifesim.aggregate(cube.isel(band=1), 30.0))


def test_a_block_is_a_size_in_metres(lai):
    with pytest.raises(TypeError, match=r"^pixel must be a size in metres, such as 30\.0, got GeoBox"):
        fifesim.aggregate(lai, grids.geobox(lai))
