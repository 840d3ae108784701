"""Names of instruments and bands, in any spelling, with the nearest where there is none."""

import re
from difflib import get_close_matches


def key(name):
    """
    What spellings of a name have in common: small letters and digits.

    Parameters
    ----------
    name : str

    Returns
    -------
    key : str

    Examples
    --------
    >>> key("Landsat-8 OLI") == key("landsat 8 oli")
    True
    """
    return re.sub(r"[^a-z0-9+]", "", name.lower())


def lookup(name, known, kind):
    """
    What a name means, in any case, with blanks, hyphens and underscores or without.

    Parameters
    ----------
    name : str
    known : dict
        What there is, by the `key` of its names.
    kind : str
        What it is called in a message.

    Returns
    -------
    found : object

    Raises
    ------
    TypeError
        If the name is not text.
    ValueError
        If there is none; the message has the nearest names and all.

    Examples
    --------
    >>> lookup("Red", {"red": 3}, "colour")
    3
    """
    if not isinstance(name, str):
        raise TypeError(f"{kind}: the name must be text, got {name!r}")
    if key(name) in known:
        return known[key(name)]
    near = [known[each].name for each in get_close_matches(key(name), known, n=2, cutoff=0.4)]
    hint = f"did you mean {' or '.join(dict.fromkeys(near))}? " if near else ""
    names = dict.fromkeys(value.name for value in known.values())
    raise ValueError(f"unknown {kind} {name!r}: {hint}There are {', '.join(names)}")
