"""The scenario: units, ranges, one line a mistake, and a round trip through its own text."""

import re
import tomllib
from dataclasses import fields

import numpy as np
import pyproj
import pytest
import rasterio
from affine import Affine

import fifesim
from fifesim.atmosphere import six_s
from fifesim.base import times
from fifesim.base.geometry import earth_sun_distance, sun_geometry
from fifesim.grids import grid as grids
from fifesim.scenario.scenario import Scenario, parse_scenario
from fifesim.scenario.sections import Ground
from fifesim.scenario.toml import write_scenario

SMALL = {"grid": {"width": 300.0, "height": 150.0}}


def read_text(tmp_path, text):
    path = tmp_path / "scenario.toml"
    path.write_text(text, encoding="utf-8")
    return fifesim.read_scenario(path)


def test_default_is_the_paper_case_on_the_whole_site():
    default = Scenario()
    assert grids.same_grid(default.geobox(), fifesim.fife_site(30 / 9))
    assert default.model_atmosphere() == fifesim.Atmosphere()
    sun = default.sun_and_view()
    assert (sun.sza, sun.saa) == pytest.approx((fifesim.fife_geometry().sza, fifesim.fife_geometry().saa), abs=1e-9)
    assert (default.ground.distribution, default.ground.arp, default.ground.seed) == ("burned-grazed", 0.15, 7)
    assert (default.sensor.instrument, default.sensor.bands) == ("TM", ["TM3", "TM4"])


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
        {
            "sensor": {
                "instrument": "L4TM",
                "interval": "native",
                "offset": [0.5, -1.0],
                "noise": ["thermal"],
                "seed": 4,
            }
        },
        {"sensor": {"interval": "30.5 m"}},
    ],
)
@pytest.mark.parametrize("complete", [False, True])
def test_text_of_a_scenario_reads_as_the_same(tmp_path, values, complete):
    scenario = parse_scenario(values)
    scenario = scenario.complete() if complete else scenario
    again = read_text(tmp_path, write_scenario(scenario))
    assert again == scenario
    assert write_scenario(again) == write_scenario(scenario)


def test_complete_scenario_runs_the_same():
    scenario = parse_scenario(SMALL | {"geometry": {"vza": 5}})
    complete = scenario.complete()
    assert complete.geobox() == scenario.geobox()
    assert complete.sun_and_view() == scenario.sun_and_view()
    assert complete.sensor.pixel == 30.0
    assert set(complete.ground.background) == {"TM3", "TM4"}
    assert complete.complete() == complete


def test_complete_scenario_keeps_what_the_ground_is_made_of():
    """Chemistry and spectra stay, with their defaults; optics by band would hide them."""
    values = {"ground": {"leaf": {"brown": 0.1}, "background_spectra": {"soil_dry": 1.0}}}
    ground = parse_scenario(SMALL | values).complete().ground
    assert ground.leaf_optics() == fifesim.Leaf(brown=0.1)
    assert set(ground.leaf) == {field.name for field in fields(fifesim.Leaf)}
    assert ground.below_canopy() == fifesim.Background({"soil_dry": 1.0})
    assert (ground.leaf_reflectance, ground.background) == ({}, {})


def test_every_key_has_a_meaning_and_every_number_a_unit():
    """Text beside each key: `key = value  # unit; meaning`."""
    text = write_scenario(Scenario().complete())
    tomllib.loads(text)
    for line in text.splitlines():
        if "=" in line and not re.match(r"TM\d", line):
            assert re.search(r"# \S", line), line
            if re.search(r"= [-\d.]+\s", line):
                assert re.search(r"# (m|km|degree|1); |seed", line), line


@pytest.mark.parametrize(
    "written, value",
    [("'23 km'", 23.0), ("'23km'", 23.0), ("'23'", 23.0), ("23", 23.0), ("'2.3e1 km'", 23.0), ("' 23  km '", 23.0)],
)
def test_number_may_carry_its_unit(tmp_path, written, value):
    assert read_text(tmp_path, f"[atmosphere]\nvisibility = {written}").atmosphere.visibility == value


def test_lengths_are_taken_in_any_of_their_units():
    """In decimals as they are written."""
    lengths = {"width": "3 km", "height": "1.1km", "cell": "333 cm", "west": "709.0 km"}
    grid = parse_scenario({"grid": lengths}).grid
    assert (grid.width, grid.height, grid.cell, grid.west) == (3000.0, 1100.0, 3.33, 709000.0)
    air = parse_scenario({"atmosphere": {"altitude": "412 m", "visibility": "23000m"}}).atmosphere
    assert (air.altitude, air.visibility) == (0.412, 23.0)


@pytest.mark.parametrize(
    "text, message",
    [
        ("[atmosphere]\nvisibilty = 45", "atmosphere.visibilty = 45: did you mean 'visibility'? allowed are profile, "),
        ("[ground]\nARP = 0.1", "unknown key ground.ARP = 0.1"),
        ("[atmosfere]\nvisibility = 45", "did you mean 'atmosphere'? allowed are grid, ground"),
        (
            "[atmosphere]\nvisibility = '45 mi'",
            "visibility = '45 mi': visibility is in km; write a number, or a number",
        ),
        ("[grid]\nwidth = '3 degree'", "width is in m; write a number, or a number and 'km' or 'm' or 'cm'"),
        ("[geometry]\nsza = '30 m'", "sza is in degree; write a number, or a number and 'degree'"),
        ("[grid]\ncell = '3 px'", "cell = '3 px': cell is in m"),
        ("[atmosphere]\nvisibility = 2", "atmosphere.visibility = 2"),
        ("[atmosphere]\nvisibility = nan", "atmosphere.visibility = nan"),
        ("[ground]\narp = 0.25", "ground.arp = 0.25"),
        ("[ground]\narp = 0.2499", "arp = 0.2499: at most 0.2498 when streaming; or method"),
        ("[ground]\nseed = -1", "ground.seed = -1"),
        ("[ground]\nseed = 1.5", "ground.seed = 1.5"),
        ("[ground]\ndistribution = 'burnt'", "did you mean 'burned-"),
        (
            "[ground.leaf]\nchlorofyll = 40",
            "unknown key 'chlorofyll': did you mean 'chlorophyll'? allowed are structure",
        ),
        ("[ground.leaf]\nwater = 12", "water must be in [0, 0.2] cm, got 12"),
        (
            "[ground.leaf]\nwater = 0.01\n[ground.leaf_reflectance]\nTM3 = 0.1",
            "ground: leaf and leaf_reflectance are both given: remove one",
        ),
        ("[ground.background_spectra]\nsoil = 1.0", "unknown spectrum 'soil': allowed are soil_dry, "),
        ("[ground.background_spectra]\nsoil_dry = 0.9", "must add up to 1, got 0.9"),
        ("[ground]\nleaf_angles = 'sphere'", "ground.leaf_angles = 'sphere'"),
        ("[geometry]\nsza = 95", "geometry.sza = 95"),
        ("[atmosphere]\naerosol = 'maritim'", "aerosol = 'maritim': aerosol must be one of"),
        ("[sensor]\ninstrument = 'TN'", "TM"),
        ("[sensor]\nbands = ['TM9']", "TM9"),
        ("[sensor]\nbands = []", "name at least one band"),
        ("[sensor]\ninterval = 'natve'", "interval = 'natve': must be product or native, or a positive distance"),
        ("[sensor]\ninterval = '30 degree'", "interval is in m"),
        ("[sensor]\ninterval = -3", "sensor.interval = -3"),
        ("[sensor]\noffset = [1.0]", "sensor.offset"),
        ("[sensor]\noffset = [nan, 0.0]", "two finite numbers"),
        ("[sensor]\nnoise = ['shto']", "sensor.noise"),
        ("[sensor]\ninstrument = 'HRV'\nnoise = ['fixed-pattern']", "HRV has no fixed-pattern noise for XS1"),
        ("[sensor]\ninstrument = 'SuperDove'\nnoise = ['shot']", "description of SuperDove has no noise for PS6"),
        ("atmosphere = 3", "atmosphere"),
        ("[atmosphere", "scenario.toml is not valid TOML"),
    ],
)
def test_mistake_is_one_line_that_names_it(tmp_path, text, message):
    with pytest.raises(ValueError) as caught:
        read_text(tmp_path, text)
    assert message in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_every_mistake_is_told_at_once(tmp_path):
    with pytest.raises(ValueError) as caught:
        read_text(tmp_path, "[atmosphere]\nvisibility = 2\naltitude = -1\n[ground]\narp = 0.3")
    lines = str(caught.value).splitlines()
    assert [line.split(" = ")[0] for line in lines] == ["ground.arp", "atmosphere.visibility", "atmosphere.altitude"]


@pytest.mark.parametrize(
    ("sections", "said"),
    [
        ({"ground": {"ARP": 0.1}}, "unknown key ground.ARP = 0.1: did you mean 'arp'? allowed are distribution, "),
        ({"atmosphere": {"visibility": 2}}, "atmosphere.visibility = 2: "),
        ({"atmosfere": {}}, "unknown key atmosfere = {}: did you mean 'atmosphere'?"),
        ({"sensor": {"instrument": "TN"}}, "unknown instrument 'TN'"),
        ({"grid": 3}, "grid = 3: expected a table of keys, got 3"),
    ],
)
def test_mistake_in_python_is_the_line_of_a_file(sections, said):
    with pytest.raises(ValueError) as caught:
        Scenario(**sections)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value) and "http" not in str(caught.value)
    with pytest.raises(ValueError) as parsed:
        parse_scenario(sections)
    assert str(parsed.value) == str(caught.value)


def test_missing_scenario_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"cannot read the scenario .*none\.toml: No such file"):
        fifesim.read_scenario(tmp_path / "none.toml")


def test_files_lie_beside_the_scenario(tmp_path):
    (tmp_path / "samples.csv").write_text("lai\n1\n1.5\n2\n2.5\n3\n")
    scenario = read_text(tmp_path, "[ground]\ndistribution = 'samples.csv'\nlai_file = 'maps/lai.tif'")
    assert scenario.ground.distribution == str((tmp_path / "samples.csv").resolve())
    assert scenario.ground.lai_file == str((tmp_path / "maps" / "lai.tif").resolve())


def test_sun_may_be_given_instead_of_time_and_place():
    sun = parse_scenario({"geometry": {"sza": "40 degree", "saa": 100}}).sun_and_view()
    assert (sun.sza, sun.saa, sun.earth_sun_distance) == (40.0, 100.0, earth_sun_distance(times.TIME))
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


def test_place_of_a_grid_is_its_own_and_what_holds_for_fife_is_asked_for():
    with pytest.raises(ValueError) as caught:
        parse_scenario({"grid": SOUTH}).complete()
    said = str(caught.value)
    assert said.startswith("grid: its centre, latitude -25.13, longitude 28.19, is not on the FIFE site: give ")
    assert (
        "geometry.time" in said
        and "geometry.sza and saa" in said
        and "atmosphere.altitude" in said
        and "terrain.dem" in said
    )
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


def test_crs_alone_has_no_corner():
    with pytest.raises(ValueError, match=r"grid.crs = 'EPSG:32614' is given without west and north: give the upper"):
        parse_scenario({"grid": {"crs": "EPSG:32614"}}).geobox()


def test_scenario_is_frozen():
    with pytest.raises(ValueError, match="frozen"):
        Scenario().atmosphere.visibility = 10.0


def test_a_map_of_real_ground_lies_on_no_invented_hills():
    assert parse_scenario({}).terrain.dem == "flint-hills"
    assert parse_scenario({"ground": {"lai_file": "lai.tif"}}).terrain.dem == "flat"
    given = {"ground": {"lai_file": "lai.tif"}, "terrain": {"dem": "flint-hills"}}
    assert parse_scenario(given).terrain.dem == "flint-hills"
    assert Scenario(ground=Ground(lai_file="lai.tif")).terrain.dem == "flat"


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"grid": {"north": 1e300}}, "north = 1e+300: the grid is outside the area of EPSG:26914"),
        ({"grid": {"north": 2**64}}, "north = 1.844674407e+19: the grid is outside"),
        ({"grid": {"west": 1e12}}, "west = 1e+12, north = 4334220: the grid is outside"),
        ({"grid": {"cell": 1000}}, "holds no cell of 1000 x 1000 m: use a larger width and height"),
        ({"grid": {"width": 1}}, "width = 1, height = 150 m holds no cell of 3.33333 x 3.33333 m"),
        ({"grid": {"width": 1e12}}, "holds over 2147483647 cells of 3.33333 x 3.33333 m along a side"),
        ({"grid": {"width": 10}}, "the image must have 2 x 2 pixels or more, sensor.pixel of 30 x 30 m fits 5 x 0"),
        ({"grid": {"width": 30}}, "fits 5 x 1 times"),
        ({"grid": {"width": 56}, "sensor": {"interval": "native"}}, "sensor.pixel of 30 x 30 m fits 5 x 1 times"),
        ({"sensor": {"interval": 100.0}}, "sensor.interval of 100 x 100 m fits 1 x 3 times"),
        ({"sensor": {"pixel": 0.1}}, "sensor.pixel = 0.1 m is smaller than a ground cell: use 3.33333 m or"),
        ({"sensor": {"interval": 0.1}}, "sensor.interval = 0.1 m is smaller than a ground cell"),
        (
            {"sensor": {"offset": [0.0, 1000.0]}},
            "sensor.offset = [0.0, 1000.0] pixels moves the image out of the scene",
        ),
        ({"grid": {"crs": "nonsense\x1b"}}, r"crs = 'nonsense\x1b': PROJ knows no such coordinate reference system"),
        ({"grid": {"crs": "EPSG:3857", "west": -1.075e7, "north": 4.7e6}}, "use another CRS, such as EPSG:32614"),
        ({"geometry": {"time": "1987-06-06T06:00Z"}}, "the sun is below the horizon"),
        ({"geometry": {"sza": 80, "saa": 0}}, "sza must be from 0 to 75 degrees, got 80"),
        ({"ground": {"lai_file": "none.tif"}}, "ground.lai_file = 'none.tif': the file does not exist"),
    ],
)
def test_what_no_run_can_be_is_one_line_before_it_begins(values, said):
    whole = {name: SMALL.get(name, {}) | values.get(name, {}) for name in {*SMALL, *values}}
    with pytest.raises(ValueError) as caught:
        parse_scenario(whole).complete()
    assert said in str(caught.value)
    assert str(caught.value).isprintable() and len(str(caught.value)) <= 500


def test_heights_beside_a_crs_are_left_out():
    found = parse_scenario(SMALL | {"grid": SMALL["grid"] | {"crs": "EPSG:26914+5703"}}).complete()
    assert found.grid.crs == "EPSG:26914" and found.geobox() == parse_scenario(SMALL).geobox()


def test_engine_that_is_not_installed_is_told_at_once(monkeypatch):
    monkeypatch.setattr(six_s, "Py6S", None)
    engine = parse_scenario(SMALL | {"atmosphere": {"engine": "6S"}})
    with pytest.raises(ImportError, match="engine='6S' needs the 6S engine: type pip install"):
        engine.complete()


@pytest.mark.parametrize(
    ("sections", "said"),
    [
        ({"classes": {"grass": {}}}, "landscape.cover is none: choose a layout"),
        ({"classes": {"a": {"share": 0.5}, "b": {}}, "landscape": {"cover": "voronoi"}}, "b has no share"),
        ({"classes": {"a": {"share": 0.5}, "b": {"share": 0.6}}, "landscape": {"cover": "levels"}}, "sum to 1.1"),
        ({"ground": {"method": "periodic"}, "landscape": {"cover": "levels"}}, "needs a single stand"),
        (
            {"classes": {"a": {"arp": 0.2499}}, "landscape": {"cover": "levels"}},
            "classes.a.arp = 0.2499: must be at most",
        ),
    ],
)
def test_landscapes_that_cannot_be(sections, said):
    with pytest.raises(ValueError, match=said):
        Scenario(**sections)


def test_a_class_without_leaf_area_has_that_of_the_ground():
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
def test_a_misspelt_key_does_not_hide_another_mistake(text, second, tmp_path):
    (tmp_path / "mine.toml").write_text(text)
    with pytest.raises(ValueError, match="unknown key") as caught:
        fifesim.read_scenario(tmp_path / "mine.toml")
    first, *others = str(caught.value).splitlines()
    assert first.startswith("unknown key") and len(others) == 1 and second in others[0]
