"""Misspelt names: the nearest of those that there are."""

import inspect
from difflib import get_close_matches
from functools import wraps

PARTS = {}
"""Names of a description and of its fields by the argument that takes it, for messages."""


def closest(value, allowed):
    """
    The name that a misspelt one stands for.

    Parameters
    ----------
    value : str
    allowed : iterable of str

    Returns
    -------
    name : str
        Empty where no spelling is close; capitals do not count.

    Examples
    --------
    >>> closest("maritme", ["continental", "maritime"]), closest("desert", ["continental", "maritime"])
    ('maritime', '')
    """
    names = {str(name).lower(): str(name) for name in allowed}
    return next((names[found] for found in get_close_matches(str(value).lower(), names, n=1)), "")


def nearest(value, allowed):
    """
    The beginning of a message that names the nearest of what is allowed.

    Parameters
    ----------
    value : str
    allowed : iterable of str

    Returns
    -------
    hint : str
        Empty where none is near.

    Examples
    --------
    >>> nearest("visibilty", ["visibility", "aot"])
    "did you mean 'visibility'? "
    """
    near = closest(value, allowed)
    return f"did you mean {near!r}? " if near else ""


def unknown_argument(name, signature, options):
    """
    What is wrong with the names of some arguments.

    Parameters
    ----------
    name : str
        Of the function.
    signature : inspect.Signature
        Of the function, which takes its arguments by name.
    options : mapping
        Arguments by name.

    Returns
    -------
    text : str
        Empty where the function has all of them.

    Examples
    --------
    >>> def sense(raster, offset=0): ...
    >>> unknown_argument("sense", inspect.signature(sense), {"ofset": 1})
    "sense has no argument 'ofset': did you mean 'offset'? There are raster, offset"
    """
    known = [each for each in signature.parameters if each != "self"]
    unknown = next((each for each in options if each not in known), None)
    if unknown is None:
        return ""
    for argument, (description, fields) in PARTS.items():
        near = unknown if unknown in fields else "" if closest(unknown, known) else closest(unknown, fields)
        if argument in known and near:
            return f"{name} has no argument {unknown!r}: type {argument}={description}({near}=...)"
    return f"{name} has no argument {unknown!r}: {nearest(unknown, known)}There are {', '.join(known)}"


def spelled(described):
    """
    A class whose making says which argument a misspelt one may be.

    Parameters
    ----------
    described : type
        It takes its arguments by name.

    Returns
    -------
    described : type
        The same.
    """
    make = described.__init__
    signature = inspect.signature(make)

    @wraps(make)
    def making(self, *args, **options):
        if wrong := unknown_argument(described.__name__, signature, options):
            raise TypeError(wrong)
        make(self, *args, **options)

    described.__init__ = making
    return described
