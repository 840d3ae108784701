"""
An unbounded lattice of cells, counted from the origin of a coordinate reference system, and fixed tiles of it.

Coordinates counted from that origin are the same to the bit in a window and in the whole; summed from each grid's own
they differ by 1e-10 m, and xarray aligns exactly. What is made by the tile is the same in every window and chunk.
"""

from functools import lru_cache

import numpy as np

# What is left over beside whole cells is rounded to this many decimals of a metre.
_DECIMALS = 6


def whole_cells(origin, cell):
    """
    Whole cells from the origin of the reference system to the edge of a grid.

    Parameters
    ----------
    origin : float
        Edge of the grid. [m]
    cell : float
        Negative along rows that count southward. [m]

    Returns
    -------
    index : int
    offset : float
        What is left over. [m]

    Examples
    --------
    >>> whole_cells(100.5, 10.0), whole_cells(100.5, -10.0)
    ((10, 0.5), (-11, -9.5))
    """
    # The floor, not the nearest: halves rounded to even would move a window of a lattice at half cells by two cells.
    index = int(np.floor(origin / cell + 1e-6))
    return index, round(origin - index * cell, _DECIMALS)


def centres(origin, cell, cells):
    """
    Coordinates of the centres of cells.

    Parameters
    ----------
    origin, cell : float
        As in `whole_cells`. [m]
    cells : array of int
        Counted from the edge of the grid; they may lie outside of it.

    Returns
    -------
    centres : array, shape of cells
        [m]

    Examples
    --------
    >>> centres(100.5, 10.0, np.array([0, 3])).tolist()
    [105.5, 135.5]
    """
    index, offset = whole_cells(origin, cell)
    return (index + cells + 0.5) * cell + offset


def assemble(make_tile, tile, row, column, shape):
    """
    Window of a lattice, cut from the fixed tiles that it touches.

    Parameters
    ----------
    make_tile : callable
        ``make_tile(tile_row, tile_column)`` gives one tile, shape (tile, tile).
    tile : int
        Size of a tile. [cell]
    row, column : int
        First row and column of the window.
    shape : (int, int)
        Rows and columns of the window.

    Returns
    -------
    window : array, shape (rows, columns)

    Examples
    --------
    >>> assemble(lambda i, j: np.full((2, 2), 10 * i + j), 2, 1, 1, (2, 3)).tolist()
    [[0.0, 1.0, 1.0], [10.0, 11.0, 11.0]]
    """
    height, width = shape
    window = np.empty(shape)
    if not window.size:
        return window
    for tile_row in range(row // tile, -(-(row + height) // tile)):
        into_rows, from_rows = _overlap(tile, tile_row, row, height)
        for tile_column in range(column // tile, -(-(column + width) // tile)):
            into_columns, from_columns = _overlap(tile, tile_column, column, width)
            window[into_rows, into_columns] = make_tile(tile_row, tile_column)[from_rows, from_columns]
    return window


def _overlap(tile, index, window_start, window_size):
    """Slices that copy one tile into the window along one axis."""
    tile_start = index * tile
    start, stop = max(tile_start, window_start), min(tile_start + tile, window_start + window_size)
    return slice(start - window_start, stop - window_start), slice(start - tile_start, stop - tile_start)


class KeptTiles:
    """
    Make tiles and keep the last ones; a copy in another process starts with none.

    Parameters
    ----------
    make : callable
        ``make(tile_row, tile_column)`` gives one tile.
    """

    def __init__(self, make):
        self._make = make
        self._kept = lru_cache(maxsize=4)(make)

    def __call__(self, tile_row, tile_column):
        return self._kept(tile_row, tile_column)

    def __reduce__(self):
        return KeptTiles, (self._make,)
