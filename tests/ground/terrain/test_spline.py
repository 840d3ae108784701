"""Spline interpolation of elevation against waves, planes and SciPy."""

import numpy as np
import pytest
from scipy import ndimage

from fifesim.base.lattice import assemble
from fifesim.ground.terrain import spline


@pytest.mark.parametrize(("cells", "error"), [(5, 6e-4), (6, 2e-4), (8, 3e-5)])
@pytest.mark.parametrize("turn", [0, 30, 45])
def test_waves_longer_than_five_cells_are_recovered(cells, error, turn):
    """Between lattice points 30 m apart, every ninth of a cell, away from the mirrored borders."""
    u, v = np.cos(np.radians(turn)) / cells, np.sin(np.radians(turn)) / cells
    rows, columns = np.mgrid[:120, :110]

    def wave(y, x):
        return np.sin(2 * np.pi * (u * x + v * y) + 0.3)

    coefficients = spline.spline_coefficients(wave(rows, columns))
    y, x = 40 + np.arange(180) / 9, 45 + np.arange(150) / 9
    found = spline.spline_grid(coefficients, y, x)
    np.testing.assert_allclose(found, wave(y[:, None], x[None, :]), rtol=0, atol=error)


def test_spline_is_that_of_scipy():
    values = np.random.default_rng(0).standard_normal((70, 60))
    coefficients = spline.spline_coefficients(values)
    y, x = np.linspace(10, 50, 31), np.linspace(20, 40, 17)
    points = np.meshgrid(y, x, indexing="ij")
    expected = ndimage.map_coordinates(values, points, order=5, mode="mirror")
    np.testing.assert_allclose(spline.spline_grid(coefficients, y, x), expected, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(spline.spline_points(coefficients, *points), spline.spline_grid(coefficients, y, x))


def test_margin_hides_what_lies_beyond():
    """0.431**32 = 2e-12."""
    values = np.random.default_rng(1).standard_normal((200, 200))
    whole = spline.spline_coefficients(values)
    part = spline.spline_coefficients(values[50:150, 50:150])
    inside = slice(spline.SPLINE_MARGIN, -spline.SPLINE_MARGIN)
    np.testing.assert_allclose(part[inside, inside], whole[50:150, 50:150][inside, inside], rtol=0, atol=1e-10)


def test_spline_of_tiles_is_the_same_in_every_window():
    """Across tiles and the origin; a part is cut from the whole to the bit, and the whole is the plain spline."""
    rng = np.random.default_rng(4)
    made = {}

    def tile(row, column):
        return made.setdefault((row, column), rng.standard_normal((20, 20)))

    y, x = -31.25 + np.arange(90) * 0.75, 12.125 + np.arange(70) * 0.875
    whole = spline.spline_of_tiles(tile, 20, y, x)
    np.testing.assert_array_equal(spline.spline_of_tiles(tile, 20, y[20:30], x[31:33]), whole[20:30, 31:33])
    coefficients = assemble(tile, 20, -50, 0, (120, 100))
    np.testing.assert_allclose(whole, spline.spline_grid(coefficients, y + 50, x), rtol=0, atol=1e-12)
