"""Gaps of elevation: planes go on, and holes are smooth."""

import numpy as np

from fifesim.ground.terrain import spline


def plane(shape=(80, 90)):
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    return 400.0 + 3.0 * columns - 2.0 * rows


def test_plane_goes_on_past_its_edge():
    values = plane()
    known = values.copy()
    known[:, 60:], known[:12], known[60:, 20:40] = np.nan, np.nan, np.nan
    out = spline.extend(known, 20, rest=False)
    found = np.isfinite(out)
    assert found[:, :79].all()
    np.testing.assert_allclose(out[found], values[found], rtol=0, atol=1e-9)
    assert np.isfinite(spline.extend(known, 2)).all()


def test_nothing_known_stays_unknown():
    nothing = np.full((5, 5), np.nan)
    assert np.isnan(spline.extend(nothing, 3)).all()
    assert np.isnan(spline.fill_gaps(nothing, (3, 3))).all()


def test_holes_in_a_plane_are_filled_by_the_plane():
    values = plane()
    known = values.copy()
    known[20:27, 30:33], known[40, 50], known[43:47, 47:53] = np.nan, np.nan, np.nan
    np.testing.assert_allclose(spline.fill_gaps(known, (4, 4)), values, rtol=0, atol=1e-8)


def test_least_bending_is_smooth_across_a_hole():
    """A hole of a quarter of a wave: within 2 % of its amplitude, where linear interpolation is 5 % off."""
    rows, columns = np.mgrid[:60, :60]
    values = np.sin(2 * np.pi * columns / 28) * np.cos(2 * np.pi * rows / 40)
    known = values.copy()
    known[26:33, 26:33] = np.nan
    np.testing.assert_allclose(spline.fill_gaps(known, (4, 4)), values, rtol=0, atol=0.02)


def test_a_hole_is_a_hole_wherever_it_lies():
    """With one known cell between it and the border, on any side, as in the middle."""
    rows, columns = np.mgrid[:40, :50]
    values = np.sin(rows / 5) + np.cos(columns / 7)
    for corner in ((1, 20), (36, 20), (18, 1), (18, 46), (18, 20)):
        known = values.copy()
        known[corner[0] : corner[0] + 3, corner[1] : corner[1] + 3] = np.nan
        by_bending = values.copy()
        hole = np.isnan(known)
        by_bending[hole] = spline._least_bending(known, hole)
        np.testing.assert_allclose(spline.fill_gaps(known, (2, 2)), by_bending, rtol=0, atol=1e-9)
        for axis in (0, 1):
            turned = np.flip(spline.fill_gaps(np.flip(known, axis), (2, 2)), axis)
            np.testing.assert_allclose(turned, by_bending, rtol=0, atol=1e-9)


def test_larger_holes_are_left_but_for_their_edge():
    known = plane()
    known[20:60, 20:60] = np.nan
    out = spline.fill_gaps(known, (3, 3))
    assert np.isnan(out[23:57, 23:57]).all()
    assert np.isfinite(out[20:23, 20:60]).all()


def test_block_means_of_a_plane_are_its_middles():
    means = spline.block_means(plane((12, 9)), 4, 3)
    np.testing.assert_allclose(means, [[403 + 9 * j - 3 - 8 * i for j in range(3)] for i in range(3)], rtol=1e-12)
    assert np.isnan(spline.block_means(np.where(plane((4, 4)) == 400, np.nan, 1.0), 2, 2)[0, 0])
