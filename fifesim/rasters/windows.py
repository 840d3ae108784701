"""Lazy arrays whose every block is one task, which gathers windows of others and hands them to a kernel."""

from collections import defaultdict
from functools import partial
from itertools import pairwise, product
from typing import NamedTuple

import dask.array as da
import numpy as np
from dask.highlevelgraph import HighLevelGraph, MaterializedLayer

# Of an array in memory beside lazy ones. [cell]
_CHUNK = 1024


class _Plan(NamedTuple):
    """How the parts of a window come together: its shape, whether parts of it lie beyond the array, and the parts."""

    shape: tuple[int, int]
    beyond: bool
    into: tuple[tuple[slice, slice], ...]
    taken: tuple[tuple[slice, slice], ...]


def array_from_windows(kernel, arrays, chunks, ask, *, token, leading=(), dtype=float, seams=((), ())):
    """
    Lazy array whose blocks are made by a kernel from windows of other lazy arrays.

    Where a window needs little of a chunk, that is cut out first, and a block made of the whole chunk waits for what is
    cut out of it, so that the chunk need not wait in memory for its neighbours. All tasks are one layer of the graph,
    and the kernel is in it once.

    Parameters
    ----------
    kernel : callable
        ``kernel(*place, *windows)`` gives a block, shape leading + (rows, columns).
    arrays : sequence of dask.array.Array or numpy.ndarray, shape (..., y, x)
    chunks : (tuple of int, tuple of int)
        Of the result over y and x.
    ask : callable
        ``ask(rows, columns)`` gives, for two slices of the result, the ``place`` that the kernel is told and the
        ``(rows, columns)`` slices of each array. Beyond an array a window is NaN.
    token : str
        Names the result: equal for equal results only.
    leading : tuple of int, optional
        Lengths of the axes of the result before y and x.
    dtype : dtype, optional
        Of the result.
    seams : (sequence of int, sequence of int), optional
        Rows and columns of the result at which windows come to lie within one chunk. Blocks are made in parts there,
        so that only the windows of rims are put together, and others are views.

    Returns
    -------
    array : dask.array.Array, shape leading + (y, x)
    """
    arrays = [_lazy(array) for array in arrays]
    name, shared = f"windows-{token}", f"windows-kernel-{token}"
    graph, rims, wholes = {shared: kernel}, defaultdict(list), {}
    starts = [[_starts(sizes) for sizes in array.chunks[-2:]] for array in arrays]
    for i, rows in enumerate(slices(chunks[0])):
        for j, columns in enumerate(slices(chunks[1])):
            made, keys, held = [], [], set()
            across = _cut_at(columns, seams[1])
            # The last part is that within a chunk, of which rims need no copies then.
            for part in reversed(list(product(_cut_at(rows, seams[0]), across))):
                place, windows = ask(*part)
                found = [_plan(*each, graph, rims, held) for each in zip(arrays, starts, windows, strict=True)]
                made.insert(0, (place, [plan for plan, _ in found]))
                keys.insert(0, [parts for _, parts in found])
            block = (name, *(0 for _ in leading), i, j)
            graph[block] = (partial(_make_parts, made, len(across)), shared, keys)
            wholes[block] = held
    for block, held in wholes.items():
        graph[block] = (*graph[block], [rim for chunk in held for rim in rims[chunk]])
    sizes = (*((length,) for length in leading), *chunks)
    layers = HighLevelGraph.from_collections(name, graph, dependencies=arrays)
    return da.Array(layers, name, sizes, dtype=dtype, meta=np.empty((0,) * len(sizes), dtype))


def lazy_together(*arrays):
    """
    Some arrays, all of them lazy where one is.

    Parameters
    ----------
    *arrays : numpy.ndarray or dask.array.Array, shape (..., y, x), or None
        None stays.

    Returns
    -------
    arrays : tuple of numpy.ndarray or dask.array.Array
        In chunks that hold all of their leading axes.
    """
    if not any(isinstance(array, da.Array) for array in arrays):
        return arrays
    return tuple(None if array is None else _lazy(array) for array in arrays)


def held(array):
    """
    A lazy array whose blocks dask makes by themselves, not as a part of what follows on them.

    Parameters
    ----------
    array : numpy.ndarray or dask.array.Array

    Returns
    -------
    array : numpy.ndarray or dask.array.Array
        The same values. ``dask.compute`` of a Dataset takes an array and another made of it, block by block, for one,
        and then misses the first.
    """
    if not isinstance(array, da.Array):
        return array
    name = f"held-{array.name}"
    graph = {(name, *index): (_same, (array.name, *index)) for index in np.ndindex(array.numblocks)}
    layers = HighLevelGraph.from_collections(name, graph, dependencies=[array])
    return da.Array(layers, name, array.chunks, dtype=array.dtype, meta=array._meta)


def slices(sizes):
    """
    Slices of chunks.

    Parameters
    ----------
    sizes : sequence of int

    Returns
    -------
    slices : list of slice

    Examples
    --------
    >>> slices((3, 2))
    [slice(0, 3, None), slice(3, 5, None)]
    """
    edges = _starts(sizes).tolist()
    return [slice(start, stop) for start, stop in pairwise(edges)]


def gather(array, window):
    """
    Window of an array in memory, NaN beyond it.

    Parameters
    ----------
    array : numpy.ndarray, shape (..., y, x)
    window : (slice, slice)
        Rows and columns, which may be negative or larger than the array.

    Returns
    -------
    window : numpy.ndarray, shape (..., rows, columns)
        A view where it can be.
    """
    parts, into = [], []
    for part, size in zip(window, array.shape[-2:], strict=True):
        start, stop = max(part.start, 0), min(part.stop, size)
        parts.append(slice(start, max(start, stop)))
        into.append(slice(start - part.start, max(start, stop) - part.start))
    shape = tuple(part.stop - part.start for part in window)
    return _joined(_Plan(shape, tuple(parts) != tuple(window), (tuple(into),), (tuple(parts),)), [array])


class _MadeByPlace(MaterializedLayer):
    """Layer of an array whose blocks are made from their place alone, as any part of it can be."""

    def __init__(self, graph, kernel):
        super().__init__(graph)
        self.kernel = kernel


def array_by_place(kernel, chunks, *, token, dtype=float):
    """
    Lazy array of a kernel that makes its cells from their place alone.

    Parameters
    ----------
    kernel : callable
        ``kernel(row, column, (rows, columns))`` gives the cells from a row and column on.
    chunks : (tuple of int, tuple of int)
    token : str
        As in `array_from_windows`.
    dtype : dtype, optional
        Of the result.

    Returns
    -------
    array : dask.array.Array, shape (y, x)
        What `array_from_windows` needs beside a chunk is made anew, not waited for.
    """
    name, shared = f"place-{token}", f"place-kernel-{token}"
    graph = {shared: kernel}
    for i, rows in enumerate(slices(chunks[0])):
        for j, columns in enumerate(slices(chunks[1])):
            graph[(name, i, j)] = _part_by_place(shared, rows, columns)
    layers = HighLevelGraph({name: _MadeByPlace(graph, shared)}, {name: set()})
    return da.Array(layers, name, chunks, dtype=dtype, meta=np.empty((0, 0), dtype))


def _part_by_place(kernel, rows, columns):
    shape = rows.stop - rows.start, columns.stop - columns.start
    return (partial(_make, (rows.start, columns.start, shape), []), kernel, [])


def _lazy(array):
    """An array in chunks that hold all of its leading axes."""
    leading = dict.fromkeys(range(array.ndim - 2), -1)
    if isinstance(array, da.Array):
        return array.rechunk(leading)
    return da.from_array(array, chunks=(*leading.values(), _CHUNK, _CHUNK), name=False)


def _same(block):
    return block


def _starts(sizes):
    return np.concatenate([[0], np.cumsum(sizes)]).astype(int)


def _plan(array, edges, window, graph, rims, held):
    """
    Where the parts of a window come from.

    Those that are little of a chunk are cut out by tasks of their own, unless the chunk is held for another part.
    """
    shape = tuple(part.stop - part.start for part in window)
    beyond = any(part.start < 0 or part.stop > size for part, size in zip(window, array.shape[-2:], strict=True))
    into, taken, keys = [], [], []
    for i, row_into, row_taken in _overlaps(edges[0], window[0]):
        for j, column_into, column_taken in _overlaps(edges[1], window[1]):
            whole = (edges[0][i + 1] - edges[0][i]) * (edges[1][j + 1] - edges[1][j])
            key = (array.name, *(0,) * (array.ndim - 2), i, j)
            part = (row_taken, column_taken)
            size = (row_taken.stop - row_taken.start) * (column_taken.stop - column_taken.start)
            if key not in held and 2 * size < whole:
                key, part = _part(array, (edges[0][i], edges[1][j]), part, key, graph, rims), (slice(None), slice(None))
            else:
                held.add(key)
            into.append((row_into, column_into))
            taken.append(part)
            keys.append(key)
    return _Plan(shape, beyond, tuple(into), tuple(taken)), keys


def _overlaps(edges, part):
    """Chunks along an axis that a slice touches, where their cells go, and which they are."""
    start, stop = max(part.start, 0), min(part.stop, int(edges[-1]))
    for index in range(int(np.searchsorted(edges, start, side="right")) - 1, int(np.searchsorted(edges, stop))):
        first, last = max(start, int(edges[index])), min(stop, int(edges[index + 1]))
        if last > first:
            before = int(edges[index])
            yield index, slice(first - part.start, last - part.start), slice(first - before, last - before)


def _part(array, start, part, chunk, graph, rims):
    """Key of a task that cuts a part off a chunk, or a task that makes the part where that takes no chunk."""
    layer = array.dask.layers.get(array.name)
    if isinstance(layer, _MadeByPlace):
        rows, columns = (
            slice(int(first) + each.start, int(first) + each.stop) for first, each in zip(start, part, strict=True)
        )
        return _part_by_place(layer.kernel, rows, columns)
    cut = (f"cut-{array.name}", *chunk[-2:], *(edge for each in part for edge in (each.start, each.stop)))
    graph[cut] = (partial(_cut, part), chunk)
    rims[chunk].append(cut)
    return cut


def _cut(part, chunk):
    return chunk[(..., *part)].copy()


def _cut_at(part, seams):
    """A slice in parts that begin at seams."""
    edges = [part.start, *(at for at in seams if part.start < at < part.stop), part.stop]
    return [slice(start, stop) for start, stop in pairwise(edges)]


def _make_parts(made, across, kernel, keys, rims):
    """A block of parts, so many of them in a row; of chunks that it takes in whole, the rims for others are cut."""
    blocks = [_make(place, plans, kernel, parts) for (place, plans), parts in zip(made, keys, strict=True)]
    if len(blocks) == 1:
        return blocks[0]
    rows = [blocks[first : first + across] for first in range(0, len(blocks), across)]
    return np.concatenate([np.concatenate(row, axis=-1) for row in rows], axis=-2)


def _make(place, plans, kernel, parts):
    return kernel(*place, *(_joined(plan, each) for plan, each in zip(plans, parts, strict=True)))


def _joined(plan, parts):
    if len(parts) == 1 and not plan.beyond:
        return parts[0][(..., *plan.taken[0])]
    dtype = np.result_type(*parts) if parts else np.float64
    leading = parts[0].shape[:-2] if parts else ()
    if plan.beyond:
        window = np.full((*leading, *plan.shape), np.nan, np.result_type(dtype, np.float32))
    else:
        window = np.empty((*leading, *plan.shape), dtype)
    for into, taken, part in zip(plan.into, plan.taken, parts, strict=True):
        window[(..., *into)] = part[(..., *taken)]
    return window
