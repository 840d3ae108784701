"""Fields take no other type than theirs."""

import pytest
from pydantic import TypeAdapter, ValidationError

from fifesim.sensor.description.fields import Count, Name, Number, Positive, Share


@pytest.mark.parametrize(
    ("field", "right", "wrong"),
    [
        (Number, (-1.5, 0, 3), ("1.5", True, float("nan"), float("inf"))),
        (Positive, (1e-9, 2), (0, -1.0, "1", float("inf"))),
        (Count, (1, 16), (0, 1.0, "1", True)),
        (Share, (0.5, 1e-3), (0.0, 1.0, 30.0)),
        (Name, ("TM", "B 3", "röd"), ("", 5, "B\x1b[31m", "B\n", "B" * 201)),
    ],
)
def test_a_field_takes_its_own_kind_alone(field, right, wrong):
    adapter = TypeAdapter(field)
    assert [adapter.validate_python(value) for value in right] == list(right)
    for value in wrong:
        with pytest.raises(ValidationError):
            adapter.validate_python(value)
