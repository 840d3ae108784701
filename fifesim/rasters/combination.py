"""Weighted sums along a dimension of labelled arrays, such as the bands of a cube."""

import dask.array as da
import numpy as np
import xarray as xr


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
        data = da.stack([_lazy_sum(first.data, row).astype(dtype) for row in weights])
        data = data.rechunk({0: -1}) if first.data.numblocks[0] == 1 else data
    else:
        data = np.stack([_add(row, first.data) for row in weights]).astype(dtype)
    coords = {key: value.variable for key, value in array.coords.items() if dim not in value.dims}
    sums = xr.DataArray(data, dims=(name, *first.dims[1:]), coords=coords, name=array.name)
    place = ("y", "x") if {"y", "x"} <= set(array.dims) else ()
    others = [name if each == dim else each for each in array.dims if each not in place]
    return sums.transpose(*others, *place)


def _lazy_sum(data, weights):
    """The sum of a row of weights along the first axis, from one chunk of it after the other."""
    total, edges = None, np.cumsum([0, *data.chunks[0]])
    rest = tuple(range(1, data.ndim))
    for number, (start, stop) in enumerate(zip(edges[:-1], edges[1:], strict=True)):
        part = weights[start:stop]
        if not np.any(part) and (total is not None or number < len(edges) - 2):
            continue
        before = () if total is None else (total, rest)
        arguments = (part, None, data.blocks[number], (0, *rest), *before)
        total = da.blockwise(
            _add, rest, *arguments, concatenate=True, dtype=float, meta=np.empty((0,) * len(rest))
        )
    return total


def _add(weights, values, total=None):
    """Add weighted values along their first axis to a sum, one after the other: the bits do not depend on chunks."""
    total = np.zeros(values.shape[1:]) if total is None else np.array(total, float)
    for number in np.flatnonzero(weights):
        total += np.multiply(values[number], weights[number], dtype=float)
    return total
