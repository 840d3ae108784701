"""
Fields of the autoregressive process on the ground lattice (Friedl et al. 1995, Fig. 2).

The streaming field is a function of (seed, row, column) on an unbounded lattice. It is made in fixed lattice tiles,
each filtered with a margin, so that no tile depends on the window or the chunk that asks for it.
"""

from functools import lru_cache, partial

import numpy as np
from scipy import fft

from fifesim.base.lattice import assemble
from fifesim.base.seeds import check_seed, generator
from fifesim.ground.landscape.autoregression import LARGEST_STREAMING_ARP, check_arp, field_variance, margin, response
from fifesim.ground.landscape.noise import white_noise

# Field tile. [cell]
TILE = 1008

# Rows of a response that are made together.
_ROWS = 32

# Stream of the periodic field's noise.
_PERIODIC = 1


def streaming_field(seed, arp, row, column, shape):
    """
    Standard normal field with autoregressive structure, as a function of place.

    The same (seed, arp, row, column) gives the same bits in every window.

    Parameters
    ----------
    seed : int
        In [0, 2**63).
    arp : float
        In [0, 0.2498]. [1]
    row, column : int
        Lattice position of the first cell; rows count southward.
    shape : (int, int)
        Rows and columns.

    Returns
    -------
    field : array, shape (rows, columns)
        Zero mean and unit variance over the ensemble. [1]

    Raises
    ------
    ValueError
        If arp or seed is out of range.
    TypeError
        If the seed is no whole number.

    References
    ----------
    [Friedl1995]_, Fig. 2, steps 1 to 4; [Salmon2011]_ for the counter-based noise

    Examples
    --------
    A window is a slice of the whole:

    >>> whole = streaming_field(7, 0.15, 0, 0, (40, 50))
    >>> bool((streaming_field(7, 0.15, 10, 20, (5, 6)) == whole[10:15, 20:26]).all())
    True
    """
    return mixed_field({check_seed(seed): 1.0}, arp, row, column, shape)


def mixed_field(weights, arp, row, column, shape, *, tile=TILE):
    """
    Field of a mixture of noises, as a function of place.

    Parameters
    ----------
    weights : dict of int to float
        Of the noise of each seed; their squares add up to 1. [1]
    arp, row, column, shape
        As in `streaming_field`.
    tile : int, optional
        Edge of the tiles that it is made in, which rounding depends on. [cell]

    Returns
    -------
    field : array, shape (rows, columns)
        Zero mean and unit variance over the ensemble. [1]

    Raises
    ------
    ValueError
        If arp or a seed is out of range.
    TypeError
        If a seed is no whole number.

    Examples
    --------
    Turned noise is turned land:

    >>> turned = mixed_field({7: -1.0}, 0.15, 0, 0, (4, 5))
    >>> bool((turned == -streaming_field(7, 0.15, 0, 0, (4, 5))).all())
    True
    """
    check_arp(arp)
    for seed in weights:
        check_seed(seed)
    if arp > LARGEST_STREAMING_ARP:
        raise ValueError(
            f'arp must be at most {LARGEST_STREAMING_ARP} for the streaming field, got {arp:g}: use method="periodic"'
        )
    made = _tile if tile == TILE else partial(_small_tile, tile)
    return assemble(partial(made, tuple(weights.items()), arp), tile, row, column, shape)


def periodic_field(seed, arp, shape):
    """
    Field by the paper's own route (Fig. 2): one Fourier transform over the whole scene, periodic at its borders.

    Parameters
    ----------
    seed : int
        In [0, 2**63).
    arp : float
        [1]
    shape : (int, int)
        Rows and columns.

    Returns
    -------
    field : array, shape (rows, columns)
        Unit variance over the ensemble. [1]

    Raises
    ------
    ValueError
        If arp or seed is out of range.
    TypeError
        If the seed is no whole number.

    References
    ----------
    [Friedl1995]_, Fig. 2, steps 1 to 4
    """
    check_arp(arp)
    check_seed(seed)
    return _filter(generator(seed, _PERIODIC).standard_normal(shape), _half_response(arp, tuple(shape), float))


# In single precision cells lie within 2e-6 standard deviations of what double precision makes of the same noise, 3e-7
# rms, and reflectances within 6e-8: a tile of four seeds, for each of the paper's three distributions and arp from 0.05
# to 0.2498.
# Chunks smaller than tiles, or cut elsewhere, ask for a tile more than once. Twelve tiles are 49 MB.
@lru_cache(maxsize=12)
def _tile(weights, arp, tile_row, tile_column):
    """One tile of a field, in single precision."""
    return _filtered_tile(TILE, weights, arp, tile_row, tile_column)


def _filtered_tile(size, weights, arp, tile_row, tile_column):
    tile = _window(weights, arp, tile_row * size, tile_column * size, (size, size)).copy()
    tile.flags.writeable = False
    return tile


# Splines between cells of a coarser lattice reach into the tiles around: those of four properties in a row of chunks of
# 20 million cells are kept until the next row needs them. So many of 252 cells are 33 MB.
_small_tile = lru_cache(maxsize=128)(_filtered_tile)


def window_field(seed, arp, row, column, shape):
    """
    Window of the streaming field, filtered by itself instead of by its tiles.

    Parameters
    ----------
    seed, arp, row, column, shape
        As of `streaming_field`, whose cells these are within 1e-5 of their standard deviation.

    Returns
    -------
    field : array of float32, shape (rows, columns)
        [1]
    """
    return _window(((seed, 1.0),), arp, row, column, shape)


def _window(weights, arp, row, column, shape):
    """Cells of a field of mixed noises, filtered with a margin."""
    around = margin(arp)
    size = tuple(fft.next_fast_len(length + 2 * around, real=True) for length in shape)
    noise = _mixed_noise(weights, row - around, column - around, size)
    inside = tuple(slice(around, around + length) for length in shape)
    return _filter(noise, _half_response(arp, size, np.float32))[inside]


def _mixed_noise(weights, row, column, shape):
    mixture = None
    for seed, weight in weights:
        noise = white_noise(seed, row, column, shape)
        if weight != 1.0:
            noise *= np.float32(weight)
        if mixture is None:
            mixture = noise
        else:
            mixture += noise
    return mixture


def _filter(noise, half_response):
    spectrum = fft.rfft2(noise)
    spectrum *= half_response
    return fft.irfft2(spectrum, s=noise.shape, overwrite_x=True)


@lru_cache(maxsize=4)
def _half_response(arp, shape, dtype):
    """Response on the half plane of a real transform, scaled so that the field has unit variance."""
    u = 2.0 * np.pi * fft.fftfreq(shape[0])[:, None]
    v = 2.0 * np.pi * fft.rfftfreq(shape[1])[None, :]
    out, deviation = np.empty((u.size, v.size), dtype), np.sqrt(field_variance(arp))
    # A few rows at a time stay in the processor's cache.
    for first in range(0, u.size, _ROWS):
        rows = slice(first, first + _ROWS)
        out[rows] = response(arp, u[rows], v) / deviation
    return out
