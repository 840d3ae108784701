"""Spline interpolation of elevation against waves, planes and SciPy."""

import numpy as np
import pytest
from scipy import ndimage

from fifesim.ground.terrain import spline as dem


def plane(shape=(80, 90)):
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    return 400.0 + 3.0 * columns - 2.0 * rows


@pytest.mark.parametrize(("cells", "error"), [(5, 6e-4), (6, 2e-4), (8, 3e-5)])
@pytest.mark.parametrize("turn", [0, 30, 45])
def test_waves_longer_than_five_cells_are_recovered(cells, error, turn):
    """Between lattice points 30 m apart, every ninth of a cell, away from the mirrored borders."""
    u, v = np.cos(np.radians(turn)) / cells, np.sin(np.radians(turn)) / cells
    rows, columns = np.mgrid[:120, :110]

    def wave(y, x):
        return np.sin(2 * np.pi * (u * x + v * y) + 0.3)

    coefficients = dem.spline_coefficients(wave(rows, columns))
    y, x = 40 + np.arange(180) / 9, 45 + np.arange(150) / 9
    found = dem.spline_grid(coefficients, y, x)
    np.testing.assert_allclose(found, wave(y[:, None], x[None, :]), rtol=0, atol=error)


def test_spline_is_that_of_scipy():
    values = np.random.default_rng(0).standard_normal((70, 60))
    coefficients = dem.spline_coefficients(values)
    y, x = np.linspace(10, 50, 31), np.linspace(20, 40, 17)
    points = np.meshgrid(y, x, indexing="ij")
    expected = ndimage.map_coordinates(values, points, order=5, mode="mirror")
    np.testing.assert_allclose(dem.spline_grid(coefficients, y, x), expected, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(dem.spline_points(coefficients, *points), dem.spline_grid(coefficients, y, x))


def test_margin_hides_what_lies_beyond():
    """0.431**32 = 2e-12."""
    values = np.random.default_rng(1).standard_normal((200, 200))
    whole = dem.spline_coefficients(values)
    part = dem.spline_coefficients(values[50:150, 50:150])
    inside = slice(dem.MARGIN, -dem.MARGIN)
    np.testing.assert_allclose(part[inside, inside], whole[50:150, 50:150][inside, inside], rtol=0, atol=1e-10)


def test_plane_goes_on_past_its_edge():
    values = plane()
    known = values.copy()
    known[:, 60:], known[:12], known[60:, 20:40] = np.nan, np.nan, np.nan
    out = dem.extend(known, 20, rest=False)
    found = np.isfinite(out)
    assert found[:, :79].all()
    np.testing.assert_allclose(out[found], values[found], rtol=0, atol=1e-9)
    assert np.isfinite(dem.extend(known, 2)).all()


def test_nothing_known_stays_unknown():
    nothing = np.full((5, 5), np.nan)
    assert np.isnan(dem.extend(nothing, 3)).all()
    assert np.isnan(dem.fill_gaps(nothing, (3, 3))).all()


def test_holes_in_a_plane_are_filled_by_the_plane():
    values = plane()
    known = values.copy()
    known[20:27, 30:33], known[40, 50], known[43:47, 47:53] = np.nan, np.nan, np.nan
    np.testing.assert_allclose(dem.fill_gaps(known, (4, 4)), values, rtol=0, atol=1e-8)


def test_least_bending_is_smooth_across_a_hole():
    """A hole of a quarter of a wave: within 2 % of its amplitude, where linear interpolation is 5 % off."""
    rows, columns = np.mgrid[:60, :60]
    values = np.sin(2 * np.pi * columns / 28) * np.cos(2 * np.pi * rows / 40)
    known = values.copy()
    known[26:33, 26:33] = np.nan
    np.testing.assert_allclose(dem.fill_gaps(known, (4, 4)), values, rtol=0, atol=0.02)


def test_larger_holes_are_left_but_for_their_edge():
    known = plane()
    known[20:60, 20:60] = np.nan
    out = dem.fill_gaps(known, (3, 3))
    assert np.isnan(out[23:57, 23:57]).all()
    assert np.isfinite(out[20:23, 20:60]).all()


def test_block_means_of_a_plane_are_its_middles():
    means = dem.block_means(plane((12, 9)), 4, 3)
    np.testing.assert_allclose(means, [[403 + 9 * j - 3 - 8 * i for j in range(3)] for i in range(3)], rtol=1e-12)
    assert np.isnan(dem.block_means(np.where(plane((4, 4)) == 400, np.nan, 1.0), 2, 2)[0, 0])


def test_terraces_are_known_by_their_step():
    gentle = plane() / 20
    assert dem.terrace_step(np.rint(gentle)) == 1
    assert dem.terrace_step(np.rint(gentle / 5) * 5) == 5
    assert dem.terrace_step(gentle) is None
    assert dem.terrace_step(np.full((9, 9), 400.0)) is None
    assert dem.terrace_step(np.rint(plane())) is None
    assert dem.terrace_step(np.full((9, 9), np.nan)) is None


@pytest.mark.parametrize(
    ("name", "metres"), [("m", 1), ("Foot", 0.3048), ("US survey foot", 1200 / 3937), ("ft", 0.3048), ("metre", 1)]
)
def test_units_by_the_names_that_files_use(name, metres):
    assert dem.metres_per_unit(name) == metres


def test_unknown_unit_is_refused():
    with pytest.raises(ValueError, match="vertical units must be one of m, ft, us-ft"):
        dem.metres_per_unit("furlong")
