"""Light attenuated in stages: nested integrals of exponentials without singular cases."""

import math

import numba
import numpy as np

# The Taylor series takes over below this spread of exponents; recursion loses no more than a digit above it.
_SPREAD = 2.0
_TERMS = 22


def exponential_chain(lai, *rates):
    r"""
    Transmission through a layer whose light changes its attenuation rate at every possible depth.

    .. math::

        C(L; r_0 \dots r_n) &= L^n \exp[-r_0 L, \dots, -r_n L] \\
            &= \int\limits_{0 < t_1 < \dots < t_n < L}
            e^{-r_0 t_1 - r_1 (t_2 - t_1) - \dots - r_n (L - t_n)} \, dt_1 \dots dt_n

    Parameters
    ----------
    lai : array
        Depth of the layer, :math:`L`. [1]
    *rates : array
        Attenuation rates :math:`r_i` per leaf area, two to five. They may be equal, and in any order. [1]

    Returns
    -------
    chain : array, shape of the broadcast inputs

    Notes
    -----
    The brackets denote a divided difference. SAIL's functions J1 and J2 are chains of two rates, and where they
    are singular the two are equal. Close exponents go through a Taylor series about their centre, distant
    ones through the recursion for divided differences; so no rate is singular.

    References
    ----------
    [McCurdy1984]_

    Examples
    --------
    Equal rates are no singular case:

    >>> float(exponential_chain(3.0, 0.0, 0.0, 0.0))
    4.5
    """
    given = [np.asarray(each, float) for each in (lai, *rates)]
    flat = np.empty((len(given), *np.broadcast_shapes(*(each.shape for each in given))))
    for number, each in enumerate(given):
        flat[number] = each
    shape, flat = flat.shape[1:], flat.reshape(len(given), -1)
    chains = np.empty(flat.shape[1])
    _chains(flat[0], flat[1:], chains)
    return chains.reshape(shape)[()]


@numba.njit(nogil=True, cache=True)
def _chains(lai, rates, chains):
    """Divided difference of the exponential over all exponents of a cell, times the power of its depth."""
    count = rates.shape[0]
    x, difference, homogeneous = np.empty(count), np.empty(count), np.empty(count)
    for cell in range(lai.size):
        _sort_exponents(lai[cell], rates[:, cell], x)
        if math.isnan(x[0]):
            chains[cell] = math.nan
            continue
        if x[-1] - x[0] < _SPREAD:
            difference[0] = _series(x, 0, count, homogeneous)
        else:
            _recursion(x, difference, homogeneous)
        chains[cell] = lai[cell] ** (count - 1) * difference[0]


@numba.njit(nogil=True, cache=True)
def _sort_exponents(lai, rates, x):
    """By insertion: the recursion divides by the widest difference. What is not a number comes first."""
    for i in range(x.size):
        exponent = -rates[i] * lai
        if math.isnan(exponent):
            x[0] = math.nan
            return
        j = i
        while j > 0 and x[j - 1] > exponent:
            x[j] = x[j - 1]
            j -= 1
        x[j] = exponent


@numba.njit(nogil=True, cache=True)
def _recursion(x, difference, homogeneous):
    """Divided differences over distant exponents, from those of fewer."""
    for i in range(x.size):
        difference[i] = np.exp(x[i])
    for order in range(1, x.size):
        for i in range(x.size - order):
            spread = x[i + order] - x[i]
            if spread < _SPREAD:
                difference[i] = _series(x, i, order + 1, homogeneous)
            else:
                difference[i] = (difference[i + 1] - difference[i]) / spread


@numba.njit(nogil=True, cache=True)
def _series(x, start, count, homogeneous):
    """Divided difference over close exponents: e^c sum_n h_n(x - c) / (n + count - 1)!, h_n homogeneous."""
    centre = (x[start] + x[start + count - 1]) / 2
    # homogeneous[j] is the complete homogeneous polynomial of one degree in the first j + 1 offsets.
    homogeneous[:count] = 1.0
    factorial = 1.0
    for n in range(2, count):
        factorial *= n
    total = 1 / factorial
    for n in range(1, _TERMS):
        factorial *= n + count - 1
        homogeneous[0] *= x[start] - centre
        for j in range(1, count):
            homogeneous[j] = homogeneous[j - 1] + (x[start + j] - centre) * homogeneous[j]
        total += homogeneous[count - 1] / factorial
    return math.exp(centre) * total
