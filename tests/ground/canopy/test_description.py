"""Tests of the description of a canopy: ranges, given fields, and the table that defines all properties."""

import pickle
import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import fifesim
from fifesim import Canopy
from fifesim.ground.canopy.description import LEAST_HOTSPOT, TALLGRASS
from fifesim.ground.canopy.properties import DRAWN, NUMERIC_PROPERTIES, PROPERTIES
from fifesim.scenario.ground import canopy_of
from fifesim.scenario.keys import ClassKeys, GroundKeys
from fifesim.scenario.scenario import find_key, parse_scenario

ROOT = Path(__file__).parents[3]
TM34 = ["TM3", "TM4"]
RASTER = xr.DataArray(np.full((2, 3), 0.25), dims=("y", "x"))


@pytest.mark.parametrize("name", list(NUMERIC_PROPERTIES))
def test_numbers_are_valid_up_to_and_including_their_limits(name):
    known = NUMERIC_PROPERTIES[name]
    low, high = known.lowest, known.highest
    assert (getattr(Canopy(**{name: low}), name), getattr(Canopy(**{name: high}), name)) == (low, high)
    for value in (np.nextafter(float(low), -np.inf), high + 1, np.inf, np.nan):
        message = re.escape(f"{name} must be in [{low:g}, {high:g}], got {value:g}: it is the {known.meaning}")
        with pytest.raises(ValueError, match=f"^{message}"):
            Canopy(**{name: value})


@pytest.mark.parametrize("name", ["brown", "soil"])
def test_rasters_need_dims_y_x_and_real_numbers(name):
    for raster in (RASTER, RASTER.T, RASTER.astype(int), RASTER.expand_dims(time=2), RASTER.chunk()):
        assert getattr(Canopy(**{name: raster}), name) is raster
    for raster in (RASTER.expand_dims(band=TM34), RASTER.rename(y="lat", x="lon")):
        with pytest.raises(ValueError, match=rf"^{name} must (be .* a raster over|have dimensions).*got "):
            Canopy(**{name: raster})
    with pytest.raises(TypeError, match=rf"^{name} must hold real numbers, got .*: type \.astype\(float\)"):
        Canopy(**{name: RASTER.astype(bool)})


def test_default_canopy_is_tallgrass_without_given_fields(lai):
    assert TALLGRASS.given == frozenset()
    assert fifesim.Setup().canopy is TALLGRASS and fifesim.CoverClass("grass").canopy is TALLGRASS
    defaults = {name: each.default for name, each in PROPERTIES.items()}
    assert {name: getattr(Canopy(), name) for name in PROPERTIES} == defaults
    rho = lai.fifesim.surface_reflectance("TM", bands=TM34)
    xr.testing.assert_identical(lai.fifesim.surface_reflectance("TM", bands=TM34, canopy=Canopy(**defaults)), rho)


def test_given_lists_the_fields_that_were_passed_and_replace_leaves_others_unset():
    assert Canopy(brown=0.0, crown_cover=RASTER, soil=None).given == {"brown", "crown_cover"}
    canopy = Canopy(brown=0.3, hotspot=LEAST_HOTSPOT)
    changed = canopy.replace(brown=0.0, hotspot=None, soil=0.1)
    assert {name: getattr(changed, name) for name in changed.given} == {"brown": 0.0, "soil": 0.1}
    assert (canopy.brown, canopy.hotspot, changed.hotspot) == (0.3, LEAST_HOTSPOT, 0.0)
    with pytest.raises(TypeError, match="no argument 'bron': did you mean 'brown'"):
        canopy.replace(bron=0.3)


def test_canopies_are_equal_by_value_frozen_and_can_be_recreated():
    """Also with rasters and leaves; a field with the default value differs from a missing one."""
    one, two = (
        {"brown": RASTER.copy(), "leaf_optics": fifesim.Leaf(water=RASTER / 10), "background": {"TM3": RASTER.copy()}}
        for _ in range(2)
    )
    assert Canopy() == TALLGRASS and hash(Canopy()) == hash(TALLGRASS)
    assert Canopy(**one) == Canopy(**two) and hash(Canopy(**one)) == hash(Canopy(**two))
    for name, other in (("brown", RASTER / 2), ("leaf_optics", fifesim.Leaf()), ("background", {"TM3": RASTER / 2})):
        assert Canopy(**one) != Canopy(**two | {name: other})
    assert Canopy(brown=0.5) == Canopy(brown=np.float64(0.5)) != Canopy(brown=0.4)
    assert Canopy(brown=0.0) != Canopy() and Canopy() != 1
    canopy = Canopy(leaf_optics=fifesim.Leaf(chlorophyll=40), leaf_angles="erectophile", brown=0.0, soil=-0.1)
    assert eval(repr(canopy), {"Canopy": Canopy, "Leaf": fifesim.Leaf}) == canopy
    again = pickle.loads(pickle.dumps(Canopy(**one)))
    assert again == Canopy(**one) and again.given == set(one)
    with pytest.raises(AttributeError, match="brown"):
        canopy.brown = 0.2


def test_a_class_inherits_only_fields_that_it_does_not_give(site):
    """A class that gives the default value keeps it."""
    classes = {
        "open": fifesim.CoverClass(lai="burned-grazed", canopy=Canopy(hotspot=0.1)),
        "green": fifesim.CoverClass(lai="burned-grazed", canopy=Canopy(brown=0.0, moisture=0.0)),
    }
    land = fifesim.landscape(site, cover=fifesim.ground.Patches("voronoi", 30), classes=classes, seed=7)
    scene = Canopy(brown=0.3, moisture=0.4)
    rho = land.fifesim.surface_reflectance("TM", bands=TM34, canopy=scene)
    green = land.fifesim.fpar(canopy=scene, leaves="green")
    for code, canopy in ((1, Canopy(brown=0.3, moisture=0.4, hotspot=0.1)), (2, Canopy())):
        cells = (land.cover == code).values
        assert cells.sum() > 400
        alone = land.lai.fifesim.surface_reflectance("TM", bands=TM34, canopy=canopy)
        np.testing.assert_array_equal(rho.values[:, cells], alone.values[:, cells])
        absorbed = land.lai.fifesim.fpar(canopy=canopy, leaves="green")
        np.testing.assert_array_equal(green.values[cells], absorbed.values[cells])


@pytest.mark.parametrize("name", list(NUMERIC_PROPERTIES))
def test_every_number_is_a_scenario_key_of_ground_and_classes(name):
    known = NUMERIC_PROPERTIES[name]
    for section in (GroundKeys, ClassKeys):
        field = section.model_fields[name]
        limits = {kind: getattr(each, kind) for each in field.metadata for kind in ("ge", "le") if hasattr(each, kind)}
        assert (field.default, field.description, section.unit(name)) == (known.default, known.meaning, known.unit)
        assert limits == {"ge": known.lowest, "le": known.highest}
    assert getattr(canopy_of(parse_scenario({"ground": {name: 0.7}})), name) == 0.7
    assert find_key(name).attributes == {"long_name": known.meaning, "units": known.unit}


def test_table_in_the_howto_page_matches_the_fields():
    """Meanings, defaults, ranges, and the properties that may be rasters."""
    page = (ROOT / "docs/howto/canopy.md").read_text(encoding="utf-8")
    rows = [[cell.strip() for cell in row.split("|")[1:-1]] for row in re.findall(r"^\| `.*\|$", page, re.MULTILINE)]
    shown = {row[0].strip("`"): row[1:] for row in rows}
    assert {name: row[0] for name, row in shown.items()} == {name: each.meaning for name, each in PROPERTIES.items()}
    for name, known in NUMERIC_PROPERTIES.items():
        _, default, limits, raster = shown[name]
        found = (float(default), limits, raster == "yes")
        assert found == (known.default, f"{known.lowest:g} to {known.highest:g}", known.by_cell)
    effects = {"brown": "dead leaves", "crown_cover": "clumping", "soil": "soil", "moisture": "soil"}
    assert {name: each.effect for name, each in DRAWN.items()} == effects
