"""Chips in memory are what simulating each of them by itself gives."""

import numpy as np
import pytest

import fifesim
from fifesim.output.chips.store import chip_arrays, layout_of
from fifesim.scenario.chips import chips_of
from fifesim.scenario.scenario import parse_scenario
from fifesim.scenario.studies import Study

SMALL = {"grid": {"width": 180.0, "height": 180.0}, "terrain": {"dem": "flat"}}
DRAWS = {"visibility": {"uniform": [10, 60]}, "brown": {"choice": [0.0, 0.3]}, "sza": {"uniform": [20, 50]}}


@pytest.fixture(scope="module")
def chips():
    sun = {"geometry": {"sza": 30.0, "saa": 120.0}}
    return chips_of(Study(parse_scenario(SMALL | sun), DRAWS, landscapes=3), 7)


@pytest.fixture(scope="module")
def layout(chips):
    return layout_of(chips)


@pytest.fixture(scope="module")
def arrays(chips, layout):
    return chip_arrays(chips, range(2, 7), layout)


@pytest.mark.parametrize("chip", [2, 5])
def test_a_chip_has_the_bits_of_its_scenario(chip, chips, arrays):
    run = fifesim.simulate(chips.scenario(chip), complete=True)
    at = chip - 2
    np.testing.assert_array_equal(arrays["dn"][at], run["image"]["dn"])
    np.testing.assert_array_equal(arrays["ndvi"][at], run["image"]["ndvi"].values.astype(np.float32))
    for name in ("lai", "fpar"):
        np.testing.assert_array_equal(arrays[name][at], run["truth"][name].values.astype(np.float32))
    assert arrays["sza"][at] == float(run["image"]["sza"])


def test_reflectance_is_that_of_the_image(chips, arrays):
    image = fifesim.simulate(chips.scenario(3), complete=True)["image"]["dn"]
    expected = fifesim.sensor.labels.to_reflectance(image).values
    np.testing.assert_array_equal(arrays["toa_reflectance"][1], expected.astype(np.float32))


def test_green_leaves_are_all_leaves_where_none_is_dead(chips, arrays):
    brown = np.array([chips.scenario(chip).ground.brown for chip in range(2, 7)])
    assert {0.0, 0.3} == set(brown.tolist())
    alike = (arrays["green_fpar"] == arrays["fpar"]).all(axis=(1, 2))
    np.testing.assert_array_equal(alike, brown == 0)


def test_layout_says_shapes_and_types(layout, arrays):
    for name, (dims, dtype) in layout.variables.items():
        assert arrays[name].shape == (5, *layout.shape(dims)) and arrays[name].dtype == dtype
    assert layout.size == sum(each.nbytes for each in arrays.values()) / 5
    assert layout.pixels == (6, 6) and layout.pixel == 30
    assert layout.bands["band"].values.tolist() == ["TM3", "TM4"]


def test_a_part_of_the_chips_is_a_slice(chips, layout, arrays):
    for name, values in chip_arrays(chips, range(4, 6), layout).items():
        np.testing.assert_array_equal(values, arrays[name][2:4])


def test_a_truth_that_others_have_not_names_its_chip(chips, layout):
    without = layout._replace(truth=("lai", "fpar"))
    with pytest.raises(ValueError, match=r"chip \d: has a true property that others lack, green_fpar"):
        chip_arrays(chips, range(0, 7), without)


GRASS = {"landscape": {"cover": "voronoi"}, "classes": {"grass": {}, "burned": {"distribution": "burned-grazed"}}}


@pytest.mark.parametrize(
    "sections",
    [
        {"sensor": {"instrument": "MSI"}},
        {"sensor": {"instrument": "L4TM", "offset": [0.5, -1.2], "noise": ["all"]}},
        {"sensor": {"instrument": "L4TM", "interval": 30.0}, **GRASS},
        {"sensor": {"instrument": "MSI"}, "terrain": {"dem": "flint-hills"}},
        {"sensor": {"instrument": "MSI"}, "atmosphere": {"adjacency": True}},
    ],
    ids=["blur", "offset", "cover", "hills", "adjacency"],
)
def test_chips_have_no_missing_pixels(sections):
    """Their edges see the ground around; each chip has the bits of its scenario, simulated with that ground."""
    study = Study(parse_scenario(SMALL | sections), {"visibility": {"uniform": [10, 60]}}, landscapes=3)
    chips = chips_of(study, 3)
    found = chip_arrays(chips, range(3), layout_of(chips))
    for name in ("toa_reflectance", "ndvi", "lai", "fpar"):
        assert np.isfinite(found[name]).all(), name
    assert (found["dn"] > 0).all()
    run = fifesim.simulate(chips.scenario(2), complete=True)
    np.testing.assert_array_equal(found["dn"][2], run["image"]["dn"])
    np.testing.assert_array_equal(found["lai"][2], run["truth"]["lai"].values.astype(np.float32))
    bare = fifesim.simulate(chips.scenario(2))
    assert run["scene"].sizes == bare["scene"].sizes
    np.testing.assert_array_equal(run["truth"]["lai"], bare["truth"]["lai"])
    if "atmosphere" not in sections:
        # Nearer to the edge, a pixel of the bare scene sees between 98 % and all of its footprint.
        middle = (..., slice(size := bare["image"].sizes["y"] // 2 - 1, -size), slice(size, -size))
        assert (run["image"]["dn"].values[middle] > 0).all()
        np.testing.assert_array_equal(run["image"]["dn"].values[middle], bare["image"]["dn"].values[middle])


def test_pixels_at_the_edge_are_those_of_a_larger_scene():
    scenario = parse_scenario(SMALL | {"sensor": {"instrument": "L4TM"}})
    image = fifesim.simulate(scenario, complete=True)["image"]["dn"]
    grid = scenario.geobox().pad(90)
    larger = {"west": grid.affine.c, "north": grid.affine.f, "width": 780.0, "height": 780.0}
    whole = fifesim.simulate(parse_scenario({**SMALL, "grid": larger, "sensor": {"instrument": "L4TM"}}))["image"]["dn"]
    np.testing.assert_array_equal(image, whole.sel(y=image.y, x=image.x, method="nearest", tolerance=0.01))
    periodic = parse_scenario(SMALL | {"ground": {"method": "periodic"}})
    with pytest.raises(ValueError, match=r"no ground beyond the scene: use method = \"streaming\""):
        fifesim.simulate(periodic, complete=True)
