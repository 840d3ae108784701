"""Fixed tiles of an unbounded lattice: what is made by the tile is the same in every window and chunk."""

from functools import lru_cache

import numpy as np


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
