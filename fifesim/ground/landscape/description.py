"""Description of a learned landscape, and its file."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, Field

Numbers = tuple[float, ...]
Share = Annotated[float, Field(ge=0, le=10)]


class _Part(BaseModel, extra="forbid", frozen=True):
    """Part of the description of a landscape."""


class TerrainResponse(_Part):
    """Response to a form of the land, linear between nodes and constant beyond them."""

    form: str
    nodes: Numbers
    mean: Numbers
    """Added to the score. [1]"""
    spread: Numbers
    """Added to the logarithm of the standard deviation of the residual. [1]"""


class Beds(_Part):
    """Response to the elevation in the sequence of beds, by slope."""

    elevation: Numbers
    slope: Numbers
    mean: tuple[Numbers, ...]


class Residual(_Part):
    """Random field of the residual; one with a height follows contours."""

    spacing: Annotated[float, Field(gt=0)]
    variance: Annotated[float, Field(ge=0)]
    height: Annotated[float, Field(ge=0)] = 0.0


class Described(_Part):
    """Numbers of a learned landscape."""

    source: str
    cell: Annotated[float, Field(gt=0)]
    terrain: tuple[TerrainResponse, ...] = ()
    beds: Beds | None = None
    residual: tuple[Residual, ...] = ()
    level: tuple[Residual, ...] = ()
    gusts: dict[str, Share]
    level_gusts: dict[str, Share]
    log_scale: float = 0.0
    explained: float = 0.0
    scores: Numbers
    lai: Numbers
