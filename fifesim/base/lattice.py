"""
Unbounded lattice of cells, and random numbers by seed and place on it.

Each stage draws from separate streams, so that one seed serves them all: 1 is the periodic field, 2 the library of
spectra, 3 to 6 the parameters and landscapes of the chips of a study, 16 and up the synthetic hills, 2**40 and up the
bands of a sensor, 2**45 the clouds, 2**50 and up the seeds of the fields of a landscape. The streaming field has a
separate generator.

Coordinates counted from this origin are identical to the bit in a window and in the whole. Coordinates summed from the
origin of each grid would differ by 1e-10 m, and xarray aligns exactly. A value computed by tile is the same in every
window and chunk.
"""

import numpy as np

from fifesim.base.arguments import described

SEED_LIMIT = 2**63  # scenario files hold signed whole numbers


def check_seed(seed):
    """Check that a seed is a whole number in [0, 2**63)."""
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer):
        raise TypeError(
            f"seed must be a whole number from 0 to 2**63 - 1, got {described(seed)}: give for instance seed=7"
        )
    if not 0 <= seed < SEED_LIMIT:
        raise ValueError(f"seed must be a whole number from 0 to 2**63 - 1, got {seed}: give for instance seed=7")
    return int(seed)


def generator(seed, stream, place=(0, 0, 0, 0)):
    """Random generator [Salmon2011]_ keyed by seed and stream, with the place as its counter."""
    # Arrays of words: a list of numbers from 2**63 up would go through floating point, and neighbours be the same.
    key = np.array([seed, stream], np.uint64)
    counter = np.array([word % 2**64 for word in place], np.uint64)
    return np.random.Generator(np.random.Philox(counter=counter, key=key))


# The offset from whole cells is rounded to this many decimals of a metre.
_DECIMALS = 6


def whole_cells(origin, cell):
    """Number of whole cells from the origin of the CRS to the edge of a grid, and the rest. [m]"""
    # The floor, not the nearest: halves rounded to even would move a window of a lattice at half cells by two cells.
    index = int(np.floor(origin / cell + 1e-6))
    return index, round(origin - index * cell, _DECIMALS)


def centres(origin, cell, cells):
    """Coordinates of the centres of cells, counted from the edge of the grid. [m]"""
    index, offset = whole_cells(origin, cell)
    return (index + cells + 0.5) * cell + offset


def assemble(make_tile, tile, row, column, shape):
    """Window of a lattice, cut from the fixed tiles that it touches, shape (rows, columns)."""
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
