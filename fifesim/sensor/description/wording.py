"""What is wrong with the description of an instrument, of a file or made in Python, in the words of the package."""

from dataclasses import fields
from functools import wraps

from pydantic import ValidationError

from fifesim.base.foreign import in_a_line, shown
from fifesim.base.refusals import in_own_words
from fifesim.base.spelling import nearest

# Keys whose value has several forms: what follows them in the place of an error is the form's name.
_FORMS = ("srf", "lsf", "interval", "ifov")


def in_words(error, known, called="key"):
    """
    All that is wrong, in one line.

    Parameters
    ----------
    error : pydantic.ValidationError
    known : collection of str
        What a misspelt key may be.
    called : str, optional
        What a key is called.

    Returns
    -------
    text : str
        Keys, their values and what is allowed; bands count from 1.
    """
    return in_a_line("; ".join(_explain(item, known, called) for item in error.errors()))


def worded(described):
    """
    A class whose making refuses in the words of the package.

    Parameters
    ----------
    described : type
        A dataclass of pydantic.

    Returns
    -------
    described : type
        The same; what it refuses is a ValueError.
    """
    make = described.__init__
    known = [each.name for each in fields(described)]

    @wraps(make)
    def making(self, *args, **options):
        try:
            make(self, *args, **options)
        except ValidationError as error:
            raise ValueError(f"{described.__name__}: {in_words(error, known, 'argument')}") from None

    described.__init__ = making
    return described


def _explain(error, known, called):
    key = ".".join(_key_parts(error["loc"]))
    if error["type"] == "unexpected_keyword_argument":
        hint = nearest(str(error["loc"][-1]), known).removesuffix("? ")
        return f"unknown {called} {key}, {hint}" if hint else f"unknown {called} {key}"
    if error["type"] == "missing":
        return f"the {called} {key} is missing"
    if error["type"] == "union_tag_invalid":
        return f"{key}.kind = {shown(error['ctx']['tag'])}: it must be one of {error['ctx']['expected_tags']}"
    if error["type"] == "union_tag_not_found":
        return f"the {called} {key}.kind is missing"
    if error["type"] == "value_error":
        return ": ".join(filter(None, (key, str(error["ctx"]["error"]))))
    return f"{key} = {shown(error['input'])}: {in_own_words(error)}"


def _key_parts(places):
    """Keys of a place in the description, without the names of the forms that a value may have."""
    places = list(places)
    while places:
        part = places.pop(0)
        yield str(part + 1) if isinstance(part, int) else part
        if part in _FORMS and places:
            form = places.pop(0)
            if part == "lsf" and form == "axes" and places:
                yield places.pop(0)
            if part == "lsf" and places and places[0] in ("cosine", "boxcar", "gaussian", "table", "system"):
                places.pop(0)
