"""What comes of all cells of a raster, to the bit the same whatever its chunks."""

from functools import reduce

import dask
import numpy as np

from fifesim.rasters.chunks import Reads, in_blocks

# Of the blocks of whole rows. [cell]
_CELLS = 2**22


def computed(*arrays):
    """
    Arrays in memory; what they have in common is computed once.

    Parameters
    ----------
    *arrays : xarray.DataArray, numpy.ndarray or dask.array.Array

    Returns
    -------
    arrays : tuple
    """
    return dask.compute(*arrays)


def extremes(array):
    """
    Smallest and largest value of a raster; computes.

    Parameters
    ----------
    array : xarray.DataArray
        NaN is left out.

    Returns
    -------
    low, high : float
    """
    low, high = computed(array.min(), array.max())
    return float(low), float(high)


def sums_by_row(kernel, *arrays, count, **parameters):
    """
    Sums of whole rows; computes.

    Parameters
    ----------
    kernel : callable
        ``kernel(*blocks, **parameters)`` gives ``count`` sums of each row of float arrays of shape (rows, columns).
    *arrays : xarray.DataArray, dims (y, x)
        Of one shape.
    count : int
    **parameters
        Passed to the kernel.

    Returns
    -------
    sums : array, shape (rows, count)
    """
    height, width = arrays[0].shape
    row = np.arange(height)
    # The result has a column, and each of its rows reads a whole one.
    reads = [Reads(array.data, (row, row + 1), ([0], [width])) for array in arrays]

    def sums(rows, columns, *blocks):
        return kernel(*(np.ascontiguousarray(block, float) for block in blocks), **parameters).T[..., None]

    (found,) = computed(in_blocks(sums, reads, (count, height, 1), max(_CELLS // width, 1)))
    return found[..., 0].T


def sums_by_block(kernel, array, shape, size, margin=(0, 0)):
    """
    Sum of what a kernel makes of the blocks of an array, one after the other; computes.

    Parameters
    ----------
    kernel : callable
        ``kernel(cells, margin)`` gives an array of this shape from a block with what there is of its margin, and how
        many cells that is, before and after it along each axis: ``((int, int), (int, int))``.
    array : numpy.ndarray or dask.array.Array, shape (..., y, x)
    shape : tuple of int
        Of the sum.
    size : int
        Rows and columns of a block, counted from the first cell.
    margin : (int, int), optional
        Down and across. [cell]

    Returns
    -------
    sums : array
    """
    (height, width), (down, across) = array.shape[-2:], margin

    def around(first, length, reach):
        return min(first, reach), max(min(length - first - size, reach), 0)

    def sums(row, column, cells):
        margins = around(row.start * size, height, down), around(column.start * size, width, across)
        return kernel(cells, margins)[..., None, None]

    def edges(length, reach):
        first = np.arange(0, length, size)
        return np.maximum(first - reach, 0), np.minimum(first + size + reach, length)

    rows, columns = edges(height, down), edges(width, across)
    # A result whose every cell is a block.
    shape = (*shape, len(rows[0]), len(columns[0]))
    (found,) = computed(in_blocks(sums, [Reads(array, rows, columns)], shape, 1))
    # One after the other: numpy's own sum goes by the layout in memory.
    return reduce(np.add, np.moveaxis(found.reshape(*shape[:-2], -1), -1, 0))
