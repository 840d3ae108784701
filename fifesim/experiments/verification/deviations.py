"""How far a result lies from an independent one."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.integrate import quad


class Deviation(NamedTuple):
    """The largest deviation that one check found, beside the bound that it must keep."""

    area: str  # of the package, one of `areas.AREAS`
    what: str  # was compared
    deviation: float
    bound: float
    unit: str  # of both; "1" for fractions
    source: str  # of the independent result

    @property
    def within(self):
        """Whether the bound is kept; what is not a number does not."""
        return bool(self.deviation <= self.bound)


def largest(found, expected, *, relative=False):
    """
    Largest absolute difference of two arrays.

    Parameters
    ----------
    found, expected : array, broadcastable
    relative : bool, optional
        In units of `expected`.

    Returns
    -------
    deviation : float
        NaN where one of them holds NaN.

    Examples
    --------
    >>> largest([1.0, 2.5], [1.0, 2.0]), largest([1.0, 2.5], [1.0, 2.0], relative=True)
    (0.5, 0.25)
    """
    difference = np.abs(np.subtract(found, expected))
    return float(np.max(difference / np.abs(expected) if relative else difference))


def rms_percent(found, expected):
    """
    Root mean square of the relative difference of two arrays.

    Parameters
    ----------
    found, expected : array, broadcastable

    Returns
    -------
    deviation : float
        [%]

    Examples
    --------
    >>> round(rms_percent([1.01, 0.99], 1.0), 12)
    1.0
    """
    return float(100 * np.sqrt(np.mean((np.divide(found, expected) - 1) ** 2)))


def integral(function, kinks):
    """
    Integral of a function with kinks.

    Parameters
    ----------
    function : callable
    kinks : sequence of float
        Increasing, from the lower end of the integral to the upper.

    Returns
    -------
    integral : float

    Examples
    --------
    >>> round(integral(abs, (-1.0, 0.0, 2.0)), 12)
    2.5
    """
    return sum(quad(function, low, high, epsabs=1e-10)[0] for low, high in pairwise(kinks))
