"""Ground of a scenario compared with explicit calls, and limits at which it equals the uniform ground."""

import re
import warnings

import numpy as np
import pytest
import xarray as xr
from elevations import write
from lazy import no_compute
from mistakes import cases, mistakes
from oracles_canopy import fpar_of_green_leaves

import fifesim
from fifesim.grids import grid as grids
from fifesim.ground.canopy.layers import extinction_coefficient
from fifesim.scenario.ground import (
    canopy_of,
    drawn_properties,
    elevation,
    ground_scene,
    scenario_light_on_hills,
    warn_of_canopy,
)
from fifesim.scenario.scenario import parse_scenario

SMALL = {"grid": {"width": 300.0, "height": 240.0}, "terrain": {"dem": "flat"}}

STAND = {"distribution": "burned-grazed"}

BACKGROUND = {"TM3": 0.1, "TM4": 0.2}

GROUND = {"arp": 0.1, "seed": 11, "hotspot": 0.1, "brown": 0.2, "dissociation": 0.5, "crown_cover": 0.8}
GROUND |= {"crown_shape": 0.7, "moisture": 0.2, "fpar_inf": 0.9, "background": BACKGROUND}
GROUND |= {"distribution": "burned-ungrazed", "leaf_angles": "planophile", "brown_leaf": {"brown": 1.0}}
OWN = {
    "ground": GROUND,
    "landscape": {"cover": "voronoi", "size": 80.0, "deviations": {"soil": 0.03, "brown": 0.06, "crown_cover": 0.0}},
    "classes": {
        "grass": {"share": 0.7, "hotspot": 0.2, "arp": 0.2, "leaf_angles": "spherical"},
        "wood": {"share": 0.3, "distribution": "unburned-ungrazed", "leaf_angles": "erectophile"},
    },
}


@pytest.fixture(scope="module")
def scenario():
    return parse_scenario(SMALL | OWN)


@pytest.fixture(scope="module")
def by_hand(scenario):
    """The landscape of `OWN`, built by explicit calls."""
    grass = fifesim.Canopy(hotspot=0.2, leaf_angles="spherical")
    wood = fifesim.CoverClass(lai="unburned-ungrazed", canopy=fifesim.Canopy(leaf_angles="erectophile"))
    return fifesim.landscape(
        scenario.geobox(),
        cover=fifesim.ground.Patches("voronoi", 80, {"grass": 0.7, "wood": 0.3}),
        classes={"grass": fifesim.CoverClass(lai="burned-ungrazed", canopy=grass, arp=0.2), "wood": wood},
        arp=0.1,
        brown=fifesim.ground.Field(mean=0.2, sd=0.06, arp=0.1),
        soil=fifesim.ground.Field(sd=0.03, arp=0.1),
        seed=11,
    )


def explicit_fields(canopy):
    return {name: getattr(canopy, name) for name in canopy.given}


def make_scene(**sections):
    case = parse_scenario(SMALL | sections | {"ground": STAND | sections.get("ground", {})})
    return ground_scene(case, case.geobox())


def test_landscape_matches_explicit_calls(scenario, by_hand):
    land = ground_scene(scenario, scenario.geobox())
    assert set(land) == {"lai", "cover", "brown", "soil"}
    for name in land:
        xr.testing.assert_identical(land[name].drop_attrs(), by_hand[name].drop_attrs())
        assert land[name].attrs["history"] == by_hand[name].attrs["history"]


def test_reflectance_and_truth_match_explicit_calls(scenario, by_hand):
    bands, sun = ["TM3", "TM4"], scenario.sun_and_view()
    shares = fifesim.Canopy(dissociation=0.5, crown_cover=0.8)
    canopy = shares.replace(hotspot=0.1, crown_shape=0.7, moisture=0.2, background=BACKGROUND)
    canopy = canopy.replace(brown_leaf=fifesim.Leaf(brown=1.0))
    rho = fifesim.surface_reflectance(by_hand, bands=bands, geometry=sun, canopy=canopy)
    with no_compute():
        tree = fifesim.simulate(scenario)
    np.testing.assert_array_equal(tree["scene"]["surface_reflectance"], rho)
    onto = grids.aligned_grid(scenario.geobox(), 30.0)
    image = fifesim.sense(fifesim.to_toa(rho), onto=onto)
    np.testing.assert_array_equal(tree["image"]["dn"], image)
    truth = {
        "lai": by_hand["lai"],
        "fpar": fifesim.fpar(by_hand, geometry=sun, fpar_inf=0.9, canopy=shares),
        "soil": by_hand["soil"],
    }
    assert set(tree["truth"].data_vars) == {*truth, "brown", "green_fpar"}
    wood = extinction_coefficient(sun.sza, "erectophile") * np.cos(np.radians(sun.sza))
    projection = np.where(by_hand["cover"] == 2, wood, 0.5)
    green = fpar_of_green_leaves(by_hand["lai"].values, sun.sza, by_hand["brown"].values, 0.5, 0.8, 0.9, projection)
    green = fifesim.aggregate(by_hand["lai"].copy(data=green), 30.0)
    np.testing.assert_allclose(tree["truth"]["green_fpar"], green, rtol=1e-12)
    for name, each in truth.items():
        np.testing.assert_array_equal(tree["truth"][name], fifesim.aggregate(each, 30.0), err_msg=name)
    # The truth is the dead fraction of a pixel's leaf area, not of its ground area.
    dead = fifesim.aggregate(by_hand["lai"] * by_hand["brown"], 30.0) / fifesim.aggregate(by_hand["lai"], 30.0)
    np.testing.assert_allclose(tree["truth"]["brown"], dead, rtol=1e-12)


def test_mapped_leaf_area_is_kept_while_other_properties_vary(tmp_path):
    varied, lai = make_scene(landscape={"deviations": {"soil": 0.02}}), make_scene(ground={"seed": 5})["lai"]
    ground = {"lai_file": str(write(tmp_path / "lai.tif", lai.values, parse_scenario(SMALL).geobox().affine))}
    land = make_scene(ground=ground, landscape={"deviations": {"soil": 0.02}})
    np.testing.assert_array_equal(land["lai"], lai)
    np.testing.assert_array_equal(land["soil"], varied["soil"])


def test_drawn_properties_take_mean_and_arp_from_the_ground():
    means = {"soil": -0.1, "moisture": 0.3, "brown": 0.2, "crown_cover": 0.8}
    deviations = {"soil": 0.03, "moisture": 0.1, "brown": 0.05, "crown_cover": 0.07}
    case = parse_scenario({"ground": {"arp": 0.1} | means, "landscape": {"deviations": deviations}})
    expected = {name: fifesim.ground.Field(mean=means[name], sd=sd, arp=0.1) for name, sd in deviations.items()}
    assert drawn_properties(case) == expected


def test_fields_set_by_classes_or_drawn_are_not_passed(scenario):
    """They would have no effect, and `surface_reflectance` rejects arguments without effect."""
    expected = {"hotspot": 0.1, "dissociation": 0.5, "crown_cover": 0.8, "crown_shape": 0.7, "moisture": 0.2}
    expected |= {"background": BACKGROUND, "brown_leaf": fifesim.Leaf(brown=1.0), "model": "sail"}
    assert explicit_fields(canopy_of(scenario)) == expected
    alone = canopy_of(parse_scenario({"ground": OWN["ground"]}))
    assert explicit_fields(alone) == expected | {"leaf_angles": "planophile", "brown": 0.2, "soil": 0.0}


def test_ground_leaf_and_spectra_are_passed_unless_every_class_sets_them():
    for key, value, field in (
        ("leaf", {"chlorophyll": 30.0}, "leaf_optics"),
        ("background_spectra", {"shade": 1.0}, "background"),
    ):
        sections = {"ground": {key: value}, "landscape": {"cover": "voronoi"}}
        for other in ({key: value}, {}):
            case = parse_scenario(sections | {"classes": {"a": {key: value}, "b": other}})
            assert (field in canopy_of(case).given) == (not other)


@pytest.mark.parametrize(("sections", "dead"), cases("dead leaves"), ids=str)
def test_green_fpar_is_output_only_where_some_leaves_are_dead(sections, dead):
    case = parse_scenario(SMALL | sections | {"ground": STAND | sections.get("ground", {})})
    truth = fifesim.simulate(case)["truth"]
    assert ("green_fpar" in truth) == dead
    if dead:
        assert truth["green_fpar"].attrs["long_name"].endswith("that green leaves absorb")
        assert float(truth["green_fpar"].mean()) < float(truth["fpar"].mean())


@pytest.fixture(scope="module")
def uniform_run():
    return fifesim.simulate(parse_scenario(SMALL | {"ground": STAND})).compute()


@pytest.mark.parametrize(("sections", "_"), cases("uniform ground"), ids=str)
def test_zero_variation_gives_the_uniform_ground(uniform_run, sections, _):
    """Results are identical to the bit."""
    found = fifesim.simulate(parse_scenario(SMALL | sections | {"ground": STAND | sections.get("ground", {})}))
    for node, name in (("scene", "lai"), ("scene", "surface_reflectance"), ("image", "dn"), ("truth", "fpar")):
        np.testing.assert_array_equal(found[node][name], uniform_run[node][name], err_msg=name)


@pytest.mark.parametrize(("stage", "keys", "taken"), mistakes("canopy"), ids=str)
def test_tallgrass_defaults_outside_the_site_give_a_warning(stage, keys, taken):
    with warnings.catch_warnings(record=True, action="always", category=UserWarning) as said:
        warn_of_canopy(parse_scenario(keys))
    assert len(said) == bool(taken) and all(re.search(taken, str(each.message)) for each in said)


GRID = {"west": 707970.0, "north": 4331220.0, "width": 300.0, "height": 240.0}


def test_hills_extend_one_cell_and_the_horizon_its_given_reach_in_cells_aligned_to_the_crs():
    """All windows of a scenario share the same horizon cells."""
    hills = parse_scenario({"grid": GRID, "terrain": {"seed": 3, "horizon_reach": 600}})
    grid = hills.geobox()
    dem, horizon, reach = elevation(hills, grid)
    assert grids.same_grid(grids.geobox(dem), grid.pad(1))
    np.testing.assert_array_equal(dem, fifesim.flint_hills(grid.pad(1), seed=3))
    assert reach == dict.fromkeys(("north", "east", "south", "west"), 600.0)
    around, box, affine = grids.geobox(horizon).boundingbox, grid.boundingbox, grids.geobox(horizon).affine
    assert around.left <= box.left - 600 + 30 and around.right >= box.right + 600 - 30
    assert around.bottom <= box.bottom - 600 + 30 and around.top >= box.top + 600 - 30
    for origin, cell in ((affine.c, affine.a), (affine.f, affine.e)):
        # Cell centres of the surrounding land lie on odd multiples of half a cell.
        assert abs(((origin + cell / 2) / (cell / 2)) - round((origin + cell / 2) / (cell / 2))) < 1e-6


@pytest.mark.parametrize(("sza", "alone"), [(70.0, True), (73.0, False)])
def test_whole_land_is_read_where_slopes_may_hide_the_sun(sza, alone):
    """The steepest of these hills slopes 18.8 degrees."""
    hills = parse_scenario({"grid": GRID, "terrain": {"seed": 7}, "geometry": {"sza": sza, "saa": 95.0}})
    light = scenario_light_on_hills(hills, hills.geobox(), hills.sun_and_view())
    assert (light is not None) is alone


def test_learned_landscape_draws_the_properties_of_the_scenario(tmp_path):
    """A property is uniform if [ground] has a value and no deviation is given; others are described or drawn."""
    deviations = {"crown_cover": 0.05, "soil": 0.1}
    own = {"ground": {"brown": 0.3, "crown_cover": 0.8}, "landscape": {"deviations": deviations}}
    case = parse_scenario(SMALL | own)
    konza = fifesim.ground.Landscape.read("konza")
    land = ground_scene(case, case.geobox())
    assert set(land.data_vars) == {"lai", "soil", "moisture", "crown_cover"}
    assert float(land["crown_cover"].mean()) == pytest.approx(0.8, abs=0.02)
    described = konza.simulate(case.geobox(), seed=7)
    np.testing.assert_array_equal(land["lai"], described["lai"])
    np.testing.assert_array_equal(land["moisture"], described["moisture"])
    np.testing.assert_allclose(land["soil"] * konza.properties["soil"].sd / 0.1, described["soil"], rtol=1e-12)
    assert drawn_properties(case.complete()) == drawn_properties(case) and case.complete().ground.moisture == 0.1
    konza.save(tmp_path / "mine.json")
    mine = parse_scenario(SMALL | {"landscape": {"learned": str(tmp_path / "mine.json")}})
    np.testing.assert_array_equal(ground_scene(mine, mine.geobox())["lai"], described["lai"])
