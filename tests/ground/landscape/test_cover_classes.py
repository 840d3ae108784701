"""Tests of cover classes: location, size and fractions of patches, codes, stored tables, and fields of properties."""

import json
from dataclasses import fields

import numpy as np
import pytest
from scipy import stats
from scipy.spatial import cKDTree

from fifesim.ground.canopy.description import Canopy
from fifesim.ground.canopy.properties import PROPERTIES
from fifesim.ground.canopy.prospect import Leaf
from fifesim.ground.canopy.spectra import Background, Spectrum
from fifesim.ground.landscape.classes import SHARES as SHARE_NAMES
from fifesim.ground.landscape.classes import CoverClass, Field, class_table, read_table, table_text
from fifesim.ground.landscape.cover import (
    PATTERNS,
    Patches,
    _blocks,
    _drawn,
    _fenced,
    _nearest,
    pastures,
    patch_classes,
    smooth_field,
    voronoi,
)
from fifesim.ground.landscape.distribution import kernel_density

SHARES = (0.2, 0.3, 0.5)


@pytest.fixture(scope="module", params=PATTERNS)
def pattern(request):
    return request.param


def axes(rows, columns, cell=10.0):
    return 4334220.0 - (np.arange(rows) + 0.5) * cell, 704970.0 + (np.arange(columns) + 0.5) * cell


def test_patches_do_not_depend_on_the_window_or_cell_size(pattern):
    north, east = axes(90, 110)
    patches = Patches(pattern, 137.0)
    whole = patch_classes(patches, SHARES, 7, north, east)
    np.testing.assert_array_equal(patch_classes(patches, SHARES, 7, north[31:32], east[17:80]), whole[31:32, 17:80])
    finer = patch_classes(patches, SHARES, 7, *axes(270, 330, 10 / 3))
    np.testing.assert_array_equal(finer[1::3, 1::3], whole)
    assert (patch_classes(patches, SHARES, 8, north, east) != whole).any()
    assert patch_classes(patches, SHARES, 7, north[:0], east).shape == (0, 110)
    codes = np.array([7, 300, 2], np.int16)
    coded = patch_classes(patches, SHARES, 7, north, east, codes)
    assert coded.dtype == np.int16
    np.testing.assert_array_equal(coded, codes[whole])


def test_fractions_of_classes_agree_within_their_sampling_error(pattern):
    """With about 3600 patches of unequal areas, the standard error is below sqrt(0.25 * 3 / 3600)."""
    counts = np.bincount(patch_classes(Patches(pattern, 100.0), SHARES, 3, *axes(600, 600)).ravel(), minlength=3)
    np.testing.assert_allclose(counts / counts.sum(), SHARES, rtol=0, atol=3 * np.sqrt(0.25 * 3 / 3600))
    assert (patch_classes(Patches(pattern, 50.0), (0.0, 1.0, 0.0), 1, *axes(60, 60)) == 1).all()


def test_neighbouring_levels_differ_by_one_class():
    """A smooth field takes all values between, so the first and the last class do not touch."""
    classes = patch_classes(Patches("levels", 400.0), (0.3, 0.4, 0.3), 4, *axes(300, 300, 5.0))
    assert set(np.unique(np.abs(np.diff(classes, axis=1)))) == {0, 1}
    assert np.unique(classes).size == 3


def test_fractions_are_matched_by_name_or_order():
    named = Patches("voronoi", 10, {"wood": 0.75, "grass": 0.25})
    assert named.shares_of(["grass", "wood"]) == (0.25, 0.75)
    assert Patches("voronoi", 10).shares_of(["a", "b", "c", "d"]) == (0.25,) * 4
    with pytest.raises(ValueError, match="shares are of wood, grass, the classes are grass, water"):
        named.shares_of(["grass", "water"])
    with pytest.raises(ValueError, match="2 shares for 3 classes"):
        Patches("levels", 10, [0.5, 0.5]).shares_of(["a", "b", "c"])


def test_voronoi_cells_agree_with_a_kd_tree():
    down, across = np.arange(200) * 0.37 - 40, np.arange(200) * 0.37 + 30
    (top, rows), (left, columns) = (_blocks(each, 2) for each in (down, across))
    points = _drawn(11, 8, top, left, (rows, columns), 3)
    points[0] += np.arange(top, top + rows)[:, None]
    points[1] += np.arange(left, left + columns)
    tree = cKDTree(points[:2].reshape(2, -1).T)
    places = np.stack(np.meshgrid(down, across, indexing="ij"), -1).reshape(-1, 2)
    _, nearest = tree.query(places)
    np.testing.assert_array_equal(voronoi(11, down, across).ravel(), points[2].ravel()[nearest])


def test_nearest_point_is_found_two_squares_away():
    """Points in the squares between lie at their far sides."""
    points = np.empty((3, 5, 5))
    points[2] = np.arange(25).reshape(5, 5)
    points[:2] = np.indices((5, 5)) + np.where(np.indices((5, 5)) < 2, 0.0, 0.99)
    points[:2, 2, 0] = 2.5, 0.99
    number = np.empty((1, 1))
    _nearest(np.array([2.5]), np.array([2.02]), 0, 0, points, number)
    away = np.hypot(points[0] - 2.5, points[1] - 2.02)
    assert away.argmin() == 10 and number[0, 0] == 10


def test_smooth_field_is_standard_normal_with_gaussian_correlation():
    """300 x 300 correlation lengths; the correlation is 1/e at distance 1 along both axes."""
    place = np.arange(1200) / 4
    field = smooth_field(3, place - 30, place + 800)
    # A field of area A has about A / pi independent values.
    independent = 300**2 / np.pi
    assert abs(field.mean()) < 4 / np.sqrt(independent)
    assert abs(field.var() - 1) < 4 * np.sqrt(2 / independent)
    for lag in (2, 4, 6):
        expected = np.exp(-((lag / 4) ** 2))
        found = np.mean(field[:, lag:] * field[:, :-lag]), np.mean(field[lag:] * field[:-lag])
        np.testing.assert_allclose(found, expected, rtol=0, atol=4 / np.sqrt(independent))
    assert abs(np.mean(field < stats.norm.ppf(0.2)) - 0.2) < 4 * np.sqrt(0.16 / independent)


def test_pastures_are_rectangles_that_fill_their_block():
    parts = [part for part, _ in _fenced(7, 3, -4)]
    areas = [(bottom - top) * (right - left) for top, left, bottom, right in parts]
    assert len(parts) == 9 and abs(sum(areas) - 1) < 1e-12
    # The largest rectangle is split first, at 3/8 to 5/8 of its length, which bounds the ratio of areas.
    assert max(areas) / min(areas) < (8 / 3) ** 2
    place = (np.arange(90) + 0.5) / 30
    inside = pastures(7, place + 9, place - 12)
    for (top, left, bottom, right), number in _fenced(7, 3, -4):
        rows, columns = ((place >= 3 * low) & (place < 3 * high) for low, high in ((top, bottom), (left, right)))
        assert (inside[np.ix_(rows, columns)] == number).all()


def test_codes_are_given_or_count_from_one():
    assert [each.code for each in class_table([CoverClass("a"), CoverClass("b")])] == [1, 2]
    assert [each.code for each in class_table({"a": CoverClass(code=0), "b": CoverClass("b", code=7)})] == [0, 7]
    assert class_table(CoverClass("a"))[0].code == 1


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


def test_stored_class_table_is_read_back():
    """Distributions of samples are not stored."""
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
    for given in (0.2, "dead_grass", {"TM3": 0.1}, Spectrum((0.4, 2.5), (0.1, 0.3))):
        (read,) = read_table(
            table_text([CoverClass("a", canopy=Canopy(background=given, leaf_optics=(0.1, (0.2, 0.3))))])
        )
        assert read.canopy.background == given and read.canopy.leaf_optics == (0.1, (0.2, 0.3))
        assert read.canopy.given == {"background", "leaf_optics"}
    text = table_text([CoverClass("a", lai=kernel_density([1.0, 2.0, 2.5, 3.0, 3.1]))])
    assert json.loads(text) == [{"name": "a"}]


@pytest.mark.parametrize("text", ["grass", "[1]", '[{"height": 3}]'])
def test_invalid_stored_tables_are_refused(text):
    with pytest.raises(ValueError, match="class table of the cover is invalid"):
        read_table(text)


@pytest.mark.parametrize("name", SHARE_NAMES)
@pytest.mark.parametrize(("mean", "sd"), [(0.2, 0.1), (0.2, 0.3999), (0.9, 0.05), (0.01, 0.005)])
def test_share_has_the_given_mean_and_deviation(name, mean, sd):
    found = Field(mean=mean, sd=sd).distribution(name)
    assert found.support() == (0, 1)
    assert (found.mean(), found.std()) == pytest.approx((mean, sd), rel=1e-12)
    assert Field(mean=mean, sd=sd, arp=0.24).distribution(name) is found


def test_default_field_and_limits_of_its_numbers():
    assert Field() == Field(mean=0.0, sd=0.0, arp=0.15)
    limits = ({"mean": 1}, {"mean": -1}, {"sd": np.int64(0)}, {"arp": 0}, {"arp": 0.2498}, {"sd": np.float32(3)})
    assert all(getattr(Field(**limit), name) == value for limit in limits for name, value in limit.items())
