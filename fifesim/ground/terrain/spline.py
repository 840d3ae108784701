r"""
Elevation onto finer cells by quintic B-splines: smooth to the fourth derivative, free of the source's facets.

A spline that interpolates a lattice recovers a surface whose wavelengths are above five lattice cells within 1e-3 of
its amplitude, and a plane exactly. What it gives at a point depends on lattice values d cells away as
:math:`0.431^d`, so that a margin of `MARGIN` cells makes it a local operation.
"""

import numba
import numpy as np
from scipy import ndimage

from fifesim.base.lattice import assemble

# Quintic: a wave of five cells is recovered within 5e-4 of its amplitude, by degree 3 within 3e-3. The larger pole of
# the prefilter is -0.4306.
DEGREE = 5
MARGIN = 32

# Lattice cells around positions that hold all that a spline there is made of, and more.
REACH = 8


def spline_coefficients(values):
    """
    Coefficients of the quintic B-spline that interpolates a lattice.

    Parameters
    ----------
    values : array, shape (rows, columns)
        Without NaN. Mirrored at the borders, which tells within `MARGIN` cells of them.

    Returns
    -------
    coefficients : array, shape (rows, columns)
    """
    return ndimage.spline_filter(values, order=DEGREE, output=np.float64, mode="mirror")


@numba.njit(nogil=True, cache=True)
def _weights(share, out):
    """The six quintic B-splines that are not zero at a share of a cell past the third of their lattice points."""
    t = share
    s = 1.0 - t
    out[0] = s**5 / 120.0
    out[5] = t**5 / 120.0
    out[1] = (26.0 + t * (-50.0 + t * (20.0 + t * (20.0 + t * (-20.0 + 5.0 * t))))) / 120.0
    out[4] = (26.0 + s * (-50.0 + s * (20.0 + s * (20.0 + s * (-20.0 + 5.0 * s))))) / 120.0
    out[2] = (66.0 + t * t * (-60.0 + t * t * (30.0 - 10.0 * t))) / 120.0
    out[3] = (66.0 + s * s * (-60.0 + s * s * (30.0 - 10.0 * s))) / 120.0


@numba.njit(nogil=True, cache=True)
def spline_grid(coefficients, rows, columns):
    """
    Values of a spline on a grid that is parallel to its lattice.

    Parameters
    ----------
    coefficients : array, shape (m, n)
    rows, columns : array, shape (rows,), (columns,)
        Positions, at least two lattice cells inside; 0 is the centre of the first cell. [cell]

    Returns
    -------
    values : array, shape (rows, columns)
    """
    across = np.empty((coefficients.shape[0], columns.size))
    weights = np.empty((columns.size, 6))
    first = np.empty(columns.size, np.int64)
    for j in range(columns.size):
        first[j] = int(np.floor(columns[j])) - 2
        _weights(columns[j] - np.floor(columns[j]), weights[j])
    for i in range(coefficients.shape[0]):
        for j in range(columns.size):
            c, w = coefficients[i, first[j] : first[j] + 6], weights[j]
            across[i, j] = w[0] * c[0] + w[1] * c[1] + w[2] * c[2] + w[3] * c[3] + w[4] * c[4] + w[5] * c[5]
    out = np.empty((rows.size, columns.size))
    w = np.empty(6)
    for i in range(rows.size):
        top = int(np.floor(rows[i])) - 2
        _weights(rows[i] - np.floor(rows[i]), w)
        a, b, c = across[top], across[top + 1], across[top + 2]
        d, e, f = across[top + 3], across[top + 4], across[top + 5]
        u, v, x, y, z, q = w[0], w[1], w[2], w[3], w[4], w[5]
        for j in range(columns.size):
            out[i, j] = u * a[j] + v * b[j] + x * c[j] + y * d[j] + z * e[j] + q * f[j]
    return out


@numba.njit(nogil=True, cache=True)
def spline_points(coefficients, rows, columns):
    """
    Values of a spline at points.

    Parameters
    ----------
    coefficients : array, shape (m, n)
    rows, columns : array, shape (y, x)
        Positions, at least two lattice cells inside; 0 is the centre of the first cell. [cell]

    Returns
    -------
    values : array, shape (y, x)
    """
    out = np.empty(rows.shape)
    down, across = np.empty(6), np.empty(6)
    for i in range(rows.shape[0]):
        for j in range(rows.shape[1]):
            row, column = np.floor(rows[i, j]), np.floor(columns[i, j])
            _weights(rows[i, j] - row, down)
            _weights(columns[i, j] - column, across)
            total = 0.0
            for k in range(6):
                line = 0.0
                for m in range(6):
                    line += across[m] * coefficients[int(row) - 2 + k, int(column) - 2 + m]
                total += down[k] * line
            out[i, j] = total
    return out


def spline_of_tiles(make_tile, tile, rows, columns):
    """
    Values on a grid of a spline without end, whose coefficients are made in fixed tiles of its lattice.

    Parameters
    ----------
    make_tile, tile
        As `fifesim.base.lattice.assemble` takes them.
    rows, columns : array, shape (rows,), (columns,)
        Rising positions on the lattice. [lattice cell]

    Returns
    -------
    values : array, shape (rows, columns)
        The same in every window, if whole cells come off the positions without rounding.
    """
    row, column = int(np.floor(rows[0])) - REACH, int(np.floor(columns[0])) - REACH
    shape = int(np.floor(rows[-1])) + REACH - row, int(np.floor(columns[-1])) + REACH - column
    return spline_grid(assemble(make_tile, tile, row, column, shape), rows - row, columns - column)
