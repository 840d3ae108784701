"""Tests of drained area and wetness index against closed forms, another filling of pits, and conservation of area."""

import heapq

import numpy as np
import pytest
from elevations import labelled
from oracles_terrain import hills

import fifesim
from fifesim.ground.terrain.wetness import LEAST_SLOPE, drained_area, fill_pits, wetness_index

FALL = 1e-4


def flooded(elevation):
    """Ground filled from its border inward, lowest cell first (priority flood)."""
    filled = np.full(elevation.shape, np.inf)
    edge = [
        (elevation[place], place)
        for place in np.ndindex(elevation.shape)
        if 0 in place or place[0] == elevation.shape[0] - 1 or place[1] == elevation.shape[1] - 1
    ]
    for height, place in edge:
        filled[place] = height
    heapq.heapify(edge)
    while edge:
        height, (y, x) = heapq.heappop(edge)
        for place in [(y + a, x + b) for a in (-1, 0, 1) for b in (-1, 0, 1)]:
            inside = 0 <= place[0] < filled.shape[0] and 0 <= place[1] < filled.shape[1]
            if inside and np.isinf(filled[place]):
                filled[place] = max(elevation[place], height + FALL)
                heapq.heappush(edge, (filled[place], place))
    return filled


@pytest.fixture(scope="module")
def rough():
    """Hills with many pits."""
    return hills((37, 52), seed=3) + np.random.default_rng(1).normal(0, 4, (37, 52))


def test_filled_pits_agree_with_a_priority_flood(rough):
    filled = fill_pits(rough)
    np.testing.assert_allclose(filled, flooded(rough), rtol=0, atol=1e-9)
    assert (filled > rough).any() and (filled >= rough).all()


def test_border_cells_drain_the_whole_area(rough):
    """Only cells on the border have no lower neighbour, and together they drain the whole area."""
    filled = fill_pits(rough)
    area = drained_area(filled, 10.0, 20.0)
    around = np.pad(filled, 1, constant_values=np.inf)
    windows = np.lib.stride_tricks.sliding_window_view(around, (3, 3))
    ends = windows.min(axis=(2, 3)) == filled
    assert not ends[1:-1, 1:-1].any()
    assert area[ends].sum() == pytest.approx(rough.size * 200.0, rel=1e-12)
    assert area.min() >= 200.0


def test_wetness_of_a_plane():
    """Away from the sides, where water leaves: ln(distance from the top / slope)."""
    rows = np.arange(40.0)[:, None]
    plane = np.repeat(200.0 - 0.08 * 10.0 * rows, 81, axis=1)
    found = wetness_index(plane, 10.0, 10.0)[:, 40]
    np.testing.assert_allclose(found[:30], np.log((rows[:30, 0] + 1) * 10.0 / 0.08), rtol=0, atol=2e-3)


def test_drained_area_of_a_cone_is_isotropic():
    """Water from the top crosses circles, so area over contour length is half the radius in all directions."""
    y, x = np.mgrid[-50:51, -50:51]
    radius = np.hypot(x, y)
    found = drained_area(100.0 - radius, 1.0, 1.0)
    ring = (radius > 25) & (radius < 35)
    # Where water crosses cells obliquely, the contour is slightly longer than the cell width.
    ratio = found[ring] / (radius[ring] / 2)
    assert ratio.mean() == pytest.approx(1.1, abs=0.1) and ratio.std() < 0.15
    np.testing.assert_allclose(found, found.T, rtol=1e-9)


def test_wetness_of_mirrored_ground_is_mirrored(rough):
    found = wetness_index(rough, 10.0, 20.0)
    np.testing.assert_allclose(wetness_index(rough[::-1], 10.0, 20.0)[::-1], found, rtol=0, atol=1e-9)
    np.testing.assert_allclose(wetness_index(rough.T, 20.0, 10.0).T, found, rtol=0, atol=1e-9)


def test_wetness_of_level_ground_and_small_rasters_is_finite():
    assert np.isfinite(wetness_index(np.full((6, 7), 3.0), 5.0, 5.0)).all()
    assert wetness_index(np.full((1, 1), 3.0), 5.0, 5.0)[0, 0] == pytest.approx(np.log(5.0 / LEAST_SLOPE))
    assert wetness_index(np.array([[3.0, 2.0]]), 5.0, 5.0).shape == (1, 2)


def test_missing_cells_drain_their_neighbours(rough):
    gap = rough.copy()
    gap[15:18, 20:30] = np.nan
    found = wetness_index(gap, 10.0, 10.0)
    np.testing.assert_array_equal(np.isnan(found), np.isnan(gap))
    area = drained_area(fill_pits(gap), 10.0, 10.0)
    assert np.isfinite(area).all()


def test_drained_area_is_divided_by_a_power_of_the_slope():
    """Water of a top 1 m above its neighbours, on cells of 10 m by 20 m, is divided by slope to the power 1.1."""
    top = np.zeros((3, 3))
    top[1, 1] = 1.0
    distance = np.hypot(10.0 * np.array([-1, 0, 1])[:, None], 20.0 * np.array([-1, 0, 1]))
    share = np.where(distance > 0, (1 / np.where(distance > 0, distance, 1)) ** 1.1, 0.0)
    expected = 200.0 * (1 + share / share.sum())
    np.testing.assert_allclose(drained_area(top, 10.0, 20.0), expected, rtol=1e-12)


def test_wetness_at_a_coarser_resolution_is_interpolated(around):
    """Every ninth cell, as in `horizon`, has the index of the coarse elevation; the index between them is linear."""
    found, places = fifesim.terrain.wetness(around, resolution=30.0), fifesim.horizon(around, resolution=30.0)
    cells = [np.abs(around[axis].values[:, None] - places[axis].values).argmin(axis=0).tolist() for axis in ("y", "x")]
    expected = wetness_index(around.values[np.ix_(*cells)], 30.0, 30.0)
    np.testing.assert_allclose(found.values[np.ix_(*cells)], expected, rtol=0, atol=1e-9)
    row, (start, stop) = cells[0][3], cells[1][4:6]
    between = found.values[row, start : stop + 1]
    np.testing.assert_allclose(between, np.linspace(between[0], between[-1], 10), rtol=0, atol=1e-9)


def test_wetness_at_the_finest_resolution_is_the_wetness_of_the_cells(dem):
    found = fifesim.terrain.wetness(dem, resolution=1.0)
    np.testing.assert_array_equal(found, wetness_index(dem.values, 30 / 9, 30 / 9))


def test_wetness_of_few_cells_is_finite_and_of_nan_is_nan(dem):
    tiny = labelled(fifesim.grid_at("EPSG:26914", 700000, 4330000, 12, 9, 3), np.full((3, 4), 7.0))
    assert np.isfinite(fifesim.terrain.wetness(tiny)).all()
    assert np.isnan(fifesim.terrain.wetness(dem * np.nan)).all()
    with pytest.raises(ValueError, match="resolution of an elevation's source must be positive"):
        fifesim.terrain.wetness(dem, resolution=0)
