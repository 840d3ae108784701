"""Patches of cover: places and shares."""

import numpy as np
import pytest

from fifesim.ground.landscape.cover import PATTERNS, Patches, patch_classes

SHARES = (0.2, 0.3, 0.5)


@pytest.fixture(scope="module", params=PATTERNS)
def pattern(request):
    return request.param


def axes(rows, columns, cell=10.0):
    return 4334220.0 - (np.arange(rows) + 0.5) * cell, 704970.0 + (np.arange(columns) + 0.5) * cell


def test_window_is_a_slice_and_cells_of_another_size_show_the_same_patches(pattern):
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


def test_shares_are_as_asked_within_their_sampling_error(pattern):
    """Some 3600 patches of unequal areas: the standard error of a share is below sqrt(.25 * 3 / 3600)."""
    counts = np.bincount(patch_classes(Patches(pattern, 100.0), SHARES, 3, *axes(600, 600)).ravel(), minlength=3)
    np.testing.assert_allclose(counts / counts.sum(), SHARES, rtol=0, atol=3 * np.sqrt(0.25 * 3 / 3600))


def test_whole_shares_leave_nothing_to_others(pattern):
    assert (patch_classes(Patches(pattern, 50.0), (0.0, 1.0, 0.0), 1, *axes(60, 60)) == 1).all()


def test_levels_follow_each_other_in_the_order_of_the_classes():
    """A smooth field passes through the class between: fences of the first and the last class do not meet."""
    classes = patch_classes(Patches("levels", 400.0), (0.3, 0.4, 0.3), 4, *axes(300, 300, 5.0))
    assert set(np.unique(np.abs(np.diff(classes, axis=1)))) == {0, 1}
    assert np.unique(classes).size == 3


@pytest.mark.parametrize(
    "arguments, message",
    [
        (("hexagons", 100), "the pattern of patches is one of voronoi, levels, pastures, got 'hexagons'"),
        (("voronoi", 0), "a number above 0, in metres, got 0"),
        (("voronoi", "300 m"), "a number above 0, in metres, got '300 m'"),
        (("voronoi", 300, (0.5, 0.4)), r"must sum to 1, got 0.9 of 0.5, 0.4"),
        (("voronoi", 300, {"a": 1.5, "b": -0.5}), r"the share of a class is in \[0, 1\], got 1.5"),
    ],
)
def test_impossible_patches_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        Patches(*arguments)


def test_shares_go_by_name_or_in_order():
    named = Patches("voronoi", 10, {"wood": 0.75, "grass": 0.25})
    assert named.shares_of(["grass", "wood"]) == (0.25, 0.75)
    assert Patches("voronoi", 10).shares_of(["a", "b", "c", "d"]) == (0.25,) * 4
    with pytest.raises(ValueError, match="shares are of wood, grass, the classes are grass, water"):
        named.shares_of(["grass", "water"])
    with pytest.raises(ValueError, match="2 shares for 3 classes"):
        Patches("levels", 10, [0.5, 0.5]).shares_of(["a", "b", "c"])
