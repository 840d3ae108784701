"""Block sums, the environment function, and the environment reflectance on blocks."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import dblquad, quad

from fifesim.atmosphere.adjacency import (
    Blocks,
    block_sums,
    blocks_along,
    environment_function,
    environment_weights,
    mixed_environment_function,
    on_cells,
    point_spread,
    spread_over,
    whole_blocks,
)
from fifesim.atmosphere.coupling import TargetTerms, inhomogeneous_reflectance

Y, X = Blocks(cells=4, offset=3, n_cells=21), Blocks(cells=3, offset=0, n_cells=16)


@pytest.fixture
def values():
    values = np.random.default_rng(1).random((2, 21, 16)) - 0.3
    values[0, 5:9, 7] = np.nan
    return values


def summed(values, along_y, along_x, linear):
    """Sums over whole blocks, with all sub-blocks computed at once."""
    rows, columns = (slice(0, along.start.size) for along in (along_y, along_x))
    sums = block_sums(rows, columns, values, along_y=along_y, along_x=along_x, linear=linear)
    return whole_blocks(sums, along_y, along_x)


def whole(blocks):
    return blocks.pieces((blocks.n_cells,))[0]


def test_blocks_are_counted_from_the_origin():
    assert (Y.count, X.count) == (6, 6)
    np.testing.assert_array_equal(Y.edges[0], [0, 1, 5, 9, 13, 17])
    np.testing.assert_array_equal(Y.edges[1], [1, 5, 9, 13, 17, 21])
    np.testing.assert_allclose(X.inside, [1, 1, 1, 1, 1, 1 / 3])
    assert blocks_along(7, 20.0, 10) == Blocks(cells=3, offset=1, n_cells=10)
    assert blocks_along(7, 200.0, 10).cells == 1


def test_block_sums_equal_the_sums_over_cells(values):
    """Sums are integers in units of 2^-52."""
    found = summed(values, whole(Y), whole(X), False)
    assert found.shape == (2, 2, 1, 1, 6, 6)
    for band, (i, rows), (j, columns) in (
        (band, rows, columns)
        for band in range(2)
        for rows in enumerate(zip(*Y.edges, strict=True))
        for columns in enumerate(zip(*X.edges, strict=True))
    ):
        block = values[band, slice(*rows), slice(*columns)]
        expected = np.nansum(block) / 12, np.isfinite(block).sum() / 12
        np.testing.assert_allclose(found[band, :, 0, 0, i, j], expected, rtol=0, atol=1e-14)


def test_interpolation_weights_partition_each_cell(values):
    plain, linear = (summed(values, whole(Y), whole(X), flag) for flag in (False, True))
    assert linear.shape == (2, 2, 3, 3, 6, 6)
    np.testing.assert_allclose(linear.sum(axis=(2, 3)), plain[:, :, 0, 0], rtol=0, atol=1e-14)
    np.testing.assert_allclose(Y.interpolation_weights.sum(axis=1), 1)
    # The weighted mean position equals the position of the cell.
    place = (np.arange(4) + 0.5) / 4 - 0.5
    np.testing.assert_allclose(Y.interpolation_weights @ [-1, 0, 1], place, atol=1e-15)


@pytest.mark.parametrize("cuts", [((21,), (5, 11)), ((1, 1, 19), (16,)), ((2, 3, 7, 9), (4, 4, 4, 4))])
@pytest.mark.parametrize("linear", [False, True])
def test_chunking_gives_bitwise_equal_sums(values, cuts, linear):
    (along_y, row_counts), (along_x, column_counts) = (axis.pieces(cut) for axis, cut in zip((Y, X), cuts, strict=True))
    parts = np.empty((2, 2, *(3, 3) * linear, *(1, 1) * (not linear), along_y.start.size, along_x.start.size), np.int64)
    row = 0
    for rows in row_counts:
        column = 0
        for columns in column_counts:
            these, those = slice(row, row + rows), slice(column, column + columns)
            cells = (
                slice(along_y.start[these][0], along_y.stop[these][-1]),
                slice(along_x.start[those][0], along_x.stop[those][-1]),
            )
            parts[..., these, those] = block_sums(
                these, those, values[(..., *cells)], along_y=along_y, along_x=along_x, linear=linear
            )
            column += columns
        row += rows
    np.testing.assert_array_equal(whole_blocks(parts, along_y, along_x), summed(values, whole(Y), whole(X), linear))


def test_values_are_clipped_at_minus_1000():
    """Clipping keeps the integer sums from overflowing."""
    sums = summed(np.full((1, 21, 16), -1e30), whole(Y), whole(X), False)
    np.testing.assert_allclose(sums[0, 0, 0, 0] / sums[0, 1, 0, 0], -1000, rtol=1e-12)


def test_single_precision_is_summed_without_loss(values):
    narrow = values.astype(np.float32)
    np.testing.assert_array_equal(
        summed(narrow, whole(Y), whole(X), True), summed(narrow.astype(float), whole(Y), whole(X), True)
    )


def test_interpolation_from_blocks_to_cells_reproduces_a_plane():
    i, j = np.mgrid[-1 : Y.count + 1, -1 : X.count + 1]
    along = Y.interpolation, X.interpolation
    rows, columns = slice(2, 19), slice(1, 16)
    windows = tuple(axis[part].window for axis, part in zip(along, (rows, columns), strict=True))
    found = on_cells(rows, columns, (2.0 * i - 3.0 * j)[windows], along_y=along[0], along_x=along[1])
    y, x = ((np.arange(axis.n_cells) + axis.offset + 0.5) / axis.cells - 0.5 for axis in (Y, X))
    np.testing.assert_allclose(found, (2 * y[:, None] - 3 * x)[rows, columns], rtol=0, atol=1e-12)


# ------------------------------------------------------------------------------------------ environment function


SIXS = pd.read_csv(Path(__file__).parents[1] / "data" / "sixs_adjacency.csv", comment="#")


def sixs_terms():
    return TargetTerms(
        SIXS["path_reflectance_with_gas"] / SIXS["gas_transmittance"],
        SIXS["transmittance_down"],
        SIXS["direct_transmittance_up"],
        SIXS["transmittance_up"] - SIXS["direct_transmittance_up"],
        SIXS["spherical_albedo"],
        SIXS["gas_transmittance"],
    )


def sixs_mixed():
    up = SIXS["diffuse_up_molecules"], SIXS["diffuse_up_aerosol"]
    return mixed_environment_function(1000 * SIXS["radius"], SIXS["vza"], *up)


def test_environment_function_agrees_with_6s_off_nadir():
    """6S computes in single precision and prints seven digits."""
    molecules, aerosol = environment_function(1000 * SIXS["radius"], SIXS["vza"])
    np.testing.assert_allclose(molecules, SIXS["environment_function_molecules"], rtol=0, atol=2e-7)
    np.testing.assert_allclose(aerosol, SIXS["environment_function_aerosol"], rtol=0, atol=2e-7)


def test_mixed_environment_function_agrees_with_6s():
    """The table holds band means of the transmittances that weight the mixture: at most 1.2e-3 off in 244 cases."""
    np.testing.assert_allclose(sixs_mixed(), SIXS["environment_function"], rtol=0, atol=1.5e-3)


def test_apparent_reflectance_of_a_target_agrees_with_6s():
    """Band means replace the sum over wavelengths: at most 2.1e-4 off in 244 cases, for an effect of up to 0.11."""
    share = sixs_mixed()
    around = share * SIXS["target_reflectance"] + (1 - share) * SIXS["environment_reflectance"]
    toa = inhomogeneous_reflectance(SIXS["target_reflectance"], around, sixs_terms())
    np.testing.assert_allclose(toa, SIXS["toa_reflectance"], rtol=0, atol=3e-4)


def test_without_scattering_the_environment_is_the_target():
    assert environment_weights(0.0, 0.0) == (0.0, 0.0)
    assert mixed_environment_function(10.0, 0.0, 0.0, 0.0) == 1.0
    np.testing.assert_array_equal(point_spread((2, 2), (60, 60), 0.0, 0.0, 0.0), [[1, 0], [0, 0]])


def density(distance, vza):
    """Point spread of the aerosol by central differences of its environment function. [m-2]"""
    step = 1e-3 * distance
    low, high = (environment_function(distance + sign * step, vza)[1] for sign in (-1, 1))
    return float(high - low) / (2 * step) / (2 * np.pi * distance)


@pytest.mark.parametrize("vza", [0.0, 40.0])
@pytest.mark.parametrize("row, column", [(0, 1), (3, 2), (9, 0), (12, 30)])
def test_weight_of_a_cell_is_the_integral_of_the_density(row, column, vza):
    """The difference quotient is accurate to 1e-6; from the ninth cell on, the quadrature is coarser."""
    down, across = 60.0, 75.0
    weight = point_spread((13, 31), (down, across), vza, 0.0, 1.0)[row, column]
    limits = [(column - 0.5) * across, (column + 0.5) * across, (row - 0.5) * down, (row + 0.5) * down]
    brute, _ = dblquad(lambda y, x: density(np.hypot(x, y), vza), *limits, epsabs=1e-12, epsrel=1e-7)
    assert weight == pytest.approx(brute, rel=1e-5)


def test_weight_of_the_target_cell_is_the_mean_over_its_edge():
    """Mean over azimuth of the environment function at the distance of the cell's edge."""
    down, across = 60.0, 75.0

    def edge(angle):
        distance = min(down / 2 / abs(np.sin(angle)), across / 2 / abs(np.cos(angle)))
        return float(environment_function(distance, 30.0)[0])

    corner = np.arctan2(down, across)
    quarter = quad(edge, 1e-12, corner)[0] + quad(edge, corner, np.pi / 2 - 1e-12)[0]
    assert point_spread((1, 1), (down, across), 30.0, 1.0, 0.0)[0, 0] == pytest.approx(quarter * 2 / np.pi, rel=1e-9)


def test_weights_of_the_plane_sum_to_one():
    """Weights beyond 400 km are missing: e^-32 for molecules."""
    weights = point_spread((400, 400), (1000.0, 1000.0), 0.0, 1.0, 0.0)
    whole = 4 * weights.sum() - 2 * weights[0].sum() - 2 * weights[:, 0].sum() + weights[0, 0]
    assert whole == pytest.approx(1.0, abs=1e-8)
    assert weights.min() > -1e-17


# ------------------------------------------------------------------------------------------ environment on blocks


# Blocks of one cell need no interpolation.
ROWS, COLUMNS = Blocks(1, 0, 9), Blocks(1, 0, 12)
CELL, VZA, WEIGHTS = (60.0, 80.0), 30.0, (0.3, 0.6)


def spread(margin=(1, 1)):
    return spread_over(ROWS, COLUMNS, CELL, margin, VZA, *WEIGHTS)


def test_one_bright_block_gives_the_point_spread():
    """Also on the ring around the scene, and without wrap-around of the Fourier transform."""
    field = np.zeros((11, 14))
    field[1 + 2, 1 + 3] = 1.0
    expected = point_spread((9, 12), CELL, VZA, *WEIGHTS)
    i, j = np.abs(np.arange(-1, 10) - 2), np.abs(np.arange(-1, 13) - 3)
    np.testing.assert_allclose(spread()(field), expected[np.ix_(i, j)], rtol=0, atol=1e-15)
