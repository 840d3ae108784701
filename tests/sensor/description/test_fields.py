"""Fields take no other type than theirs; one value for both axes, or one for each."""

import pytest
from pydantic import TypeAdapter, ValidationError

from fifesim.sensor.description.fields import AlongAcross, Angles, Count, Name, Number, Positive, Share, by_axes
from fifesim.sensor.description.spatial_response import BoxcarResponse, TwoAxesResponse


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


@pytest.mark.parametrize(
    ("replacements", "message"),
    [
        (("interval = 43.0e-6", "interval = { along = 43.0e-6 }"), "the key interval.across is missing"),
        (("interval = 43.0e-6", "interval = '43 urad'"), "interval = '43 urad': .*number"),
    ],
)
def test_mistakes_in_an_angle_name_key_and_remedy(changed, replacements, message):
    with pytest.raises(ValueError, match=f"mine.toml: .*{message}"):
        changed(*replacements)


def test_values_stand_along_and_across():
    wide, narrow = BoxcarResponse("boxcar", width=2e-3), BoxcarResponse("boxcar", width=1e-3)
    assert by_axes(Angles(along=1.3e-3, across=0.95e-3)) == AlongAcross(1.3e-3, 0.95e-3)
    assert by_axes(TwoAxesResponse(along=wide, across=narrow)) == AlongAcross(wide, narrow)
    assert by_axes(wide) == AlongAcross(wide, wide)
    assert by_axes(None) == AlongAcross(None, None)


def test_angles_of_a_file_reach_the_ground_on_their_axes(changed):
    mine = changed("interval = 43.0e-6", "interval = { along = 40.0e-6, across = 44.0e-6 }")
    along, across = mine.ground_intervals(mine.bands[0])
    assert (along, across) == pytest.approx((28.2, 31.02), rel=1e-12)
    assert mine.ground_interval == across
