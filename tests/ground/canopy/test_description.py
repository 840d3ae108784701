"""Tests of the description of a canopy: ranges, given fields, and the table that defines all properties."""

import os
import pickle
import re
import subprocess
import sys
from pathlib import Path
from shutil import copytree

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
from fifesim.scenario.toml import write_scenario

ROOT = Path(__file__).parents[3]
TM34 = ["TM3", "TM4"]
RASTER = xr.DataArray(np.full((2, 3), 0.25), dims=("y", "x"))
BY_CELL = [name for name, known in NUMERIC_PROPERTIES.items() if known.by_cell]


def given_by(canopy):
    return {name: getattr(canopy, name) for name in canopy.given}


@pytest.mark.parametrize("name", list(NUMERIC_PROPERTIES))
def test_numbers_are_valid_up_to_and_including_their_limits(name):
    low, high = NUMERIC_PROPERTIES[name].lowest, NUMERIC_PROPERTIES[name].highest
    for value in (low, high, float(low), np.float32(high), np.int64(high)):
        assert getattr(Canopy(**{name: value}), name) == value
    for value in (np.nextafter(float(low), -np.inf), low - 1, high + 1, high * 30, np.inf, -np.inf, np.nan):
        message = re.escape(
            f"{name} must be in [{low:g}, {high:g}], got {value:g}: it is the {NUMERIC_PROPERTIES[name].meaning}"
        )
        with pytest.raises(ValueError, match=f"^{message}"):
            Canopy(**{name: value})


@pytest.mark.parametrize("name", list(NUMERIC_PROPERTIES))
def test_values_of_other_types_are_refused_by_name(name):
    raster = r", or an xarray.DataArray over \(y, x\)" if name in BY_CELL else ""
    for value, text in (
        ("0.3", "'0.3'"),
        (True, "True"),
        ([0.3], "a list of 1"),
        (np.full(3, 0.3), r"a numpy array \(3,\)"),
        (RASTER.to_dataset(name="a"), "an xarray.Dataset of a"),
    ):
        with pytest.raises(TypeError, match=f"^{name} must be a number{raster}, got {text}"):
            Canopy(**{name: value})


@pytest.mark.parametrize("name", BY_CELL)
def test_rasters_need_dims_y_x_and_real_numbers(name):
    for raster in (RASTER, RASTER.T, RASTER.astype(int), RASTER.expand_dims(time=2), RASTER.chunk()):
        assert getattr(Canopy(**{name: raster}), name) is raster
    for raster, dims in (
        (RASTER.expand_dims(band=TM34), r"\('band', 'y', 'x'\)"),
        (RASTER.isel(y=0), r"got \(x\)"),
        (RASTER.rename(y="lat", x="lon"), r"\('lat', 'lon'\)"),
        (RASTER.isel(y=0, x=0), r"got \(\)"),
    ):
        with pytest.raises(ValueError, match=rf"^{name} must (be .* a raster over|have dimensions).*{dims}"):
            Canopy(**{name: raster})
    for kind in ("bool", "complex64", "str", "datetime64[s]"):
        with pytest.raises(TypeError, match=rf"^{name} must hold real numbers, got .*: type \.astype\(float\)"):
            Canopy(**{name: RASTER.astype(kind)})


@pytest.mark.parametrize("name", sorted(set(NUMERIC_PROPERTIES) - set(BY_CELL)))
def test_properties_of_the_whole_scene_must_not_be_rasters(name):
    with pytest.raises(TypeError, match=rf"^{name} must be a number, got an xarray.DataArray \(y: 2, x: 3\)"):
        Canopy(**{name: RASTER})


@pytest.mark.parametrize(
    ("field", "error", "message"),
    [
        ({"crown_shape": 30}, ValueError, "crown diameter over the height of its middle$"),
        ({"hotspot": 0.99 * LEAST_HOTSPOT}, ValueError, "hotspot must be 0, for no .* at least 1e-06, got 9.9e-07"),
        ({"leaf_angles": [0.5, 0.6]}, ValueError, "1.1"),
        ({"leaf_angles": {30: 1.0}}, TypeError, "leaf_angles must be a name such as 'planophile', .*got a dict of 1"),
        ({"leaf_optics": 0.4}, TypeError, "^leaf_optics must be a fifesim.Leaf, .*got 0.4"),
        ({"leaf_optics": RASTER}, TypeError, "^leaf_optics must be a fifesim.Leaf, .*got an xarray.DataArray"),
        ({"brown_leaf": True}, TypeError, "^brown_leaf must be a fifesim.Leaf, .*got True"),
        ({"brown_leaf": [0.1]}, TypeError, "^brown_leaf must be a fifesim.Leaf, .*got a list of 1"),
        ({"leaf": fifesim.Leaf()}, TypeError, "Canopy has no argument 'leaf': There are leaf_optics"),
        ({"given": {"brown"}}, TypeError, "Canopy has no argument 'given'"),
    ],
    ids=str,
)
def test_invalid_fields_are_refused_by_name(field, error, message):
    with pytest.raises(error, match=message):
        Canopy(**field)


def test_default_canopy_is_tallgrass_without_given_fields():
    assert TALLGRASS.given == frozenset() and repr(TALLGRASS) == "Canopy()"
    assert all(getattr(Canopy(), name) == known.default for name, known in PROPERTIES.items())
    assert (Canopy().leaf_angles, Canopy().model) == ("spherical", "sail")
    assert fifesim.Setup().canopy is TALLGRASS and fifesim.CoverClass("grass").canopy is TALLGRASS


def test_passing_the_defaults_changes_no_bit(lai):
    defaults = {name: each.default for name, each in PROPERTIES.items()}
    rho = lai.fifesim.surface_reflectance("TM", bands=TM34)
    xr.testing.assert_identical(lai.fifesim.surface_reflectance("TM", bands=TM34, canopy=Canopy(**defaults)), rho)


def test_given_lists_the_fields_that_were_passed():
    canopy = Canopy(brown=0.0, leaf_angles="spherical", crown_cover=RASTER, soil=None)
    assert canopy.given == {"brown", "leaf_angles", "crown_cover"}
    assert canopy.soil == 0.0
    assert Canopy(hotspot=LEAST_HOTSPOT).hotspot == LEAST_HOTSPOT


def test_replace_leaves_other_fields_unset():
    canopy = Canopy(brown=0.3, hotspot=0.1)
    changed = canopy.replace(brown=0.0, soil=0.1)
    assert given_by(changed) == {"brown": 0.0, "hotspot": 0.1, "soil": 0.1}
    assert given_by(canopy) == {"brown": 0.3, "hotspot": 0.1}
    unset = changed.replace(brown=None, hotspot=None)
    assert given_by(unset) == {"soil": 0.1} and (unset.brown, unset.hotspot) == (0.0, 0.0)
    with pytest.raises(ValueError, match=r"brown must be in \[0, 1\], got 3"):
        canopy.replace(brown=3)
    with pytest.raises(TypeError, match="no argument 'bron': did you mean 'brown'"):
        canopy.replace(bron=0.3)


def test_given_fields_take_precedence_in_over():
    first, scene = Canopy(brown=0.0, background=0.1), Canopy(brown=0.3, hotspot=0.1, moisture=RASTER)
    both = first.over(scene)
    assert both.given == {"brown", "background", "hotspot", "moisture"}
    assert (both.brown, both.background, both.hotspot, both.moisture is RASTER) == (0.0, 0.1, 0.1, True)
    assert given_by(Canopy().over(first)) == given_by(first) == given_by(first.over(Canopy()))


def test_repr_recreates_a_canopy():
    canopy = Canopy(leaf_optics=fifesim.Leaf(chlorophyll=40), leaf_angles="erectophile", brown=0.0, soil=-0.1)
    again = eval(repr(canopy), {"Canopy": Canopy, "Leaf": fifesim.Leaf})
    assert given_by(again) == given_by(canopy)
    assert repr(Canopy(brown=RASTER, hotspot=0.1)) == "Canopy(hotspot=0.1, brown=<an xarray.DataArray (y: 2, x: 3)>)"


def test_canopy_is_frozen_and_can_be_pickled():
    canopy = Canopy(brown=RASTER, leaf_optics=fifesim.Leaf(), hotspot=0.0)
    with pytest.raises(AttributeError, match="brown"):
        canopy.brown = 0.2
    again = pickle.loads(pickle.dumps(canopy))
    assert again.given == canopy.given == {"brown", "leaf_optics", "hotspot"}
    xr.testing.assert_identical(again.brown, RASTER)
    assert again.leaf_optics == fifesim.Leaf()


@pytest.mark.parametrize("name", list(PROPERTIES))
def test_error_for_a_property_outside_a_canopy_names_the_remedy(lai, name):
    message = re.escape(f"has no argument '{name}': type canopy=fifesim.Canopy({name}=...)")
    for call in (
        lambda: lai.fifesim.surface_reflectance("TM", **{name: 0.3}),
        lambda: fifesim.fpar(lai, **{name: 0.3}),
        lambda: fifesim.Setup(**{name: 0.3}),
        lambda: fifesim.CoverClass("grass", **{name: 0.3}),
    ):
        with pytest.raises(TypeError, match=message):
            call()
    inside = Canopy(**{name: PROPERTIES[name].default})
    assert lai.fifesim.surface_reflectance("TM", bands=["TM3"], canopy=inside).notnull().all()


def test_rasters_over_time_are_evaluated_date_by_date(lai):
    """Also rasters in a mapping."""
    days = xr.Variable("time", np.array(["1987-06-06T16:35", "1987-07-06T16:35"], "M8[ns]"))
    season = xr.concat([lai, 1.1 * lai], dim=days, combine_attrs="override")
    share = xr.concat([lai / 10, lai / 20], dim=days, combine_attrs="override").drop_attrs(deep=False)
    canopy = Canopy(background={"TM3": share, "TM4": 0.3}, brown=share, hotspot=0.1)
    found = season.fifesim.surface_reflectance("TM", bands=TM34, canopy=canopy)
    absorbed = season.fifesim.fpar(canopy=canopy, leaves="green")
    for date in (0, 1):
        one = Canopy(background={"TM3": share[date], "TM4": 0.3}, brown=share[date], hotspot=0.1)
        alone = season[date].fifesim.surface_reflectance("TM", bands=TM34, canopy=one)
        np.testing.assert_array_equal(found[date], alone)
        np.testing.assert_array_equal(absorbed[date], season[date].fifesim.fpar(canopy=one, leaves="green"))
    with pytest.raises(ValueError, match="has dates and the raster of surface_reflectance has none"):
        lai.fifesim.surface_reflectance("TM", bands=TM34, canopy=Canopy(brown=share))


@pytest.fixture(scope="module")
def classes():
    """A class without a given dead share, and a class with a dead share of 0."""
    return {
        "open": fifesim.CoverClass(lai="burned-grazed", canopy=Canopy(hotspot=0.1)),
        "green": fifesim.CoverClass(lai="burned-grazed", canopy=Canopy(brown=0.0, moisture=0.0)),
    }


def test_a_class_inherits_only_fields_that_it_does_not_give(site, classes):
    """A class that gives the default value keeps it."""
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
        limits = {kind: value for each in field.metadata for kind, value in vars_of(each).items()}
        assert (field.default, field.description, section.unit(name)) == (known.default, known.meaning, known.unit)
        assert (limits["ge"], limits["le"]) == (known.lowest, known.highest)
    # A class that gives the default value keeps it.
    classes = {"wood": {name: known.default}, "open": {}}
    case = parse_scenario({"ground": {name: 0.7}, "classes": classes, "landscape": {"cover": "voronoi"}})
    canopies = [each.canopy.over(canopy_of(case)) for each in case.class_table().values()]
    assert [getattr(canopy, name) for canopy in canopies] == [known.default, 0.7]
    text = write_scenario(case)
    assert f"\n{name} = 0.7 # {known.unit}; {known.meaning}\n" in text.split("[landscape]")[0]
    assert f"\n{name} = {known.default} # {known.unit}; {known.meaning}\n" in text.split("[classes.wood]")[1]
    assert find_key(name).name == f"ground.{name}"
    assert find_key(name).attributes == {"long_name": known.meaning, "units": known.unit}
    assert find_key(f"classes.wood.{name}").name == f"classes.wood.{name}"
    small = parse_scenario({"grid": {"width": 300, "height": 300}, "terrain": {"dem": "flat"}})
    assert fifesim.scenario.sweep(small, {name: [0.5, 1.0]})[name].values.tolist() == [0.5, 1.0]


def vars_of(limit):
    """Limits of the metadata of a field, such as ``Ge(ge=0)``."""
    return {name: getattr(limit, name) for name in ("ge", "le") if hasattr(limit, name)}


def test_table_in_the_howto_page_matches_the_fields():
    """Meanings, defaults, ranges, and the properties that may be rasters."""
    page = (ROOT / "docs/howto/canopy.md").read_text(encoding="utf-8")
    rows = [[cell.strip() for cell in row.split("|")[1:-1]] for row in re.findall(r"^\| `.*\|$", page, re.MULTILINE)]
    shown = {row[0].strip("`"): row[1:] for row in rows}
    assert list(shown) == list(PROPERTIES)
    for name, known in PROPERTIES.items():
        meaning, default, limits, raster = shown[name]
        assert meaning == known.meaning
        if name in NUMERIC_PROPERTIES:
            found = (float(default), limits, raster == "yes")
            assert found == (known.default, f"{known.lowest:g} to {known.highest:g}", known.by_cell)
    effects = {"brown": "dead leaves", "crown_cover": "clumping", "soil": "soil", "moisture": "soil"}
    assert {name: each.effect for name, each in DRAWN.items()} == effects


# A property that no model uses yet.
ONE_MORE = {
    "properties.py": ('\n    "background"', '\n    "clumping": Property(1.0, "clumping index", "1", 0.2, 1),'),
    "description.py": ("\n    given: frozenset", "\n    clumping: float | None = None"),
}


def test_adding_a_property_takes_two_lines(tmp_path):
    """The tests of this file pass for a new property, in classes, scenarios and sweeps without other edits."""
    for folder in ("fifesim", "data"):
        copytree(ROOT / folder, tmp_path / folder)
    for name, (place, line) in ONE_MORE.items():
        path = tmp_path / "fifesim/ground/canopy" / name
        text = path.read_text(encoding="utf-8")
        assert text.count(place) == 1
        path.write_text(text.replace(place, line + place), encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", "clumping", __file__]
    copied = os.environ | {"PYTHONPATH": str(tmp_path)}
    run = subprocess.run(command, cwd=tmp_path, env=copied, capture_output=True, text=True, check=False)
    assert run.returncode == 0 and run.stdout.startswith("....."), run.stdout[-2000:]


def test_canopies_are_equal_by_value():
    """Also with rasters and leaves; a field with the default value differs from a missing one."""
    raster = {
        "brown": RASTER,
        "leaf_optics": fifesim.Leaf(water=RASTER / 10),
        "background": {"TM3": RASTER, "TM4": 0.2},
    }
    copied = {
        "brown": RASTER.copy(),
        "leaf_optics": fifesim.Leaf(water=RASTER / 10),
        "background": dict(raster["background"]),
    }
    assert Canopy() == TALLGRASS and hash(Canopy()) == hash(TALLGRASS)
    assert Canopy(**raster) == Canopy(**copied) and hash(Canopy(**raster)) == hash(Canopy(**copied))
    assert Canopy(brown=0.5) == Canopy(brown=np.float64(0.5)) != Canopy(brown=0.4)
    for name, other in (("brown", RASTER / 2), ("leaf_optics", fifesim.Leaf()), ("background", {"TM3": RASTER / 2})):
        assert Canopy(**raster) != Canopy(**copied | {name: other})
    assert Canopy(brown=0.0) != Canopy() and Canopy() != 1
