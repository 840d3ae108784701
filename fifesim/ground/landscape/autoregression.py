"""
The simultaneous autoregressive process of the paper's landscapes (Friedl et al. 1995, Fig. 2).

It solves x = e + arp (sum of the four neighbours of x) for white Gaussian noise e.
"""

from __future__ import annotations

import numpy as np
from scipy import optimize, special

# Of the streaming field, and of what is found from a length.
LARGEST_STREAMING_ARP = 0.2498

# A margin of so many leaves exp(-18) = 1.5e-8 of the standard deviation at a tile's edge, less than the rounding of
# the single precision in which a tile is filtered.
DECAY_LENGTHS = 18

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

    >>> from fifesim import correlation_length
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
        If the length is negative or longer than that of the largest streaming arp.

    Examples
    --------
    >>> from fifesim import arp_for_length, correlation_length
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
