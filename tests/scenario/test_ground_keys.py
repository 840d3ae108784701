"""Keys of the ground: what is one stand, what a class says, and what is refused."""

import os

import pytest
from pydantic import ValidationError

from fifesim.scenario.keys import COVARIATES, VARYING, ClassKeys, GroundKeys, LandscapeKeys, Section, StandKeys


@pytest.mark.parametrize(
    "values",
    [
        {},
        {"cover": "none", "size": 50.0},
        {"deviations": {"soil": 0.0, "brown": 0}},
        {"deviations": {"soil": 0.0}, "arps": {"soil": 0.24}},
        {"deviations": {"soil": 0.0}, "covary": {"elevation": 0.0, "soil": 0}},
    ],
)
def test_one_stand_is_where_nothing_varies_but_leaf_area(values):
    """What is 0 is as if it were not said."""
    assert LandscapeKeys(**values).is_one() is True


@pytest.mark.parametrize(
    "values",
    [
        {"cover": "pastures"},
        {"cover": "cover.tif"},
        {"deviations": {"soil": 0.02}},
        {"deviations": {"soil": 0.0, "brown": 0.1}},
        {"covary": {"elevation": -0.3}},
    ],
)
def test_one_stand_is_not_where_something_does(values):
    assert LandscapeKeys(**values).is_one() is False


def test_a_class_says_what_it_was_given_and_no_default():
    stand = ClassKeys(hotspot=0.0, distribution="burned-grazed", code=None)
    assert list(stand.written) == ["distribution", "hotspot", "code"]
    assert list(ClassKeys().written) == []
    assert stand.written["hotspot"] is ClassKeys.model_fields["hotspot"]
    ground = GroundKeys(hotspot=0.2)
    assert list(ground.written) == list(GroundKeys.model_fields)


def test_a_class_keeps_what_it_says_in_another_place():
    """As a complete scenario has it: with the full path of its file."""
    whole = ClassKeys(distribution="samples.csv", brown=0.0).with_paths(os.path.abspath)
    assert list(whole.written) == ["distribution", "brown"]
    assert whole.distribution.endswith("samples.csv") and len(whole.distribution) > len("samples.csv")


def test_what_varies_is_named_once():
    assert not set(VARYING) & set(COVARIATES)
    for name in VARYING + COVARIATES:
        assert name in LandscapeKeys.model_fields["covary"].description
        assert (name in LandscapeKeys.model_fields["deviations"].description) == (name in VARYING)


def test_a_map_of_cover_is_a_file_and_the_names_of_patterns_are_none():
    assert LandscapeKeys(cover="maps/cover.tif").files == {"cover": "maps/cover.tif"}
    for name in ("none", "pastures", "voronoi", "levels"):
        assert LandscapeKeys(cover=name).files == {}


def test_numbers_come_with_their_unit_and_limits_are_allowed():
    assert LandscapeKeys(size="1.2 km").size == 1200.0
    LandscapeKeys(deviations=dict.fromkeys(VARYING, 1), arps={"soil": 0.2498, "brown": 0})
    LandscapeKeys(covary={"wetness": 1, "illumination": -1}, deviations={})
    StandKeys(hotspot=1e-6, brown=1, dissociation=1, crown_cover=0, crown_shape=10, soil=-1, moisture=1)
    ClassKeys(share=1)


@pytest.mark.parametrize(
    ("section", "values", "said"),
    [
        (
            LandscapeKeys,
            {"cover": "voronoy"},
            "did you mean 'voronoi'. use none, pastures, voronoi, levels, or a",
        ),
        (LandscapeKeys, {"cover": ""}, "use none"),
        (LandscapeKeys, {"size": 0.0}, "greater than 0"),
        (LandscapeKeys, {"size": "1 degree"}, "size is in m"),
        (LandscapeKeys, {"moisture": 0.1}, "moisture\n +Extra inputs are not permitted"),
        (
            LandscapeKeys,
            {"deviations": {"elevation": 0.1}},
            "unknown name 'elevation': .*allowed are brown, crown_cover, soil, moisture",
        ),
        (LandscapeKeys, {"deviations": {"soil": 1.1}}, r"soil = 1.1: must be in \[0, 1\]"),
        (LandscapeKeys, {"deviations": {"soil": "much"}}, "valid number"),
        (LandscapeKeys, {"deviations": {"soil": float("nan")}}, "finite"),
        (LandscapeKeys, {"deviations": {"soil": 0.1}, "arps": {"soil": 0.2499}}, r"must be in \[0, 0.2498\]"),
        (
            LandscapeKeys,
            {"deviations": {"soil": 0.1}, "arps": {"soil": -0.1}},
            r"soil = -0.1: must be in \[0, 0.2498\]",
        ),
        (LandscapeKeys, {"arps": {"lai": 0.1}}, "unknown name 'lai'"),
        (LandscapeKeys, {"arps": {"brown": 0.1}}, "arps.brown is for a field that is drawn: give deviations.brown too"),
        (
            LandscapeKeys,
            {"covary": {"moisture": 0.1}},
            "covary.moisture is for a field that is drawn: give deviations.m",
        ),
        (LandscapeKeys, {"covary": {"wettness": 0.1}}, "did you mean 'wetness'"),
        (LandscapeKeys, {"covary": {"wetness": -1.1}}, r"wetness = -1.1: must be in \[-1, 1\]"),
        (LandscapeKeys, {"colour": "green"}, "colour"),
        (StandKeys, {"moisture": 1.1}, "less than or equal to 1"),
        (StandKeys, {"soil": -1.1}, "greater than or equal to -1"),
        (StandKeys, {"crown_cover": 1.01}, "less than or equal to 1"),
        (StandKeys, {"brown": -0.01}, "greater than or equal to 0"),
        (StandKeys, {"leaf": {"water": 0.01}, "leaf_reflectance": {"TM3": 0.1}}, "leaf and leaf_reflectance are both"),
        (
            StandKeys,
            {"background_spectra": {"shade": 1.0}, "background": {"TM3": 0.1}},
            "background_spectra and background are both given: remove one of them",
        ),
        (StandKeys, {"brown_leaf": {"a\nb": 0.1}}, "is not a name: names have up to 60 printable characters"),
        (ClassKeys, {"share": 0.0}, "greater than 0"),
        (ClassKeys, {"code": "one"}, "valid integer"),
        (ClassKeys, {"seed": 7}, "seed"),
    ],
)
def test_what_is_not_allowed_is_named(section, values, said):
    with pytest.raises(ValidationError, match=said):
        section(**values)


def test_sections_are_frozen():
    assert all(issubclass(each, Section) for each in (GroundKeys, ClassKeys, LandscapeKeys))
    with pytest.raises(ValidationError, match="frozen"):
        LandscapeKeys().size = 0.5
