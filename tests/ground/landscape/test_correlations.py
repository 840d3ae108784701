"""Correlations as they are asked for."""

import pytest

from fifesim.ground.landscape.covariance import Impossible, largest_share, pairs_of, refused

FIELDS, GROUND = ["lai", "soil", "moisture"], ["elevation", "wetness"]


def test_both_spellings_are_the_same():
    pairs = {("lai", "soil"): -0.4, ("soil", "elevation"): 0.3}
    assert pairs_of({"lai": {"soil": -0.4}, "elevation": {"soil": 0.3}}, FIELDS, GROUND) == pairs
    assert pairs_of({("lai", "soil"): -0.4, ("elevation", "soil"): 0.3}, FIELDS, GROUND) == pairs
    assert pairs_of(None, FIELDS) == {}


@pytest.mark.parametrize(
    ("correlations", "kind", "message"),
    [
        ({("lai", "sand"): 0.1}, ValueError, "name 'sand', there are 'lai', 'soil'"),
        ({("elevation", "wetness"): 0.1}, ValueError, "of two fields, or of a field with the ground"),
        ({("lai", "lai"): 1.0}, ValueError, "of two fields"),
        ({("lai", "soil"): 0.1, ("soil", "lai"): 0.1}, ValueError, "'soil' with 'lai' is given twice"),
        ({("lai", "soil"): 1.2}, ValueError, r"must be in \[-1, 1\], got 1.2"),
        ({("lai", "soil"): float("nan")}, ValueError, r"must be in \[-1, 1\], got nan"),
        ({("lai", "soil"): "much"}, TypeError, "must be a number, got str"),
        ({"soil": 0.1}, TypeError, "the key 'soil': name the other one too"),
        ([("lai", "soil", 0.1)], TypeError, "got list"),
    ],
)
def test_what_is_no_correlation_is_one_line(correlations, kind, message):
    with pytest.raises(kind, match=message) as caught:
        pairs_of(correlations, FIELDS, GROUND)
    assert len(str(caught.value)) <= 500


def test_largest_share_is_found():
    def attempt(share):
        if share > 0.37:
            raise Impossible

    assert largest_share(attempt) == pytest.approx(0.37, abs=1e-5)


def test_refusal_names_all_and_is_short():
    names = [f"property {number}" for number in range(5)]
    pairs = {("lai", name): -0.98765 for name in names}
    message = refused(pairs, 0.999, "no correlation matrix has them together; pairs that are not named count as 0")
    assert len(message) <= 500
    assert all(f"lai-{name} -0.98" in message for name in names)
