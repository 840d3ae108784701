"""Sections of a scenario: tables whose keys know their units, and which of them name files."""

import re
from pathlib import Path
from typing import get_args

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from fifesim.base.foreign import check_regular, shown

_QUANTITY = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*)")

# Units of length by their power of ten. [m]
_LENGTHS = {"km": 3, "m": 0, "cm": -2}


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
    return Field(default, description=description)


def seed(default, description):
    """
    A key whose value is a seed.

    Parameters
    ----------
    default : int
    description : str
        Of what.

    Returns
    -------
    field : pydantic.fields.FieldInfo
    """
    return Field(default, description=description, ge=0, lt=2**63, strict=True)


def file(default, description, *, names=(), suffix=None):
    """
    A key whose value is the path of a file, or one of some names.

    Parameters
    ----------
    default : str or None
    description : str
    names : sequence of str, optional
        What stands for no file.
    suffix : str or tuple of str, optional
        Tells a file from a name where not all names are known; ``"*"`` is any suffix. Without it all else is a file.

    Returns
    -------
    field : pydantic.fields.FieldInfo
    """
    return Field(default, description=description, json_schema_extra={"file": {"names": names, "suffix": suffix}})


class Section(BaseModel):
    """A table of the scenario. A number may be written with its unit, ``"45 km"``, a length in km, m or cm."""

    model_config = ConfigDict(extra="forbid", frozen=True, validate_default=True)

    @model_validator(mode="before")
    @classmethod
    def _strip_units(cls, values):
        if not isinstance(values, dict):
            raise ValueError(f"expected a table of keys, got {shown(values)}")
        return {key: cls.in_unit(key, value) for key, value in values.items()}

    @classmethod
    def in_unit(cls, key, value):
        """
        Value of a key without its unit.

        Parameters
        ----------
        key : str
        value : object
            A number, or text such as ``"45 km"``; all else stays as it is.

        Returns
        -------
        value : object

        Raises
        ------
        ValueError
            If the unit is not that of the key.
        """
        unit = cls.unit(key) if key in cls.model_fields else ""
        if unit and isinstance(value, bool):
            raise ValueError(f"{key} = {value}: {key} is in {unit}; write a number")
        if not unit or not isinstance(value, str):
            return value
        match = _QUANTITY.fullmatch(value.strip())
        if match is None and str in get_args(cls.model_fields[key].annotation):
            # A key that takes words beside numbers.
            return value
        given = (match[2] or unit) if match else None
        if given != unit and not {given, unit} <= set(_LENGTHS):
            units = " or ".join(repr(each) for each in (_LENGTHS if unit in _LENGTHS else [unit]))
            raise ValueError(f"{key} = {shown(value)}: {key} is in {unit}; write a number, or a number and {units}")
        return float(match[1]) if given == unit else _in_length(float(match[1]), given, unit)

    @classmethod
    def unit(cls, key):
        """
        Unit of a key.

        Parameters
        ----------
        key : str

        Returns
        -------
        unit : str
            Empty where it has none.
        """
        return (cls.model_fields[key].json_schema_extra or {}).get("unit", "")

    @classmethod
    def names_a_file(cls, key, value):
        """
        Whether the value of a key is the path of a file.

        Parameters
        ----------
        key : str
        value : object

        Returns
        -------
        answer : bool
        """
        if not isinstance(value, str) or key not in cls.model_fields:
            return False
        kind = (cls.model_fields[key].json_schema_extra or {}).get("file")
        if kind is None or value in kind["names"]:
            return False
        found, suffix = Path(value).suffix.lower(), kind["suffix"]
        if suffix in (None, "*"):
            return suffix is None or bool(found)
        return found in suffix if isinstance(suffix, tuple) else found == suffix

    @field_validator("*")
    @classmethod
    def _openable(cls, value, info):
        """A missing file is told by who reads it, which may know it by another name."""
        if cls.names_a_file(info.field_name, value):
            if not value:
                raise ValueError("name a file, or drop the key")
            value.encode()  # a ValueError where it could not be written
            try:
                check_regular(value)
            except (FileNotFoundError, NotADirectoryError):
                pass
            except OSError as error:
                raise ValueError(f"the file cannot be opened: {error.strerror}") from None
        return value

    @property
    def said(self):
        """Keys that the table says, in their order, a dict of `pydantic.fields.FieldInfo`."""
        return type(self).model_fields

    @property
    def files(self):
        """Files that the section names, a dict of their paths by key."""
        values = {key: getattr(self, key) for key in type(self).model_fields}
        return {key: value for key, value in values.items() if self.names_a_file(key, value)}

    def with_paths(self, change):
        """
        The same with other paths of its files.

        Parameters
        ----------
        change : callable
            Gives a path for a path.

        Returns
        -------
        section : Section
        """
        return self.model_copy(update={key: change(value) for key, value in self.files.items()})


def _in_length(value, given, wanted):
    """A length in another unit; a power of ten is divided by where that is exact."""
    shift = _LENGTHS[given] - _LENGTHS[wanted]
    return value * 10**shift if shift > 0 else value / 10**-shift
