"""Footprints that are turned against the grid of the ground: one sparse operator over both axes."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.sparse import csr_array

# A cell is cut until its pieces are this share of the narrower response.
_PIECE = 1 / 16

# Nodes of the tabulated responses.
_NODES = 4097


@dataclass(frozen=True, eq=False)
class Footprints:
    """
    Pixels on a grid of cells: where each lies, and what a step of one cell is in its own frame.

    Parameters
    ----------
    row, column : array, shape (..., n_pixels)
        Centre, counted from the upper left corner of the grid. [cell]
    frame : array, shape (..., n_pixels, 2, 2)
        A step of a row and of a column (last axis) along and across the track, as it would be at nadir: divided by the
        growth of the footprint. [m]
    along, across : line spread function
        At nadir, as `fifesim.base.footprints` takes them.
    """

    row: np.ndarray
    column: np.ndarray
    frame: np.ndarray
    along: object
    across: object

    def reach(self):
        """Half height and half width of the box around each footprint, each of shape (n_pixels,) [cell]."""
        back = np.linalg.inv(self.frame)
        half = np.array([self.along.half_width, self.across.half_width])
        # Pieces that touch the footprint from outside have a share, too.
        return np.moveaxis(np.abs(back) @ half, -1, 0) + 1

    def window(self, shape):
        """
        Cells that the footprints touch.

        Parameters
        ----------
        shape : (int, int)
            Of the grid.

        Returns
        -------
        rows, columns : slice
            At least one cell.
        """
        out = []
        for center, half, size in zip((self.row, self.column), self.reach(), shape, strict=True):
            first = int(np.clip(np.floor(np.min(center - half)), 0, size - 1))
            out.append(slice(first, int(np.clip(np.ceil(np.max(center + half)), first + 1, size))))
        return tuple(out)

    def __getitem__(self, pixels):
        """Footprints of some of the pixels, one after the other."""
        frame = self.frame[pixels].reshape(-1, 2, 2)
        return Footprints(self.row[pixels].ravel(), self.column[pixels].ravel(), frame, self.along, self.across)


def footprint_operator(footprints, rows, columns):
    r"""
    Weights of the cells of a window in turned footprints.

    .. math::

        w_{ij} \propto \sum_k \left[ C_{along}(u + \tfrac{a}{2}) - C_{along}(u - \tfrac{a}{2}) \right]
            \left[ C_{across}(v + \tfrac{b}{2}) - C_{across}(v - \tfrac{b}{2}) \right]

    over pieces k of cell j, which lie at u along and v across the track from the centre of pixel i. A piece stands for
    an upright rectangle of sides a and b with its own second moments; on a grid along the track that is exact.

    Parameters
    ----------
    footprints : Footprints
        On one axis.
    rows, columns : slice
        Window of the grid; what lies outside of it is lost.

    Returns
    -------
    operator : scipy.sparse.csr_array, shape (n_pixels, n_cells)
        Cells of the window row by row. A row sums to the share of the footprint that lies in the window.

    References
    ----------
    [Friedl1995]_, Eq. 3, the sensor's part

    Examples
    --------
    A footprint of 30 m turned by 45 degrees over cells of 5 m is whole:

    >>> from fifesim.base.footprints import Boxcar
    >>> turn = 5 * np.array([[[1, 1], [-1, 1]]]) / np.sqrt(2)
    >>> pixel = Footprints(np.array([10.0]), np.array([10.0]), turn, Boxcar(30.0), Boxcar(30.0))
    >>> round(float(footprint_operator(pixel, slice(0, 20), slice(0, 20)).sum()), 12)
    1.0
    """
    tables = [_table(spread) for spread in (footprints.along, footprints.across)]
    widths = [2 * half / (table.size - 1) / np.diff(table).max() for table, half in tables]
    step = np.sqrt(np.abs(np.linalg.det(footprints.frame)))
    pieces = np.clip(np.ceil(step / (_PIECE * min(widths))), 1, 64).astype(np.int64)
    half_row, half_column = footprints.reach()
    limit = np.sum((2 * half_row + 3).astype(np.int64) * (2 * half_column + 3).astype(np.int64))
    pointers = np.zeros(footprints.row.size + 1, np.int64)
    indices, weights = np.empty(limit, np.int64), np.empty(limit)
    window = np.array([rows.start, rows.stop, columns.start, columns.stop])
    used = _fill(
        footprints.row, footprints.column, footprints.frame, half_row, half_column, pieces,
        *tables[0], *tables[1], window, pointers, indices, weights,
    )  # fmt: skip
    shape = footprints.row.size, (rows.stop - rows.start) * (columns.stop - columns.start)
    return csr_array((weights[:used].copy(), indices[:used].copy(), pointers), shape=shape)


def apply_operator(operator, values, min_valid):
    """
    Means over footprints, each over its valid cells.

    Parameters
    ----------
    operator : scipy.sparse.csr_array, shape (n_pixels, n_cells)
        From `footprint_operator`.
    values : array, shape (..., n_cells)
        NaN where they are missing.
    min_valid : float
        Smallest share of the footprint that valid cells must hold. [1]

    Returns
    -------
    means : array, shape (..., n_pixels)
        NaN below ``min_valid``.
    """
    values = np.asarray(values, float)
    flat = values.reshape(-1, values.shape[-1])
    out = np.empty((flat.shape[0], operator.shape[0]))
    for layer, cells in enumerate(flat):
        valid = ~np.isnan(cells)
        share = operator @ valid.astype(float)
        total = operator @ np.where(valid, cells, 0.0)
        enough = (share > 0) & (share >= min_valid - 1e-9)
        out[layer] = np.where(enough, total / np.where(enough, share, 1.0), np.nan)
    return out.reshape(*values.shape[:-1], operator.shape[0])


def _table(spread):
    """Cumulative line spread function at even nodes, and the half width that they span."""
    return spread.cumulative(np.linspace(-spread.half_width, spread.half_width, _NODES)), spread.half_width


@njit(nogil=True, cache=True)
def _cumulative(table, half, scale, x):
    place = min(max((x + half) * scale, 0.0), table.size - 1.0)
    index = min(int(place), table.size - 2)
    share = place - index
    return table[index] * (1 - share) + table[index + 1] * share


@njit(nogil=True, cache=True)
def _share(table, half, scale, x, reach):
    return _cumulative(table, half, scale, x + reach) - _cumulative(table, half, scale, x - reach)


@njit(nogil=True, cache=True)
def _fill(
    row, column, frame, half_row, half_column, pieces, along, along_half, across, across_half, window, pointers,
    indices, weights,
):  # fmt: skip
    used = 0
    width = window[3] - window[2]
    # Nodes of the tables a metre.
    s, t = (along.size - 1) / (2 * along_half), (across.size - 1) / (2 * across_half)
    for pixel in range(row.size):
        start, total = used, 0.0
        n = pieces[pixel]
        piece = 1.0 / n
        a = np.hypot(frame[pixel, 0, 0], frame[pixel, 0, 1]) / (2 * n)
        b = np.hypot(frame[pixel, 1, 0], frame[pixel, 1, 1]) / (2 * n)
        for i in range(int(np.floor(row[pixel] - half_row[pixel])), int(np.ceil(row[pixel] + half_row[pixel]))):
            for j in range(
                int(np.floor(column[pixel] - half_column[pixel])), int(np.ceil(column[pixel] + half_column[pixel]))
            ):
                # Most cells of the box lie beyond the footprint's turned sides.
                down, right = i + 0.5 - row[pixel], j + 0.5 - column[pixel]
                u = frame[pixel, 0, 0] * down + frame[pixel, 0, 1] * right
                v = frame[pixel, 1, 0] * down + frame[pixel, 1, 1] * right
                if abs(u) > along_half + 2 * n * a or abs(v) > across_half + 2 * n * b:
                    continue
                weight = 0.0
                for k in range(n):
                    down = i + (k + 0.5) * piece - row[pixel]
                    for m in range(n):
                        right = j + (m + 0.5) * piece - column[pixel]
                        u = frame[pixel, 0, 0] * down + frame[pixel, 0, 1] * right
                        v = frame[pixel, 1, 0] * down + frame[pixel, 1, 1] * right
                        if abs(u) < along_half + a and abs(v) < across_half + b:
                            weight += _share(along, along_half, s, u, a) * _share(across, across_half, t, v, b)
                total += weight
                if weight != 0 and window[0] <= i < window[1] and window[2] <= j < window[3]:
                    indices[used] = (i - window[0]) * width + j - window[2]
                    weights[used] = weight
                    used += 1
        for k in range(start, used):
            weights[k] /= total
        pointers[pixel + 1] = used
    return used
