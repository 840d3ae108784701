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

        C(L; r_0 \dots r_n) = \int\limits_{0 < t_1 < \dots < t_n < L}
            e^{-r_0 t_1 - r_1 (t_2 - t_1) - \dots - r_n (L - t_n)} \, dt_1 \dots dt_n
            = L^n \exp[-r_0 L, \dots, -r_n L]

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
    rates = np.stack(np.broadcast_arrays(*(np.asarray(rate, float) for rate in rates)), axis=-1)
    return _chain(np.asarray(lai, float), rates)


@numba.njit(cache=True)
def _series(x, start, count):
    """Divided difference over close exponents: e^c sum_n h_n(x - c) / (n + count - 1)!, h_n homogeneous."""
    centre = (x[start] + x[start + count - 1]) / 2
    # homogeneous[j] is the complete homogeneous polynomial of one degree in the first j + 1 offsets.
    homogeneous = np.ones(count)
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


# Not cached: processes that fill numba's cache of universal functions side by side can crash.
@numba.guvectorize(["(float64, float64[:], float64[:])"], "(),(n)->()")
def _chain(lai, rates, chain):
    """Divided difference of the exponential over all exponents, times the power of the depth."""
    count = rates.size
    x = np.empty(count)
    for i in range(count):
        exponent = -rates[i] * lai
        if math.isnan(exponent):
            chain[0] = math.nan
            return
        # Sorted by insertion: the recursion divides by the widest difference.
        j = i
        while j > 0 and x[j - 1] > exponent:
            x[j] = x[j - 1]
            j -= 1
        x[j] = exponent
    if x[count - 1] - x[0] < _SPREAD:
        chain[0] = lai ** (count - 1) * _series(x, 0, count)
        return
    difference = np.exp(x)
    for order in range(1, count):
        for i in range(count - order):
            spread = x[i + order] - x[i]
            if spread < _SPREAD:
                difference[i] = _series(x, i, order + 1)
            else:
                difference[i] = (difference[i + 1] - difference[i]) / spread
    chain[0] = lai ** (count - 1) * difference[0]
