"""Fractions that a canopy is given: in 0 to 1, or refused."""

import numpy as np


def within_one(values):
    """
    Whether all values are in 0 to 1; NaN is passed over.

    Parameters
    ----------
    values : array

    Returns
    -------
    answer : bool

    Examples
    --------
    >>> within_one(np.array([0.2, np.nan])), within_one(np.array([0.2, 1.5]))
    (True, False)
    """
    # Two passes without a temporary.
    low, high = np.fmin.reduce(values, axis=None, initial=0.0), np.fmax.reduce(values, axis=None, initial=1.0)
    return bool(low >= 0 and high <= 1)


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
    if not within_one(cells):
        check_fraction(name, cells[~np.isnan(cells)])
    return values
