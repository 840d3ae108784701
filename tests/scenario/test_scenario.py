"""Scenario: units, ranges, one line per mistake, and a round trip through TOML."""

import inspect
import re
import tomllib
from dataclasses import fields
from pathlib import Path

import numpy as np
import pyproj
import pytest
import rasterio
from affine import Affine
from mistakes import check_message, lines, mistakes

import fifesim
from fifesim.base.geometry import earth_sun_distance, sun_geometry
from fifesim.base.times import SITE_TIME
from fifesim.grids import grid as grids
from fifesim.scenario.scenario import (
    Scenario,
    default_scenario,
    find_key,
    in_text,
    parse_scenario,
    put,
    statement,
    summary,
    values_of,
    with_false_colour,
)
from fifesim.scenario.sections import Ground
from fifesim.scenario.toml import write_scenario

SMALL = {"grid": {"width": 300.0, "height": 150.0}}


def read_text(tmp_path, text):
    path = tmp_path / "scenario.toml"
    path.write_text(text, encoding="utf-8")
    return fifesim.scenario.read_scenario(path)


def test_default_scenario_is_the_paper_case_on_the_whole_site():
    default = Scenario()
    assert grids.same_grid(default.geobox(), fifesim.fife_site(30 / 9))
    assert default.model_atmosphere() == fifesim.Atmosphere()
    sun = default.sun_and_view()
    assert (sun.sza, sun.saa) == pytest.approx((fifesim.fife_geometry().sza, fifesim.fife_geometry().saa), abs=1e-9)
    assert (default.ground.distribution, default.ground.arp, default.ground.seed) == ("burned-grazed", 0.15, 7)
    assert (default.sensor.instrument, default.sensor.bands) == ("TM", ["TM3", "TM4"])


@pytest.mark.parametrize(
    ("section", "keys", "function"),
    [
        ("ground", ("fpar_inf",), fifesim.fpar),
        ("ground", ("distribution", "arp", "method"), fifesim.lai_scene),
        ("terrain", ("upwelling", "slopes"), fifesim.surface_reflectance),
        ("atmosphere", ("profile", "aerosol", "altitude", "engine"), fifesim.Atmosphere),
        ("clouds", ("thickness", "length"), fifesim.cloud_field),
        ("sensor", ("min_valid",), fifesim.sense),
    ],
)
def test_keys_have_the_defaults_of_the_functions(section, keys, function):
    arguments = inspect.signature(function).parameters
    for key in keys:
        assert getattr(getattr(Scenario(), section), key) == arguments[key].default, key


@pytest.mark.parametrize(
    "values",
    [
        {},
        SMALL,
        {"geometry": {"sza": 40.0, "saa": 100.0, "vza": 10.0, "vaa": 5.0}},
        {"ground": {"arp": 0.24, "seed": 2**63 - 1, "method": "periodic", "leaf_angles": "verhoef(-0.35,-0.15)"}},
        {"ground": {"background": {"TM3": 0.1, "TM4": 0.2}}, "sensor": {"pixel": 15.0, "min_valid": 0.5}},
        {"grid": {"cell": 1 / 3, "width": 60.0, "height": 60.0}},
        {"ground": {"leaf": {"chlorophyll": 40.0}, "background_spectra": {"soil_wet": 0.5, "shade": 0.5}}},
        {"sensor": {"instrument": "OLI", "bands": ["OLI4", "OLI5"]}},
        {"sensor": {"instrument": "L4TM", "interval": "native", "offset": [0.5, -1.0], "noise": ["thermal"]}},
        {"sensor": {"interval": "30.5 m", "seed": 4}},
        default_scenario().model_dump(exclude_unset=True),
    ],
)
@pytest.mark.parametrize("complete", [False, True])
def test_scenario_survives_a_round_trip_through_text(tmp_path, values, complete):
    scenario = parse_scenario(values)
    scenario = scenario.complete() if complete else scenario
    again = read_text(tmp_path, write_scenario(scenario))
    assert again == scenario
    assert write_scenario(again.complete() if complete else again) == write_scenario(scenario)


def test_base_gives_way_to_given_keys():
    paper = Scenario(base="paper")
    assert (paper.learned, paper.ground.distribution, paper.sensor.response) == (None, "burned-grazed", "paper")
    given = Scenario(base="paper", ground={"distribution": "unburned-ungrazed"}, sensor={"response": "detector"})
    assert (given.ground.distribution, given.sensor.response) == ("unburned-ungrazed", "detector")
    assert Scenario(base="paper", sensor={"instrument": "OLI"}).sensor.response is None
    assert Scenario(base="landscape") == Scenario()


def test_completing_a_scenario_does_not_change_its_meaning():
    scenario = parse_scenario(SMALL | {"geometry": {"vza": 5}})
    complete = scenario.complete()
    assert complete.geobox() == scenario.geobox()
    assert complete.sun_and_view() == scenario.sun_and_view()
    assert complete.sensor.pixel == 30.0
    assert set(complete.ground.background) == {"TM3", "TM4"}
    assert complete.complete() == complete
    # Leaf chemistry and spectra are written with their defaults; optics by band would override them.
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


def test_lengths_may_be_given_in_any_length_unit():
    """Conversion is exact in decimal."""
    lengths = {"width": "3 km", "height": "1.1km", "cell": "333 cm", "west": "709.0 km"}
    grid = parse_scenario({"grid": lengths}).grid
    assert (grid.width, grid.height, grid.cell, grid.west) == (3000.0, 1100.0, 3.33, 709000.0)
    air = parse_scenario({"atmosphere": {"altitude": "412 m", "visibility": "23000m"}}).atmosphere
    assert (air.altitude, air.visibility) == (0.412, 23.0)


def test_sun_may_be_given_instead_of_time_and_place():
    sun = parse_scenario({"geometry": {"sza": "40 degree", "saa": 100}}).sun_and_view()
    assert (sun.sza, sun.saa, sun.earth_sun_distance) == (40.0, 100.0, earth_sun_distance(SITE_TIME))
    night = parse_scenario({"geometry": {"time": "1987-06-06T06:00:00Z"}})
    with pytest.raises(ValueError, match="the sun is below the horizon"):
        night.sun_and_view()


def test_scene_of_a_map_covers_the_map(tmp_path):
    path = tmp_path / "lai.tif"
    affine = Affine(10, 0, 709003, 0, -10, 4332001)
    with rasterio.open(
        path, "w", driver="GTiff", height=33, width=44, count=1, dtype="float32", crs="EPSG:26914", transform=affine
    ) as sink:
        sink.write(np.ones((1, 33, 44), np.float32))
    covering = parse_scenario({"ground": {"lai_file": str(path)}}).geobox().boundingbox
    assert covering.left <= 709003 < covering.left + 30 and covering.top - 30 < 4332001 <= covering.top
    given = parse_scenario(SMALL | {"ground": {"lai_file": str(path)}}).geobox()
    assert given == parse_scenario(SMALL).geobox()
    in_cone = parse_scenario({"grid": {"crs": "EPSG:5070"}, "ground": {"lai_file": str(path)}}).geobox()
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
    with pytest.raises(ValueError, match=r"FIFE site: give geometry.time, such as [^;]*$"):
        parse_scenario({"grid": SOUTH, "atmosphere": {"altitude": 1.3}, "terrain": {"dem": "flat"}}).complete()
    air = {"atmosphere": {"altitude": 1.3}, "terrain": {"dem": "flat"}}
    overpass = parse_scenario({"grid": SOUTH, "geometry": {"time": "2022-06-01T08:05Z"}} | air).complete()
    longitude, latitude = pyproj.Transformer.from_crs(32735, 4326, always_xy=True).transform(620150, 7219850)
    sun = sun_geometry("2022-06-01T08:05Z", latitude, longitude, 1300)
    assert (overpass.sun_and_view().sza, overpass.sun_and_view().saa) == pytest.approx((sun.sza, sun.saa), abs=1e-9)
    assert sun.saa < 90  # north of east, as below the equator in winter
    given = parse_scenario({"grid": SOUTH, "geometry": {"sza": 50, "saa": 40}} | air).complete()
    assert given.geometry.time is None and given.sun_and_view().earth_sun_distance == 1.0


def test_mapped_leaf_area_defaults_to_flat_terrain():
    assert parse_scenario({}).terrain.dem == "flint-hills"
    assert parse_scenario({"ground": {"lai_file": "lai.tif"}}).terrain.dem == "flat"
    given = {"ground": {"lai_file": "lai.tif"}, "terrain": {"dem": "flint-hills"}}
    assert parse_scenario(given).terrain.dem == "flint-hills"
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


@pytest.mark.parametrize(
    ("text", "second"),
    [
        ("[sensor]\ninstrment = 'TM'\nbands = ['XX']\n", "sensor: unknown band of TM 'XX'"),
        ("[sensor]\npixl = 30\nnoise = ['fixed-pattern']\n", "TM has no fixed-pattern noise for TM2"),
        ("[landscap]\ncover = 'pastures'\n[classes.a]\nshare = 0.3\n[classes.b]\n", "classes: b has no share"),
        ("[sensor]\nxyzzy = 1\nbands = ['XX']\n", "sensor: unknown band of TM 'XX'"),
    ],
)
def test_misspelt_key_does_not_hide_another_mistake(text, second, tmp_path):
    with pytest.raises(ValueError, match="unknown key") as caught:
        read_text(tmp_path, text)
    first, *others = str(caught.value).splitlines()
    assert first.startswith("scenario.toml: unknown key") and len(others) == 1 and second in others[0]


@pytest.mark.parametrize(
    ("name", "whole"),
    [
        ("visibility", "atmosphere.visibility"),
        ("ground.seed", "ground.seed"),
        ("classes.grass.brown", "classes.grass.brown"),
        ("ground.leaf.chlorophyll", "ground.leaf.chlorophyll"),
        ("leaf.chlorophyll", "ground.leaf.chlorophyll"),
        ("classes.grass.leaf.chlorophyll", "classes.grass.leaf.chlorophyll"),
        ("deviations.soil", "landscape.deviations.soil"),
    ],
)
def test_key_is_found_by_short_or_full_name(name, whole):
    assert find_key(name).name == whole


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("senser.seed", r"not a key of a scenario: did you mean 'sensor\.seed'"),
        ("classes.grass.brwn", r"not a key of a scenario: did you mean 'classes\.grass\.brown'"),
        ("ground.arp.tall", "not a key of a scenario"),
        ("ground.leaf.", "not a key of a scenario"),
        ("ground", "not a key of a scenario"),
        ("classes", "not a key of a scenario"),
        ("classes.grass", "not a key of a scenario"),
    ],
)
def test_unknown_or_ambiguous_key_names_are_rejected(name, message):
    with pytest.raises(ValueError, match=message):
        find_key(name)


def test_replacing_keys_equals_writing_them_in_the_scenario():
    """Replace keys of several sections, of a class and of a table, and two keys that must be given together."""
    values = {
        "ground": {"arp": 0.1, "seed": 5},
        "landscape": {"cover": "voronoi"},
        "classes": {"grass": {"brown": 0.1}},
    }
    changes = {"visibility": "20 km", "sensor.seed": 3, "classes.grass.brown": 0.4, "sza": 30, "saa": np.float64(140)}
    expected = values | {
        "atmosphere": {"visibility": 20}, "sensor": {"seed": 3}, "classes": {"grass": {"brown": 0.4}},
        "geometry": {"sza": 30, "saa": 140},
    }  # fmt: skip
    first = Scenario(**values)
    assert first.replace(**changes) == Scenario(**expected)
    assert first == Scenario(**values) and first.replace() == first
    assert values_of(Scenario()) == {}
    offset = {}
    put(offset, ("sensor", "offset"), np.array([0.5, 0.0]))
    assert offset == {"sensor": {"offset": [0.5, 0.0]}}
    assert [in_text(value) for value in (["shot"], [], True, "TM")] == ["shot", "none", True, "TM"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"sensor.sed": 3}, r"replace: 'sensor\.sed' is not a key of a scenario: did you mean 'sensor\.seed'"),
        ({"visibilty": 3}, "replace: 'visibilty' is not a key of a scenario: did you mean 'visibility'"),
        ({"seed": 3}, r"replace: 'seed' exists in several sections: use .*sensor\.seed"),
        ({"sensor.seed": -1}, r"sensor\.seed = -1: must be at least 0"),
        ({"sza": 30}, "sza and saa go together"),
        ({"leaf.chlorofyll": 30}, "unknown key 'chlorofyll': did you mean 'chlorophyll'"),
        ({"classes.gras.brown": 0.3}, r"classes\.gras\.brown is of a class .*did you mean 'grass'\? .* are grass"),
        ({"arp": 0.1, "ground.arp": 0.2}, r"replace: arp and ground\.arp are one key"),
        ({"bands": ["OLI4"]}, "OLI4"),
    ],
)
def test_invalid_replacements_are_rejected(changes, message):
    scenario = Scenario(landscape={"cover": "voronoi"}, classes={"grass": {"brown": 0.1}})
    with pytest.raises(ValueError, match=message):
        scenario.replace(**changes)


ROOT = Path(__file__).parents[2]
DEFAULT = (
    "Synthetic landscape: ground and hills are synthetic; only the location is FIFE's. Leaf area was learned from "
    "Kings Creek, Konza Prairie: NDVI of Sentinel-2, 3 June 2022 (contains modified Copernicus Sentinel data 2022), "
    "and elevation of USGS 3DEP. Hypothetical overpass, 6 June 1987 16:35 UTC."
)
OVERPASS = "Hypothetical overpass, 6 June 1987 16:35 UTC."
PASTURES = {"landscape": {"cover": "pastures"}}
GIVEN = {"ground": {"lai_file": "lai.tif"}, "terrain": {"dem": "dem.tif"}}
ELSEWHERE = {"grid": {"west": 600_000.0}, "geometry": {"time": "2022-06-01T10:05:00Z"}}


def test_default_landscape_is_called_synthetic():
    """The same holds once every default is written out and read again."""
    found = default_scenario()
    for scenario in (found, found.complete(), Scenario()):
        assert statement(scenario) == scenario.provenance() == DEFAULT
        assert summary(scenario) == "synthetic landscape, hypothetical overpass"


@pytest.mark.parametrize(("values", "said", "short"), lines("scenario_statements"), ids=str)
def test_statement_distinguishes_synthetic_parts_and_files(values, said, short):
    scenario = parse_scenario(values)
    assert statement(scenario) == f"{said} {OVERPASS}"
    assert summary(scenario) == short


@pytest.mark.parametrize(
    ("geometry", "said"),
    [
        ({"time": "1987-08-15T16:40:30Z"}, "Time as given, 15 August 1987 16:40 UTC."),
        ({"time": "1987-08-15T23:40:00-05:00"}, "Time as given, 16 August 1987 04:40 UTC."),
        ({"sza": 30.0, "saa": 120.0}, "Sun angles as given."),
    ],
)
def test_explicit_time_is_not_called_hypothetical(geometry, said):
    scenario = parse_scenario(GIVEN | {"geometry": geometry})
    assert statement(scenario) == f"Leaf area and elevation are from files. {said}"
    assert summary(scenario) == ""


def test_statement_outside_fife_names_no_location_or_overpass():
    """At another place even the overpass time of FIFE may belong to a real image."""
    said = "Synthetic landscape: fields and hills are synthetic; only the three grass types are FIFE's."
    scenario = parse_scenario(PASTURES | ELSEWHERE)
    assert statement(scenario) == f"{said} Time as given, 1 June 2022 10:05 UTC."
    same = parse_scenario(PASTURES | ELSEWHERE | {"geometry": {"time": "1987-06-06T16:35Z"}})
    assert statement(same) == f"{said} Time as given, 6 June 1987 16:35 UTC." and "overpass" not in summary(same)
    # An incomplete scenario is described without opening its files.
    assert statement(parse_scenario(GIVEN)) == "Leaf area and elevation are from files."
    assert "location" not in statement(parse_scenario({"grid": {"crs": "EPSG:1"}}))


def test_readme_and_scenario_files_begin_with_the_statement():
    for scenario, said in ((default_scenario(), DEFAULT), (Scenario(**GIVEN), statement(parse_scenario(GIVEN)))):
        assert write_scenario(scenario).splitlines()[0] == f"# {said}"
    _, first, *_ = (ROOT / "README.md").read_text(encoding="utf-8").split("\n\n")
    assert re.sub(r"\s+", " ", first).endswith(f"shows no real scene. *{DEFAULT}*")


@pytest.mark.parametrize(
    ("text", "bands"),
    [
        ("", ["TM2", "TM3", "TM4"]),
        ("[sensor]\ninstrument = 'MSI'\n", ["MSI3", "MSI4", "MSI8"]),
        ("[sensor]\ninstrument = 'MODIS'\n", ["MODIS1", "MODIS2"]),
        ("[sensor]\ninstrument = 'AVHRR9'\npixel = 1100\n", ["AVHRR1", "AVHRR2"]),
        ("[sensor]\nbands = ['TM4']\n", ["TM4"]),
        ("[ground]\nbackground = { TM3 = 0.1, TM4 = 0.2 }\n", ["TM3", "TM4"]),
        ("[ground]\nbackground = { TM2 = 0.1, TM3 = 0.1, TM4 = 0.2 }\n", ["TM2", "TM3", "TM4"]),
    ],
)
def test_default_bands_of_a_file_without_bands(tmp_path, text, bands):
    assert read_text(tmp_path, text).sensor.bands == bands


def test_green_band_is_added_only_to_valid_sensors_with_known_noise():
    """SuperDove has no known noise in any band; later checks name this and other mistakes."""
    noiseless = {"instrument": "SuperDove", "noise": ["shot"]}
    for sensor in ({"instrument": "TN"}, {"instrument": 3}, {"instrument": "missing.toml"}, "TM", noiseless):
        assert with_false_colour({"sensor": sensor}) == {"sensor": sensor}
    noisy = {"sensor": {"instrument": "OLI", "noise": ["shot"]}}
    assert with_false_colour(noisy)["sensor"]["bands"] == ["OLI3", "OLI4", "OLI5"]


@pytest.mark.parametrize(("stage", "values", "said"), mistakes("read", "complete"), ids=str)
def test_mistakes_are_reported_before_a_run_begins(stage, values, said):
    with pytest.raises(ValueError) as caught:
        scenario = parse_scenario(values)
        assert stage == "complete"
        scenario.complete()
    check_message(str(caught.value), said)
