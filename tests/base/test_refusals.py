"""What pydantic refuses, in words of the package."""

from typing import Annotated, Literal

import pytest
from pydantic import BaseModel, Field, TypeAdapter, ValidationError

from fifesim.base.messages import in_own_words


class Table(BaseModel):
    number: float = 1.0


@pytest.mark.parametrize(
    ("kind", "value", "said"),
    [
        (bool, "x", "must be true or false"),
        (bool, [], "must be true or false"),
        (dict[str, float], 3, "must be a table of keys"),
        (Table, 3, "must be a table of keys"),
        (Annotated[float, Field(allow_inf_nan=False)], float("nan"), "must be a finite number"),
        (float, "x", "must be a number"),
        (float, [], "must be a number"),
        (Annotated[float, Field(gt=0.25)], 0.25, "must be above 0.25"),
        (Annotated[float, Field(ge=5)], 4, "must be at least 5"),
        (Annotated[float, Field(lt=0.25)], 0.25, "must be below 0.25"),
        (Annotated[float, Field(le=100)], 101, "must be at most 100"),
        (int, 1.5, "must be a whole number"),
        (int, "x", "must be a whole number"),
        (int, [], "must be a whole number"),
        (list[str], True, "must be a list, in brackets"),
        (tuple[str, ...], 3, "must be a list, in brackets"),
        (Literal["streaming", "periodic"], "quick", "must be 'streaming' or 'periodic'"),
        (str, 3, "must be text, in quotes"),
        (Annotated[str, Field(max_length=2)], "abc", "must have at most 2 characters"),
        (Annotated[str, Field(min_length=2)], "a", "must have at least 2 characters"),
        (Annotated[list[float], Field(min_length=2)], [1.0], "needs 2 of them or more"),
        (Annotated[list[float], Field(max_length=1)], [1.0, 2.0], "takes 1 of them at most"),
    ],
)
def test_each_refusal_says_what_the_value_must_be(kind, value, said):
    with pytest.raises(ValidationError) as caught:
        TypeAdapter(kind).validate_python(value)
    assert in_own_words(caught.value.errors()[0]) == said
