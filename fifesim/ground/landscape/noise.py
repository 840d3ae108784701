"""
White Gaussian noise as a function of seed, row and column.

Every cell has its own number of a counter-based generator, so that any window can be drawn alone. Only additions,
products, quotients and square roots of single precision are used, which all machines round alike.
"""

import numpy as np
from numba import njit

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

    Examples
    --------
    A window is a slice of the whole:

    >>> whole = white_noise(7, -3, -5, (20, 30))
    >>> bool((white_noise(7, 2, 4, (5, 6)) == whole[5:10, 9:15]).all())
    True
    """
    first, last = column // 4, -(-(column + shape[1]) // 4)
    out = np.empty((shape[0], 4 * (last - first)), np.float32)
    _fill(np.uint64(seed), np.int64(row), np.int64(first), out)
    skip = column - 4 * first
    return out[:, skip : skip + shape[1]]


@njit(nogil=True, cache=True, inline="always")
def philox(c0, c1, c2, c3, k0, k1):
    """
    Philox-4x32-10 of one counter.

    Parameters
    ----------
    c0, c1, c2, c3 : uint64
        Counter, words of 32 bits.
    k0, k1 : uint64
        Key, words of 32 bits.

    Returns
    -------
    words : tuple of uint64, length 4
        Of 32 bits.

    References
    ----------
    [Salmon2011]_
    """
    for _ in range(_ROUNDS):
        p0, p1 = _M0 * c0, _M1 * c2
        c0, c1, c2, c3 = (p1 >> _HALF) ^ c1 ^ k0, p1 & _WORD, (p0 >> _HALF) ^ c3 ^ k1, p0 & _WORD
        k0, k1 = (k0 + _W0) & _WORD, (k1 + _W1) & _WORD
    return c0, c1, c2, c3


@njit(nogil=True, cache=True)
def _fill(seed, row, first, out):
    groups = out.shape[1] // 4
    words = np.empty((4, groups), np.uint32)
    normals = np.empty((4, groups), np.float32)
    k0, k1 = seed & _WORD, seed >> _HALF
    for i in range(out.shape[0]):
        place = np.uint64(row + i)
        for g in range(groups):
            group = np.uint64(first + g)
            words[0, g], words[1, g], words[2, g], words[3, g] = philox(
                group & _WORD, group >> _HALF, place & _WORD, place >> _HALF, k0, k1
            )
        _box_muller(words[0], words[1], normals[0], normals[1])
        _box_muller(words[2], words[3], normals[2], normals[3])
        for g in range(groups):
            for k in range(4):
                out[i, 4 * g + k] = normals[k, g]


# No divisor is 0: without that being asked, cells are done several at once.
@njit(nogil=True, cache=True, error_model="numpy")
def _box_muller(one, other, cosines, sines):
    """Two normals from two words of 32 bits."""
    n = one.size
    uniform = np.empty(n, np.float32)
    for i in range(n):
        uniform[i] = (np.float32(one[i]) + np.float32(0.5)) * _SPAN
    bits = uniform.view(np.int32)
    exponent = np.empty(n, np.float32)
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
