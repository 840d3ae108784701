"""Description of a learned landscape, and its file."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, Field

_Numbers = tuple[float, ...]
_Share = Annotated[float, Field(ge=0, le=10)]


class _Part(BaseModel, extra="forbid", frozen=True):
    """Part of the description of a landscape."""


class TerrainResponse(_Part, frozen=True):
    """Response to a form of the land, linear between nodes and constant beyond them."""

    form: str
    nodes: _Numbers
    mean: _Numbers
    """Added to the score. [1]"""
    spread: _Numbers
    """Added to the logarithm of the standard deviation of the residual. [1]"""


class Beds(_Part, frozen=True):
    """Response to the elevation in the sequence of beds, by slope."""

    elevation: _Numbers
    slope: _Numbers
    mean: tuple[_Numbers, ...]


class Residual(_Part, frozen=True):
    """Random field of the residual; one with a height follows contours."""

    spacing: Annotated[float, Field(gt=0)]
    variance: Annotated[float, Field(ge=0)]
    height: Annotated[float, Field(ge=0)] = 0.0


class Described(_Part, frozen=True):
    """_Numbers of a learned landscape."""

    source: str
    cell: Annotated[float, Field(gt=0)]
    terrain: tuple[TerrainResponse, ...] = ()
    beds: Beds | None = None
    residual: tuple[Residual, ...] = ()
    level: tuple[Residual, ...] = ()
    gusts: dict[str, _Share]
    level_gusts: dict[str, _Share]
    log_scale: float = 0.0
    explained: float = 0.0
    scores: _Numbers
    lai: _Numbers
