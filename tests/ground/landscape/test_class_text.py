"""Classes as text and back."""

import json
from dataclasses import fields

import numpy as np
import pytest
from scipy import stats

from fifesim.ground.canopy.description import Canopy
from fifesim.ground.canopy.properties import PROPERTIES
from fifesim.ground.canopy.prospect import Leaf
from fifesim.ground.canopy.spectra import Background, Spectrum
from fifesim.ground.landscape.classes import CoverClass, read_table, table_text
from fifesim.ground.landscape.distribution import kernel_density

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


def test_table_comes_back_as_it_was():
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


@pytest.mark.parametrize("background", [0.2, "dead_grass", {"TM3": 0.1}, Spectrum((0.4, 2.5), (0.1, 0.3))])
def test_backgrounds_come_back(background):
    (read,) = read_table(table_text([CoverClass("a", canopy=Canopy(background=background))]))
    assert read.canopy.background == background and read.canopy.given == {"background"}


def test_leaf_optics_of_all_bands_come_back():
    (read,) = read_table(table_text([CoverClass("a", canopy=Canopy(leaf_optics=(0.1, [0.2, 0.3])))]))
    assert read.canopy.leaf_optics == (0.1, (0.2, 0.3))


def test_distribution_of_samples_is_left_out():
    text = table_text([CoverClass("a", lai=kernel_density([1.0, 2.0, 2.5, 3.0, 3.1]))])
    assert json.loads(text) == [{"name": "a"}]


@pytest.mark.parametrize("text", ["grass", "[1]", '[{"height": 3}]'])
def test_other_text_is_refused(text):
    with pytest.raises(ValueError, match="class table of the cover is invalid"):
        read_table(text)
