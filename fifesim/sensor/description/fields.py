"""What the fields of an instrument file may hold: numbers and names of one type, one for both axes or one for each."""

from typing import Annotated, Any, NamedTuple

from pydantic import AfterValidator, ConfigDict, Discriminator, Field, Tag
from pydantic.dataclasses import dataclass

from fifesim.base.foreign import shown


def _prints(name):
    """Names stand in messages, tables and files of images."""
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
    """
    Two values in the order of a raster's axes: along the track, by rows, and across it, by columns.

    Parameters
    ----------
    along, across : float or line spread function
    """

    along: Any
    across: Any


class TwoAxes:
    """What an instrument file gives for each axis: ``along`` and ``across`` the track."""


@dataclass(frozen=True, config=CONFIG)
class Angles(TwoAxes):
    """
    An angle that differs between the axes.

    Parameters
    ----------
    along, across : float
        Along and across the track. [rad]
    """

    along: Positive
    across: Positive


def _form(value):
    return "axes" if isinstance(value, dict | Angles) else "number"


# One value for both axes, or one for each.
Angle = Annotated[Annotated[Positive, Tag("number")] | Annotated[Angles, Tag("axes")], Discriminator(_form)]


def by_axes(value):
    """
    A value of both axes, where it may be given for each.

    Parameters
    ----------
    value : TwoAxes or one value
        None stays None for both.

    Returns
    -------
    values : AlongAcross

    Examples
    --------
    >>> by_axes(Angles(along=1.3e-3, across=0.95e-3)).across
    0.00095
    >>> by_axes(42.5e-6).along
    4.25e-05
    """
    return AlongAcross(value.along, value.across) if isinstance(value, TwoAxes) else AlongAcross(value, value)
