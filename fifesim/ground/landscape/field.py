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
    check_arp(arp)
    check_seed(seed)
    if arp > LARGEST_STREAMING_ARP:
        raise ValueError(
            f'arp must be at most {LARGEST_STREAMING_ARP} for the streaming field, got {arp:g}: use method="periodic"'
        )
    return assemble(partial(_tile, seed, arp), TILE, row, column, shape)


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
def _tile(seed, arp, tile_row, tile_column):
    """One tile of the streaming field, in single precision."""
    around = margin(arp)
    size = fft.next_fast_len(TILE + 2 * around, real=True)
    noise = white_noise(seed, tile_row * TILE - around, tile_column * TILE - around, (size, size))
    inside = slice(around, around + TILE)
    tile = _filter(noise, _half_response(arp, (size, size), np.float32))[inside, inside].copy()
    tile.flags.writeable = False
    return tile


def _filter(noise, half_response):
    spectrum = fft.rfft2(noise)
    spectrum *= half_response
    return fft.irfft2(spectrum, s=noise.shape, overwrite_x=True)


@lru_cache(maxsize=4)
def _half_response(arp, shape, dtype):
    """Response on the half plane of a real transform, scaled so that the field has unit variance."""
    u = 2.0 * np.pi * fft.fftfreq(shape[0])[:, None]
    v = 2.0 * np.pi * fft.rfftfreq(shape[1])[None, :]
    return (response(arp, u, v) / np.sqrt(field_variance(arp))).astype(dtype)
