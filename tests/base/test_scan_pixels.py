"""Scan pixels on a map, compared with polygons and brute-force distances."""

import numpy as np
import pytest
from shapely.geometry import Polygon, box

from fifesim.base.scan_pixels import corners, covered_means, nearest_pixels, reach

CELL = (20.0, 30.0)


def swath(lines=7, samples=9):
    """Pixel centres on a map, rotated and bent, off the lattice of cells."""
    line, sample = np.mgrid[0:lines, 0:samples]
    row = 2.3 + 0.9 * line + 0.23 * sample + 0.01 * sample**2
    return row, 3.1 - 0.31 * line + 1.21 * sample + 0.02 * sample**2


def test_corners_lie_between_centres_and_tile_the_swath():
    row, column = swath()
    rows, columns = corners(row, column)
    assert rows.shape == (7, 2, 10)
    assert rows[3, 0, 4] == pytest.approx(row[2:4, 3:5].mean(), abs=1e-14)
    np.testing.assert_array_equal(rows[1:, 0], rows[:-1, 1])
    np.testing.assert_allclose(rows[0, 0], 2 * rows[1, 0] - rows[2, 0], rtol=0, atol=0.05)
    assert columns[0, 0, 0] < column[0, 0] < columns[0, 1, 1]


def test_only_lines_of_one_sweep_share_edges():
    """Each sweep has the same corners as alone, except that a single line takes its height from its neighbours."""
    row, column = swath()
    sweep = np.array([4, 5, 5, 5, 6, 6, 6])
    row = row - 0.4 * sweep[:, None]
    rows, columns = corners(row, column, sweep)
    for part in (slice(1, 4), slice(4, 7)):
        for found, alone in zip((rows, columns), corners(row[part], column[part]), strict=True):
            np.testing.assert_allclose(found[part], alone, rtol=0, atol=1e-13)
    assert np.all(rows[4, 0] < rows[3, 1])
    np.testing.assert_allclose(rows[0, 1] - rows[0, 0], rows[1, 1] - rows[1, 0], rtol=0, atol=1e-13)
    last = corners(row[:5], column[:5], sweep[:5])[0]
    np.testing.assert_allclose(last[4, 1] - last[4, 0], last[3, 1] - last[3, 0], rtol=0, atol=1e-13)
    np.testing.assert_allclose(last[4, 0][1:-1], (row[4, 1:] + row[4, :-1]) / 2 - 0.45, rtol=0, atol=1e-13)


def test_reach_is_the_distance_to_the_farthest_corner():
    row, column = swath()
    rows, columns = corners(row, column)
    found = reach(row, column, (rows, columns), CELL)
    for line, sample in ((0, 0), (3, 4), (6, 8)):
        down, across = (
            (edges[line, :, sample : sample + 2] - centre[line, sample]) * size
            for edges, centre, size in ((rows, row, CELL[0]), (columns, column, CELL[1]))
        )
        assert found[line, sample] == pytest.approx(np.hypot(down, across).max(), rel=1e-14)


def test_nearest_pixel_matches_brute_force():
    row, column = swath()
    far = reach(row, column, corners(row, column), CELL)
    found = nearest_pixels(row.ravel(), column.ravel(), far.ravel(), CELL, (1, 12), (0, 15))
    i, j = np.mgrid[1:12, 0:15] + 0.5
    away = np.hypot((i[..., None] - row.ravel()) * CELL[0], (j[..., None] - column.ravel()) * CELL[1])
    away = np.where(away <= far.ravel(), away, np.inf)
    expected = np.where(np.isfinite(away.min(-1)), away.argmin(-1), -1)
    np.testing.assert_array_equal(found, expected)
    assert (found == -1).any() and (found >= 0).sum() > 50


def test_first_of_two_equidistant_pixels_is_taken_and_pixels_without_coordinates_are_ignored():
    row, column, far = np.array([0.5, 0.5]), np.array([0.0, 1.0]), np.array([30.0, 30.0])
    assert nearest_pixels(row, column, far, (20.0, 20.0), (0, 1), (0, 1)) == 0
    row, column = np.array([np.nan, 0.5]), np.array([0.5, np.nan])
    assert (nearest_pixels(row, column, far, CELL, (0, 2), (0, 2)) == -1).all()


def test_means_are_weighted_by_polygon_overlap():
    row, column = swath()
    rows, columns = corners(row, column)
    values = np.random.default_rng(3).uniform(0, 1, (2, *row.shape))
    values[1, 2:4, 3] = np.nan
    means, covered = covered_means(values, rows, columns, (1, 12), (0, 15))
    total, area = np.zeros_like(means), np.zeros_like(means)
    for line in range(row.shape[0]):
        for sample in range(row.shape[1]):
            around = [(line, *edge) for edge in ((0, sample), (0, sample + 1), (1, sample + 1), (1, sample))]
            pixel = Polygon([(columns[at], rows[at]) for at in around])
            for i in range(1, 12):
                for j in range(15):
                    share = pixel.intersection(box(j, i, j + 1, i + 1)).area
                    for band in range(2):
                        if np.isfinite(values[band, line, sample]):
                            total[band, i - 1, j] += share * values[band, line, sample]
                            area[band, i - 1, j] += share
    np.testing.assert_allclose(covered, area, rtol=0, atol=1e-12)
    inside = area > 1e-9
    np.testing.assert_allclose(means[inside], (total / np.where(inside, area, 1))[inside], rtol=1e-9)
    assert np.isnan(means[covered == 0]).all()


def test_window_is_identical_to_the_whole_map():
    rows, columns = corners(*swath())
    values = np.random.default_rng(3).uniform(0, 1, (1, 7, 9))
    whole = covered_means(values, rows, columns, (0, 12), (0, 15))[0]
    part = covered_means(values[:, 1:], rows[1:], columns[1:], (5, 9), (4, 11))[0]
    np.testing.assert_array_equal(part, whole[:, 5:9, 4:11])


def test_single_line_without_pixel_size_is_rejected():
    with pytest.raises(ValueError, match="1 x 4 pixels does not tell"):
        corners(np.zeros((1, 4)), np.zeros((1, 4)))
