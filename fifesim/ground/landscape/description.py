"""Description of a learned landscape, and its file."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, Field, model_validator

from fifesim.ground.landscape import classes
from fifesim.ground.landscape.learned import GUST_LENGTHS, PROBABILITIES
from fifesim.ground.terrain.forms import FORMS

_Numbers = tuple[float, ...]
_Share = Annotated[float, Field(ge=0, le=10)]


class _Part(BaseModel, extra="forbid", frozen=True, ser_json_inf_nan="constants"):
    """Part of the description of a landscape."""


def _check_table(nodes, *columns):
    """Raise an error unless the nodes ascend and each column has a value at each of them."""
    if len(nodes) < 2 or not np.all(np.diff(nodes) > 0):
        raise ValueError("nodes must be two or more ascending numbers")
    if any(len(column) != len(nodes) for column in columns):
        raise ValueError(f"each of the {len(nodes)} nodes needs a value")


class TerrainResponse(_Part, frozen=True):
    """Response to a form of the land, linear between nodes and constant beyond them."""

    form: str
    nodes: _Numbers
    mean: _Numbers
    """Added to the score. [1]"""
    spread: _Numbers
    """Added to the logarithm of the standard deviation of the residual. [1]"""

    @model_validator(mode="after")
    def _check(self):
        if self.form not in FORMS:
            raise ValueError(f"the form {self.form!r} is unknown, there are {', '.join(FORMS)}")
        _check_table(self.nodes, self.mean, self.spread)
        return self


class Beds(_Part, frozen=True):
    """Response to the elevation in the sequence of beds, by slope."""

    elevation: _Numbers
    slope: _Numbers
    mean: tuple[_Numbers, ...]

    @model_validator(mode="after")
    def _check(self):
        _check_table(self.elevation, self.mean)
        _check_table(self.slope, *self.mean)
        return self


class Residual(_Part, frozen=True):
    """Random field of the residual; one with a height follows contours."""

    spacing: Annotated[float, Field(gt=0)]
    variance: Annotated[float, Field(ge=0)]
    height: Annotated[float, Field(ge=0)] = 0.0


class DeclaredProperty(_Part, frozen=True):
    """Property of the ground that varies with leaf area, forms of the land and fields of its own."""

    mean: float
    sd: float
    leaf_area: Annotated[float, Field(ge=-1, le=1)] = 0.0
    """Correlation of its score with the residual of leaf area. [1]"""
    forms: dict[str, float] = {}
    """Weights of normal scores of forms of the land, which count as independent. [1]"""
    spacings: tuple[Annotated[float, Field(gt=0)], ...]
    """Spacings of fields with equal variance, which have the rest of the variance. [m]"""
    note: str
    """Source of the numbers."""

    @property
    def field(self):
        """Distribution of the property."""
        return classes.Field(mean=self.mean, sd=self.sd)

    def own(self, forms):
        """Variance of the score that is left for the own fields."""
        return 1 - self.leaf_area**2 - sum(weight**2 for weight in self.forms.values() if forms)

    @model_validator(mode="after")
    def _check(self):
        if not (self.spacings and self.own(True) >= 0):
            raise ValueError("a property needs spacings, and the squares of leaf_area and of forms sum to 1 at most")
        return self


class Described(_Part, frozen=True):
    """Numbers of a learned landscape."""

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
    properties: dict[Literal["soil", "brown", "moisture"], DeclaredProperty] = {}

    @model_validator(mode="after")
    def _check(self):
        if not set(self.gusts) == set(self.level_gusts) == set(GUST_LENGTHS):
            raise ValueError(f"gusts and level_gusts have the keys {', '.join(GUST_LENGTHS)}")
        known = {each.form for each in self.terrain if len(each.nodes) == len(PROBABILITIES)}
        for name, each in self.properties.items():
            if name in classes.SHARES:
                each.field.distribution(name)
            if unknown := set(each.forms) - known:
                raise ValueError(f"{name} follows {', '.join(sorted(unknown))}, which the terrain lacks")
        _check_table(self.scores, self.lai)
        if not min(self.lai) >= 0:
            raise ValueError(f"leaf area must be 0 or more, got {min(self.lai):g}")
        return self
