"""Going through a raster twice: what all of it gives, band by band, and then its cells once more."""

import dask
import dask.array as da
import numpy as np
import pytest
import xarray as xr
from lazy import ODD_CHUNKS, in_chunks, no_compute

from fifesim.grids import chunks

VALUES = np.random.default_rng(2).random((3, 20, 30))


def total(rows, columns, block):
    """Sum of all cells of a band, on every cell of the result."""
    return np.broadcast_to(block.sum(axis=(-2, -1), keepdims=True), (*block.shape[:-2], 4, 5))


@pytest.mark.parametrize("pieces", [ODD_CHUNKS, ODD_CHUNKS | {"band": 1}, ODD_CHUNKS | {"band": 2}])
def test_every_cell_reads_the_whole_of_its_band(pieces):
    lazy = in_chunks(xr.DataArray(VALUES, dims=("band", "y", "x")), pieces).data
    with no_compute():
        found = chunks.windows_by_band([total] * 3, [chunks.whole_reads(lazy, (4, 5))], (1, 1, 1), (4, 5), ((4,), (5,)))
    assert found.chunks == ((1, 1, 1), (4,), (5,))
    at_once = chunks.windows_by_band([total] * 3, [chunks.whole_reads(VALUES, (4, 5))], (1, 1, 1), (4, 5))
    np.testing.assert_array_equal(found, at_once)
    np.testing.assert_array_equal(at_once[:, 0, 0], VALUES.sum(axis=(1, 2)))


def test_each_group_of_bands_has_its_kernel():
    kernels = [lambda rows, columns, block, factor=factor: factor * block for factor in (1, -1)]
    place = np.arange(20), np.arange(30)
    reads = [chunks.Reads(VALUES, *((at, at + 1) for at in place))]
    found = chunks.windows_by_band(kernels, reads, (1, 2), (20, 30))
    np.testing.assert_array_equal(found, VALUES * np.array([1, -1, -1])[:, None, None])


def test_second_pass_begins_when_the_first_is_over():
    """The one is made of all chunks; without a barrier, each of these would be held until then."""
    order = []

    def made(block_info=None):
        order.append(block_info[None]["chunk-location"])
        return np.ones((10, 10))

    source = xr.DataArray(da.map_blocks(made, chunks=((10, 10), (10,)), dtype=float), dims=("y", "x"))
    mean = source.data.mean()
    again = chunks.second_pass(source, mean)
    with dask.config.set(scheduler="sync"):
        np.testing.assert_array_equal((again - mean).compute(), np.zeros((20, 10)))
    assert sorted(order[:2]) == sorted(order[2:]) == [(0, 0), (1, 0)]


def test_what_lies_in_memory_is_not_made_again():
    array = xr.DataArray(VALUES, dims=("band", "y", "x"))
    assert chunks.second_pass(array, VALUES) is array
