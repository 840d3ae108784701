"""Rasters that are gone through twice: what all cells together give of each band, and then each cell with that."""

import dask.array as da
import numpy as np
from dask.graph_manipulation import bind

from fifesim.rasters.chunks import Reads, windows
from fifesim.rasters.windows import slices


def whole_reads(array, shape):
    """
    Reads of a whole array by every cell of a result.

    Parameters
    ----------
    array : numpy.ndarray or dask.array.Array, shape (..., y, x)
    shape : (int, int)
        Of the result over y and x.

    Returns
    -------
    reads : fifesim.rasters.chunks.Reads
    """
    rows, columns = ((np.zeros(size, int), np.full(size, n)) for size, n in zip(shape, array.shape[-2:], strict=True))
    return Reads(array, rows, columns)


def windows_by_band(kernels, reads, bands, shape, chunks=None):
    """
    Array made from windows of others as by `chunks.windows`, a group of bands after the other.

    Parameters
    ----------
    kernels : sequence of callable
        One for each group of bands.
    reads : sequence of Reads
        Of arrays whose first axis is the band.
    bands : sequence of int
        Number of bands in each group.
    shape : (..., int, int)
        Of the result for one band.
    chunks : (tuple of int, tuple of int), optional
        Of a lazy result over y and x. Without them all is made at once.

    Returns
    -------
    array : numpy.ndarray or dask.array.Array, shape (band, ...)
        Its chunks along the first axis are the groups.
    """
    parts = []
    for kernel, group in zip(kernels, slices(bands), strict=True):
        of_group = [each._replace(array=each.array[group]) for each in reads]
        parts.append(windows(kernel, of_group, (group.stop - group.start, *shape), chunks))
    if chunks is not None:
        return da.concatenate(parts)
    return np.concatenate(parts) if len(parts) > 1 else parts[0]


def second_pass(array, first):
    """
    The same raster, made afresh once what a first pass over it gives is known.

    Parameters
    ----------
    array : xarray.DataArray
    first : numpy.ndarray or dask.array.Array
        Made of it.

    Returns
    -------
    array : xarray.DataArray
        As it is where it lies in memory. A lazy one is computed twice: holding it until its first cell can be used
        would take the memory of the whole scene.
    """
    if array.chunks is None:
        return array
    return array.copy(data=bind(array.data, first, seed=first.name))
