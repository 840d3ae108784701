"""The nine scenarios, and what is made of each."""

from dataclasses import replace

import numpy as np
import pytest

from fifesim.chain.setup import image_of
from fifesim.experiments.friedl1995 import case as friedl1995
from fifesim.experiments.friedl1995.case import Case, case_of, ground_of, image
from fifesim.experiments.friedl1995.readings import READINGS
from fifesim.rasters import grid as grids

SCENE = ("burned-grazed", 0.24, 3)


@pytest.fixture(scope="module")
def ground():
    return ground_of(Case(cells=180), *SCENE)


def test_native_pixels_drift_from_the_truth_by_the_interval(ground):
    """43 microradian x 705 km = 30.315 m (Table 1): 0.315 m a pixel."""
    case = Case(cells=180)
    native = grids.geobox(image(case, ground))
    assert grids.cell_size(native) == pytest.approx((30.315, 30.315), rel=1e-12)
    blocks = grids.geobox(friedl1995.block_means(case, ground, ground.lai))
    drift = (native.affine * (15.5, 15.5))[0] - (blocks.affine * (15.5, 15.5))[0]
    assert drift == pytest.approx(15.5 * 0.315, rel=1e-6)
    assert case.drift == pytest.approx((native.shape.x - 1) * 0.315, rel=1e-9)
    assert Case(cells=180, reading=READINGS["aligned"]).drift == 0


def test_offset_pixels_see_the_ground_to_the_south_east(ground):
    """Two cells each way: the aligned image of the scene without its first two rows and columns."""
    moved = image(Case(cells=180, reading=READINGS["offset"]), ground)
    aligned = image_of(replace(ground.setup, onto=None, interval=None), ground.reflectance[:, 2:, 2:])
    # Sums of another window round otherwise, which may carry a value over the middle of two counts.
    off = abs(moved[:, :19, :19].values.astype(int) - aligned[:, :19, :19].values)
    assert off.max() <= 1 and (off > 0).mean() < 0.005


def test_scene_has_exactly_the_density():
    """Exact ranks: the quantiles of the cells are those of the distribution."""
    ground = ground_of(Case(cells=90), "burned-ungrazed", 0.24, 3)
    ranks = (np.arange(8100) + 0.5) / 8100
    expected = friedl1995.inputs.lai_distribution("burned-ungrazed").ppf(ranks)
    np.testing.assert_allclose(np.sort(ground.lai.values.ravel()), expected, rtol=1e-12)
    assert (ground.fpar > 0).all() and (ground.fpar < 0.94).all()


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


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"cells": 50}, "at least 90, 10 pixels"),
        ({"dem": "nowhere.tif"}, "a raster file of elevation"),
        ({"sensor": "SuperDove"}, "smaller than a cell"),
        ({"sensor": "NOPE"}, "unknown instrument"),
        ({"reading": "mine"}, "must be one of native"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_is_computed(options, said):
    with pytest.raises(ValueError, match=said):
        case_of(**options)


def test_level_ground_has_no_elevation():
    assert Case(cells=90).land() == (None, None)
