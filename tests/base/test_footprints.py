"""Footprints compared with quadrature, Fourier transform and symmetry; line spread functions with their transforms."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

from fifesim.base.footprints import Boxcar, axis_operator, regularize
from fifesim.sensor.response.spatial import CosineSpread

CELL = 30 / 9
TM_WIDTH = 9 * 4.778e-6 * 705e3

# pixel size, pixel origin, width of the line spread [m]
GRIDS = [
    pytest.param(30.0, 0.0, 30.0, id="aligned"),
    pytest.param(30.0, 0.0, TM_WIDTH, id="tm"),
    pytest.param(30.315, 0.0, TM_WIDTH, id="native-interval"),
    pytest.param(30.0, 7.123, TM_WIDTH, id="offset"),
    pytest.param(2.5, -1.7, 4.1, id="smaller-than-cells"),
    pytest.param(1100.0 / 7, 11.0, 47.0, id="gaps"),
]


def density(x, width):
    """The paper's line spread function, normalized by quadrature."""
    area = quad(lambda t: np.cos(2 * np.pi * t / (3 * width)), -width / 2, width / 2, epsabs=0)[0]
    return np.cos(2 * np.pi * x / (3 * width)) / area


def quadrature(low, high, width):
    """Integral of the line spread function over an interval around the pixel's centre."""
    low, high = max(low, -width / 2), min(high, width / 2)
    return quad(density, low, high, args=(width,), epsabs=1e-13)[0] if high > low else 0.0


def brute_force_weights(width, pixel, origin, n_pixels, n_cells, cell=CELL):
    """Dense weights by quadrature of each cell in each pixel."""
    centers = origin + (np.arange(n_pixels) + 0.5) * pixel
    return np.array([[quadrature(j * cell - x, (j + 1) * cell - x, width) for j in range(n_cells)] for x in centers])


def dense(operator, n_cells):
    """The operator as a matrix."""
    matrix = np.zeros((len(operator), n_cells))
    for i, (start, count) in enumerate(zip(operator.start, operator.count, strict=True)):
        matrix[i, start : start + count] = operator.weights[i, :count]
    return matrix


def operator(n_cells, n_pixels, pixel=30.0, origin=0.0, width=TM_WIDTH, cell=CELL, cell_origin=0.0):
    cells = {"cell_origin": cell_origin, "cell_size": cell, "n_cells": n_cells}
    return axis_operator(CosineSpread(width), **cells, pixel_origin=origin, pixel_size=pixel, n_pixels=n_pixels)


@pytest.mark.parametrize(("pixel", "origin", "width"), GRIDS)
def test_weights_agree_with_quadrature(pixel, origin, width):
    """Column j of the matrix is the image of a single bright cell j, so all impulse responses are compared."""
    n_cells, n_pixels = 90, int(300 / pixel) + 2
    found = dense(operator(n_cells, n_pixels, pixel, origin, width), n_cells)
    expected = brute_force_weights(width, pixel, origin, n_pixels, n_cells)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)
    inside = operator(900, int(2900 / pixel), pixel, origin + 40.0, width)
    np.testing.assert_allclose([inside.weights.sum(axis=1), inside.share], 1.0, rtol=1e-12)


@pytest.mark.parametrize("wavelength", [400.0, 90.0, 45.4, 21.0])
@pytest.mark.parametrize("interval", [30.0, 30.315])
def test_sinusoid_is_reduced_by_the_mtf(wavelength, interval):
    """
    The attenuation is compared with the Fourier transform of the line spread function by quadrature, without cells.

    Cells hold the means of the sinusoid. The error comes from the two cells that the ends of the support cut:
    at most w k cell^2 / 8 each, 4e-10 together for w = 0.02 m-1 and cells of 0.5 mm.
    """
    cell, n_cells, n_pixels, k = 5e-4, 200_000, 2, 2 * np.pi / wavelength
    edges = np.arange(n_cells + 1) * cell
    scene = np.diff(np.sin(k * edges)) / (k * cell)
    columns, row = operator(n_cells, n_pixels, interval, 17.3, cell=cell), operator(1, 1, 1.0, width=1.0, cell=1.0)
    mtf = quad(lambda x: density(x, TM_WIDTH) * np.cos(k * x), -TM_WIDTH / 2, TM_WIDTH / 2, epsabs=1e-13)[0]
    centers = 17.3 + (np.arange(n_pixels) + 0.5) * interval
    np.testing.assert_allclose(regularize(scene[None], row, columns), [mtf * np.cos(k * centers)], rtol=0, atol=1e-9)
    np.testing.assert_allclose(CosineSpread(TM_WIDTH).mtf(1 / wavelength), mtf, rtol=0, atol=1e-12)


def test_line_spread_ends_at_half_its_maximum():
    """The paper truncates the cosine at half its amplitude."""
    spread, step = CosineSpread(30.0), 1e-4
    at_the_end = spread.cumulative(15.0) - spread.cumulative(15.0 - step)
    in_the_middle = spread.cumulative(step / 2) - spread.cumulative(-step / 2)
    np.testing.assert_allclose(at_the_end / in_the_middle, 0.5, rtol=1e-4)


@pytest.mark.parametrize(("pixel", "origin", "width"), GRIDS)
def test_constant_scene_stays_constant(pixel, origin, width):
    """This includes pixels at the scene edges and at holes, wherever a value is given."""
    scene = np.full((90, 120), 204.3)
    rows, columns = (operator(n, int(400 / pixel) + 1, pixel, origin, width) for n in scene.shape)
    full = regularize(scene, rows, columns, min_valid=0.3)
    scene[::7, ::5] = np.nan
    holes = regularize(scene, rows, columns, min_valid=0.3)
    for image in (full, holes):
        assert np.isfinite(image).any()
        np.testing.assert_allclose(image[np.isfinite(image)], 204.3, rtol=1e-14)


def test_scene_with_holes_is_the_normalized_sum_over_valid_cells():
    scene = np.random.default_rng(3).random((2, 70, 80))
    scene[:, 20:24, 30:37] = np.nan
    scene[1, 50, 60] = np.nan
    rows, columns = operator(70, 8, origin=1.1), operator(80, 9, origin=-2.3)
    y = brute_force_weights(TM_WIDTH, 30.0, 1.1, 8, 70)
    x = brute_force_weights(TM_WIDTH, 30.0, -2.3, 9, 80)
    total = np.einsum("ik,jl,bkl->bij", y, x, np.nan_to_num(scene))
    share = np.einsum("ik,jl,bkl->bij", y, x, np.isfinite(scene).astype(float))
    with np.errstate(invalid="ignore"):
        expected = np.where(share >= 0.9, total / share, np.nan)
    assert 0 < np.isnan(expected).sum() < expected.size
    np.testing.assert_allclose(regularize(scene, rows, columns, min_valid=0.9), expected, rtol=1e-12)


def test_min_valid_decides_at_the_scene_edge():
    """The 30.32 m TM footprint may overhang the scene by 0.16 m, but not by one more cell."""
    scene = np.ones((90, 90))
    rows = operator(90, 10)
    assert np.isfinite(regularize(scene, rows, rows)).all()
    assert np.isnan(regularize(scene, rows, rows, min_valid=1.0)[0]).all()
    assert np.isnan(regularize(scene, operator(90, 10, origin=-CELL), rows)[0]).all()
    inner = operator(90, 8, origin=30.0)
    assert np.isfinite(regularize(scene, inner, inner, min_valid=1.0)).all()


@pytest.mark.parametrize(("pixel", "origin", "width"), GRIDS)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_any_window_gives_the_same_bits(pixel, origin, width, dtype):
    """Only some windows contain holes; holes outside the footprint must not affect a pixel."""
    rng = np.random.default_rng(11)
    scene = rng.normal(100.0, 30.0, (2, 151, 173)).astype(dtype)
    scene[:, 31:33, 100:] = np.nan
    scene[rng.random(scene.shape) < 0.001] = np.nan
    n_pixels = int(600 / pixel)
    rows, columns = (operator(n, n_pixels, pixel, origin, width) for n in scene.shape[1:])
    whole = regularize(scene, rows, columns)
    assert whole.dtype == dtype
    step = max(n_pixels // 5, 1)
    cuts = [0, *range(1, n_pixels, step), n_pixels]
    for i0, i1 in pairwise(cuts):
        for j0, j1 in pairwise(cuts):
            y, x = rows[i0:i1], columns[j0:j1]
            part = regularize(scene[:, y.window, x.window], y, x)
            np.testing.assert_array_equal(part, whole[:, i0:i1, j0:j1])


@pytest.mark.parametrize("view", [np.s_[::2, ::2], np.s_[:30, ::-1], np.s_[::-1, :30], np.s_[5:35, 7:37]], ids=str)
@pytest.mark.parametrize("dtype", ["<f8", ">f8", "<f4", "i2"])
def test_view_of_an_array_gives_the_same_bits_as_its_copy(view, dtype):
    cells = np.random.default_rng(5).integers(0, 99, (60, 60)).astype(dtype)
    for each in (cells[view], cells.T[view]):
        rows, columns = (operator(n, 3, 30.0, 0.0, 30.0) for n in each.shape)
        copy = np.array(each, np.float32 if dtype == "<f4" else float, order="C")
        np.testing.assert_array_equal(regularize(each, rows, columns), regularize(copy, rows, columns))


def test_window_holds_only_the_required_cells():
    rows = operator(4500, 500, width=30.0)
    assert rows.window == slice(0, 4500)
    assert rows[100:200].window == slice(900, 1800)
    assert rows[100:200][10:20].window == slice(990, 1080)
    outside = operator(30, 5, origin=1000.0)
    assert outside[1:3].window == slice(0, 1)
    assert np.isnan(regularize(np.ones((1, 1)), outside[1:3], outside[1:3])).all()


def test_rows_of_a_north_up_grid_count_from_the_north():
    """Negative sizes mirror the axis; coordinates of millions of metres keep their digits."""
    north = operator(90, 9, -30.0, 4334211.0 - 7.5, cell=-CELL, cell_origin=4334211.0)
    plain = operator(90, 9, origin=7.5)
    np.testing.assert_array_equal(north.start, plain.start)
    np.testing.assert_allclose(north.weights, plain.weights, rtol=0, atol=1e-12)


def test_invalid_operators_are_rejected():
    for width in (0.0, -30.0, np.inf, np.nan):
        for spread in (CosineSpread, Boxcar):
            with pytest.raises(ValueError, match=f"width.* must be above 0 m, got {width:g}"):
                spread(width)
    for cell, pixel in ((-3, 9), (0, 9), (3, 0)):
        with pytest.raises(ValueError, match="same sign"):
            operator(9, 3, pixel, cell=cell)
    with pytest.raises(ValueError, match="at least 1"):
        operator(0, 3)
    rows = operator(90, 9)
    with pytest.raises(ValueError, match="cut them with"):
        regularize(np.ones((90, 80)), rows, rows)
    with pytest.raises(ValueError, match="min_valid"):
        regularize(np.ones((90, 90)), rows, rows, min_valid=98)
    with pytest.raises(TypeError, match="step 1"):
        rows[::2]


def test_uniform_response_has_a_linear_edge_response_and_its_transform_as_mtf():
    spread = Boxcar(30.0)
    assert spread.half_width == 15.0
    np.testing.assert_allclose(spread.cumulative([-99.0, -15.0, -7.5, 0.0, 15.0, 99.0]), [0, 0, 0.25, 0.5, 1, 1])
    for frequency in (0.0, 0.01, 0.05, 0.2):
        transform, _ = quad(lambda x, of=frequency: np.cos(2 * np.pi * of * x) / 30.0, -15.0, 15.0)
        np.testing.assert_allclose(spread.mtf(frequency), transform, atol=1e-12)
