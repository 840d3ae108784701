"""Names of instruments and bands, in any case, with the nearest where there is none."""

from difflib import get_close_matches


def lookup(name, known, kind):
    """
    What a name means, in any case.

    Parameters
    ----------
    name : str
    known : dict
        What there is, by names in lower case.
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
    if name.lower() in known:
        return known[name.lower()]
    near = [known[key].name for key in get_close_matches(name.lower(), known, n=2, cutoff=0.4)]
    hint = f"did you mean {' or '.join(dict.fromkeys(near))}? " if near else ""
    names = dict.fromkeys(value.name for value in known.values())
    raise ValueError(f"unknown {kind} {name!r}: {hint}There are {', '.join(names)}")
