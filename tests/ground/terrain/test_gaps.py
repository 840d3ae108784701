"""Gaps of elevation: planes go on, and holes are smooth."""

import numpy as np

from fifesim.ground.terrain import gaps


def plane(shape=(80, 90)):
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    return 400.0 + 3.0 * columns - 2.0 * rows


def test_plane_goes_on_past_its_edge():
    values = plane()
    known = values.copy()
    known[:, 60:], known[:12], known[60:, 20:40] = np.nan, np.nan, np.nan
    out = gaps.extend(known, 20, rest=False)
    found = np.isfinite(out)
    assert found[:, :79].all()
    np.testing.assert_allclose(out[found], values[found], rtol=0, atol=1e-9)
    assert np.isfinite(gaps.extend(known, 2)).all()


def test_nothing_known_stays_unknown():
    nothing = np.full((5, 5), np.nan)
    assert np.isnan(gaps.extend(nothing, 3)).all()
    assert np.isnan(gaps.fill_gaps(nothing, (3, 3))).all()


def test_holes_in_a_plane_are_filled_by_the_plane():
    values = plane()
    known = values.copy()
    known[20:27, 30:33], known[40, 50], known[43:47, 47:53] = np.nan, np.nan, np.nan
    np.testing.assert_allclose(gaps.fill_gaps(known, (4, 4)), values, rtol=0, atol=1e-8)


def test_least_bending_is_smooth_across_a_hole():
    """A hole of a quarter of a wave: within 2 % of its amplitude, where linear interpolation is 5 % off."""
    rows, columns = np.mgrid[:60, :60]
    values = np.sin(2 * np.pi * columns / 28) * np.cos(2 * np.pi * rows / 40)
    known = values.copy()
    known[26:33, 26:33] = np.nan
    np.testing.assert_allclose(gaps.fill_gaps(known, (4, 4)), values, rtol=0, atol=0.02)


def test_larger_holes_are_left_but_for_their_edge():
    known = plane()
    known[20:60, 20:60] = np.nan
    out = gaps.fill_gaps(known, (3, 3))
    assert np.isnan(out[23:57, 23:57]).all()
    assert np.isfinite(out[20:23, 20:60]).all()


def test_block_means_of_a_plane_are_its_middles():
    means = gaps.block_means(plane((12, 9)), 4, 3)
    np.testing.assert_allclose(means, [[403 + 9 * j - 3 - 8 * i for j in range(3)] for i in range(3)], rtol=1e-12)
    assert np.isnan(gaps.block_means(np.where(plane((4, 4)) == 400, np.nan, 1.0), 2, 2)[0, 0])
