"""Fractions that a canopy is given: in 0 to 1, or refused."""

import numpy as np
from numba import njit
from numba.extending import register_jitable


def within(values, lowest, highest):
    """
    Whether all values are in a range; NaN is passed over.

    Parameters
    ----------
    values : array
    lowest, highest : float

    Returns
    -------
    answer : bool

    Examples
    --------
    >>> within(np.array([0.2, np.nan]), 0, 1), within(np.array([0.2, 1.5]), 0, 1)
    (True, False)
    """
    values = np.asarray(values, float)
    if values.flags.c_contiguous or values.flags.f_contiguous:
        return not _outside(values.ravel(order="K"), float(lowest), float(highest))
    # Two passes without a copy.
    low, high = (np.fmin.reduce(values, axis=None, initial=lowest), np.fmax.reduce(values, axis=None, initial=highest))
    return bool(low >= lowest and high <= highest)


@register_jitable
def outside(values, lowest, highest):
    """
    How many values are outside a range; NaN is passed over.

    Parameters
    ----------
    values : array, shape (n,)
    lowest, highest : float

    Returns
    -------
    count : int
        A sum, so that several values are looked at at once.

    Examples
    --------
    >>> int(outside(np.array([0.2, np.nan, 1.5]), 0.0, 1.0))
    1
    """
    count = 0
    for i in range(values.size):
        count += (values[i] < lowest) | (values[i] > highest)
    return count


@njit(nogil=True, cache=True)
def _outside(values, lowest, highest):
    return outside(values, lowest, highest)


def check_fraction(name, values):
    """
    Refuse values outside 0 to 1, and NaN.

    Parameters
    ----------
    name : str
        What they are.
    values : array
        [1]

    Raises
    ------
    ValueError
        If one is.

    Examples
    --------
    >>> check_fraction("leaf reflectance", 0.4)
    """
    values = np.asarray(values, float)
    wrong = ~((values >= 0) & (values <= 1))
    if wrong.any():
        raise ValueError(
            f"{name} must be in [0, 1], got {values[wrong].flat[0]:g}: give a fraction, not percent or digital numbers"
        )


def check_share(name, values):
    """
    Refuse a share outside 0 to 1; NaN passes.

    Parameters
    ----------
    name : str
        Of the argument.
    values : array
        [1]

    Returns
    -------
    values : array
        What was given.

    Raises
    ------
    ValueError
        If one is outside 0 to 1.

    Examples
    --------
    >>> check_share("brown", 0.4)
    0.4
    """
    cells = np.asarray(values, float)
    if not within(cells, 0.0, 1.0):
        check_fraction(name, cells[~np.isnan(cells)])
    return values
