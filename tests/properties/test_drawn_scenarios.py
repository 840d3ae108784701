"""
Statements about drawn canopies, chunks and scenario files.

Any scenario file runs or is rejected with a short message. Its keys are drawn from the schema, so that new keys need no
change here. The suite draws 50 scenarios. To draw more:

    FIFESIM_DRAWS=10000 pytest -m slow tests/properties/test_drawn_scenarios.py
"""

import math
import os
import re
from datetime import datetime
from itertools import pairwise
from types import UnionType
from typing import get_args, get_origin

import numpy as np
import pytest
import xarray as xr
from affine import Affine
from elevations import write
from hypothesis import given, settings
from hypothesis import strategies as st
from lazy import in_chunks, no_compute

import fifesim
from fifesim.atmosphere import gases
from fifesim.base import files
from fifesim.ground.canopy.leaf_angles import leaf_angle_classes
from fifesim.ground.canopy.reflectance_table import canopy_reflectance
from fifesim.ground.canopy.sail_model import sail, with_background
from fifesim.scenario.keys import Keys
from fifesim.scenario.scenario import read_scenario
from fifesim.scenario.simulation import simulate
from fifesim.scenario.toml import check_spelling, write_scenario

# ------------------------------------------------------------------------------------------ canopies

modest = settings(max_examples=80)
zenith = st.floats(0, 89.9)
azimuth = st.floats(0, 180)
lai = st.floats(0, 50)
fraction = st.floats(0, 1)
hotspot = st.one_of(st.just(0.0), st.floats(0.001, 2))
leaf_angles = st.one_of(
    st.sampled_from(["spherical", "planophile", "erectophile", "plagiophile", "extremophile", "uniform"]),
    st.tuples(st.floats(-1, 1), st.floats(-1, 1)).map(lambda p: ("verhoef", p[0], p[1] * (1 - abs(p[0])))),
    st.tuples(st.just("campbell"), st.floats(5, 85)),
)


@modest
@given(lai, fraction, fraction, zenith, zenith, azimuth, leaf_angles, hotspot, fraction)
def test_reflectance_is_finite_reciprocal_and_not_negative(lai, rho, share, sza, vza, raa, shape, hotspot, r):
    given = {"raa": raa, "leaf_angles": leaf_angle_classes(shape), "hotspot": hotspot}
    there = with_background(sail(lai, rho, share * (1 - rho), sza=sza, vza=vza, **given), r)
    back = with_background(sail(lai, rho, share * (1 - rho), sza=vza, vza=sza, **given), r)
    assert np.isfinite(there.rso) and there.rso >= 0
    # Reciprocity: a beam into the canopy and a view out of it are the same problem.
    np.testing.assert_allclose([there.rso, there.rsd], [back.rso, back.rdo], rtol=1e-12, atol=1e-300)


@modest
@given(lai, fraction, fraction, zenith, leaf_angles, fraction)
def test_canopies_create_no_light_and_conservative_leaves_lose_none(lai, rho, share, sza, shape, r):
    canopy = sail(lai, rho, share * (1 - rho), sza=sza, leaf_angles=shape)
    assert canopy.rdd + canopy.tdd <= 1 + 1e-12
    assert canopy.rsd + canopy.tsd + canopy.tss <= 1 + 1e-12
    assert all(value <= 1 + 1e-12 for value in with_background(canopy, r)[2:])
    canopy = sail(lai, rho, 1 - rho, sza=sza, leaf_angles=shape)
    kept = canopy.rdd + canopy.tdd, canopy.rsd + canopy.tsd + canopy.tss, with_background(canopy, 1.0).rdd
    np.testing.assert_allclose(kept, 1, atol=1e-9)


@modest
@given(lai, lai, fraction, fraction, zenith, leaf_angles, fraction)
def test_two_layers_equal_one_thick_layer(upper, lower, rho, share, sza, shape, r):
    """The surface below may be a canopy too: for diffuse light, two layers combine like a layer and its background."""

    def over(lai, below):
        return with_background(sail(lai, rho, share * (1 - rho), sza=sza, leaf_angles=shape), below).rdd

    np.testing.assert_allclose(over(upper, over(lower, r)), over(upper + lower, r), rtol=1e-9, atol=1e-12)


@settings(modest, max_examples=40)
@given(lai, fraction, fraction, zenith, zenith, azimuth, leaf_angles, hotspot, fraction, fraction)
def test_table_is_within_its_bound(lai, rho, share, sza, vza, raa, shape, hotspot, r, sky):
    angles = {"sza": sza, "vza": vza, "raa": raa, "leaf_angles": shape, "hotspot": hotspot, "diffuse_fraction": sky}
    lai = np.array([lai, lai / 50, lai / 5])
    for ground in (r, np.full((1, 3), r)):
        quick, exact = (
            canopy_reflectance(lai, rho, share * (1 - rho), ground, exact=each, **angles) for each in (False, True)
        )
        np.testing.assert_allclose(quick, exact, rtol=0, atol=1e-6)


ROWS, COLUMNS = 45, 54
SITE = fifesim.fife_site(30 / 9, window=((90, 90 + ROWS), (180, 180 + COLUMNS)))


def image_in(rows, columns, later, bands):
    """Lazy image of a scene in chunks of some rows and columns, which change after the reflectance."""
    lai = fifesim.lai_scene(SITE, arp=0.15, seed=7, chunks={"y": rows, "x": columns})
    assert lai.chunks == (rows, columns)
    rho = fifesim.surface_reflectance(lai, bands=["TM3", "TM4"])
    return in_chunks(rho, {"y": later, "band": bands}).fifesim.to_toa().fifesim.sense("TM")


WHOLE = fifesim.surface_reflectance(fifesim.lai_scene(SITE, arp=0.15, seed=7), bands=["TM3", "TM4"])
IMAGE = WHOLE.fifesim.to_toa().fifesim.sense("TM")


@st.composite
def pieces(draw, size, most):
    """Tuples of lengths that add up to `size`."""
    cuts = draw(st.lists(st.integers(1, size - 1), unique=True, max_size=most - 1))
    edges = [0, *sorted(cuts), size]
    return tuple(end - start for start, end in pairwise(edges))


@settings(max_examples=25)
@given(pieces(ROWS, 9), pieces(COLUMNS, 9), pieces(ROWS, 5), st.sampled_from([(2,), (1, 1)]))
def test_image_is_the_same_in_any_chunks(rows, columns, later, bands):
    with no_compute():
        image = image_in(rows, columns, later, bands)
    xr.testing.assert_identical(image.compute(), IMAGE)


# ------------------------------------------------------------------------------------------ scenarios

# Keys that are not drawn: 9 x 9 cells, 3 x 3 pixels, on level ground.
SMALL = {"grid": {"width": 90.0, "height": 90.0, "cell": 10.0}, "terrain": {"dem": "flat"}}

# Values that the descriptions do not mention; most are invalid for most keys.
NAMES = [
    *("EPSG:26914", "EPSG:32614", "EPSG:3857", "EPSG:5041", "EPSG:2277", "EPSG:4326", "EPSG:26914+5703", "+proj=utm"),
    *fifesim.sensor.instrument_names(),
    *gases.PROFILES,
    *("maritime", "urban", "dust:0.5+soot:0.5", "none", "dust:1e308+soot:-1"),
    *("erectophile", "planophile", "campbell(1.5)", "verhoef(-0.35,-0.15)", "verhoef(9,9)"),
    *("TM1", "tm4", "OLI4", "shot", "thermal", "ft", "km"),
    *("1987-06-06T16:35:00Z", "1987-12-06 17:00", "now", "today", "12:00", "-1987-06-06", "2199-12-31T23:59-12:00"),
    *("mine.toml", "lai.tif", "samples.csv", "none.tif", "pipe.tif", "/dev/zero", "~/lai.tif", "a" * 300 + ".csv"),
]
ODD_TEXTS = ["", " ", "\x1b[31mred", "a\nb.tif", "röd", "B 3", '"', "\\", "\0", "\u202e", "3 m", "1e999 m", "x" * 5000]
ODD_NUMBERS = [0, -1, 2**31, 2**63, 2**64, 10**400, 1e12, 1e300, -1e300, 5e-324, math.nan, math.inf, -math.inf]
ANYTHING = st.sampled_from([datetime(1987, 6, 6, 16, 35), {"a": [1]}, ["a", math.nan], *ODD_TEXTS, *ODD_NUMBERS])


def limits(field):
    """Ends of the valid range of a key."""
    ends = ("ge", "gt", "le", "lt")
    return [float(getattr(each, end)) for each in field.metadata for end in ends if hasattr(each, end)]


def numbers(field):
    """Numbers inside the range of a key and at its ends."""
    ends = limits(field)
    found = [end for end in ends if end < 1000] or [1.0, 30.0]
    if len(ends) == 2 and ends[1] < 1e6:
        found += [ends[0] + share * (ends[1] - ends[0]) for share in (0.01, 0.1, 0.5)]
    if isinstance(field.default, float):
        found += [field.default, field.default / 2, 1.01 * field.default, field.default + 10]
    integer = int in (field.annotation, *get_args(field.annotation))
    return st.sampled_from(sorted({int(each) if integer else each for each in found}))


def texts(field):
    """Words in the description of a key, its default, and names of other things."""
    words = st.sampled_from(re.findall(r"[\w-]+", field.description) + [f"{field.default}"])
    return words | words | st.sampled_from(NAMES)


def of_type(annotation, field):
    """Strategy for sound values of the type of a key."""
    found = []
    for kind in get_args(annotation) if isinstance(annotation, UnionType) else (annotation,):
        if get_origin(kind) is list:
            found.append(st.lists(of_type(get_args(kind)[0], field), max_size=3))
        elif get_origin(kind) is dict:
            found.append(st.dictionaries(texts(field), numbers(field), max_size=3))
        elif kind in (bool, int, float):
            found.append(st.booleans() if kind is bool else numbers(field))
        elif kind is not type(None):
            found.append(texts(field))
    return st.one_of(found)


def odd(field):
    """Strategy for values just outside the range of a key, of other types, and far from it."""
    beside = [math.nextafter(end, way) for end in limits(field) for way in (math.inf, -math.inf)]
    return st.sampled_from([*beside, *ODD_NUMBERS]) | ANYTHING | st.text(max_size=20)


@st.composite
def scenarios(draw):
    """A small scenario in which some keys have arbitrary values."""
    found = {name: dict(keys) for name, keys in SMALL.items()}
    if draw(st.integers(0, 9)) == 0:
        # The grid is the whole site or the extent of a map.
        del found["grid"]
        found["ground"] = {"lai_file": "lai.tif"} if draw(st.booleans()) else {}
    sections = st.sampled_from([name for name in Keys.model_fields if name != "classes"])
    wild = draw(st.integers(0, 2)) == 0
    for _ in range(draw(st.integers(1, 3))):
        name = draw(sections)
        key, field = draw(st.sampled_from(list(Keys.section((name,)).model_fields.items())))
        value = of_type(field.annotation, field)
        found.setdefault(name, {})[key] = draw(value | odd(field) if wild else value)
    if wild and draw(st.integers(0, 3)) == 0:
        unknown = draw(st.text() | st.just("k" * 5000))
        draw(st.sampled_from([found, found["terrain"]]))[unknown] = draw(ANYTHING)
    return found


def toml(value):
    """TOML text of a value, with inline tables."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{toml(key)} = {toml(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    if isinstance(value, str):
        return "".join(f"\\U{ord(each):08x}" if not each.isalnum() else each for each in value).join('""')
    return str(value).lower() if isinstance(value, bool | datetime) else repr(value)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Folder with valid and invalid files next to the scenario."""
    folder = tmp_path_factory.mktemp("drawn")
    tm = files.path("instruments/tm.toml").read_text(encoding="utf-8")
    (folder / "mine.toml").write_text(tm, encoding="utf-8")
    (folder / "samples.csv").write_text("lai\n1\n1.5\n2\n2.5\n3\n")
    lai = np.linspace(0.5, 3, 400).reshape(20, 20)
    write(folder / "lai.tif", lai, Affine(10, 0, 704970, 0, -10, 4334220), dtype="float32")
    os.mkfifo(folder / "pipe.tif")
    return folder


class Refused(Exception):
    """A scenario was rejected with a short message."""


def attempt(function, *arguments):
    """Result of a function; a ValueError is checked and becomes Refused."""
    try:
        return function(*arguments)
    except (ValueError, ImportError) as error:
        said = str(error)
        assert said and len(said) <= 500, f"{len(said)} characters: {said}"
        assert all(line.isprintable() for line in said.split("\n")), repr(said)
        raise Refused(said) from error


def check_same(path, scenario):
    """Check that a written scenario reads back unchanged."""
    path.write_text(write_scenario(scenario), encoding="utf-8")
    assert read_scenario(path) == scenario


def few(scenario):
    """Whether a scenario is quick to compute."""
    terrain = scenario.terrain
    cheap = scenario.atmosphere.engine == "5S" and not scenario.atmosphere.adjacency
    near = terrain.dem == "flat" or (terrain.dem == "flint-hills" and terrain.horizon_reach < 1000)
    return cheap and near and math.prod(scenario.geobox().shape) <= 3000


@pytest.mark.slow
@settings(max_examples=int(os.environ.get("FIFESIM_DRAWS", 50)))
@given(scenarios())
def test_drawn_scenario_runs_or_is_rejected_in_a_few_lines(folder, drawn):
    """Digital numbers are within their bits, and LAI and FPAR are physical."""
    path = folder / "drawn.toml"
    path.write_text("\n".join(f"{toml(name)} = {toml(keys)}" for name, keys in drawn.items()), encoding="utf-8")
    try:
        attempt(check_spelling, path)
        scenario = attempt(read_scenario, path)
        check_same(path, scenario)
        check_same(path, attempt(scenario.complete))
        if not few(scenario):
            return
        lazy = attempt(simulate, scenario)
    except Refused:
        return
    try:
        run = attempt(lazy.compute)
    except Refused as error:
        # Crowns that cannot hold their leaves are detected in advance unless LAI or crown cover varies.
        assert scenario.ground.lai_file or scenario.landscape.deviations.get("crown_cover"), error
        assert "leaf area index within the crowns" in str(error)
        return
    dn, truth = run["image"]["dn"], run["truth"]
    assert min(dn.sizes["y"], dn.sizes["x"]) >= 2
    assert dn.min() >= 0 and dn.max() < 2**scenario.sensor.description.bits
    assert np.isfinite(truth["lai"]).any() and truth["lai"].min() >= 0
    assert truth["fpar"].min() >= 0 and truth["fpar"].max() <= 1
