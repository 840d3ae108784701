"""
Simultaneous autoregressive fields on the ground lattice (Friedl et al. 1995, Fig. 2).

The field solves x = e + arp (sum of the four neighbours of x) for white Gaussian noise e. The streaming field is a
function of (seed, row, column) on an unbounded lattice. It is made in fixed lattice tiles, each filtered with a margin,
so that no tile depends on the window or the chunk that asks for it.
"""

from functools import lru_cache, partial

import numpy as np
from scipy import fft, optimize, special

from fifesim.base.lattice import assemble
from fifesim.base.seeds import check_seed, generator
from fifesim.ground.landscape.noise import white_noise

# Field tile. [cell]
TILE = 1008

# A margin of 18 decay lengths leaves exp(-18) = 1.5e-8 of the standard deviation at a tile's edge, less than the
# rounding of the single precision in which a tile is filtered: that moves cells by 4e-7 of it rms, and reflectances by
# less than 1e-6.
DECAY_LENGTHS = 18
LARGEST_STREAMING_ARP = 0.2498

# Stream of the periodic field's noise.
_PERIODIC = 1

# The correlation length is where the correlation has fallen to this value: the practical range of geostatistics.
PRACTICAL_RANGE = 0.05


def check_arp(arp):
    """
    Refuse an autoregressive parameter for which the process is not stationary.

    Parameters
    ----------
    arp : float
        [1]

    Raises
    ------
    ValueError
        If arp is not in [0, 0.25).
    """
    if not 0 <= arp < 0.25:
        raise ValueError(
            f"arp must be in [0, 0.25), got {arp:g}: the four-neighbour process is not stationary from 0.25 up; "
            "the paper uses 0.05 to 0.24"
        )


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

    Examples
    --------
    Without interaction the noise passes unchanged:

    >>> float(response(0.0, 0.3, 0.1))
    1.0
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

    Examples
    --------
    >>> field_variance(0.0)
    1.0
    """
    check_arp(arp)
    k2 = (4.0 * arp) ** 2
    return float(2.0 / np.pi * special.ellipe(k2) / (1.0 - k2))


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

    Examples
    --------
    >>> float(autocorrelation(0.24, 0))
    1.0
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


def correlation_length(arp, cell=1.0):
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
    The paper's three landscapes have length scales of roughly 5, 15 and 30 m:

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


def arp_for_length(length, cell=1.0):
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
        If the length is negative or longer than that of the largest streaming arp.

    Examples
    --------
    >>> round(arp_for_length(correlation_length(0.2)), 9)
    0.2
    """
    longest = correlation_length(LARGEST_STREAMING_ARP, cell)
    if not 0 <= length <= longest:
        raise ValueError(
            f"length must be in [0, {longest:.0f}] m for cells of {cell:g} m, got {length:g}: "
            "use larger cells for a longer range"
        )
    if length == 0:
        return 0.0
    # Below this length the lag-one correlation, about 2 arp, underflows the bracket of the root search.
    smallest = 1e-12
    if length <= correlation_length(smallest, cell):
        return smallest
    return float(
        optimize.brentq(lambda arp: correlation_length(arp, cell) - length, smallest, LARGEST_STREAMING_ARP, xtol=1e-13)
    )


def margin(arp):
    """
    Margin that a tile of the streaming field is filtered with, at least.

    The response of the process falls off as exp(-d arccosh(1 / (2 arp) - 1)) over d cells.

    Parameters
    ----------
    arp : float
        [1]

    Returns
    -------
    margin : int
        [cell]
    """
    if arp == 0:
        return 0
    decay = np.arccosh(1.0 / (2.0 * arp) - 1.0)
    return int(np.ceil(DECAY_LENGTHS / decay))


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
    Field of the paper's own route: one Fourier transform over the whole scene, periodic at its borders.

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
