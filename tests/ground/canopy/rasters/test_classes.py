"""Canopies of classes on labelled rasters: the kernel's numbers by cell, and what they are labelled."""

import numpy as np
import pytest
from fifesim.ground.canopy.rasters.classes import reflectance_of_classes

from fifesim.base.geometry import Geometry
from fifesim.ground.canopy.raster import level_reflectance
from fifesim.ground.canopy.rasters import classes

SCENE = {
    "bands": ["red", "nir"],
    "wavelengths": [0.66, 0.84],
    "geometry": Geometry(30.0, 120.0, 0.0, 0.0),
    "diffuse_fraction": [0.1, 0.05],
    "exact": False,
}
CANOPIES = {
    3: {"leaf_reflectance": [0.07, 0.46], "leaf_transmittance": [0.04, 0.41], "background": [0.1, 0.2]},
    8: {"leaf_reflectance": [0.1, 0.4], "leaf_transmittance": [0.1, 0.5], "background": [0.2, 0.3], "hotspot": 0.2},
}


@pytest.fixture
def cover(lai):
    return lai.copy(data=np.random.default_rng(5).choice([3, 8], lai.shape).astype(np.int16)).rename("cover")


def test_each_class_is_its_canopy_alone(lai, cover):
    made = reflectance_of_classes(lai, cover, CANOPIES, **SCENE, atmosphere="none")
    for code, canopy in CANOPIES.items():
        alone = level_reflectance(lai, **canopy, **SCENE)
        np.testing.assert_array_equal(made.values[:, cover == code], alone.values[:, cover == code])
    assert made.name == "surface_reflectance" and made.attrs["atmosphere"] == "none"
    assert made.attrs["leaf_angles"] == alone.attrs["leaf_angles"] and made.attrs["background"] == "by class"


def test_classes_of_one_canopy_are_evaluated_together(lai, cover, monkeypatch):
    """What differs by a number, or by another raster of the same values, is not."""
    asked = []
    real = classes.canopy_kernel
    monkeypatch.setattr(classes, "canopy_kernel", lambda *args, **given: asked.append(given) or real(*args, **given))
    share = lai.drop_attrs(deep=False) / 10
    alike = CANOPIES[3] | {"leaf_reflectance": np.array([0.07, 0.46]), "crown_cover": share, "hotspot": 0.1}
    for other, kinds in (({}, 1), ({"hotspot": 0.2}, 2), ({"crown_cover": share.copy()}, 2), ({"crown_cover": 0.5}, 2)):
        asked.clear()
        pair = {3: alike, 8: alike | {"leaf_reflectance": np.array([0.07, 0.46])} | other}
        made = reflectance_of_classes(lai, cover, pair, **SCENE)
        assert len(asked) == kinds
        alone = level_reflectance(lai, **pair[8], **SCENE)
        np.testing.assert_array_equal(made.values[:, cover == 8], alone.values[:, cover == 8])


def test_leaf_angles_of_classes_are_told_once_each(lai, cover):
    turned = {3: CANOPIES[3] | {"leaf_angles": "planophile"}, 8: CANOPIES[8]}
    made = reflectance_of_classes(lai, cover, turned, **SCENE)
    assert made.attrs["leaf_angles"].count(" and ") == 1 and "planophile" in made.attrs["leaf_angles"]


def test_leaf_area_that_cannot_be_is_refused(lai, cover):
    with pytest.raises(ValueError, match="negative"):
        reflectance_of_classes(lai - 5, cover, CANOPIES, **SCENE)
