"""Tests of cover classes: names, codes, stored tables, ranges of properties, and errors."""

import json
from dataclasses import fields

import numpy as np
import pytest
import xarray as xr
from scipy import stats

import fifesim
from fifesim.ground.canopy.description import Canopy
from fifesim.ground.canopy.properties import PROPERTIES
from fifesim.ground.canopy.prospect import Leaf
from fifesim.ground.canopy.spectra import Background, Spectrum
from fifesim.ground.landscape.classes import SHARES, CoverClass, Field, class_table, read_table, table_text
from fifesim.ground.landscape.distribution import kernel_density

RASTER = xr.DataArray(np.full((2, 2), 0.2), dims=("y", "x"))


def with_canopy(**fields):
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
        ({"arp": 0.2499}, ValueError, r"class 'wood': arp of the streaming field must be in \[0, 0.2498\]"),
        ({"arp": "0.2"}, TypeError, "class 'wood': arp must be a number, got '0.2'"),
        ({"canopy": 0.4}, TypeError, "class 'wood': canopy must be a fifesim.Canopy, got 0.4"),
        *((with_canopy(**{name: RASTER}), TypeError, varies(name)) for name in ("brown", "moisture", "background")),
        (with_canopy(background={"soil_dry": RASTER}), TypeError, varies("background")),
        (with_canopy(leaf_optics=Leaf(chlorophyll=RASTER)), TypeError, varies("leaf_optics")),
        (with_canopy(brown_leaf={"TM3": (RASTER, 0.1)}), TypeError, varies("brown_leaf")),
        ({"code": -1}, ValueError, r"class 'wood': code must be in \[0, 32767\], got -1"),
        ({"code": 1.5}, TypeError, "class 'wood': code must be a whole number, got 1.5"),
    ],
)
def test_impossible_classes_are_refused_by_name(fields, error, message):
    with pytest.raises(error, match=message) as caught:
        CoverClass(**{"name": "wood"} | fields)
    assert len(str(caught.value)) <= 500


def test_codes_are_given_or_count_from_one():
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
def test_impossible_class_tables_are_refused(classes, error, message):
    with pytest.raises(error, match=message):
        class_table(classes)


FULL = CoverClass(
    "wood",
    lai=stats.gamma(4, scale=0.4),
    arp=0.2,
    canopy=Canopy(
        leaf_optics=Leaf(chlorophyll=40),
        brown_leaf={"TM3": (0.1, 0.2), "TM4": (0.3, np.float64(0.4))},
        background=Background({"soil_dry": 0.5, "shade": 0.5}),
        leaf_angles=np.full(13, 1 / 13),
        hotspot=0.05,
        brown=0.1,
        dissociation=1.0,
        crown_cover=0.7,
        crown_shape=0.4,
    ),
    code=np.int64(41),
)


def test_stored_class_table_is_read_back():
    (read,) = read_table(table_text([FULL]))
    for each in fields(CoverClass):
        was, now = getattr(FULL, each.name), getattr(read, each.name)
        if each.name == "lai":
            np.testing.assert_array_equal(now.ppf([0.1, 0.9]), was.ppf([0.1, 0.9]))
        elif each.name != "canopy":
            assert now == was, each.name
    assert read.canopy.given == FULL.canopy.given
    for name in PROPERTIES:
        was, now = getattr(FULL.canopy, name), getattr(read.canopy, name)
        assert np.array_equal(now, was) if name == "leaf_angles" else now == was, name


@pytest.mark.parametrize(
    ("name", "given", "expected"),
    [
        *(("background", each, each) for each in (0.2, "dead_grass", {"TM3": 0.1}, Spectrum((0.4, 2.5), (0.1, 0.3)))),
        ("leaf_optics", (0.1, [0.2, 0.3]), (0.1, (0.2, 0.3))),
    ],
)
def test_stored_background_and_leaf_optics_are_read_back(name, given, expected):
    (read,) = read_table(table_text([CoverClass("a", canopy=Canopy(**{name: given}))]))
    assert getattr(read.canopy, name) == expected and read.canopy.given == {name}


def test_distributions_of_samples_are_not_stored():
    text = table_text([CoverClass("a", lai=kernel_density([1.0, 2.0, 2.5, 3.0, 3.1]))])
    assert json.loads(text) == [{"name": "a"}]


@pytest.mark.parametrize("text", ["grass", "[1]", '[{"height": 3}]'])
def test_invalid_stored_tables_are_refused(text):
    with pytest.raises(ValueError, match="class table of the cover is invalid"):
        read_table(text)


@pytest.mark.parametrize("name", SHARES)
@pytest.mark.parametrize(("mean", "sd"), [(0.2, 0.1), (0.2, 0.39), (0.5, 0.02), (0.9, 0.05), (0.01, 0.005)])
def test_share_has_the_given_mean_and_deviation(name, mean, sd):
    found = Field(mean=mean, sd=sd).distribution(name)
    assert found.support() == (0, 1)
    assert (found.mean(), found.std()) == pytest.approx((mean, sd), rel=1e-12)
    assert Field(mean=mean, sd=sd, arp=0.24).distribution(name) is found


@pytest.mark.parametrize(
    ("mean", "sd", "message"),
    [
        (0.2, 0.4, "brown lies between 0 and 1: with a mean of 0.2 its sd must be above 0 and below 0.4, got 0.4"),
        (0.2, 0.0, "its sd must be above 0 and below 0.4, got 0"),
        (0.0, 0.1, "brown lies between 0 and 1: for it to vary .* such as 0.2, got 0$"),
        (1.0, 0.1, "for it to vary .*, got 1$"),
        (-0.2, 0.1, "for it to vary .*, got -0.2$"),
    ],
)
def test_impossible_shares_are_refused(mean, sd, message):
    with pytest.raises(ValueError, match=message):
        Field(mean=mean, sd=sd).distribution("brown")
    assert Field(mean=0.2, sd=0.3999).distribution("brown").std() == pytest.approx(0.3999, rel=1e-12)


def test_default_field_and_limits_of_its_numbers():
    assert Field() == Field(mean=0.0, sd=0.0, arp=0.15)
    assert fifesim.ground.Field is Field
    for limit in ({"mean": 1}, {"mean": -1}, {"sd": np.int64(0)}, {"arp": 0}, {"arp": 0.2498}, {"sd": np.float32(3)}):
        Field(**limit)


@pytest.mark.parametrize(
    ("values", "error", "message"),
    [
        ({"sd": -0.1}, ValueError, "sd must be at least 0, got -0.1: it is a standard deviation"),
        ({"sd": np.inf}, ValueError, "sd must be at least 0"),
        ({"sd": np.nan}, ValueError, "sd must be at least 0"),
        ({"mean": 1.01}, ValueError, r"mean must be in \[-1, 1\], got 1.01"),
        ({"mean": -1.01}, ValueError, r"mean must be in \[-1, 1\], got -1.01"),
        ({"mean": np.nan}, ValueError, "mean must be in"),
        ({"arp": 0.25}, ValueError, "arp must be in"),
        ({"arp": -0.01}, ValueError, "arp must be in"),
        ({"coarser": 4}, TypeError, "no argument 'coarser': it was removed"),
        ({"arp": 0.2499}, ValueError, r"arp of the streaming field must be in \[0, 0.2498\], got 0.2499: use larger"),
        ({"sd": True}, TypeError, "sd must be a number"),
        ({"mean": "0.2"}, TypeError, "mean must be a number, got '0.2'"),
    ],
)
def test_invalid_fields_are_refused_by_name(values, error, message):
    with pytest.raises(error, match=message):
        Field(**values)
