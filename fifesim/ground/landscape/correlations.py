"""Correlations that are asked for: pairs of names, and what to say where none can have them."""

from collections.abc import Mapping

import numpy as np


class Impossible(Exception):
    """Correlations that no fields have together."""


def pairs_of(correlations, fields, ground=()):
    """
    Correlations by pairs, each once and with a field first.

    Parameters
    ----------
    correlations : mapping of (str, str) to float, or of str to mappings of str to float
        ``{("lai", "soil"): -0.4}`` or ``{"lai": {"soil": -0.4}}``. [1]
    fields, ground : sequence of str
        Names that there are: of fields, and of properties of the ground.

    Returns
    -------
    pairs : dict of (str, str) to float

    Raises
    ------
    ValueError
        If a name is unknown, no field is in a pair or twice the same, a pair is given twice, or a correlation is not
        in -1 to 1.
    TypeError
        If one is no pair of names, or no number.

    Examples
    --------
    >>> pairs_of({("elevation", "lai"): 0.3}, ["lai"], ["elevation"])
    {('lai', 'elevation'): 0.3}
    """
    known = [*fields, *ground]
    pairs = {}
    for one, other, r in flat(correlations or {}):
        for name in (one, other):
            if name not in known:
                raise ValueError(f"correlations name {name!r}, there are {', '.join(map(repr, known))}")
        if one == other or not {one, other} & set(fields):
            raise ValueError(
                f"a correlation is of two fields, or of a field with the ground, got {one!r} with {other!r}: fields "
                f"are {', '.join(fields)}; how the ground correlates with itself is known"
            )
        if one not in fields:
            one, other = other, one
        if (one, other) in pairs or (other, one) in pairs:
            raise ValueError(f"the correlation of {one!r} with {other!r} is given twice: give it once")
        pairs[one, other] = _correlation(one, other, r)
    return pairs


def flat(correlations):
    """
    Correlations one by one.

    Parameters
    ----------
    correlations : mapping
        As `pairs_of` takes them.

    Yields
    ------
    one, other : str
    correlation : float

    Raises
    ------
    TypeError
        If they are no mapping, or one has no pair of names.

    Examples
    --------
    >>> list(flat({"lai": {"soil": -0.4}}))
    [('lai', 'soil', -0.4)]
    """
    if not isinstance(correlations, Mapping):
        raise TypeError(f"correlations are {{(name, name): number}}, got {type(correlations).__name__}")
    for key, value in correlations.items():
        if isinstance(value, Mapping):
            yield from ((key, other, r) for other, r in value.items())
        elif isinstance(key, tuple) and len(key) == 2:
            yield *key, value
        else:
            raise TypeError(f"correlations are {{(name, name): number}}, got the key {key!r}: name the other one too")


def _correlation(one, other, r):
    if isinstance(r, bool) or not isinstance(r, int | float | np.number):
        raise TypeError(f"the correlation of {one} with {other} must be a number, got {type(r).__name__}")
    if not -1 <= r <= 1:
        raise ValueError(f"the correlation of {one} with {other} must be in [-1, 1], got {r:g}")
    return float(r)


def largest_share(attempt):
    """
    Largest share of all correlations that some fields have together.

    Parameters
    ----------
    attempt : callable
        ``attempt(share)`` raises `Impossible` where there are none.

    Returns
    -------
    share : float
        In [0, 1).
    """
    low, high = 0.0, 1.0
    for _ in range(20):
        middle = (low + high) / 2
        try:
            attempt(middle)
        except Impossible:
            high = middle
        else:
            low = middle
    return low


def refused(correlations, share, reason):
    """
    What to say of correlations that no fields have together.

    Parameters
    ----------
    correlations : dict of (str, str) to float
    share : float
        From `largest_share`.
    reason : str

    Returns
    -------
    message : str
        At most 500 characters for up to seven pairs.

    Examples
    --------
    >>> print(refused({("lai", "soil"): 0.9}, 0.7, "none have them"))
    correlations lai-soil 0.9 cannot be: none have them. The nearest allowed in their proportion are lai-soil 0.63
    """
    asked = ", ".join(f"{one}-{other} {r:g}" for (one, other), r in correlations.items())
    # Cut, not rounded, to hundredths: what is named must be allowed.
    near = ", ".join(f"{one}-{other} {np.trunc(100 * share * r) / 100:g}" for (one, other), r in correlations.items())
    return f"correlations {asked} cannot be: {reason}. The nearest allowed in their proportion are {near}"
