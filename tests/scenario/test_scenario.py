"""Scenario: keys, units, ranges, one line per mistake, and a round trip through TOML."""

import inspect
import re
import tomllib
from dataclasses import fields
from datetime import datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pyproj
import pytest
from affine import Affine
from elevations import write
from hypothesis import given
from hypothesis import strategies as st
from mistakes import cases, check_message, lines, mistakes
from pydantic import Field, ValidationError

import fifesim
from fifesim.base.geometry import earth_sun_distance, sun_geometry
from fifesim.base.times import SITE_TIME
from fifesim.grids import grid as grids
from fifesim.scenario.keys import VARYING, ClassKeys, LandscapeKeys, Section, StandKeys, file, number, seed, text
from fifesim.scenario.scenario import (
    Scenario,
    default_scenario,
    find_key,
    in_text,
    parse_scenario,
    read_scenario,
    statement,
    summary,
    values_of,
    with_false_colour,
)
from fifesim.scenario.sections import Ground
from fifesim.scenario.toml import check_spelling, load_values, write_scenario, write_tables

SMALL = {"grid": {"width": 300.0, "height": 150.0}}


def write_toml(tmp_path, text):
    path = tmp_path / "scenario.toml"
    path.write_text(text, encoding="utf-8")
    return path


def read_text(tmp_path, text):
    return read_scenario(write_toml(tmp_path, text))


def test_default_scenario_is_the_paper_case_on_the_whole_site():
    default = Scenario()
    assert grids.same_grid(default.geobox(), fifesim.fife_site(30 / 9))
    assert default.model_atmosphere() == fifesim.Atmosphere()
    sun = default.sun_and_view()
    assert (sun.sza, sun.saa) == pytest.approx((fifesim.fife_geometry().sza, fifesim.fife_geometry().saa), abs=1e-9)
    assert (default.ground.distribution, default.ground.arp, default.ground.seed) == ("burned-grazed", 0.15, 7)
    assert (default.sensor.instrument, default.sensor.bands) == ("TM", ["TM3", "TM4"])


def test_keys_have_the_defaults_of_the_functions():
    for section, keys, function in (
        ("ground", ("fpar_inf",), fifesim.fpar),
        ("ground", ("distribution", "arp", "method"), fifesim.lai_scene),
        ("terrain", ("upwelling", "slopes"), fifesim.surface_reflectance),
        ("atmosphere", ("profile", "aerosol", "altitude", "engine"), fifesim.Atmosphere),
        ("clouds", ("thickness", "length"), fifesim.cloud_field),
        ("sensor", ("min_valid",), fifesim.sense),
    ):
        arguments = inspect.signature(function).parameters
        for key in keys:
            assert getattr(getattr(Scenario(), section), key) == arguments[key].default, key


class Shelf(Section):
    """Keys of every kind."""

    length: float = number(2.0, "m", "of it")
    step: float | str = Field(1.0, description="or a word", json_schema_extra={"unit": "m"})
    colour: str = text("red", "of it")
    grain: int = seed(3, "of its noise")
    picture: str | None = file(None, "always a file")
    list_of: str = file("oak", "a name, or a .csv", suffix=".csv")
    map_of: str = file("flat", "flat, or a file of any suffix", names=("flat", "v1.2"), suffix="*")


def test_numbers_may_carry_their_unit_and_seeds_are_integers_that_toml_can_hold():
    """Conversion is exact in decimal."""
    for written, value in (("3 m", 3.0), ("3", 3.0), (" 3e0m ", 3.0), (3, 3.0), ("3 km", 3000.0), ("3 cm", 0.03)):
        assert Shelf(length=written).length == value
    assert Shelf(step="native").step == "native" and Shelf(grain=2**63 - 1).grain == 2**63 - 1
    for wrong in ({"length": "3 ft"}, {"step": "3 ft"}, *({"grain": each} for each in (-1, 2**63, 1.0, "1", True))):
        with pytest.raises(ValidationError, match=r"(length|step) is in m; write a number|grain"):
            Shelf(**wrong)
    lengths = {"width": "3 km", "height": "1.1km", "cell": "333 cm", "west": "709.0 km"}
    grid = parse_scenario({"grid": lengths}).grid
    assert (grid.width, grid.height, grid.cell, grid.west) == (3000.0, 1100.0, 3.33, 709000.0)
    air = parse_scenario({"atmosphere": {"altitude": "412 m", "visibility": "23000m"}}).atmosphere
    assert (air.altitude, air.visibility) == (0.412, 23.0)


def test_key_tells_whether_its_value_is_a_file():
    named = {"picture": ["anything"], "list_of": ["mine.CSV"], "map_of": ["hills.tif"]}
    others = {"picture": [None], "list_of": ["oak", "mine.tif"], "map_of": ["hills", "v1.2"], "colour": ["red.csv"]}
    for answer, values in ((True, named), (False, others | {"unknown": ["a.csv"]})):
        assert {Shelf.names_a_file(key, value) for key, each in values.items() for value in each} == {answer}


def test_limits_of_keys_are_allowed():
    LandscapeKeys(deviations=dict.fromkeys(VARYING, 1))
    StandKeys(hotspot=1e-6, brown=1, dissociation=1, crown_cover=0, crown_shape=10, soil=-1, moisture=1)
    assert ClassKeys(share=1).share == 1


def test_landscape_is_one_stand_if_only_leaf_area_varies():
    for values, is_one in cases("one stand"):
        assert Scenario(**values).is_one() is is_one, values
    assert (
        LandscapeKeys(cover="cover.tif").files == {"cover": "cover.tif"} and LandscapeKeys(cover="levels").files == {}
    )


FILE_NAMES = ("a\nb.tif", "a\tb", "\x1b[31mred.tif", "a\x7fb.tif", "röd 😀.tif", "a\u202eb", "\"'.tif", "a\\b")
BAND_NAMES = ("B 3", "röd", 'b"3', "b.3", "b\\3", "", "=", "3")


def test_any_scenario_or_name_of_a_file_or_band_is_read_back(tmp_path):
    for values, _ in cases("round trip"):
        whole = parse_scenario(values).complete()
        for scenario in (parse_scenario(values), whole):
            assert read_text(tmp_path, write_scenario(scenario)) == scenario
        assert write_scenario(read_text(tmp_path, write_scenario(whole)).complete()) == write_scenario(whole)
    for name, band in zip(FILE_NAMES, BAND_NAMES, strict=True):
        odd = parse_scenario({"ground": {"lai_file": str(tmp_path / name), "background": {band: 0.1, "TM3": 0.2}}})
        assert read_text(tmp_path, write_scenario(odd)) == odd


@given(st.text(st.characters(exclude_categories=["Cs"]), max_size=30), st.floats())
def test_text_and_numbers_are_written_as_toml(text, number):
    """tomllib reads the same values back."""
    values = {text: {"text": text, "list": [text, number], "flag": True}, "none": None}
    found = tomllib.loads(write_tables("", {("draw",): values, ("empty",): {}}))
    assert list(found) == ["draw"] and list(found["draw"]) == [text]
    found = found["draw"][text]
    assert (found["text"], found["list"][0], found["flag"]) == (text, text, True)
    assert found["list"][1] == number or number != number


def test_base_gives_way_to_given_keys():
    paper = Scenario(base="paper")
    assert (paper.learned, paper.ground.distribution, paper.sensor.response) == (None, "burned-grazed", "paper")
    given = Scenario(base="paper", ground={"distribution": "unburned-ungrazed"}, sensor={"instrument": "OLI"})
    assert (given.ground.distribution, given.sensor.response) == ("unburned-ungrazed", None)
    assert Scenario(base="landscape") == Scenario()


def test_completing_a_scenario_does_not_change_its_meaning():
    """Leaf chemistry and spectra are written with their defaults; optics by band would override them."""
    scenario = parse_scenario(SMALL | {"geometry": {"vza": 5}})
    complete = scenario.complete()
    assert complete.geobox() == scenario.geobox() and complete.sun_and_view() == scenario.sun_and_view()
    assert complete.sensor.pixel == 30.0 and set(complete.ground.background) == {"TM3", "TM4"}
    assert complete.complete() == complete
    values = {"ground": {"leaf": {"brown": 0.1}, "background_spectra": {"soil_dry": 1.0}}}
    ground = parse_scenario(SMALL | values).complete().ground
    assert ground.leaf_optics() == fifesim.Leaf(brown=0.1)
    assert set(ground.leaf) == {field.name for field in fields(fifesim.Leaf)}
    assert ground.below_canopy() == fifesim.Background({"soil_dry": 1.0})
    assert (ground.leaf_reflectance, ground.background) == ({}, {})


def test_every_key_has_a_meaning_and_every_number_a_unit():
    """The comment after each key has the form `key = value  # unit; meaning`."""
    text = write_scenario(Scenario().complete())
    tomllib.loads(text)
    for line in text.splitlines():
        if "=" in line and not re.match(r"(TM\d|soil|brown|moisture) = ", line):
            assert re.search(r"# \S", line), line
            if re.search(r"= [-\d.]+\s", line):
                assert re.search(r"# (m|km|degree|1); |seed", line), line


def test_sun_may_be_given_instead_of_time_and_place():
    """Time is UTC unless it names an offset."""
    sun = parse_scenario({"geometry": {"sza": "40 degree", "saa": 100}}).sun_and_view()
    assert (sun.sza, sun.saa, sun.earth_sun_distance) == (40.0, 100.0, earth_sun_distance(SITE_TIME))
    for time in ("1987-06-06 16:35", datetime(1987, 6, 6, 11, 35, tzinfo=timezone(timedelta(hours=-5)))):
        assert Scenario(geometry={"time": time}).sun_and_view() == Scenario().sun_and_view()
    with pytest.raises(ValueError, match="the sun is below the horizon"):
        parse_scenario({"geometry": {"time": "1987-06-06T06:00:00Z"}}).sun_and_view()


def test_scene_of_a_map_covers_the_map(tmp_path):
    path = str(write(tmp_path / "lai.tif", np.ones((33, 44)), Affine(10, 0, 709003, 0, -10, 4332001)))
    covering = parse_scenario({"ground": {"lai_file": path}}).geobox().boundingbox
    assert covering.left <= 709003 < covering.left + 30 and covering.top - 30 < 4332001 <= covering.top
    assert parse_scenario(SMALL | {"ground": {"lai_file": path}}).geobox() == parse_scenario(SMALL).geobox()
    in_cone = parse_scenario({"grid": {"crs": "EPSG:5070"}, "ground": {"lai_file": path}}).geobox()
    to_cone = pyproj.Transformer.from_crs(26914, 5070, always_xy=True)
    west, south, east, north = to_cone.transform_bounds(709003, 4331671, 709443, 4332001)
    box = in_cone.boundingbox
    assert in_cone.crs.epsg == 5070
    assert box.left <= west < box.left + 30 and box.top - 30 < north <= box.top
    assert box.right - 30 < east <= box.right and box.bottom <= south < box.bottom + 30


SOUTH = {"crs": "EPSG:32735", "west": 620000.0, "north": 7220000.0, "width": 300.0, "height": 300.0, "cell": 10.0}


def test_grid_outside_fife_needs_time_altitude_and_elevation():
    with pytest.raises(ValueError) as caught:
        parse_scenario({"grid": SOUTH}).complete()
    said = str(caught.value)
    assert said.startswith("grid: its centre, latitude -25.13, longitude 28.19, is not on the FIFE site: give ")
    assert all(key in said for key in ("geometry.time", "geometry.sza and saa", "atmosphere.altitude", "terrain.dem"))
    known = {"grid": SOUTH, "atmosphere": {"altitude": 1.3}, "terrain": {"dem": "flat"}}
    with pytest.raises(ValueError, match=r"FIFE site: give geometry.time, such as [^;]*$"):
        parse_scenario(known).complete()
    overpass = parse_scenario(known | {"geometry": {"time": "2022-06-01T08:05Z"}}).complete().sun_and_view()
    longitude, latitude = pyproj.Transformer.from_crs(32735, 4326, always_xy=True).transform(620150, 7219850)
    sun = sun_geometry("2022-06-01T08:05Z", latitude, longitude, 1300)
    assert (overpass.sza, overpass.saa) == pytest.approx((sun.sza, sun.saa), abs=1e-9)
    assert sun.saa < 90  # north of east, as below the equator in winter
    given = parse_scenario(known | {"geometry": {"sza": 50, "saa": 40}}).complete()
    assert given.geometry.time is None and given.sun_and_view().earth_sun_distance == 1.0


def test_mapped_leaf_area_defaults_to_flat_terrain():
    given = {"ground": {"lai_file": "lai.tif"}, "terrain": {"dem": "flint-hills"}}
    assert parse_scenario({}).terrain.dem == parse_scenario(given).terrain.dem == "flint-hills"
    assert parse_scenario({"ground": {"lai_file": "lai.tif"}}).terrain.dem == "flat"
    assert Scenario(ground=Ground(lai_file="lai.tif")).terrain.dem == "flat"


def test_class_without_leaf_area_takes_it_from_the_ground():
    scenario = Scenario(
        ground={"distribution": "unburned-ungrazed", "arp": 0.2},
        landscape={"cover": "voronoi"},
        classes={"grass": {}, "own": {"distribution": "burned-grazed", "brown": 0.3}},
    )
    grass, own = (stand.cover_class(name, scenario.ground) for name, stand in scenario.classes.items())
    assert (grass.lai, grass.arp, grass.canopy.given) == ("unburned-ungrazed", None, frozenset())
    assert (own.lai, own.canopy.brown, own.canopy.given) == ("burned-grazed", 0.3, {"brown"})


def test_misspelt_key_does_not_hide_another_mistake(tmp_path):
    for wrong, second in (
        ("[sensor]\npixl = 30\nnoise = ['fixed-pattern']\n", "TM has no fixed-pattern noise for TM2"),
        ("[landscap]\ncover = 'pastures'\n[classes.a]\nshare = 0.3\n[classes.b]\n", "classes: b has no share"),
    ):
        with pytest.raises(ValueError, match="unknown key") as caught:
            read_text(tmp_path, wrong)
        first, *others = str(caught.value).splitlines()
        assert first.startswith("scenario.toml: unknown key") and len(others) == 1 and second in others[0]


def test_key_is_found_by_short_or_full_name():
    assert find_key("visibility").name == "atmosphere.visibility"
    assert find_key("leaf.chlorophyll").name == "ground.leaf.chlorophyll"
    assert find_key("deviations.soil").name == "landscape.deviations.soil"
    for name in ("ground.seed", "classes.grass.brown", "classes.grass.leaf.chlorophyll"):
        assert find_key(name).name == name


def test_replacing_keys_equals_writing_them_in_the_scenario():
    """Replace keys of several sections, of a class and of a table, and two keys that must be given together."""
    values = {"ground": {"seed": 5}, "landscape": {"cover": "voronoi"}, "classes": {"grass": {"brown": 0.1}}}
    changes = {"visibility": "20 km", "sensor.seed": 3, "classes.grass.brown": 0.4, "sza": 30, "saa": np.float64(140)}
    expected = values | {"atmosphere": {"visibility": 20}, "sensor": {"seed": 3}, "geometry": {"sza": 30, "saa": 140}}
    first = Scenario(**values)
    assert first.replace(**changes) == Scenario(**expected | {"classes": {"grass": {"brown": 0.4}}})
    assert first == Scenario(**values) and first.replace() == first
    assert first.replace(offset=np.array([0.5, 0.0])).sensor.offset == [0.5, 0.0]
    assert values_of(Scenario()) == {}
    assert [in_text(value) for value in (["shot"], [], True, "TM")] == ["shot", "none", True, "TM"]


@pytest.mark.parametrize(("values", "said", "short"), lines("scenario_statements"), ids=str)
def test_statement_distinguishes_synthetic_parts_and_files(values, said, short):
    scenario = parse_scenario(values)
    assert statement(scenario) == scenario.provenance() == said and summary(scenario) == short
    assert write_scenario(scenario).splitlines()[0] == f"# {said}"


def test_default_landscape_is_called_synthetic_in_the_readme():
    """The same holds once every default is written out and read again."""
    (_, said, _), *_ = lines("scenario_statements")
    assert {statement(each) for each in (default_scenario(), default_scenario().complete(), Scenario())} == {said}
    readme = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8").partition("## Install")[0]
    assert said in re.sub(r"\s+", " ", readme)


def test_default_bands_of_a_file_without_bands(tmp_path):
    """SuperDove has no known noise in any band; later checks name this and other mistakes."""
    assert read_text(tmp_path, "").sensor.bands == ["TM2", "TM3", "TM4"]
    for values, bands in cases("bands of a file"):
        assert parse_scenario(with_false_colour(values)).sensor.bands == bands
    noiseless = {"instrument": "SuperDove", "noise": ["shot"]}
    for sensor in ({"instrument": "TN"}, {"instrument": 3}, {"instrument": "missing.toml"}, "TM", noiseless):
        assert with_false_colour({"sensor": sensor}) == {"sensor": sensor}


@pytest.mark.parametrize(("stage", "values", "said"), mistakes("read", "complete", "replace"), ids=str)
def test_mistakes_are_reported_before_a_run_begins(stage, values, said):
    with pytest.raises(ValueError) as caught:
        if stage == "replace":
            Scenario(landscape={"cover": "voronoi"}, classes={"grass": {"brown": 0.1}}).replace(**values)
        scenario = parse_scenario(values)
        assert stage == "complete"
        scenario.complete()
    check_message(str(caught.value), said)


def test_file_paths_are_relative_to_the_scenario(tmp_path):
    """Only values that name files become paths; an unset key is a comment in its section that can be filled in."""
    (tmp_path / "version1").write_text("lai\n1\n2\n3\n")
    # The target of the link has no suffix that distinguishes a file from a name.
    (tmp_path / "samples.csv").symlink_to("version1")
    path = write_toml(
        tmp_path,
        "[ground]\nlai_file = 'lai.tif'\ndistribution = 'burned-grazed'\n[terrain]\ndem = '/vsizip//a.zip/dem.tif'\n"
        "[sensor]\ninstrument = 'mine.toml'\n",
    )
    here, values = tmp_path.resolve(), load_values(path)
    assert values["ground"] == {"lai_file": str(here / "lai.tif"), "distribution": "burned-grazed"}
    assert values["terrain"]["dem"] == "/vsizip//a.zip/dem.tif"
    assert values["sensor"]["instrument"] == str(here / "mine.toml")
    filled = write_scenario(Scenario(base="paper")).replace("# lai_file = ", "lai_file = 'lai.tif'")
    assert load_values(write_toml(tmp_path, filled))["ground"]["lai_file"] == str(here / "lai.tif")
    assert read_text(tmp_path, "ground.distribution = 'samples.csv'").ground.distribution == str(here / "samples.csv")


def test_each_class_is_written_as_a_table(tmp_path):
    """Its files are relative to the scenario, only its explicit keys are written, and they are read back unchanged."""
    (tmp_path / "mine.csv").write_text("lai\n1\n2\n3\n4\n5\n")
    scenario = read_text(
        tmp_path,
        "[landscape]\ncover = 'voronoi'\n[classes.grass]\nshare = 0.7\n[classes.wood]\nshare = 0.3\n"
        "distribution = 'mine.csv'\nbackground = { TM3 = 0.1, TM4 = 0.2 }\n",
    )
    assert scenario.files == {("classes", "wood", "distribution"): str(tmp_path.resolve() / "mine.csv")}
    assert scenario.classes["wood"].distribution == scenario.files["classes", "wood", "distribution"]
    text = write_scenario(scenario)
    assert text.count("distribution =") == 2 and "[classes.wood.background]" in text
    again = parse_scenario(tomllib.loads(text))
    assert again == scenario and write_scenario(again) == text


def spelling_error(path):
    """Error message of the spelling check, which must be short and printable."""
    with pytest.raises(ValueError) as caught:
        check_spelling(path)
    said = str(caught.value)
    assert len(said) <= 500 and all(line.isprintable() for line in said.splitlines())
    return said


def test_spelling_check_reports_each_mistake_on_one_line(tmp_path):
    """Names of instruments and models are left to physics."""
    said = spelling_error(write_toml(tmp_path, "[sensor]\nbandz = ['TM3']\npixel = -1\n[ground]\narp = 0.3\n"))
    assert [line.partition(" =")[0] for line in said.splitlines()] == [
        "ground.arp", "sensor.pixel", "unknown key sensor.bandz",
    ]  # fmt: skip
    check_spelling(write_toml(tmp_path, "[sensor]\ninstrument = 'TN'\n[ground]\nleaf_angles = 'sphere'\n"))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[" + "a." * 5000 + "a]", "nests its tables too deeply"),
        ("[ground]\nleaf_angles = 3\ndistribution = 4\n" + "".join(f"k{i} = 1\n" for i in range(999)), "and 99"),
        ("grid.north = 0x" + "f" * 9000, "grid.north"),
        ("grid.north = '1" + " " * 900_000 + "x'", "north is in m"),
        ("#" * 2_000_000, "has 2000000 bytes"),
    ],
    ids=["tables", "many", "digits", "spaces", "size"],
)
def test_message_is_short_and_printable(tmp_path, text, said):
    assert said in spelling_error(write_toml(tmp_path, text))
