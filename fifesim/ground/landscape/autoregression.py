"""
Simultaneous autoregressive process of the paper's landscapes, and its fields (Friedl et al. 1995, Fig. 2).

It solves x = e + arp (sum of the four neighbours of x) for white Gaussian noise e.

Every cell has a separate number of a counter-based generator, so that any window can be drawn alone. Only additions,
products, quotients and square roots of single precision are used, which all machines round alike.

The streaming field is a function of (seed, row, column) on an unbounded lattice. It is made in fixed lattice tiles,
each filtered with a margin, so that no tile depends on the requested window or chunk.
"""

from __future__ import annotations

import zlib
from functools import partial

import numpy as np
from scipy import fft, optimize, special

from fifesim.base.arguments import Range, check_number
from fifesim.base.arrays import compiled
from fifesim.base.caches import cached
from fifesim.base.lattice import assemble, check_seed, generator
from fifesim.ground.landscape import ARP, STREAMING_ARP

# Largest arp of the streaming field, and of an arp found from a length. [1]
LARGEST_STREAMING_ARP = STREAMING_ARP.highest

# With a margin of this many decay lengths, exp(-18) = 1.5e-8 of the standard deviation is left at a tile's edge, less
# than the rounding of the single precision in which a tile is filtered.
DECAY_LENGTHS = 18

# The correlation length is where the correlation has fallen to this value: the practical range of geostatistics.
PRACTICAL_RANGE = 0.05


def check_arp(arp):
    """Raise ValueError if the process is not stationary for an autoregressive parameter."""
    check_number("arp", arp, ARP)


def check_streaming_arp(arp, remedy="use larger cells for a longer range"):
    """Raise ValueError if an autoregressive parameter is invalid, or too large for the streaming field."""
    check_arp(arp)
    check_number("arp of the streaming field", arp, STREAMING_ARP._replace(note=remedy))


def response(arp, u, v):
    r"""
    Frequency response of the simultaneous autoregressive process.

    .. math:: H(u, v) = \frac{1}{1 - 2\,\mathrm{arp}\,(\cos u + \cos v)}

    Parameters
    ----------
    arp : float
        Autoregressive parameter. [1]
    u, v : array
        Angular frequencies. [radian per cell]

    Returns
    -------
    response : array, shape of the broadcast frequencies
        [1]

    References
    ----------
    [Friedl1995]_, Fig. 2, step 3; [Whittle1954]_, Section 7
    """
    return 1.0 / (1.0 - 2.0 * arp * (np.cos(u) + np.cos(v)))


def field_variance(arp):
    r"""
    Variance of the field for noise of unit variance.

    .. math:: \sigma^2 = \frac{1}{4\pi^2} \iint H^2 \, du \, dv = \frac{2}{\pi} \frac{E(k)}{1 - k^2},
        \quad k = 4\,\mathrm{arp}

    with E the complete elliptic integral of the second kind.

    Parameters
    ----------
    arp : float
        [1]

    Returns
    -------
    variance : float
        [1]
    """
    check_arp(arp)
    k2 = (4.0 * arp) ** 2
    return float(2.0 / np.pi * special.ellipe(k2) / (1.0 - k2))


def margin(arp):
    """Smallest margin for the filter of a tile of the streaming field. [cell]"""
    # The response of the process falls off as exp(-d arccosh(1 / (2 arp) - 1)) over d cells.
    if arp == 0:
        return 0
    return int(np.ceil(DECAY_LENGTHS / np.arccosh(1.0 / (2.0 * arp) - 1.0)))


def autocorrelation(arp, lag):
    r"""
    Correlation of two cells of one row or one column.

    .. math:: \rho(d) = \frac{1}{2\pi\sigma^2} \int \frac{A}{(A^2 - B^2)^{3/2}} \cos(u d) \, du,
        \quad A = 1 - 2\,\mathrm{arp} \cos u, \; B = 2\,\mathrm{arp}

    which is the double integral of :math:`H^2` with the one over v done.

    Parameters
    ----------
    arp : float
        [1]
    lag : array of int
        Distance along the row or column. [cell]

    Returns
    -------
    correlation : array, shape of lag
        [1]
    """
    check_arp(arp)
    lag = np.asarray(lag)
    # The trapezoidal rule converges like exp(-n x decay) on a periodic integrand.
    nodes = 2 * max(256, margin(arp), int(np.max(lag, initial=0)))
    u = 2.0 * np.pi * np.arange(nodes) / nodes
    a, b = 1.0 - 2.0 * arp * np.cos(u), 2.0 * arp
    row_spectrum = a / ((a - b) * (a + b)) ** 1.5
    covariance = np.mean(row_spectrum * np.cos(u * lag[..., None]), axis=-1)
    return covariance / np.mean(row_spectrum)


def correlation_length(arp: float, cell: float = 1.0) -> float:
    """
    Distance along a row or column at which the correlation has fallen to 0.05 (the practical range).

    Between whole cells the correlation is interpolated log-linearly.

    Parameters
    ----------
    arp : float
        [1]
    cell : float, optional
        Cell size. [m]

    Returns
    -------
    length : float
        [m], or cells where no cell size is given

    Raises
    ------
    ValueError
        If arp is not in [0, 0.25).

    Examples
    --------
    The paper's three landscapes have length scales of "roughly" 5, 15 and 30 m (section Analyses):

    >>> from fifesim.ground import correlation_length
    >>> [round(correlation_length(arp, 10 / 3), 1) for arp in (0.05, 0.15, 0.24)]
    [4.3, 8.3, 32.1]
    """
    check_arp(arp)
    if arp == 0:
        return 0.0
    reach = 8
    while (correlation := autocorrelation(arp, np.arange(reach)))[-1] > PRACTICAL_RANGE:
        reach *= 2
    after = int(np.argmax(correlation <= PRACTICAL_RANGE))
    upper, lower = np.log(correlation[after - 1]), np.log(correlation[after])
    return float(cell * (after - 1 + (upper - np.log(PRACTICAL_RANGE)) / (upper - lower)))


def arp_for_length(length: float, cell: float = 1.0) -> float:
    """
    Autoregressive parameter of a correlation length; the inverse of `correlation_length`.

    Parameters
    ----------
    length : float
        Practical range. [m], or cells where no cell size is given
    cell : float, optional
        [m]

    Returns
    -------
    arp : float
        [1]

    Raises
    ------
    ValueError
        If the length is negative or exceeds the length of the largest streaming arp.

    Examples
    --------
    >>> from fifesim.ground import arp_for_length, correlation_length
    >>> round(arp_for_length(correlation_length(0.2)), 9)
    0.2
    """
    longest = correlation_length(LARGEST_STREAMING_ARP, cell)
    check_number("length", length, Range("m", 0, longest, note="use larger cells for a longer range"))
    if length == 0:
        return 0.0
    if length < cell / 50:
        raise ValueError(f"length must be 0 or at least 1/50 of a cell of {cell:g} m, got {length:g}: metres, not km")
    # Below this length the lag-one correlation, about 2 arp, underflows the bracket of the root search.
    smallest = 1e-12
    if length <= correlation_length(smallest, cell):
        return smallest
    return float(
        optimize.brentq(lambda arp: correlation_length(arp, cell) - length, smallest, LARGEST_STREAMING_ARP, xtol=1e-13)
    )


# Multipliers and increments of the keys of Philox-4x32, Salmon et al. (2011), Table 2.
_M0, _M1 = np.uint64(0xD2511F53), np.uint64(0xCD9E8D57)
_W0, _W1 = np.uint64(0x9E3779B9), np.uint64(0xBB67AE85)
_ROUNDS = 10
_WORD = np.uint64(0xFFFFFFFF)
_HALF = np.uint64(32)

_LN2 = np.float32(0.6931471805599453)
_SQRT2 = np.float32(1.4142135623730951)
_SPAN = np.float32(2.0**-32)
# A quarter turn over the range of 30 bits. [radian]
_QUARTER = np.float32(np.pi / 2 * 2.0**-30)


def white_noise(seed, row, column, shape):
    r"""
    Standard normal white noise of a window of an unbounded lattice.

    .. math:: z = \sqrt{-2 \ln u} \; (\cos 2 \pi v, \; \sin 2 \pi v)

    with u and v uniform: four cells of a row that begin at a multiple of four share one block of the generator, whose
    counter is their place.

    Parameters
    ----------
    seed : int
        In [0, 2**63).
    row, column : int
        Place of the first cell.
    shape : (int, int)
        Rows and columns.

    Returns
    -------
    noise : array of float32, shape (rows, columns)
        At most 6.7 standard deviations, beyond which lie 2e-11 of a normal distribution. [1]

    References
    ----------
    [Salmon2011]_ for Philox-4x32-10; [BoxMuller1958]_
    """
    first, last = column // 4, -(-(column + shape[1]) // 4)
    out = np.empty((shape[0], 4 * (last - first)), np.float32)
    words, parts = np.empty((4, last - first), np.uint32), np.empty((6, last - first), np.float32)
    _fill(np.uint64(seed), np.int64(row), np.int64(first), words, parts, parts[0].view(np.int32), out)
    skip = column - 4 * first
    return out[:, skip : skip + shape[1]]


# Inlined by numba, so that the loop over cells is vectorized: four times as fast.
@compiled(inline="always")
def philox(c0, c1, c2, c3, k0, k1):
    """Philox-4x32-10 output for one counter and key, words of 32 bits in uint64, [Salmon2011]_."""
    for _ in range(_ROUNDS):
        p0, p1 = _M0 * c0, _M1 * c2
        c0, c1, c2, c3 = (p1 >> _HALF) ^ c1 ^ k0, p1 & _WORD, (p0 >> _HALF) ^ c3 ^ k1, p0 & _WORD
        k0, k1 = (k0 + _W0) & _WORD, (k1 + _W1) & _WORD
    return c0, c1, c2, c3


@compiled
def _fill(seed, row, first, words, parts, bits, out):
    """Fill in white noise; `words` and `parts` are memory, and `bits` are the bits of the first part."""
    groups = out.shape[1] // 4
    uniform, exponent, normals = parts[0], parts[1], parts[2:]
    k0, k1 = seed & _WORD, seed >> _HALF
    for i in range(out.shape[0]):
        place = np.uint64(row + i)
        for g in range(groups):
            group = np.uint64(first + g)
            words[0, g], words[1, g], words[2, g], words[3, g] = philox(
                group & _WORD, group >> _HALF, place & _WORD, place >> _HALF, k0, k1
            )
        _box_muller(words[0], words[1], uniform, bits, exponent, normals[0], normals[1])
        _box_muller(words[2], words[3], uniform, bits, exponent, normals[2], normals[3])
        for g in range(groups):
            for k in range(4):
                out[i, 4 * g + k] = normals[k, g]


# No divisor is 0; without this check the loop is vectorized.
@compiled
def _box_muller(one, other, uniform, bits, exponent, cosines, sines):
    """Two normal deviates from two 32-bit words; `uniform` and `bits` are the same memory."""
    n = one.size
    for i in range(n):
        uniform[i] = (np.float32(one[i]) + np.float32(0.5)) * _SPAN
    for i in range(n):
        exponent[i] = np.float32((bits[i] >> np.int32(23)) - np.int32(127))
        bits[i] = (bits[i] & np.int32(0x7FFFFF)) | np.int32(0x3F800000)
    for i in range(n):
        m, e = uniform[i], exponent[i]
        large = m > _SQRT2
        m = m * np.float32(0.5) if large else m
        e = e + np.float32(1.0) if large else e
        # ln m = 2 artanh s, whose series is cut where |s| <= 0.172 leaves 4e-10.
        s = (m - np.float32(1.0)) / (m + np.float32(1.0))
        q = s * s
        series = np.float32(1 / 7) + q * np.float32(1 / 9)
        series = np.float32(1.0) + q * (np.float32(1 / 3) + q * (np.float32(1 / 5) + q * series))
        radius = np.sqrt(max(np.float32(-2.0) * (e * _LN2 + np.float32(2.0) * s * series), np.float32(0.0)))
        # An angle within an eighth of a turn from 30 bits, by their Taylor series, and a quarter from two.
        quarter = other[i] & np.uint32(3)
        a = (np.float32(np.int32(other[i] >> np.uint32(2))) - np.float32(2.0**29)) * _QUARTER
        q = a * a
        sine = np.float32(1 / 120) - q * (np.float32(1 / 5040) - q * np.float32(1 / 362880))
        sine = a * (np.float32(1.0) - q * (np.float32(1 / 6) - q * sine))
        cosine = np.float32(1 / 24) - q * (np.float32(1 / 720) - q * np.float32(1 / 40320))
        cosine = np.float32(1.0) - q * (np.float32(0.5) - q * cosine)
        turned = quarter & np.uint32(1)
        x = sine if turned else cosine
        y = cosine if turned else sine
        # Quarter turns of (cosine, sine): the signs of the four quadrants, each as likely as the others.
        cosines[i] = radius * (-x if quarter & np.uint32(2) else x)
        sines[i] = radius * (-y if (quarter == np.uint32(1)) | (quarter == np.uint32(2)) else y)


# Field tile. [cell]
FIELD_TILE = 1008

# Rows of a response that are made together.
_ROWS = 32

# Stream of the periodic field's noise.
_PERIODIC = 1

# First of the streams of random numbers that are named after fields.
_STREAM = 2**50


def field_seed(seed, name):
    """Seed of the noise of a field; "lai" has the seed of the landscape."""
    seed = check_seed(seed)
    if name == "lai":
        return seed
    return int(generator(seed, _STREAM + zlib.crc32(name.encode())).integers(2**63))


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

    References
    ----------
    [Friedl1995]_, Fig. 2, steps 1 to 4; [Salmon2011]_ for the counter-based noise
    """
    check_streaming_arp(arp, 'use method="periodic"')
    return assemble(partial(_tile, check_seed(seed), arp), FIELD_TILE, row, column, shape)


def periodic_field(seed, arp, shape):
    """
    Field by the method of the paper (Fig. 2): one Fourier transform over the whole scene, periodic at its borders.
    Shape (rows, columns), zero mean and unit variance over the ensemble [1]; [Friedl1995]_, Fig. 2, steps 1 to 4.
    """
    check_arp(arp)
    check_seed(seed)
    return _filter(generator(seed, _PERIODIC).standard_normal(shape), _half_response(arp, tuple(shape), float))


# In single precision, cells are within 2e-6 standard deviations of the double-precision result for the same noise, 3e-7
# rms, and reflectances within 6e-8: a tile of four seeds, for each of the paper's three distributions and arp from 0.05
# to 0.2498.
#
# Chunks smaller than tiles, or cut elsewhere, ask for a tile more than once. Twelve tiles are 49 MB.
@cached(12, "tiles of random fields")
def _tile(seed, arp, tile_row, tile_column):
    """One tile of a field, in single precision."""
    tile = window_field(seed, arp, tile_row * FIELD_TILE, tile_column * FIELD_TILE, (FIELD_TILE, FIELD_TILE)).copy()
    tile.flags.writeable = False
    return tile


def window_field(seed, arp, row, column, shape):
    """Window of the streaming field that is filtered with a margin rather than by tiles, equal within 1e-5."""
    around = margin(arp)
    size = tuple(fft.next_fast_len(length + 2 * around, real=True) for length in shape)
    noise = white_noise(seed, row - around, column - around, size)
    inside = tuple(slice(around, around + length) for length in shape)
    return _filter(noise, _half_response(arp, size, np.float32))[inside]


def _filter(noise, half_response):
    spectrum = fft.rfft2(noise)
    spectrum *= half_response
    return fft.irfft2(spectrum, s=noise.shape, overwrite_x=True)


@cached(4, "spectral response of a periodic field")
def _half_response(arp, shape, dtype):
    """Frequency response on the half plane of a real transform, scaled to unit variance of the field."""
    u = 2.0 * np.pi * fft.fftfreq(shape[0])[:, None]
    v = 2.0 * np.pi * fft.rfftfreq(shape[1])[None, :]
    out, deviation = np.empty((u.size, v.size), dtype), np.sqrt(field_variance(arp))
    # A few rows at a time stay in the processor's cache.
    for first in range(0, u.size, _ROWS):
        rows = slice(first, first + _ROWS)
        out[rows] = response(arp, u[rows], v) / deviation
    return out


def pair_correlations(arp, ratio):
    """Correlations of all pairs of cells in a pixel by lag, and weights that sum to 1, of shape `ratio`. [1]"""
    check_arp(arp)
    size = fft.next_fast_len(2 * (max(ratio) + margin(arp)), real=True)
    u = 2.0 * np.pi * fft.fftfreq(size)
    covariance = fft.irfft2(response(arp, u[:, None], np.abs(u[: size // 2 + 1])) ** 2, s=(size, size))
    down, across = (
        np.where(np.arange(number) > 0, 2.0, 1.0) * (number - np.arange(number)) / number**2 for number in ratio
    )
    return covariance[: ratio[0], : ratio[1]] / covariance[0, 0], down[:, None] * across
