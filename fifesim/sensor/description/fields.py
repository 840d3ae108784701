"""Fields and names in the description of an instrument, and messages about mistakes in it."""

import re
from dataclasses import fields
from difflib import get_close_matches
from functools import wraps
from typing import Annotated, Any, NamedTuple

from pydantic import AfterValidator, ConfigDict, Discriminator, Field, Tag, ValidationError
from pydantic.dataclasses import dataclass

from fifesim.base.bands import COMMON_NAMES, colour_composite, nearest_band
from fifesim.base.files import in_a_line, shown
from fifesim.base.messages import in_own_words, nearest


def _prints(name):
    """Raise ValueError for names with unprintable characters, as they appear in messages and files."""
    if not name.isprintable():
        raise ValueError(f"{shown(name)} must have characters that print")
    return name


CONFIG = ConfigDict(extra="forbid")

# Strict: TOML has types, and text where a number belongs is a mistake.
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[float, Field(strict=True, gt=0, allow_inf_nan=False)]
Count = Annotated[int, Field(strict=True, gt=0)]
Share = Annotated[float, Field(strict=True, gt=0, lt=1, allow_inf_nan=False)]
Name = Annotated[str, Field(strict=True, min_length=1, max_length=200), AfterValidator(_prints)]


class AlongAcross(NamedTuple):
    """Two values in the order of the axes of a raster: along the track (rows) and across it (columns)."""

    along: Any
    across: Any


class TwoAxes:
    """Values of an instrument file for each axis: ``along`` and ``across`` the track."""


@dataclass(frozen=True, config=CONFIG)
class Angles(TwoAxes):
    """Angle that differs between the axes, along and across the track. [rad]"""

    along: Positive
    across: Positive


def _form(value):
    return "axes" if isinstance(value, dict | Angles) else "number"


# One value for both axes, or one for each.
Angle = Annotated[Annotated[Positive, Tag("number")] | Annotated[Angles, Tag("axes")], Discriminator(_form)]


def by_axes(value):
    """Values along and across the track, from a single value or one for each."""
    return AlongAcross(value.along, value.across) if isinstance(value, TwoAxes) else AlongAcross(value, value)


def key(name):
    """Canonical form of a name: lower-case letters and digits."""
    return re.sub(r"[^a-z0-9+]", "", name.lower())


def lookup(name, known, kind):
    """Value of a name in any case, with or without blanks, hyphens and underscores."""
    if not isinstance(name, str):
        raise TypeError(f"{kind}: the name must be text, got {name!r}")
    if key(name) in known:
        return known[key(name)]
    near = [known[each].name for each in get_close_matches(key(name), known, n=2, cutoff=0.4)]
    hint = f"did you mean {' or '.join(dict.fromkeys(near))}? " if near else ""
    names = dict.fromkeys(value.name for value in known.values())
    raise ValueError(f"unknown {kind} {name!r}: {hint}There are {', '.join(names)}")


# Prefixes of band numbers used by agencies.
_PREFIXES = {"", "b", "band", "srb", "surreflb"}


def band_called(name, instrument):
    """Band of an instrument by its name, its number, or a common name such as ``red``; None if there is none."""
    wanted = key(str(name))
    # A common name may end like a band number: nir08.
    if wanted in COMMON_NAMES:
        found = nearest_band([band.wavelength for band in instrument.bands], COMMON_NAMES[wanted])
        return None if found is None else instrument.bands[found]
    prefix, number = _parts(wanted)
    own = [(band, *_parts(band.name)) for band in instrument.bands]
    for band, letters, its in own:
        if wanted == key(band.name) or (number and (letters, its) == (prefix, number)):
            return band
    # VIIRS has two kinds of bands, I1 and M1, so a number is ambiguous.
    numbered = [band for band, _, its in own if number and its == number]
    return numbered[0] if len(numbered) == 1 and prefix in _PREFIXES else None


def _parts(name):
    """Prefix of a name, and its final band number with its letter, without leading zeros."""
    found = re.fullmatch(r"(|.*[a-z])0*([1-9]\d*a?)", key(name))
    return found.groups() if found else (key(name), "")


def false_colour_bands(instrument):
    """Green, red and near infrared band of one grid for a false-colour picture, or the latter two without a green."""
    pair = instrument.red_and_near_infrared()
    sizes = {instrument.pixel(band) for band in pair}
    beside = [band for band in instrument.bands if {instrument.pixel(band)} == sizes]
    # None of them where red and near infrared lie on different grids.
    *_, red, green = colour_composite([band.wavelength for band in beside])
    return pair if green == red else (beside[green], *pair)


# Keys with several types of values. In the location of an error, they are followed by the name of the type.
_FORMS = ("srf", "lsf", "paper_lsf", "interval", "ifov")


def errors_in_words(error, known, called="key"):
    """Message for the errors in a description: keys, values and the allowed values; bands count from 1."""
    return in_a_line("; ".join(_explain(item, known, called) for item in error.errors()))


def worded(described):
    """Wrap the initialization of a class so that pydantic errors become ValueError with the messages of the package."""
    make = described.__init__
    known = [each.name for each in fields(described)]

    @wraps(make)
    def making(self, *args, **options):
        try:
            make(self, *args, **options)
        except ValidationError as error:
            raise ValueError(f"{described.__name__}: {errors_in_words(error, known, 'argument')}") from None

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
    """Keys of a place in the description, without the names of alternative types."""
    places = list(places)
    while places:
        part = places.pop(0)
        yield str(part + 1) if isinstance(part, int) else part
        if part in _FORMS and places:
            form = places.pop(0)
            if part.endswith("lsf") and form == "axes" and places:
                yield places.pop(0)
            if part.endswith("lsf") and places and places[0] in ("cosine", "boxcar", "gaussian", "table", "system"):
                places.pop(0)
