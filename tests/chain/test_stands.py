"""Canopies from arguments, and the warning about the tallgrass of FIFE on other ground."""

import warnings

import pytest

import fifesim
from fifesim.chain.landscapes import stands_of

GRID = fifesim.fife_site(30, window=((0, 12), (0, 12)))
ELSEWHERE = fifesim.grid_at("EPSG:32633", 390000, 5820000, 360, 360, 30)
KNOWN = {"atmosphere": fifesim.Atmosphere(altitude=0.1), "geometry": fifesim.Geometry(40.0, 150.0)}
BARE = {"background": {"soil_dry": 1.0}}
GREEN = {"leaf_optics": fifesim.Leaf()}


def own_map(grid=GRID):
    return fifesim.open_lai(fifesim.lai_scene(grid, seed=7), grid)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "using FIFE's tallgrass for soil and litter, green leaves; give background=.*give leaf_optics="),
        (BARE, "the vegetation of lai is unknown: using FIFE's tallgrass for green leaves; give leaf_optics="),
        (GREEN, r"tallgrass for soil and litter; give background=\{'soil_dry': 1.0\}"),
        (GREEN | BARE | {"brown": 0.2}, "tallgrass for dead leaves; give brown_leaf="),
    ],
)
def test_assumed_tallgrass_on_a_user_map_is_a_warning(given, message):
    lai = own_map()
    for function in (
        lambda: lai.fifesim.surface_reflectance("TM", **KNOWN, canopy=fifesim.Canopy(**given)),
        lambda: fifesim.compare(lai, ["TM"], fifesim.Setup(**KNOWN, canopy=fifesim.Canopy(**given))),
    ):
        with pytest.warns(UserWarning, match=message) as said:
            function()
        assert len([each for each in said if "vegetation" in str(each.message)]) == 1
        assert {each.filename for each in said if each.category is UserWarning} == {__file__}


def test_given_canopy_is_no_warning():
    with warnings.catch_warnings(action="error", category=UserWarning):
        canopy = fifesim.Canopy(**GREEN, **BARE)
        own_map().fifesim.surface_reflectance("TM", **KNOWN, canopy=canopy)
        dead = canopy.replace(brown=0.2, brown_leaf=fifesim.Leaf(chlorophyll=0, brown=1))
        own_map().fifesim.surface_reflectance("TM", **KNOWN, canopy=dead)
        fifesim.lai_scene(GRID, seed=7).fifesim.surface_reflectance("TM")
        of_fife = fifesim.landscape(GRID, cover="pastures", seed=7).fifesim.surface_reflectance("TM")
    assert of_fife.notnull().all()


def test_classes_with_leaves_need_optics():
    """Water needs no leaves, and arguments of the call fill the gaps of a class."""
    water = fifesim.CoverClass(lai=0, canopy=fifesim.Canopy(background=0.03))
    forest = fifesim.CoverClass(lai=4.0, canopy=fifesim.Canopy(leaf_optics=fifesim.Leaf(chlorophyll=50)))
    patches = fifesim.ground.Patches("voronoi", 100)
    land = fifesim.landscape(ELSEWHERE, cover=patches, classes={"water": water, "forest": forest}, seed=7)
    with pytest.warns(
        UserWarning, match="vegetation of lai is unknown: using FIFE's tallgrass for soil and litter; give background"
    ):
        land.fifesim.surface_reflectance("TM", **KNOWN)
    with warnings.catch_warnings(action="error", category=UserWarning):
        land.fifesim.surface_reflectance("TM", **KNOWN, canopy=fifesim.Canopy(background=0.1))


def test_cells_override_classes_and_classes_override_arguments():
    kind = fifesim.CoverClass("grass", lai=1.0, canopy=fifesim.Canopy(hotspot=0.1, brown=0.3), code=4)
    canopy = fifesim.Canopy(brown=0.1, crown_cover=0.9)
    alone = stands_of((), canopy, {"brown": 0.5})[None]
    assert (alone.brown, alone.crown_cover, alone.given) == (0.5, 0.9, {"brown", "crown_cover"})
    found = stands_of((kind,), canopy, {"brown": 0.5})[4]
    assert (found.hotspot, found.brown, found.crown_cover, found.leaf_optics) == (0.1, 0.5, 0.9, None)
    assert stands_of((kind,), canopy)[4].brown == 0.3
