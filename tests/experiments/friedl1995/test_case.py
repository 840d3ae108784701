"""What the nine scenarios share, and what each of them says."""

import pytest

from fifesim.experiments.friedl1995.case import Case, case_of


def test_scenario_says_what_the_ground_is_whatever_the_defaults_are():
    scenario = Case().scenario("burned-ungrazed", 0.15, 7)
    assert {"distribution", "arp", "seed", "method"} <= scenario.ground.model_fields_set
    assert "dem" in scenario.terrain.model_fields_set and scenario.terrain.dem == "flat"
    assert {"instrument", "bands", "interval", "offset"} <= scenario.sensor.model_fields_set
    assert scenario.geobox().shape == (333, 333)


def test_inputs_of_a_readers_own_are_in_the_scenario(folders):
    case = case_of(reading="offset", dem="flint-hills", **folders)
    scenario = case.scenario("burned-ungrazed", 0.05, 1)
    assert scenario.ground.distribution == str(folders["densities"] / "burned-ungrazed.csv")
    assert scenario.ground.leaf_transmittance == {"TM3": 0.05, "TM4": 0.4}
    assert scenario.ground.background == {"TM3": 0.10, "TM4": 0.16}
    assert scenario.terrain.dem == "flint-hills" and scenario.sensor.interval == "product"
    assert scenario.sensor.offset == pytest.approx([2 / 9, 2 / 9])
    shares = case_of(background="soil_dry:0.4+shade:0.6").scenario("burned-grazed", 0.05, 1)
    assert shares.ground.background_spectra == {"soil_dry": 0.4, "shade": 0.6} and not shares.ground.background


def test_another_sensor_brings_its_bands_pixels_and_a_scene_that_holds_some():
    case = case_of(sensor="MODIS")
    assert case.bands == ("MODIS1", "MODIS2") and case.pixel == 250
    assert case.cells == 900 and case_of(sensor="OLI").cells == 333


def test_corner_of_the_scenes_is_where_it_is_asked_for():
    """Three kilometres and a third from that of the site by default."""
    box = case_of().grid.boundingbox
    assert (box.left, box.top) == pytest.approx((704970 + 10000 / 3, 4334220 - 10000 / 3))
    box = case_of(west=706000.0, north=4333000.0).grid.boundingbox
    assert (box.left, box.top) == (706000.0, 4333000.0)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"west": 600000.0}, "is not on the FIFE site"),
        ({"cells": 50}, "at least 90, 10 pixels"),
        ({"dem": "nowhere.tif"}, "a raster file of elevation"),
        ({"sensor": "SuperDove"}, "smaller than a ground cell"),
        ({"sensor": "NOPE"}, "unknown instrument"),
        ({"reading": "mine"}, "must be one of native"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_is_computed(options, said):
    with pytest.raises(ValueError, match=said):
        case_of(**options)


def test_level_ground_has_no_elevation():
    assert Case(cells=90).land() == (None, None)
