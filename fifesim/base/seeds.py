"""
Seeds, and random numbers that are a function of a seed and of a place.

Each stage draws from streams of its own, so that one seed serves them all: 1 is the periodic field, 2 the library of
spectra, 3 to 6 parameters and landscapes of the chips of a study, 16 and up are the synthetic hills, 2**40 and up the
bands of a sensor, 2**50 and up make seeds of the fields of a landscape. The streaming field has its own generator.
"""

import numpy as np

from fifesim.base.kinds import described

LIMIT = 2**63  # scenario files hold signed whole numbers


def check_seed(seed):
    """
    Refuse what is no seed.

    Parameters
    ----------
    seed : int
        In [0, 2**63).

    Returns
    -------
    seed : int

    Raises
    ------
    ValueError
        If it is out of range.
    TypeError
        If it is no whole number.

    Examples
    --------
    >>> check_seed(np.uint8(7))
    7
    """
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer):
        raise TypeError(
            f"seed must be a whole number from 0 to 2**63 - 1, got {described(seed)}: give for instance seed=7"
        )
    if not 0 <= seed < LIMIT:
        raise ValueError(f"seed must be a whole number from 0 to 2**63 - 1, got {seed}: give for instance seed=7")
    return int(seed)


def generator(seed, stream, place=(0, 0, 0, 0)):
    """
    Random numbers of one place.

    Parameters
    ----------
    seed, stream : int
        Key of the Philox generator.
    place : (int, int, int, int), optional
        Its counter, which may be negative; the first word counts on as numbers are drawn.

    Returns
    -------
    generator : numpy.random.Generator

    References
    ----------
    [Salmon2011]_
    """
    # Arrays of words: a list of numbers from 2**63 up would go through floating point, and neighbours be the same.
    key = np.array([seed, stream], np.uint64)
    counter = np.array([word % 2**64 for word in place], np.uint64)
    return np.random.Generator(np.random.Philox(counter=counter, key=key))
