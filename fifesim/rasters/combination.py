"""Weighted sums along a dimension of labelled arrays, such as the bands of a cube."""

import dask.array as da
import numpy as np
import xarray as xr
from dask.graph_manipulation import bind
from dask.highlevelgraph import HighLevelGraph
from numba import vectorize
from scipy.sparse.csgraph import connected_components

# Bytes of the sums that one task makes, from which bands are summed by themselves.
_LARGEST_SUM = 2**26

# Bytes of a sum from which its chunks are read in turn.
_IN_TURN = 2**24


def combined(array, dim, weights, name="band"):
    """
    Weighted sums along a dimension.

    Parameters
    ----------
    array : xarray.DataArray
        With a dimension ``dim`` of n.
    dim : str
    weights : array, shape (m, n)
        What is 0 is not read, and its NaN does not count. [1]
    name : str, optional
        Of the new dimension of m.

    Returns
    -------
    sums : xarray.DataArray
        With ``name`` in the place of ``dim``, or before y and x; in single precision where the array is. Lazy where
        the array is, in its chunks along all other dimensions, and the same bits whatever these are.

    Notes
    -----
    Sums run along the chunks of ``dim`` one after the other, so that a task holds one chunk of the array and one
    sum. A cube with a chunk for each band is never gathered, and has a chunk for each band again.
    """
    weights = np.asarray(weights, float)
    first = array.transpose(dim, ...)
    dtype = np.result_type(array.dtype, np.float32)
    if isinstance(first.data, da.Array):
        data = _lazy_sums(first.data, weights).astype(dtype)
    else:
        data = _add(weights, first.data).astype(dtype)
    coords = {key: value.variable for key, value in array.coords.items() if dim not in value.dims}
    sums = xr.DataArray(data, dims=(name, *first.dims[1:]), coords=coords, name=array.name)
    place = ("y", "x") if {"y", "x"} <= set(array.dims) else ()
    others = [name if each == dim else each for each in array.dims if each not in place]
    return sums.transpose(*others, *place)


def _lazy_sums(data, weights):
    """Weighted sums along the first axis. Rows of weights that read the same chunks go together."""
    edges = np.cumsum([0, *data.chunks[0]])
    cells = np.prod([max(sizes) for sizes in data.chunks[1:]])
    largest = max(int(_LARGEST_SUM // (8 * cells)), 1)
    read = np.add.reduceat(weights != 0, edges[:-1], axis=1) > 0
    groups = [part for rows in _sharing(read) for part in _split(rows, largest)]
    parts = [_chain(data, weights[rows], edges, np.flatnonzero(read[rows].any(axis=0))) for rows in groups]
    order = np.argsort(np.concatenate(groups))
    together = da.concatenate(parts)
    return together if np.all(np.diff(order) == 1) else together[order]


def _sharing(read):
    """Groups of rows of which each shares a chunk with another of its group; rows that read nothing go together."""
    _, labels = connected_components(read.astype(int) @ read.T.astype(int))
    return [np.flatnonzero(labels == label) for label in range(labels.max() + 1)]


def _split(rows, largest):
    return [rows[first : first + largest] for first in range(0, len(rows), largest)]


def _chain(data, weights, edges, numbers):
    """The sums of one group, from one chunk after the other: each is read by one task, and may go then."""
    if 8 * np.prod([max(sizes) for sizes in data.chunks[1:]]) < _IN_TURN:
        return _links(data, weights, edges, numbers)
    # Large chunks are read in turn: an idle thread would read on, and all of a cube would wait to be added.
    parts = np.empty(data.numblocks[1:], object)
    for place in np.ndindex(*parts.shape):
        parts[place] = _links(data.blocks[(slice(None), *place)], weights, edges, numbers, in_turn=True)
    return da.block(parts[None].tolist())


def _alone(chunk):
    """The same array with no more of its graph than it needs."""
    graph = {chunk.name: chunk.dask.cull(chunk.__dask_keys__()).to_dict()}
    return da.Array(HighLevelGraph(graph, {chunk.name: set()}), chunk.name, chunk.chunks, meta=chunk._meta)


def _links(data, weights, edges, numbers, in_turn=False):
    """One chain, each chunk of which is read when the sum before is there, or whenever there is time."""
    rest = tuple(range(1, data.ndim))
    sums, rows = (data.ndim, *rest), {data.ndim: len(weights)}
    total = ()
    for number in numbers if len(numbers) else [0]:
        part, chunk = weights[:, edges[number] : edges[number + 1]], data.blocks[number]
        if in_turn and total:
            chunk = bind(_alone(chunk), total[0])
        arguments = (part, None, chunk, (0, *rest), *total)
        meta = np.empty((0,) * data.ndim)
        made = da.blockwise(_add, sums, *arguments, concatenate=True, new_axes=rows, dtype=float, meta=meta)
        total, rows = (made, sums), None
    return made


def _add(weights, values, total=None):
    """Add weighted values along their first axis to sums, one after the other: the bits do not depend on chunks."""
    sums = np.zeros((len(weights), *values.shape[1:])) if total is None else total.copy()
    for row, number in np.argwhere(weights):
        _add_product(sums[row], values[number], weights[row, number], out=sums[row, ...])
    return sums


@vectorize(["float64(float64, float32, float64)", "float64(float64, float64, float64)"], cache=True)
def _add_product(total, value, weight):
    """In one pass and in double precision: a plane of a cube leaves no room for products by the side."""
    return total + weight * value
