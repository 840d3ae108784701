"""Sequences of points that fill a space of parameters."""

import warnings

import numpy as np
from scipy.stats import qmc


def points(sequence, seed, stream, count, dimensions):
    """
    Points in the unit cube.

    Parameters
    ----------
    sequence : {"sobol", "latin-hypercube", "random"}
        Of Sobol and of random points the first are the same however many there are; those of a Latin hypercube are not,
        since each of its ``count`` slices of a dimension has one point.
    seed, stream : int
        What makes them, and which of several sequences.
    count, dimensions : int

    Returns
    -------
    points : array, shape (count, dimensions)
        In [0, 1). [1]

    References
    ----------
    [Sobol1967]_ with the scrambling of [Matousek1998]_; [McKay1979]_

    Examples
    --------
    >>> some, more = (points("sobol", 7, 3, count, 2) for count in (5, 12))
    >>> bool((some == more[:5]).all())
    True
    """
    if not count or not dimensions:
        return np.empty((count, dimensions))
    return SEQUENCES[sequence](np.random.default_rng((seed, stream)), count, dimensions)


def _sobol(random, count, dimensions):
    with warnings.catch_warnings():
        # A training set has as many chips as its user wants, not a power of two.
        warnings.filterwarnings("ignore", "The balance properties of Sobol")
        return qmc.Sobol(dimensions, scramble=True, seed=random).random(count)


def _latin_hypercube(random, count, dimensions):
    return qmc.LatinHypercube(dimensions, seed=random).random(count)


def _random(random, count, dimensions):
    return random.random((count, dimensions))


SEQUENCES = {"sobol": _sobol, "latin-hypercube": _latin_hypercube, "random": _random}
"""What makes the points, by name."""
