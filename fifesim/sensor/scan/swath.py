"""Footprints that are turned against the grid of the ground: one sparse operator over both axes."""

from dataclasses import dataclass
from typing import NamedTuple

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
        half_row, half_column = self.reach()
        return _touched(self.row, half_row, shape[0]), _touched(self.column, half_column, shape[1])

    def __getitem__(self, pixels):
        """Footprints of some of the pixels, one after the other."""
        frame = self.frame[pixels].reshape(-1, 2, 2)
        return Footprints(self.row[pixels].ravel(), self.column[pixels].ravel(), frame, self.along, self.across)


def footprint_operator(footprints, rows, columns):
    r"""
    Weights of the cells of a window in turned footprints.

    .. math::

        w_{ij} \propto \sum_k
            &\left[ C_\mathrm{along}(u + \tfrac{a}{2}) - C_\mathrm{along}(u - \tfrac{a}{2}) \right] \\
            \cdot &\left[ C_\mathrm{across}(v + \tfrac{b}{2}) - C_\mathrm{across}(v - \tfrac{b}{2}) \right]

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

    >>> from fifesim.base.line_spread import Boxcar
    >>> turn = 5 * np.array([[[1, 1], [-1, 1]]]) / np.sqrt(2)
    >>> pixel = Footprints(np.array([10.0]), np.array([10.0]), turn, Boxcar(30.0), Boxcar(30.0))
    >>> round(float(footprint_operator(pixel, slice(0, 20), slice(0, 20)).sum()), 12)
    1.0
    """
    along, across = _table(footprints.along), _table(footprints.across)
    step = np.sqrt(np.abs(np.linalg.det(footprints.frame)))
    pieces = np.clip(np.ceil(step / (_PIECE * min(along.width, across.width))), 1, 64).astype(np.int64)
    half_row, half_column = footprints.reach()
    boxes = footprints.row, footprints.column, footprints.frame, half_row, half_column, pieces
    limit = np.sum((2 * half_row + 3).astype(np.int64) * (2 * half_column + 3).astype(np.int64))
    pointers = np.zeros(footprints.row.size + 1, np.int64)
    indices, weights = np.empty(limit, np.int64), np.empty(limit)
    window = np.array([rows.start, rows.stop, columns.start, columns.stop])
    used = _fill(boxes, along, across, window, pointers, indices, weights)
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


def _touched(center, half, size):
    """Cells of an axis from the first to the last that boxes touch."""
    first = int(np.clip(np.floor(np.min(center - half)), 0, size - 1))
    return slice(first, int(np.clip(np.ceil(np.max(center + half)), first + 1, size)))


class _Table(NamedTuple):
    """Cumulative line spread function at even nodes, the half width that they span, and their number a metre."""

    cumulative: np.ndarray
    half: float
    scale: float

    @property
    def width(self):
        """Of a boxcar as high as the response at its highest. [m]"""
        return 2 * self.half / (self.cumulative.size - 1) / np.diff(self.cumulative).max()


def _table(spread):
    half = spread.half_width
    return _Table(spread.cumulative(np.linspace(-half, half, _NODES)), half, (_NODES - 1) / (2 * half))


@njit(nogil=True, cache=True)
def _cumulative(table, x):
    place = min(max((x + table.half) * table.scale, 0.0), table.cumulative.size - 1.0)
    index = min(int(place), table.cumulative.size - 2)
    share = place - index
    return table.cumulative[index] * (1 - share) + table.cumulative[index + 1] * share


@njit(nogil=True, cache=True)
def _share(table, x, reach):
    return _cumulative(table, x + reach) - _cumulative(table, x - reach)


@njit(nogil=True, cache=True)
def _in_frame(frame, down, right):
    return frame[0, 0] * down + frame[0, 1] * right, frame[1, 0] * down + frame[1, 1] * right


@njit(nogil=True, cache=True)
def _cell_weight(i, j, row, column, frame, n, a, b, along, across):
    # Most cells of the box lie beyond the footprint's turned sides.
    u, v = _in_frame(frame, i + 0.5 - row, j + 0.5 - column)
    if abs(u) > along.half + 2 * n * a or abs(v) > across.half + 2 * n * b:
        return 0.0
    piece = 1.0 / n
    weight = 0.0
    for k in range(n):
        down = i + (k + 0.5) * piece - row
        for m in range(n):
            u, v = _in_frame(frame, down, j + (m + 0.5) * piece - column)
            if abs(u) < along.half + a and abs(v) < across.half + b:
                weight += _share(along, u, a) * _share(across, v, b)
    return weight


@njit(nogil=True, cache=True)
def _fill(boxes, along, across, window, pointers, indices, weights):
    used = 0
    top, bottom, left, right = window
    # Half the box around each pixel, and into how many pieces a side of a cell is cut.
    rows, columns, frames, half_rows, half_columns, pieces = boxes
    for pixel in range(rows.size):
        start, total = used, 0.0
        row, column, frame, n = rows[pixel], columns[pixel], frames[pixel], pieces[pixel]
        half_row, half_column = half_rows[pixel], half_columns[pixel]
        # Half sides of a piece.
        a = np.hypot(frame[0, 0], frame[0, 1]) / (2 * n)
        b = np.hypot(frame[1, 0], frame[1, 1]) / (2 * n)
        for i in range(int(np.floor(row - half_row)), int(np.ceil(row + half_row))):
            for j in range(int(np.floor(column - half_column)), int(np.ceil(column + half_column))):
                weight = _cell_weight(i, j, row, column, frame, n, a, b, along, across)
                total += weight
                if weight != 0 and top <= i < bottom and left <= j < right:
                    indices[used] = (i - top) * (right - left) + j - left
                    weights[used] = weight
                    used += 1
        for k in range(start, used):
            weights[k] /= total
        pointers[pixel + 1] = used
    return used
