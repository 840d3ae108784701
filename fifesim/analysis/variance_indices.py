"""Sobol indices: shares of the variance of a function by input."""

from typing import NamedTuple

import numpy as np


class SobolIndices(NamedTuple):
    """Indices by input, shape (k,), with their standard errors. [1]"""

    first: np.ndarray
    """Share of the variance by the input alone."""
    total: np.ndarray
    """Share by the input and its interactions."""
    first_error: np.ndarray
    total_error: np.ndarray


def sobol_points(points):
    r"""
    Points at which a function is evaluated for its Sobol indices.

    Parameters
    ----------
    points : array, shape (n, 2 k)
        Points in the unit cube of twice the number of inputs.

    Returns
    -------
    sets : array, shape (k + 2, n, k)
        The matrices A and B, and for each input :math:`A_B^i`, A with the column of this input from B.

    References
    ----------
    [Saltelli2010]_

    Examples
    --------
    >>> sobol_points(np.array([[0.1, 0.2, 0.8, 0.9]]))[:, 0].tolist()
    [[0.1, 0.2], [0.8, 0.9], [0.8, 0.2], [0.1, 0.9]]
    """
    one, other = np.split(np.asarray(points, float), 2, axis=1)
    inputs = one.shape[1]
    mixed = np.repeat(one[None], inputs, axis=0)
    for each in range(inputs):
        mixed[each, :, each] = other[:, each]
    return np.concatenate([one[None], other[None], mixed])


def sobol_indices(values):
    r"""
    First-order and total Sobol indices by the estimators of Saltelli et al. and Jansen.

    .. math::

        S_i = \frac{1}{V n} \sum_j f(B)_j \left[ f(A_B^i)_j - f(A)_j \right], \qquad
        T_i = \frac{1}{2 V n} \sum_j \left[ f(A)_j - f(A_B^i)_j \right]^2

    Parameters
    ----------
    values : array, shape (k + 2, n)
        Values of the function at `sobol_points`.

    Returns
    -------
    indices : SobolIndices
        Standard errors are of independent points, so that they are too large for points of a Sobol sequence.

    Raises
    ------
    ValueError
        If the function is constant, or a value is not finite.

    References
    ----------
    [Saltelli2010]_, Table 2, rows b and f

    Examples
    --------
    In the sum of an input and twice another, the second has four times the variance:

    >>> from scipy.stats import qmc
    >>> sets = sobol_points(qmc.Sobol(4, seed=0).random(1024))
    >>> sobol_indices(sets @ [1.0, 2.0]).first.round(2).tolist()
    [0.2, 0.8]
    """
    values = np.asarray(values, float)
    if not np.isfinite(values).all():
        raise ValueError("the function is not finite at all points: check the ranges of its inputs")
    variance = values[:2].var()
    if variance == 0:
        raise ValueError("the function is constant: no input has an index")
    # The mean does not matter, but the smaller the numbers, the smaller is the error.
    one, other, *mixed = values - values.mean()
    changes, count = np.array(mixed) - one, one.size
    terms = other * changes / variance, changes**2 / (2 * variance)
    first, total = (each.mean(axis=1) for each in terms)
    errors = (each.std(axis=1, ddof=1) / np.sqrt(count) for each in terms)
    return SobolIndices(first, total, *errors)
