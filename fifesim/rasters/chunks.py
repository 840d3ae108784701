"""How a kernel of numpy arrays meets dask: by cell, by place, or from windows of others."""

from itertools import combinations, product
from typing import NamedTuple

import dask.array as da
import numpy as np
import xarray as xr
from dask.base import tokenize

from fifesim.rasters import grid as grids
from fifesim.rasters.crs import with_crs_of
from fifesim.rasters.windows import array_from_windows, gather, slices


def pointwise(kernel, *arrays, bands=None, dtype=float, **parameters):
    """
    Apply a kernel cell by cell.

    Parameters
    ----------
    kernel : callable
        Takes numpy arrays that broadcast against each other, and the parameters.
    *arrays : xarray.DataArray
        Rasters on one grid, or arrays along ``band``.
    bands : int, optional
        The kernel makes a new leading axis of this many bands, and gets inputs along ``band`` with it as last axis.
    dtype : dtype, optional
        Of the result.
    **parameters
        Passed to the kernel.

    Returns
    -------
    array : xarray.DataArray
        Lazy where an input is.

    Raises
    ------
    ValueError
        If the rasters differ in grid, or in a scalar coordinate such as sza.
    """
    arrays, core = aligned(arrays), {}
    along_band = [bands is not None and "band" in array.dims for array in arrays]
    if bands is not None:
        core = {"input_core_dims": [["band"] * along for along in along_band], "output_core_dims": [["band"]]}

    def call(*blocks):
        out = np.asarray(kernel(*blocks, **parameters), dtype)
        # apply_ufunc wants new axes last; the transpose below undoes this view.
        return out if bands is None else np.moveaxis(out, 0, -1)

    def by_blocks(*data):
        lazy = any(isinstance(each, da.Array) for each in data)
        return _blockwise(call, data, along_band, bands, dtype) if lazy else call(*data)

    # Variables have no coordinates to align, which takes longer than the kernel on small rasters.
    variables = [array.variable for array in arrays]
    out = xr.apply_ufunc(by_blocks, *variables, dask="allowed", keep_attrs=True, **core)
    dims = [name for name in ("band", "y", "x") if name in out.dims]
    return xr.DataArray(out.transpose(*dims, ...), coords=_shared_coordinates(arrays, out.dims), name=_name(arrays))


def _name(arrays):
    """Name that all named arrays share, else None."""
    names = {array.name for array in arrays}
    return names.pop() if len(names) == 1 else None


def _shared_coordinates(arrays, dims):
    """Coordinates of aligned arrays along some dimensions; those that differ are left out."""
    variables, indexes, differing = {}, {}, set()
    for array in arrays:
        for name, variable in array.coords.variables.items():
            if not set(variable.dims) <= set(dims):
                continue
            if name not in variables:
                variables[name] = variable
            elif name not in dims and not (variables[name] is variable or variables[name].equals(variable)):
                differing.add(name)
        indexes |= {name: each for name, each in array.xindexes.items() if name not in indexes and name in variables}
    known = {name: variable for name, variable in variables.items() if name not in differing}
    return xr.Coordinates(known, indexes=indexes)


def _blockwise(call, data, along_band, bands, dtype):
    """
    An array of which a block is made of those of others: its last axis is new, of so many bands.

    dask's own gufuncs put the blocks along such an axis together, which copies one, too.
    """
    loops = max(each.ndim - along for each, along in zip(data, along_band, strict=True))
    arguments, last = [], {loops: bands} if bands is not None else {}
    for each, along in zip(data, along_band, strict=True):
        if along and isinstance(each, da.Array):
            # A file opened lazily has one band a chunk, and the kernel wants all.
            each = each.rechunk({-1: -1})
        axes = (*range(loops - each.ndim + along, loops), *(loops,) * along)
        whole = isinstance(each, np.ndarray) and each.ndim == along
        arguments += [each, None if whole else axes]
    known = any(loops in (axes or ()) for axes in arguments[1::2])
    how = {"adjust_chunks" if known else "new_axes": last}
    meta = np.empty((0,) * (loops + len(last)), dtype)
    return da.blockwise(call, (*range(loops), *last), *arguments, dtype=dtype, meta=meta, **how)


class Reads(NamedTuple):
    """
    What each cell of a result reads of an array: from its row ``rows[0]`` up to ``rows[1]``, and so its columns.

    Rows and columns that the array does not have are NaN.
    """

    array: np.ndarray | da.Array  # shape (..., y, x)
    rows: tuple[np.ndarray, np.ndarray]
    columns: tuple[np.ndarray, np.ndarray]

    def window(self, rows, columns):
        """
        Slices that a block of the result reads.

        Parameters
        ----------
        rows, columns : slice
            Of the result.

        Returns
        -------
        rows, columns : slice
        """
        return tuple(
            slice(int(start[block.start]), int(stop[block.stop - 1]))
            for (start, stop), block in ((self.rows, rows), (self.columns, columns))
        )


def margin_reads(array, rows, columns=None, offset=(0, 0), shape=None):
    """
    Reads of cells that need a margin around them; beyond the array it is NaN.

    Parameters
    ----------
    array : numpy.ndarray or dask.array.Array, shape (..., y, x)
    rows : int
        Margin. [cell]
    columns : int, optional
        The same by default. [cell]
    offset : (int, int), optional
        Row and column of the array that the first cell of the result lies on.
    shape : (int, int), optional
        Of the result; as far as the array goes by default.

    Returns
    -------
    reads : Reads
    """
    columns = rows if columns is None else columns
    if (rows or columns) and array.dtype.kind != "f":
        # Missing is NaN, which integers do not have.
        array = array.astype(float)
    if shape is None:
        shape = array.shape[-2] - offset[0], array.shape[-1] - offset[1]
    cells = [first + np.arange(size) for first, size in zip(offset, shape, strict=True)]
    return Reads(array, *((at - depth, at + depth + 1) for at, depth in zip(cells, (rows, columns), strict=True)))


def windows(kernel, reads, shape, chunks=None, dtype=float, seams=((), ())):
    """
    Array whose every block is made from windows of others.

    Parameters
    ----------
    kernel : callable
        ``kernel(rows, columns, *blocks)`` gives the cells of two slices of the result from the windows that they read.
    reads : sequence of Reads
        Or of others with an ``array`` and its ``window(rows, columns)``.
    shape : (..., int, int)
        Of the result; its last axes are y and x.
    chunks : (tuple of int, tuple of int), optional
        Of a lazy result over y and x. Without them all is made at once.
    dtype : dtype, optional
        Of a lazy result.
    seams : (sequence of int, sequence of int), optional
        As in `array_from_windows`, of a kernel that makes the same of a block in parts.

    Returns
    -------
    array : numpy.ndarray or dask.array.Array
    """
    if chunks is None:
        whole = [slice(0, size) for size in shape[-2:]]
        return kernel(*whole, *(gather(each.array, each.window(*whole)) for each in reads))

    def ask(rows, columns):
        return (rows, columns), [each.window(rows, columns) for each in reads]

    token = tokenize(kernel, reads, shape, chunks)
    arrays, leading = [each.array for each in reads], shape[:-2]
    how = {"token": token, "leading": leading, "dtype": dtype, "seams": seams}
    return array_from_windows(kernel, arrays, chunks, ask, **how)


def along_first(array):
    """
    The entries of an array along its first axis, as views of it.

    Parameters
    ----------
    array : numpy.ndarray or dask.array.Array, shape (n, ...)
        In one chunk along that axis.

    Returns
    -------
    entries : tuple of numpy.ndarray or dask.array.Array
        By an index, dask would copy them.
    """
    if isinstance(array, np.ndarray):
        return tuple(array)
    axes = tuple(range(array.ndim))
    meta = np.empty((0,) * (array.ndim - 1), array.dtype)
    return tuple(da.blockwise(_entry, axes[1:], array, axes, k, None, meta=meta) for k in range(array.shape[0]))


def _entry(chunks, k):
    # Along an axis that a result lacks, dask hands over a list of chunks.
    (chunk,) = chunks
    return chunk[k]


def in_blocks(kernel, reads, shape, size, dtype=float):
    """
    Array that is made by fixed blocks, however it is read.

    Parameters
    ----------
    kernel, reads, shape
        As in `windows`.
    size : int
        Rows and columns of a block, counted from the first cell.
    dtype : dtype, optional
        Of the result.

    Returns
    -------
    array : numpy.ndarray or dask.array.Array
        Lazy where one of the arrays is; else its blocks are made one after the other, which bounds the memory.
    """
    sizes = tuple(tuple(np.diff([*range(0, length, size), length]).tolist()) for length in shape[-2:])
    if any(isinstance(each.array, da.Array) for each in reads):
        return windows(kernel, reads, shape, sizes, dtype)
    out = np.empty(shape, dtype)
    for block in product(*map(slices, sizes)):
        out[(..., *block)] = kernel(*block, *(gather(each.array, each.window(*block)) for each in reads))
    return out


def neighbourhood(kernel, array, depth, bands=0, *, located=False):
    """
    Apply a kernel that needs cells around each.

    Parameters
    ----------
    kernel : callable
        Takes a block with a margin, NaN beyond the raster, and returns it without.
    array : xarray.DataArray, dims (y, x)
    depth : int
        Margin. [cell]
    bands : int, optional
        The kernel makes a new leading axis ``band`` of this many.
    located : bool, optional
        The kernel takes the rows and columns of the block, as slices, before it.

    Returns
    -------
    array : xarray.DataArray, dims ([band], y, x)
        Lazy, in the same chunks, where the input is; the same bits whatever these are.
    """
    array = array.transpose("y", "x")
    chunks = array.chunks
    shape = (bands,) * bool(bands) + array.shape
    by_place = kernel if located else lambda rows, columns, block: kernel(block)
    data = windows(by_place, [margin_reads(array.data, depth)], shape, chunks)
    dims = ("band",) * bool(bands) + ("y", "x")
    return xr.DataArray(data, dims=dims, coords=other_coordinates(array))


def other_coordinates(array):
    """
    Coordinates of a raster that are not by cells.

    Parameters
    ----------
    array : xarray.DataArray

    Returns
    -------
    coordinates : dict of str to xarray.DataArray
    """
    return {name: value for name, value in array.coords.items() if not {"y", "x"} & set(value.dims)}


def runs(cells, chunks):
    """
    Chunks of a sorted selection of cells, so that each selects from one chunk of all.

    Parameters
    ----------
    cells : array of int, shape (n,)
    chunks : sequence of int
        Sizes of the chunks of all cells.

    Returns
    -------
    sizes : tuple of int
        Of runs in the selection; they sum to n.

    Examples
    --------
    >>> runs(np.array([1, 4, 7, 10]), (5, 3, 4))
    (2, 1, 1)
    """
    chunk = np.minimum(np.searchsorted(np.cumsum(chunks), cells, side="right"), len(chunks) - 1)
    starts = np.flatnonzero(np.diff(chunk, prepend=-1))
    return tuple(np.diff([*starts, len(chunk)]).tolist())


def _is_raster(array):
    return isinstance(array, xr.DataArray) and {"y", "x"} <= set(array.dims)


def _with_crs(arrays):
    """The same, where rasters without a CRS lie on the cells of one that has it."""
    rasters = [array for array in arrays if _is_raster(array)]
    known = [array for array in rasters if array.odc.crs is not None] if rasters[1:] else []
    if len(known) in (0, len(rasters)):
        return arrays
    return [with_crs_of(array, known[0]) if _is_raster(array) else array for array in arrays]


def aligned(arrays):
    """
    Rasters with the coordinates of one on all.

    Parameters
    ----------
    arrays : sequence of xarray.DataArray
        Those without dimensions y and x stay as they are; one that has lost its CRS takes that of the others.

    Returns
    -------
    arrays : list of xarray.DataArray

    Raises
    ------
    ValueError
        If they do not share their cells, or a scalar coordinate such as sza differs.
    """
    rasters = [array for array in arrays if _is_raster(array)]
    if len(rasters) < 2:
        return list(arrays)
    if grids.on_same_coordinates(rasters):
        for one, other in combinations(rasters, 2):
            _check_scalars(one, other)
        return list(arrays)
    arrays = _with_crs(arrays)
    rasters = [array for array in arrays if _is_raster(array)]
    placed = [(array, grids.geobox(array)) for array in rasters]
    for (one, own), (other, others) in combinations(placed, 2):
        if not grids.same_grid(own, others):
            raise ValueError(
                f"{one.name!r} and {other.name!r} lie on different grids, {grids.in_words(own)} and "
                f"{grids.in_words(others)}: bring one onto the other's first"
            )
        _check_scalars(one, other)
    # xarray aligns to the bit, and coordinates from elsewhere differ by rounding.
    place = {axis: rasters[0].coords[axis].variable for axis in ("y", "x")}
    return [array.assign_coords(place) if any(array is each for each in rasters[1:]) else array for array in arrays]


def _check_scalars(one, other):
    """Raise ValueError if a scalar coordinate such as sza differs."""
    known, others = one.coords.variables, other.coords.variables
    for name in set(known) & set(others) - {"spatial_ref"}:
        a, b = known[name], others[name]
        if a is not b and a.ndim == 0 and a.dtype.kind in "fiu" and not np.array_equal(a, b, equal_nan=True):
            raise ValueError(f"{name} is {float(a):g} in {one.name!r} and {float(b):g} in {other.name!r}")
