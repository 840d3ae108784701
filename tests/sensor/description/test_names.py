"""Names in any case, and what is said of one that is unknown."""

from typing import NamedTuple

import pytest

from fifesim.sensor.description.fields import lookup
from fifesim.sensor.description.instruments import instrument


class Named(NamedTuple):
    name: str


KNOWN = {"tm": Named("TM"), "landsat5tm": Named("TM"), "oli": Named("OLI"), "hrv": Named("HRV")}


@pytest.mark.parametrize("name", ["TM", "tm", "landsat-5 tm", "LANDSAT 5_TM"])
def test_any_case_and_any_alias_find_the_same(name):
    assert lookup(name, KNOWN, "instrument") == Named("TM")


def test_nearest_names_come_first_and_each_once():
    with pytest.raises(ValueError, match=r"^unknown instrument 'OIL': did you mean OLI\? There are TM, OLI, HRV$"):
        lookup("OIL", KNOWN, "instrument")
    with pytest.raises(ValueError, match=r"^unknown instrument 'zzzz': There are TM, OLI, HRV$"):
        lookup("zzzz", KNOWN, "instrument")
    with pytest.raises(TypeError, match="instrument: the name must be text, got None"):
        lookup(None, KNOWN, "instrument")


def test_unknown_names_list_the_nearest_and_all():
    with pytest.raises(ValueError, match=r"unknown instrument 'TN': did you mean TM\b.*\? There are .*TM"):
        instrument("TN")
    with pytest.raises(ValueError, match=r"unknown band of TM 'TM6': did you mean .* TM1, TM2, TM3, TM4, TM5"):
        instrument("TM").select(["TM3", "TM6"])
    with pytest.raises(TypeError, match="band of TM: the name must be text, got 3"):
        instrument("TM").select([3])
