"""Sections of a scenario: tables whose numbers know their units."""

import re
from typing import get_args

from pydantic import BaseModel, ConfigDict, Field, model_validator

_QUANTITY = re.compile(r"\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(.*?)\s*")


def number(default, unit, description, **limits):
    """
    A key whose value is a number.

    Parameters
    ----------
    default : float or None
        None is a number that need not be given.
    unit, description : str
    **limits
        As `pydantic.Field` takes them.

    Returns
    -------
    field : pydantic.fields.FieldInfo
    """
    return Field(default, description=description, json_schema_extra={"unit": unit}, allow_inf_nan=False, **limits)


def text(default, description):
    """
    A key whose value is a text or a switch.

    Parameters
    ----------
    default : str, bool or None
    description : str

    Returns
    -------
    field : pydantic.fields.FieldInfo
    """
    return Field(default, description=description, json_schema_extra={"unit": ""})


class Section(BaseModel):
    """A table of the scenario. A number may be written with its unit, ``"45 km"``; another unit is a mistake."""

    model_config = ConfigDict(extra="forbid", frozen=True, validate_default=True)

    @model_validator(mode="before")
    @classmethod
    def _strip_units(cls, values):
        if not isinstance(values, dict):
            raise ValueError(f"expected a table of keys, got {values!r}")
        return {key: cls._in_unit(key, value) for key, value in values.items()}

    @classmethod
    def _in_unit(cls, key, value):
        known = cls.model_fields.get(key)
        unit = (known.json_schema_extra or {}).get("unit") if known else None
        if not unit or not isinstance(value, str):
            return value
        match = _QUANTITY.fullmatch(value)
        if match is None and str in get_args(known.annotation):
            # A key that takes words beside numbers.
            return value
        if match is None or match[2] not in ("", unit):
            raise ValueError(f"{key} = {value!r}: {key} is in {unit}; write a number, or a number and {unit!r}")
        return float(match[1])
