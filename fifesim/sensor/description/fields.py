"""What the fields of an instrument file may hold: numbers and names, none of them of another type."""

from typing import Annotated

from pydantic import AfterValidator, ConfigDict, Field

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
