"""What each of several causes adds to an effect that they have together."""

from math import factorial

import numpy as np


def shapley(values, causes):
    r"""
    Shares of an effect, after Shapley: the mean of what a cause adds over all orders in which they can come.

    .. math::

        \varphi_i = \sum_{S \not\ni i} \frac{|S|! \, (k - |S| - 1)!}{k!} \left[ v(S \cup i) - v(S) \right], \qquad
        \sum_i \varphi_i = v(\mathrm{all}) - v(\mathrm{none})

    Parameters
    ----------
    values : array, shape (2,) * causes + (...)
        Effect v of each set of causes: index 1 along the axis of a cause where it is at work, 0 where it is not.
    causes : int
        Their number k.

    Returns
    -------
    shares : array, shape (causes, ...)
        Exactly 0 for a cause that changes nothing.

    Raises
    ------
    ValueError
        If the values have no axis of two for each cause.

    References
    ----------
    [Shapley1953]_

    Examples
    --------
    Two causes that only work together share alike, and one that does nothing gets nothing:

    >>> together = np.zeros((2, 2, 2))
    >>> together[1, 1, :] = 3.0
    >>> shapley(together, 3).tolist()
    [1.5, 1.5, 0.0]
    """
    values = _checked(values, causes)
    shares = []
    for cause in range(causes):
        added = np.diff(values, axis=cause).squeeze(axis=cause)
        # Number of other causes at work in each set.
        others = np.indices((2,) * (causes - 1)).sum(axis=0) if causes > 1 else np.zeros((), int)
        weights = np.array([factorial(n) * factorial(causes - n - 1) / factorial(causes) for n in range(causes)])
        shares.append(np.tensordot(weights[others], added, axes=causes - 1))
    return np.array(shares).reshape(causes, *values.shape[causes:])


def taken_away(values, causes):
    r"""
    How much of an effect is gone when one cause is taken away, :math:`v(\mathrm{all}) - v(\mathrm{all} \setminus i)`.

    Parameters
    ----------
    values, causes
        As in `shapley`.

    Returns
    -------
    changes : array, shape (causes, ...)

    Raises
    ------
    ValueError
        As in `shapley`.

    Examples
    --------
    >>> taken_away(np.array([[0.0, 1.0], [2.0, 5.0]]), 2).tolist()
    [4.0, 3.0]
    """
    return np.asarray(values, float)[(1,) * causes] - _one_apart(values, causes, 0)


def by_itself(values, causes):
    r"""
    Effect of one cause without any other, :math:`v(i) - v(\mathrm{none})`.

    Parameters
    ----------
    values, causes
        As in `shapley`.

    Returns
    -------
    changes : array, shape (causes, ...)

    Raises
    ------
    ValueError
        As in `shapley`.

    Examples
    --------
    >>> by_itself(np.array([[0.0, 1.0], [2.0, 5.0]]), 2).tolist()
    [2.0, 1.0]
    """
    return _one_apart(values, causes, 1) - np.asarray(values, float)[(0,) * causes]


def _one_apart(values, causes, state):
    """Effect where one cause is at work, 1, or not, 0, and all others otherwise, shape (causes, ...)."""
    values = _checked(values, causes)
    sets = np.where(np.eye(causes, dtype=bool), state, 1 - state)
    return np.array([values[tuple(each)] for each in sets]).reshape(causes, *values.shape[causes:])


def _checked(values, causes):
    values = np.asarray(values, float)
    if values.shape[:causes] != (2,) * causes:
        raise ValueError(f"values must have {causes} axes of 2 first, one for each cause, got shape {values.shape}")
    return values
