"""Footprints, scan pixels on a map, and windows and random streams of the lattice, compared with brute force."""

from itertools import pairwise, product

import numpy as np
import pytest
from scipy.integrate import quad
from shapely.geometry import Polygon, box

import fifesim
from fifesim.base.footprints import Boxcar, axis_operator, regularize
from fifesim.base.lattice import assemble, generator
from fifesim.base.scan_pixels import corners, covered_means, nearest_pixels, reach
from fifesim.ground.landscape.autoregression import periodic_field, streaming_field
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


@pytest.mark.parametrize(
    ("spread", "of"), [(CosineSpread(TM_WIDTH), density), (Boxcar(30.0), lambda x, width: 1 / width)]
)
def test_mtf_is_the_fourier_transform_of_the_line_spread(spread, of):
    width = 2 * spread.half_width
    for frequency in (0.0, 1 / 400, 0.01, 1 / 45.4, 0.05, 0.2):
        k = 2 * np.pi * frequency
        mtf = quad(lambda x, k=k: of(x, width) * np.cos(k * x), -width / 2, width / 2, epsabs=1e-13)[0]
        np.testing.assert_allclose(spread.mtf(frequency), mtf, rtol=0, atol=1e-12)
    np.testing.assert_allclose(Boxcar(30.0).cumulative([-99, -15, -7.5, 0, 15, 99]), [0, 0, 0.25, 0.5, 1, 1])


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


@pytest.mark.parametrize("dtype", ["<f8", ">f8", "<f4", "i2"])
def test_view_of_an_array_gives_the_same_bits_as_its_copy(dtype):
    cells = np.random.default_rng(5).integers(0, 99, (60, 60)).astype(dtype)
    for view in (np.s_[::2, ::2], np.s_[:30, ::-1], np.s_[::-1, :30], np.s_[5:35, 7:37]):
        for each in (cells[view], cells.T[view]):
            rows, columns = (operator(n, 3, 30.0, 0.0, 30.0) for n in each.shape)
            copy = np.array(each, np.float32 if dtype == "<f4" else float, order="C")
            np.testing.assert_array_equal(regularize(each, rows, columns), regularize(copy, rows, columns))


def test_rows_of_a_north_up_grid_count_from_the_north():
    """Negative sizes mirror the axis; coordinates of millions of metres keep their digits."""
    north = operator(90, 9, -30.0, 4334211.0 - 7.5, cell=-CELL, cell_origin=4334211.0)
    plain = operator(90, 9, origin=7.5)
    np.testing.assert_array_equal(north.start, plain.start)
    np.testing.assert_allclose(north.weights, plain.weights, rtol=0, atol=1e-12)


def test_invalid_operators_are_rejected():
    for width, spread in product((0.0, np.inf, np.nan), (CosineSpread, Boxcar)):
        with pytest.raises(ValueError, match=f"width.* must be above 0 m, got {width:g}"):
            spread(width)
    for cell, pixel, n_cells, said in ((-3, 9, 9, "same sign"), (0, 9, 9, "same sign"), (3, 9, 0, "at least 1")):
        with pytest.raises(ValueError, match=said):
            operator(n_cells, 3, pixel, cell=cell)
    rows = operator(90, 9)
    for scene, options, said in (((90, 80), {}, "cut them with"), ((90, 90), {"min_valid": 98}, "min_valid")):
        with pytest.raises(ValueError, match=said):
            regularize(np.ones(scene), rows, rows, **options)
    with pytest.raises(TypeError, match="step 1"):
        rows[::2]


MAP_CELL = (20.0, 30.0)


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
    with pytest.raises(ValueError, match="1 x 4 pixels does not tell"):
        corners(np.zeros((1, 4)), np.zeros((1, 4)))


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
    found = reach(row, column, (rows, columns), MAP_CELL)
    for line, sample in ((0, 0), (3, 4), (6, 8)):
        down, across = (
            (edges[line, :, sample : sample + 2] - centre[line, sample]) * size
            for edges, centre, size in ((rows, row, MAP_CELL[0]), (columns, column, MAP_CELL[1]))
        )
        assert found[line, sample] == pytest.approx(np.hypot(down, across).max(), rel=1e-14)


def test_nearest_pixel_matches_brute_force():
    row, column = swath()
    far = reach(row, column, corners(row, column), MAP_CELL)
    found = nearest_pixels(row.ravel(), column.ravel(), far.ravel(), MAP_CELL, (1, 12), (0, 15))
    i, j = np.mgrid[1:12, 0:15] + 0.5
    away = np.hypot((i[..., None] - row.ravel()) * MAP_CELL[0], (j[..., None] - column.ravel()) * MAP_CELL[1])
    away = np.where(away <= far.ravel(), away, np.inf)
    expected = np.where(np.isfinite(away.min(-1)), away.argmin(-1), -1)
    np.testing.assert_array_equal(found, expected)
    assert (found == -1).any() and (found >= 0).sum() > 50


def test_first_of_two_equidistant_pixels_is_taken_and_pixels_without_coordinates_are_ignored():
    row, column, far = np.array([0.5, 0.5]), np.array([0.0, 1.0]), np.array([30.0, 30.0])
    assert nearest_pixels(row, column, far, (20.0, 20.0), (0, 1), (0, 1)) == 0
    row, column = np.array([np.nan, 0.5]), np.array([0.5, np.nan])
    assert (nearest_pixels(row, column, far, MAP_CELL, (0, 2), (0, 2)) == -1).all()


def test_means_are_weighted_by_polygon_overlap():
    row, column = swath()
    rows, columns = corners(row, column)
    values = np.random.default_rng(3).uniform(0, 1, (2, *row.shape))
    values[1, 2:4, 3] = np.nan
    means, covered = covered_means(values, rows, columns, (1, 12), (0, 15))
    total, area = np.zeros_like(means), np.zeros_like(means)
    for line, sample in np.ndindex(row.shape):
        around = [(line, *edge) for edge in ((0, sample), (0, sample + 1), (1, sample + 1), (1, sample))]
        pixel = Polygon([(columns[at], rows[at]) for at in around])
        for i, j in np.ndindex(11, 15):
            share = pixel.intersection(box(j, i + 1, j + 1, i + 2)).area * np.isfinite(values[:, line, sample])
            total[:, i, j] += share * np.nan_to_num(values[:, line, sample])
            area[:, i, j] += share
    np.testing.assert_allclose(covered, area, rtol=0, atol=1e-12)
    inside = area > 1e-9
    np.testing.assert_allclose(means[inside], (total / np.where(inside, area, 1))[inside], rtol=1e-9)
    assert np.isnan(means[covered == 0]).all()
    # A window of the map, from fewer lines, is identical.
    part = covered_means(values[:, 1:], rows[1:], columns[1:], (5, 9), (4, 11))[0]
    np.testing.assert_array_equal(part, means[:, 4:8, 4:11])


TILE = 5


def place_code(row, column):
    """A value that encodes the row and column."""
    return 1000.0 * row + column


def test_window_holds_the_right_cells_and_each_required_tile_is_made_once():
    made = []

    def tile(tile_row, tile_column):
        made.append((tile_row, tile_column))
        rows, columns = (np.arange(TILE) + index * TILE for index in (tile_row, tile_column))
        return place_code(rows[:, None], columns)

    starts = [(0, 0), (3, 4), (-7, 2), (-5, -10), (-1, -1), (10**9, -(10**9))]
    for (row, column), shape in product(starts, [(1, 1), (5, 5), (4, 13), (11, 2)]):
        expected = place_code(row + np.arange(shape[0])[:, None], column + np.arange(shape[1]))
        np.testing.assert_array_equal(assemble(tile, TILE, row, column, shape), expected)
    made.clear()
    assemble(tile, TILE, -2, 5, (7, 5))
    assert made == [(-1, 1), (0, 1)]


GRID = fifesim.fife_site(30 / 9, window=((90, 108), (180, 198)))


@pytest.fixture(params=["lai_scene", "periodic", "flint_hills", "streaming_field", "periodic_field", "sense"])
def draw(request):
    """A public function that takes a seed."""
    instrument, model = fifesim.instrument("TM", response="paper"), fifesim.NoiseModel(thermal=5.0, shot=0.0)
    toa = fifesim.lai_scene(GRID).fifesim.surface_reflectance("TM", bands=["TM4"]).fifesim.to_toa()
    noise = {"noise": "thermal", "noise_models": model, "quantise": False}
    return {
        "lai_scene": lambda seed: fifesim.lai_scene(GRID, seed=seed),
        "periodic": lambda seed: fifesim.lai_scene(GRID, seed=seed, method="periodic"),
        "flint_hills": lambda seed: fifesim.flint_hills(GRID, seed),
        "streaming_field": lambda seed: streaming_field(seed, 0.1, 0, 0, (3, 3)),
        "periodic_field": lambda seed: periodic_field(seed, 0.1, (3, 3)),
        "sense": lambda seed: toa.fifesim.sense(instrument, seed=seed, **noise),
    }[request.param]


def test_seeds_are_whole_numbers_that_scenarios_can_hold(draw):
    for seed in (7.0, None, True, np.True_, "7", [7]):
        with pytest.raises(
            TypeError, match=r"seed must be a whole number from 0 to 2\*\*63 - 1, got .*: give for inst"
        ):
            draw(seed)
    for seed in (-1, 2**63, np.int8(-3), np.uint64(2**63)):
        with pytest.raises(ValueError, match=rf"seed must be a whole number from 0 to 2\*\*63 - 1, got {seed}: give"):
            draw(seed)
    np.testing.assert_array_equal(draw(np.uint16(9)), draw(9))
    assert not np.array_equal(draw(np.int64(2**63 - 1)), draw(2**63 - 2))


def test_places_streams_and_seeds_give_independent_numbers():
    """Neighbouring integers above 2**63 are equal in double precision; place indices are 64-bit words."""
    keys = [(seed, stream, (0, 0, place, 0)) for seed, stream, place in product((0, 2**63 - 1), (1, 2**63), (0, -1))]
    keys += [(2**63 - 2, 1, (0, 0, 0, 0)), (0, 2**63 + 1, (0, 0, 0, 0)), (0, 1, (0, 0, -2, 0)), (0, 1, (0, 0, 0, -1))]
    drawn = [generator(*key).standard_normal(40_000) for key in keys]
    np.testing.assert_allclose(np.corrcoef(drawn), np.eye(len(keys)), rtol=0, atol=4.5 / 200)
