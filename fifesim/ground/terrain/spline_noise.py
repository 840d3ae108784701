"""Gaussian noise that is smooth: quintic splines of white noise on a lattice."""

from functools import lru_cache, partial

import numpy as np

from fifesim.base.seeds import generator
from fifesim.ground.terrain.spline import spline_grid, spline_of_tiles

# Standard deviation of a quintic spline of white noise, the value at 0 of the B-spline of degree 11.
_DEVIATION = 0.3939255651755652

# Noise is drawn in blocks of this size. [lattice node]
_BLOCK = 64


def smooth_noise(seed, stream, step, south, east):
    """
    Gaussian noise of unit variance without wavelengths much below twice a lattice step, as a function of place.

    Parameters
    ----------
    seed, stream : int
        Streams of a seed are independent.
    step : float
        [m]
    south, east : array, shape (y,), (x,)
        Rising. [m]

    Returns
    -------
    noise : array, shape (y, x)
        [1]
    """
    return spline_of_tiles(partial(_block, seed, stream), _BLOCK, south / step, east / step) / _DEVIATION


def noise_square(drawn, spacing, count):
    """
    The same noise on a square of nodes, from a generator.

    Parameters
    ----------
    drawn : numpy.random.Generator
    spacing : float
        From node to node. [lattice step]
    count : int
        Nodes along an edge.

    Returns
    -------
    noise : array, shape (count, count)
        [1]
    """
    positions = 3 + np.arange(count) * spacing
    size = int(positions[-1]) + 5
    return spline_grid(drawn.standard_normal((size, size)), positions, positions) / _DEVIATION


@lru_cache(maxsize=256)
def _block(seed, stream, block_row, block_column):
    """White noise of one lattice block: its place is the upper half of the Philox counter."""
    return generator(seed, stream, (0, 0, block_row, block_column)).standard_normal((_BLOCK, _BLOCK))
