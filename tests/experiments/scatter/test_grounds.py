"""Ground with ideal (uniform) properties, and its stages in a budget."""

from functools import cache

import numpy as np
import pytest
from elevations import write

import fifesim
from fifesim.experiments.scatter.stages import IDEAL_PROPERTIES, ground_with, pixels, varying_ground, working_stages
from fifesim.scenario.ground import ground_scene
from fifesim.scenario.scenario import parse_scenario

# 10 x 10 pixels of 30 m.
GRID = {"west": 707970.0, "north": 4331220.0, "width": 300.0, "height": 300.0}
FLAT = {"grid": GRID, "terrain": {"dem": "flat"}, "sensor": {"response": "paper"}}
ALL = {
    "ground": {"brown": 0.2, "crown_cover": 0.8, "moisture": 0.2},
    "landscape": {
        "cover": "voronoi",
        "size": 60.0,
        "deviations": {"soil": 0.04, "moisture": 0.1, "brown": 0.1, "crown_cover": 0.1},
    },
    "classes": {
        "grass": {"background_spectra": {"soil_dry": 0.5, "shade": 0.5}},
        "litter": {"background_spectra": {"dead_grass": 0.6, "shade": 0.4}, "distribution": "unburned-ungrazed"},
    },
}
ALL["classes"]["litter"]["leaf_angles"] = "planophile"


def case_of(**sections):
    return parse_scenario(FLAT | sections | {"ground": {"arp": 0.15} | sections.get("ground", {})})


@pytest.fixture(scope="module")
def everything():
    return case_of(**ALL)


@pytest.fixture(scope="module")
def whole(everything):
    """The ground with all variation."""
    return ground_scene(everything, everything.geobox())


@pytest.fixture(scope="module")
def ideal(everything):
    """A cached function that makes this ground with the named properties ideal."""
    return cache(lambda *left_out: ground_with(everything, everything.geobox(), set(IDEAL_PROPERTIES) - set(left_out)))


@pytest.mark.parametrize(
    ("sections", "found"),
    [
        ({"ground": {"brown": 0.2, "hotspot": 0.1, "soil": 0.1, "moisture": 0.2}}, ()),
        ({"landscape": {"deviations": {"soil": 0.02}}}, ("soil",)),
        ({"landscape": {"deviations": {"soil": 0.0}}}, ()),
        ({"ground": {"moisture": 0.2}, "landscape": {"deviations": {"moisture": 0.1}}}, ("soil",)),
        ({"ground": {"brown": 0.2}, "landscape": {"deviations": {"brown": 0.1}}}, ("dead leaves",)),
        ({"ground": {"crown_cover": 0.8}}, ("clumping",)),
        ({"landscape": {"cover": "voronoi"}, "classes": {"a": {"hotspot": 0.1}}}, ()),
        ({"landscape": {"cover": "voronoi"}, "classes": {"a": {"hotspot": 0.1}, "b": {}}}, ("cover",)),
        ({"landscape": {"cover": "voronoi"}, "classes": {"a": {"arp": 0.1}, "b": {}}}, ()),
        ({"landscape": {"cover": "voronoi"}, "classes": {"a": {"crown_cover": 0.9}}}, ("clumping",)),
        (ALL, tuple(IDEAL_PROPERTIES)),
    ],
    ids=str,
)
def test_varying_properties_are_found(sections, found):
    case = case_of(**sections)
    assert varying_ground(case) == found
    assert tuple(name for name in working_stages(case) if name in IDEAL_PROPERTIES) == found


def test_ideal_property_is_uniform_and_the_rest_unchanged(ideal, whole):
    """All other variables are identical to the bit, because random numbers are the same."""
    changed = {"soil": {"soil", "moisture"}, "dead leaves": {"brown"}, "cover": {"cover"}, "clumping": {"crown_cover"}}
    for name, variables in changed.items():
        found = ideal(name)
        for other in set(whole) - variables:
            np.testing.assert_array_equal(found[other], whole[other], err_msg=f"{name}: {other}")
    assert ideal("soil")["soil"].item() == 0.0 and ideal("soil")["moisture"].item() == 0.2
    assert ideal("dead leaves")["brown"].item() == 0.2
    assert ideal("clumping")["crown_cover"].item() == 1.0
    first = ideal("cover")["cover"]
    assert (first == 1).all() and first.dtype == whole["cover"].dtype
    assert first.attrs["flag_meanings"] == whole["cover"].attrs["flag_meanings"] and (whole["cover"] == 2).any()


def test_missing_cover_stays_missing(tmp_path, everything):
    """A cell of unknown class does not get the first class."""
    codes = np.where(ground_scene(everything, everything.geobox())["cover"] == 1, 3, 0)
    codes[:20, :9] = -1
    path = write(tmp_path / "cover.tif", codes, everything.geobox().affine, nodata=-1)
    classes = {name: keys | {"code": code} for (name, keys), code in zip(ALL["classes"].items(), (3, 0), strict=True)}
    land = ALL["landscape"] | {"cover": str(path)}
    case = case_of(**ALL | {"landscape": land, "classes": classes})
    found = ground_with(case, case.geobox(), ["soil"])["cover"]
    assert (codes == 0).any()
    np.testing.assert_array_equal(found, np.where(codes < 0, -1, 3))


def test_pixels_with_an_ideal_property_equal_a_scenario_without_it():
    """With the same random numbers, the image equals the image of a scenario that omits the property."""
    land = {"deviations": {"soil": 0.04}}
    seen = pixels(case_of(landscape=land))
    for soil, own in {1: land, 0: {}}.items():
        run = fifesim.simulate(case_of(landscape=own))
        at = tuple({"soil": soil}.get(stage, 1) for stage in seen.stages)
        ndvi, fpar = seen.ndvi[at], np.broadcast_to(seen.truth["fpar"], seen.ndvi.shape)[at]
        np.testing.assert_array_equal(ndvi, run["image"]["ndvi"].values.ravel(), err_msg=str(own))
        np.testing.assert_array_equal(fpar, run["truth"]["fpar"].values.ravel(), err_msg=str(own))
