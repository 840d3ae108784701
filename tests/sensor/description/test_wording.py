from dataclasses import replace

import pytest

import fifesim


def _numbers(**changes):
    tm = fifesim.instrument("TM")
    names = ("name", "title", "altitude", "gsd", "interval", "bits", "lsf", "bands", "sources", "references", "ifov")
    return {name: getattr(tm, name) for name in names} | changes


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"altitude": -1.0}, "Instrument: altitude = -1.0: must be above 0"),
        ({"bits": 40}, "Instrument: bits = 40: must be at most 16"),
        ({"altitdue": 1.0}, "Instrument: unknown argument altitdue, did you mean 'altitude'"),
        ({"references": {}}, "Instrument: sources.altitude: must be one of"),
    ],
)
def test_an_instrument_made_in_python_refuses_in_own_words(changes, said):
    with pytest.raises(ValueError) as caught:
        fifesim.Instrument(**_numbers(**changes))
    assert str(caught.value).startswith(said)
    assert "pydantic" not in str(caught.value) and len(str(caught.value)) <= 500


def test_a_missing_argument_is_named():
    numbers = _numbers()
    del numbers["gsd"]
    with pytest.raises(ValueError, match=r"^Instrument: the argument gsd is missing$"):
        fifesim.Instrument(**numbers)


def test_a_changed_copy_refuses_alike():
    with pytest.raises(ValueError, match=r"^Instrument: gsd = 'wide': must be a number$"):
        replace(fifesim.instrument("TM"), gsd="wide")


def test_what_is_right_is_made():
    assert fifesim.Instrument(**_numbers(altitude=800e3)).altitude == 800e3
