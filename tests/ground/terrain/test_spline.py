"""Tests of spline interpolation of elevation against waves, planes and scipy, of smooth noise, and of filled gaps."""

import numpy as np
import pytest
from scipy import ndimage

from fifesim.base.lattice import assemble
from fifesim.ground.terrain import spline
from fifesim.ground.terrain.spline import smooth_noise


@pytest.mark.parametrize(("cells", "error"), [(5, 6e-4), (6, 2e-4), (8, 3e-5)])
@pytest.mark.parametrize("turn", [0, 30, 45])
def test_waves_longer_than_five_cells_are_recovered(cells, error, turn):
    """At every ninth of a cell, away from the mirrored borders."""
    u, v = np.cos(np.radians(turn)) / cells, np.sin(np.radians(turn)) / cells
    rows, columns = np.mgrid[:120, :110]

    def wave(y, x):
        return np.sin(2 * np.pi * (u * x + v * y) + 0.3)

    coefficients = spline.spline_coefficients(wave(rows, columns))
    y, x = 40 + np.arange(180) / 9, 45 + np.arange(150) / 9
    found = spline.spline_grid(coefficients, y, x)
    np.testing.assert_allclose(found, wave(y[:, None], x[None, :]), rtol=0, atol=error)


def test_spline_agrees_with_scipy():
    values = np.random.default_rng(0).standard_normal((70, 60))
    coefficients = spline.spline_coefficients(values)
    y, x = np.linspace(10, 50, 31), np.linspace(20, 40, 17)
    points = np.meshgrid(y, x, indexing="ij")
    expected = ndimage.map_coordinates(values, points, order=5, mode="mirror")
    np.testing.assert_allclose(spline.spline_grid(coefficients, y, x), expected, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(spline.spline_points(coefficients, *points), spline.spline_grid(coefficients, y, x))


def test_values_beyond_the_margin_have_no_effect():
    """They are weighted by 0.431**32 = 2e-12."""
    values = np.random.default_rng(1).standard_normal((200, 200))
    whole = spline.spline_coefficients(values)
    part = spline.spline_coefficients(values[50:150, 50:150])
    inside = slice(spline.SPLINE_MARGIN, -spline.SPLINE_MARGIN)
    np.testing.assert_allclose(part[inside, inside], whole[50:150, 50:150][inside, inside], rtol=0, atol=1e-10)


def test_spline_of_tiles_equals_the_spline_of_the_whole():
    """Across tiles and the origin; windows have the same bits."""
    rng = np.random.default_rng(4)
    made = {}

    def tile(row, column):
        return made.setdefault((row, column), rng.standard_normal((20, 20)))

    y, x = -31.25 + np.arange(90) * 0.75, 12.125 + np.arange(70) * 0.875
    whole = spline.spline_of_tiles(tile, 20, y, x)
    np.testing.assert_array_equal(spline.spline_of_tiles(tile, 20, y[20:30], x[31:33]), whole[20:30, 31:33])
    coefficients = assemble(tile, 20, -50, 0, (120, 100))
    np.testing.assert_allclose(whole, spline.spline_grid(coefficients, y + 50, x), rtol=0, atol=1e-12)


def test_smooth_noise_has_unit_variance():
    """Also between nodes; within four standard errors, where the weights of a node correlate its neighbours."""
    at = np.arange(1500) * 5.0
    noise = smooth_noise(3, 1, 30.0, at, at)
    assert np.mean(noise**2) == pytest.approx(1, abs=4 * np.sqrt(2 * 2.2 / 250**2))
    assert noise.mean() == pytest.approx(0, abs=4 / (250 * 0.39))
    fine, coarse = (np.sqrt(np.mean(np.diff(noise[:, ::step], 2) ** 2)) for step in (1, 2))
    assert coarse / fine == pytest.approx(4, rel=0.1)


def test_smooth_noise_windows_equal_slices_and_streams_are_uncorrelated():
    south, east = -700.0 + 7.0 * np.arange(200), 96.0 + 9.0 * np.arange(150)
    whole = smooth_noise(7, 2, 16.0, south, east)
    np.testing.assert_array_equal(smooth_noise(7, 2, 16.0, south[50:60], east[9:11]), whole[50:60, 9:11])
    others = [smooth_noise(seed, stream, 16.0, south, east) for seed, stream in ((7, 3), (8, 2))]
    assert np.abs(np.corrcoef([each.ravel() for each in (whole, *others)]) - np.eye(3)).max() < 0.1


def plane(shape=(80, 90)):
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    return 400.0 + 3.0 * columns - 2.0 * rows


def test_extended_plane_remains_a_plane():
    values = plane()
    known = values.copy()
    known[:, 60:], known[:12], known[60:, 20:40] = np.nan, np.nan, np.nan
    out = spline.extend(known, 20, rest=False)
    found = np.isfinite(out)
    assert found[:, :79].all()
    np.testing.assert_allclose(out[found], values[found], rtol=0, atol=1e-9)
    assert np.isfinite(spline.extend(known, 2)).all()


def test_holes_in_a_plane_are_filled_exactly():
    values = plane()
    known = values.copy()
    known[20:27, 30:33], known[40, 50], known[43:47, 47:53] = np.nan, np.nan, np.nan
    np.testing.assert_allclose(spline.fill_gaps(known, (4, 4)), values, rtol=0, atol=1e-8)


def test_filled_hole_is_smooth():
    """A hole of a quarter of a wavelength: within 2 % of the amplitude, where linear interpolation has 5 % error."""
    rows, columns = np.mgrid[:60, :60]
    values = np.sin(2 * np.pi * columns / 28) * np.cos(2 * np.pi * rows / 40)
    known = values.copy()
    known[26:33, 26:33] = np.nan
    np.testing.assert_allclose(spline.fill_gaps(known, (4, 4)), values, rtol=0, atol=0.02)


def test_filled_hole_does_not_depend_on_its_location():
    """Also with only one known cell between the hole and a border."""
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


def test_only_the_edge_of_large_holes_is_filled():
    known = plane()
    known[20:60, 20:60] = np.nan
    out = spline.fill_gaps(known, (3, 3))
    assert np.isnan(out[23:57, 23:57]).all()
    assert np.isfinite(out[20:23, 20:60]).all()


def test_block_means_of_a_plane():
    means = spline.block_means(plane((12, 9)), 4, 3)
    np.testing.assert_allclose(means, [[403 + 9 * j - 3 - 8 * i for j in range(3)] for i in range(3)], rtol=1e-12)
    assert np.isnan(spline.block_means(np.where(plane((4, 4)) == 400, np.nan, 1.0), 2, 2)[0, 0])
