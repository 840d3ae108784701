"""Blocks of cells, and sums over them."""

import numpy as np
import pytest

from fifesim.atmosphere.adjacency import Blocks, block_sums, blocks_along, on_cells, whole_blocks

Y, X = Blocks(cells=4, offset=3, n_cells=21), Blocks(cells=3, offset=0, n_cells=16)


@pytest.fixture
def values():
    values = np.random.default_rng(1).random((2, 21, 16)) - 0.3
    values[0, 5:9, 7] = np.nan
    return values


def summed(values, along_y, along_x, linear):
    """Sums of whole blocks, from the sums of all pieces at once."""
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


def test_sums_are_those_of_the_cells_of_each_block(values):
    """Whole numbers of 2 to the -52."""
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


def test_weights_between_blocks_share_each_cell_out(values):
    plain, linear = (summed(values, whole(Y), whole(X), flag) for flag in (False, True))
    assert linear.shape == (2, 2, 3, 3, 6, 6)
    np.testing.assert_allclose(linear.sum(axis=(2, 3)), plain[:, :, 0, 0], rtol=0, atol=1e-14)
    np.testing.assert_allclose(Y.interpolation_weights.sum(axis=1), 1)
    # Mean place of a cell that is shared out so is its own.
    place = (np.arange(4) + 0.5) / 4 - 0.5
    np.testing.assert_allclose(Y.interpolation_weights @ [-1, 0, 1], place, atol=1e-15)


@pytest.mark.parametrize("cuts", [((21,), (5, 11)), ((1, 1, 19), (16,)), ((2, 3, 7, 9), (4, 4, 4, 4))])
@pytest.mark.parametrize("linear", [False, True])
def test_cuts_give_the_same_bits(values, cuts, linear):
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


def test_values_beyond_a_thousand_count_as_that():
    """A sum that overflowed would be any number."""
    sums = summed(np.full((1, 21, 16), -1e30), whole(Y), whole(X), False)
    np.testing.assert_allclose(sums[0, 0, 0, 0] / sums[0, 1, 0, 0], -1000, rtol=1e-12)


def test_single_precision_is_summed_as_it_is(values):
    narrow = values.astype(np.float32)
    np.testing.assert_array_equal(
        summed(narrow, whole(Y), whole(X), True), summed(narrow.astype(float), whole(Y), whole(X), True)
    )


def test_cells_between_blocks_lie_on_the_plane_through_them():
    i, j = np.mgrid[-1 : Y.count + 1, -1 : X.count + 1]
    along = Y.interpolation, X.interpolation
    rows, columns = slice(2, 19), slice(1, 16)
    windows = tuple(axis[part].window for axis, part in zip(along, (rows, columns), strict=True))
    found = on_cells(rows, columns, (2.0 * i - 3.0 * j)[windows], along_y=along[0], along_x=along[1])
    y, x = ((np.arange(axis.n_cells) + axis.offset + 0.5) / axis.cells - 0.5 for axis in (Y, X))
    np.testing.assert_allclose(found, (2 * y[:, None] - 3 * x)[rows, columns], rtol=0, atol=1e-12)
