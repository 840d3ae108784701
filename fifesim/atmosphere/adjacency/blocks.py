"""
Blocks of the cells of a scene, and sums over them in whole numbers: the same to the bit in any order and any chunks.

Blocks are counted from the origin of the CRS, as cells are.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from fifesim.base.footprints import axis_operator, regularize
from fifesim.base.line_spread import Boxcar

BLOCK = 60.0  # size of the blocks, as far as whole cells go [m]

# Sums are taken in whole numbers of this part of one, which do not depend on their order as long as none overflows: a
# block's is at most the largest value that counts.
_UNIT, _LARGEST = 2.0**52, 1000.0


class Blocks(NamedTuple):
    """Blocks of cells along one axis, counted from the origin of the CRS as cells are."""

    cells: int  # in a block
    offset: int  # of the scene's first cell in its block
    n_cells: int  # of the scene

    @property
    def count(self):
        """Number of blocks that the scene touches."""
        return -(-(self.offset + self.n_cells) // self.cells)

    @property
    def edges(self):
        """First cell of each block in the scene and behind its last, shape (count,) each."""
        start = np.arange(self.count) * self.cells - self.offset
        return np.maximum(start, 0), np.minimum(start + self.cells, self.n_cells)

    def pieces(self, chunks):
        """
        Blocks, cut where chunks end.

        Parameters
        ----------
        chunks : sequence of int
            Sizes of the chunks of cells.

        Returns
        -------
        pieces : Pieces
        sizes : tuple of int
            Number of pieces in each chunk.
        """
        ends = np.cumsum(chunks)
        start = np.union1d(self.edges[0], ends[:-1])
        sizes = np.diff(np.searchsorted(start, [0, *ends]))
        return Pieces(start, np.append(start[1:], self.n_cells), self), tuple(sizes.tolist())

    @property
    def inside(self):
        """Share of each block that lies in the scene, shape (count,). [1]"""
        start, stop = self.edges
        return (stop - start) / self.cells

    @property
    def interpolation(self):
        """Operator from blocks, with one more on either side, to cells."""
        # The overlap of a block's width around a cell with the blocks is the weight of linear interpolation.
        blocks = {"cell_origin": -self.cells, "cell_size": self.cells, "n_cells": self.count + 2}
        cells = {"pixel_origin": self.offset, "pixel_size": 1, "n_pixels": self.n_cells}
        return axis_operator(Boxcar(float(self.cells)), **blocks, **cells)

    @property
    def interpolation_weights(self):
        """Weights of the block before, the own one and that behind, by the cell's place in it, shape (cells, 3)."""
        place = (np.arange(self.cells) + 0.5) / self.cells - 0.5
        return np.stack([np.maximum(-place, 0), 1 - np.abs(place), np.maximum(place, 0)], axis=-1)


class Pieces(NamedTuple):
    """Parts of blocks along one axis, shape (n,)."""

    start: np.ndarray  # first cell
    stop: np.ndarray  # behind the last cell
    blocks: Blocks

    @property
    def first(self):
        """First piece of each block, shape (count,)."""
        return np.searchsorted(self.start, self.blocks.edges[0])


def blocks_along(position, cell_size, n_cells):
    """
    Blocks of a scene along one axis.

    Parameters
    ----------
    position : int
        Of the scene's first cell, counted from the origin of the CRS.
    cell_size : float
        [m]
    n_cells : int

    Returns
    -------
    blocks : Blocks

    Examples
    --------
    >>> blocks = blocks_along(19, 30 / 9, 40)
    >>> blocks.cells, blocks.offset, blocks.count
    (18, 1, 3)
    """
    cells = max(1, round(BLOCK / cell_size))
    return Blocks(cells, position % cells, n_cells)


def block_sums(rows, columns, values, *, along_y, along_x, linear=False):
    """
    Sums over the valid cells of pieces of blocks, and their number, both as shares of a whole block's cells.

    Parameters
    ----------
    rows, columns : slice
        Of the pieces.
    values : array, shape (..., y, x)
        Their cells, NaN where they are missing.
    along_y, along_x : Pieces
    linear : bool, optional
        Weight the cells as they interpolate between each pair of blocks: for the block before, the own one and that
        behind, along either axis.

    Returns
    -------
    sums : array of int, shape (..., 2, 1, 1, rows, columns)
        Of the values, and of 1, in units that `whole_blocks` knows; (..., 2, 3, 3, rows, columns) with ``linear``.
    """
    down, across = _cells_of(along_y, rows, linear), _cells_of(along_x, columns, linear)
    size = down.weights.shape[1], across.weights.shape[1], rows.stop - rows.start, columns.stop - columns.start
    sums = np.zeros((*values.shape[:-2], 2, *size), np.int64)
    dtype = np.float32 if values.dtype == np.float32 else np.float64
    for layer in np.ndindex(values.shape[:-2]):
        _add_moments(np.ascontiguousarray(values[layer], dtype), down, across, sums[layer])
    return sums


def whole_blocks(sums, along_y, along_x):
    """
    Put the pieces of blocks together.

    Parameters
    ----------
    sums : array of int, shape (..., rows, columns)
        Of pieces, from `block_sums`.
    along_y, along_x : Pieces

    Returns
    -------
    sums : array, shape (..., y, x)
        Of blocks, the same to the bit however these were cut.
    """
    first_row, first_column = along_y.first, along_x.first
    whole = np.empty((*sums.shape[:-2], first_row.size, first_column.size))
    for layer in np.ndindex(sums.shape[:-2]):
        lines = np.add.reduceat(sums[layer], first_row, axis=0)
        whole[layer] = np.add.reduceat(lines, first_column, axis=1) / _UNIT
    return whole


class _Cells(NamedTuple):
    """Cells along one axis of pieces of blocks."""

    piece: np.ndarray  # of each cell
    place: np.ndarray  # of each cell in its block
    weights: np.ndarray  # by place, shape (cells, 1 or 3) [1]


def _cells_of(along, pieces, linear):
    cells = np.arange(along.start[pieces.start], along.stop[pieces.stop - 1])
    piece = np.searchsorted(along.start[pieces], cells, side="right") - 1
    size = along.blocks.cells
    weights = along.blocks.interpolation_weights / size if linear else np.full((size, 1), 1 / size)
    return _Cells(piece, (cells + along.blocks.offset) % size, weights)


@njit(nogil=True, cache=True)
def _add_moments(values, down, across, sums):
    """Whole numbers have the same sum in any order."""
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            value = np.float64(values[i, j])
            if not np.isnan(value):
                value = min(max(value, -_LARGEST), _LARGEST)
                row, column = down.piece[i], across.piece[j]
                for k in range(down.weights.shape[1]):
                    for m in range(across.weights.shape[1]):
                        weight = down.weights[down.place[i], k] * across.weights[across.place[j], m] * _UNIT
                        if weight > 0:
                            sums[0, k, m, row, column] += np.int64(np.rint(weight * value))
                            sums[1, k, m, row, column] += np.int64(np.rint(weight))


def on_cells(rows, columns, around, *, along_y, along_x):
    """
    Interpolate linearly from blocks to cells.

    Parameters
    ----------
    rows, columns : slice
        Of the cells.
    around : array, shape (..., y, x)
        At the centres of the blocks that these need.
    along_y, along_x : AxisOperator
        `Blocks.interpolation`.

    Returns
    -------
    cells : array, shape (..., rows, columns)
    """
    return regularize(around, along_y[rows], along_x[columns], min_valid=0.0)
