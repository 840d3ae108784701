"""Classes of cover: what is refused when they are made, and their names and codes."""

import numpy as np
import pytest
import xarray as xr
from scipy import stats

from fifesim.ground.canopy.description import Canopy
from fifesim.ground.canopy.prospect import Leaf
from fifesim.ground.landscape.classes import CoverClass, class_table, fife_classes

RASTER = xr.DataArray(np.full((2, 2), 0.2), dims=("y", "x"))


def of_canopy(**fields):
    return {"canopy": Canopy(**fields)}


def varies(name):
    return f"class 'wood': {name} must be uniform within a class, got one that varies: give it to landscape"


@pytest.mark.parametrize(
    "fields, error, message",
    [
        ({"name": "tall grass"}, ValueError, "one word, got 'tall grass'"),
        ({"lai": "grazed"}, ValueError, "class 'wood': unknown LAI distribution 'grazed'"),
        ({"lai": -1}, ValueError, "class 'wood': leaf area index must not be negative"),
        ({"lai": 35}, ValueError, "class 'wood': leaf area index up to 35"),
        ({"lai": stats.norm(1, 1)}, ValueError, "class 'wood': leaf area index cannot be negative"),
        ({"arp": 0.3}, ValueError, r"class 'wood': arp must be in \[0, 0.25\), got 0.3"),
        ({"arp": 0.2499}, ValueError, "class 'wood': arp must be at most 0.2498"),
        ({"arp": "0.2"}, TypeError, "class 'wood': arp must be a number, got '0.2'"),
        ({"canopy": 0.4}, TypeError, "class 'wood': canopy must be a fifesim.Canopy, got 0.4"),
        *((of_canopy(**{name: RASTER}), TypeError, varies(name)) for name in ("brown", "moisture", "background")),
        (of_canopy(background={"soil_dry": RASTER}), TypeError, varies("background")),
        (of_canopy(leaf_optics=Leaf(chlorophyll=RASTER)), TypeError, varies("leaf_optics")),
        (of_canopy(brown_leaf={"TM3": (RASTER, 0.1)}), TypeError, varies("brown_leaf")),
        ({"code": -1}, ValueError, "class 'wood': code must be in 0 to 32767, got -1"),
        ({"code": 1.5}, TypeError, "class 'wood': code must be a whole number, got 1.5"),
    ],
)
def test_impossible_class_is_refused_by_name(fields, error, message):
    with pytest.raises(error, match=message) as told:
        CoverClass(**{"name": "wood"} | fields)
    assert len(str(told.value)) <= 500


def test_codes_count_from_one_or_are_given():
    assert [each.code for each in class_table([CoverClass("a"), CoverClass("b")])] == [1, 2]
    assert [each.code for each in class_table({"a": CoverClass(code=0), "b": CoverClass("b", code=7)})] == [0, 7]
    assert class_table(CoverClass("a"))[0].code == 1


@pytest.mark.parametrize(
    "classes, error, message",
    [
        ([], ValueError, "one class or more"),
        ("grass", TypeError, r"classes are a list of fifesim.CoverClass, or \{name: CoverClass\}, got 'grass'"),
        ({"a": 2.0}, TypeError, "class a must be a fifesim.CoverClass, got 2.0"),
        ([CoverClass(lai=1)], ValueError, "class 1 of the list has no name"),
        ([CoverClass("a"), CoverClass("a")], ValueError, "two classes have the name 'a'"),
        ([CoverClass("a", code=3), CoverClass("b", code=3)], ValueError, "two classes have the code 3"),
        ([CoverClass("a", code=3), CoverClass("b")], ValueError, "1 of 2 classes have a code, b none"),
        ({"a": CoverClass("b")}, ValueError, "class 'a' has another name, 'b'"),
    ],
)
def test_impossible_table_is_refused(classes, error, message):
    with pytest.raises(error, match=message):
        class_table(classes)


def test_treatments_of_fife_differ_by_their_leaf_area():
    table = class_table(fife_classes())
    assert [(each.code, each.lai) for each in table] == [
        (1, "burned-grazed"),
        (2, "burned-ungrazed"),
        (3, "unburned-ungrazed"),
    ]
    assert all(not each.canopy.given and each.arp is None for each in table)
