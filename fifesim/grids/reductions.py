"""Sums and means of rasters: over all cells, over bands, and over the footprints of pixels."""

from functools import reduce
from typing import NamedTuple

import dask
import dask.array as da
import numpy as np
import xarray as xr
from dask.graph_manipulation import bind
from scipy.sparse.csgraph import connected_components

from fifesim.base.arrays import compiled, read_only
from fifesim.base.footprints import AxisOperator, Boxcar, axis_operator, regularize
from fifesim.grids import chunks, windows
from fifesim.grids import grid as grids
from fifesim.grids.chunks import Reads, in_blocks

# Size of the blocks of whole rows. [cell]
_CELLS = 2**22


def computed(*arrays):
    """Arrays in memory; common tasks are computed once."""
    return dask.compute(*arrays)


def extremes(array):
    """Smallest and largest value of a raster; computes."""
    low, high = computed(array.min(), array.max())
    return float(low), float(high)


def row_by_row(kernel, *arrays, leading):
    """Sums over rows by a kernel in fixed blocks, shape (*leading, rows), lazy where an input is."""
    height, width = arrays[0].shape[-2:]
    row = np.arange(height)
    # Each row of the single-column result reads a complete row.
    reads = [Reads(array, (row, row + 1), ([0], [width])) for array in arrays]

    def sums(rows, columns, *blocks):
        return kernel(*(np.ascontiguousarray(block, float) for block in blocks))[..., None]

    return in_blocks(sums, reads, (*leading, height, 1), max(_CELLS // width, 1))[..., 0]


def sums_by_row(kernel, *arrays, count, **parameters):
    """Sums over rows by a kernel, shape (rows, count); computes."""
    data = [array.data for array in arrays]
    return computed(row_by_row(lambda *cells: kernel(*cells, **parameters).T, *data, leading=(count,)))[0].T


def sums_by_block(kernel, array, shape, size, margin=(0, 0)):
    """Sum of the results of a kernel for the blocks of an array, one after the other; computes."""
    (height, width), (down, across) = array.shape[-2:], margin

    def around(first, length, reach):
        return min(first, reach), max(min(length - first - size, reach), 0)

    def sums(row, column, cells):
        margins = around(row.start * size, height, down), around(column.start * size, width, across)
        return kernel(cells, margins)[..., None, None]

    def edges(length, reach):
        first = np.arange(0, length, size)
        return np.maximum(first - reach, 0), np.minimum(first + size + reach, length)

    rows, columns = edges(height, down), edges(width, across)
    # Each cell of the result represents a block.
    shape = (*shape, len(rows[0]), len(columns[0]))
    (found,) = computed(in_blocks(sums, [Reads(array, rows, columns)], shape, 1))
    # In a fixed order, because the order in numpy's sum depends on the memory layout.
    return reduce(np.add, np.moveaxis(found.reshape(*shape[:-2], -1), -1, 0))


# Bytes of the sums that one task makes, from which bands are summed by themselves.
_LARGEST_SUM = 2**26

# Bytes of a sum from which its chunks are read in turn.
_IN_TURN = 2**24


def combined(array, dim, weights):
    """Weighted sums along a dimension, which becomes "band", lazy in the same chunks; zero weights skip NaN."""
    # Chunks along the dimension are added in sequence, so that a task holds one chunk and one sum.
    weights = np.asarray(weights, float)
    first = array.transpose(dim, ...)
    dtype = np.result_type(array.dtype, np.float32)
    if isinstance(first.data, da.Array):
        data = _lazy_sums(first.data, weights).astype(dtype)
    else:
        data = _add(weights, first.data).astype(dtype)
    coords = {key: value.variable for key, value in array.coords.items() if dim not in value.dims}
    sums = xr.DataArray(data, dims=("band", *first.dims[1:]), coords=coords, name=array.name)
    place = ("y", "x") if {"y", "x"} <= set(array.dims) else ()
    others = ["band" if each == dim else each for each in array.dims if each not in place]
    return sums.transpose(*others, *place)


def _lazy_sums(data, weights):
    """Weighted sums along the first axis, with rows of weights that read the same chunks grouped together."""
    edges = np.cumsum([0, *data.chunks[0]])
    cells = np.prod([max(sizes) for sizes in data.chunks[1:]])
    largest = max(int(_LARGEST_SUM // (8 * cells)), 1)
    read = np.add.reduceat(weights != 0, edges[:-1], axis=1) > 0
    # Groups of rows that share chunks, cut where their sums are too large for one task.
    count, labels = connected_components(read.astype(int) @ read.T.astype(int))
    sharing = (np.flatnonzero(labels == label) for label in range(count))
    groups = [rows[first : first + largest] for rows in sharing for first in range(0, len(rows), largest)]
    parts = [_chain(data, weights[rows], edges, np.flatnonzero(read[rows].any(axis=0))) for rows in groups]
    order = np.argsort(np.concatenate(groups))
    together = da.concatenate(parts)
    return together if np.all(np.diff(order) == 1) else together[order]


def _chain(data, weights, edges, numbers):
    """Sums of one group, chunk after chunk: each chunk is read by one task and can be released."""
    if 8 * np.prod([max(sizes) for sizes in data.chunks[1:]]) < _IN_TURN:
        return _links(data, weights, edges, numbers)
    # Large chunks are read in turn; otherwise idle threads would load the whole cube.
    parts = np.empty(data.numblocks[1:], object)
    for place in np.ndindex(*parts.shape):
        parts[place] = _links(data.blocks[(slice(None), *place)], weights, edges, numbers, in_turn=True)
    return da.block(parts[None].tolist())


def _links(data, weights, edges, numbers, in_turn=False):
    """One chain of sums, with each chunk read after the previous sum, or at any time."""
    rest = tuple(range(1, data.ndim))
    sums, rows = (data.ndim, *rest), {data.ndim: len(weights)}
    total = ()
    for number in numbers if len(numbers) else [0]:
        part, chunk = weights[:, edges[number] : edges[number + 1]], data.blocks[number]
        if in_turn and total:
            chunk = bind(windows.alone(chunk), total[0])
        arguments = (part, None, chunk, (0, *rest), *total)
        meta = np.empty((0,) * data.ndim)
        made = da.blockwise(_add, sums, *arguments, concatenate=True, new_axes=rows, dtype=float, meta=meta)
        total, rows = (made, sums), None
    return made


def _add(weights, values, total=None):
    """Add weighted values along their first axis to sums in order, so that the bits do not depend on chunks."""
    sums = np.zeros((len(weights), *values.shape[1:])) if total is None else total.copy()
    kind = np.float32 if values.dtype == np.float32 else float
    for row, number in np.argwhere(weights):
        own = read_only(np.asarray(values[number], kind)).reshape(-1)
        _add_product(sums[row, ...].reshape(-1), own, weights[row, number])
    return sums


@compiled
def _add_product(total, values, weight):
    """Multiply and add in one pass and in double precision, without memory for products."""
    for at in range(total.size):
        total[at] += weight * values[at]


def areas(pixels):
    """Boxcar line spread functions one pixel wide."""
    down, across = grids.cell_size(pixels)
    return Boxcar(down), Boxcar(across)


def operators(spreads, cells, pixels, shifts=(0.0, 0.0)):
    """Operators from a grid of cells to a grid of pixels, for rows and columns."""
    down, across = spreads
    south, east = shifts
    a, b = cells.affine, pixels.affine
    rows = axis_operator(
        down, cell_origin=a.f, cell_size=a.e, n_cells=cells.shape.y, pixel_origin=b.f, pixel_size=b.e,
        n_pixels=pixels.shape.y, shift=south,
    )  # fmt: skip
    columns = axis_operator(
        across, cell_origin=a.c, cell_size=a.a, n_cells=cells.shape.x, pixel_origin=b.c, pixel_size=b.a,
        n_pixels=pixels.shape.x, shift=east,
    )  # fmt: skip
    return rows, columns


def regularized(array, spreads, pixels, *, shifts=(0.0, 0.0), min_valid):
    """Means over the footprints of pixels, dims (..., y, x), lazy where the array is."""
    rows, columns = operators(spreads, grids.geobox(array), pixels, shifts)
    return resample(rows, columns, array, pixels, min_valid=min_valid)


class _Covered(NamedTuple):
    """Reads of the pixels of two operators from an array, for `chunks.windows`."""

    array: object
    rows: AxisOperator
    columns: AxisOperator

    def window(self, rows, columns):
        return self.rows[rows].window, self.columns[columns].window


def resample(rows, columns, array, grid, *, min_valid=0.98):
    """Resample a raster to another grid by one operator for each axis, dims (..., y, x), lazily where the input is."""
    array = array if array.dims[-2:] == ("y", "x") else array.transpose(..., "y", "x")
    sizes, seams = None, ((), ())
    if isinstance(array.data, da.Array):
        # A pixel is computed with the chunk of its last cell; parts of earlier chunks are kept for it.
        lasts = [axis.start + np.maximum(axis.count, 1) - 1 for axis in (rows, columns)]
        sizes = tuple(chunks.runs(last, each) for last, each in zip(lasts, array.chunks[-2:], strict=True))
        # From the first pixel on that begins in a chunk, all up to the next chunk lie in it.
        edges = [np.cumsum((0, *each[:-1])) for each in array.chunks[-2:]]
        seams = tuple(
            np.unique(np.searchsorted(axis.start, each)).tolist()
            for axis, each in zip((rows, columns), edges, strict=True)
        )

    def means(these, those, cells):
        return regularize(cells, rows[these], columns[those], min_valid=min_valid)

    shape = (*array.shape[:-2], len(rows), len(columns))
    # The type that `regularize` returns.
    dtype = np.dtype(np.float32 if array.dtype == np.float32 else np.float64)
    out = chunks.windows(means, [_Covered(array.data, rows, columns)], shape, sizes, dtype, seams)
    return grids.place(chunks.with_other_cells(array, out), grid)
