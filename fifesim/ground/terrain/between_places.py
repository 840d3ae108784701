"""Values between the rows and columns of a coarser raster."""

import numpy as np
from numba import njit


def bilinear(layer, rows, columns):
    """
    Values of cells that lie between places.

    Parameters
    ----------
    layer : array, shape (y, x)
        Values at the places.
    rows, columns : (array of int, array)
        Of each row and each column of cells: the place before it, and the share of that after it. [1]

    Returns
    -------
    values : array, shape (rows, columns)
        Past the last place those of this one.

    Examples
    --------
    >>> bilinear(np.array([[0.0, 4.0]]), (np.array([0]), np.array([0.0])), (np.array([0, 0]), np.array([0.0, 0.25])))
    array([[0., 1.]])
    """
    (row, down), (column, across) = rows, columns
    out = np.empty((row.size, column.size))
    _bilinear(np.asarray(layer, float), row, down, column, across, out)
    return out


@njit(nogil=True, cache=True)
def _bilinear(layer, row, down, column, across, out):
    line = np.empty(layer.shape[1])
    last = layer.shape[0] - 1, layer.shape[1] - 1
    for i in range(row.size):
        one, other = row[i], min(row[i] + 1, last[0])
        share = down[i]
        for k in range(line.size):
            line[k] = layer[one, k] * (1 - share) + layer[other, k] * share
        for j in range(column.size):
            before = column[j]
            out[i, j] = line[before] * (1 - across[j]) + line[min(before + 1, last[1])] * across[j]
