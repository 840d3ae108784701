"""Application of numpy kernels to dask arrays: by cell, by position, in two passes, or from windows."""

import sys
from concurrent.futures import Future
from functools import partial
from itertools import combinations, product
from threading import Lock
from typing import NamedTuple

import dask
import dask.array as da
import numpy as np
import xarray as xr
from dask.base import tokenize
from dask.graph_manipulation import bind

from fifesim.base.caches import Results
from fifesim.grids import grid as grids
from fifesim.grids.grid import with_crs_of
from fifesim.grids.windows import array_from_windows, gather, slices


def pointwise(kernel, *arrays, bands=None, dtype=float, **parameters):
    """Apply a kernel cell by cell to rasters on one grid, lazily where an input is."""
    # The kernel takes bands along the last axis and returns them along the first. xarray.apply_ufunc aligns coordinates
    # and wants new axes last, which takes longer than the kernel on small rasters.
    arrays = aligned(arrays)
    variables = [getattr(array, "variable", array) for array in arrays]
    cells = list(dict.fromkeys([name for each in variables for name in each.dims if bands is None or name != "band"]))
    blocks = [_with_axes(each, cells) for each in variables]
    if [each for each in blocks if isinstance(each, da.Array)]:
        along_band = [bands is not None and "band" in each.dims for each in variables]
        data = _blockwise(partial(_typed, partial(kernel, **parameters), dtype), blocks, along_band, bands, dtype)
    else:
        data = np.asarray(kernel(*blocks, **parameters), dtype)
    out = xr.Variable(cells if bands is None else ["band", *cells], data, variables[0].attrs)
    names = dict.fromkeys([getattr(array, "name", None) for array in arrays])
    first = [name for name in ("band", "y", "x") if name in out.dims]
    ordered = out if out.dims[: len(first)] == tuple(first) else out.transpose(*first, ...)
    return grids.raster_of(ordered, *_shared_coordinates(arrays, out.dims), *names if len(names) == 1 else ())


def _with_axes(variable, cells):
    """Data with axes in the order of some dimensions, then bands, which broadcast as arrays of numpy do."""
    known, dims = [*filter(variable.dims.__contains__, cells)], variable.dims
    order = [*map(dims.index, known), *(axis for axis, name in enumerate(dims) if name not in known)]
    # Transposing a variable takes 20 us, and an array 1 us.
    data = variable.data if order == sorted(order) else variable.data.transpose(order)
    # Missing axes in front are added by broadcasting.
    axes = cells[cells.index(known[0]) :] if known else known
    return data if axes == known else data[tuple([slice(None) if name in known else None for name in axes])]


def _typed(kernel, dtype, *blocks):
    return np.asarray(kernel(*blocks), dtype)


def _shared_coordinates(arrays, dims):
    """Coordinates of aligned arrays along some dimensions, and their indexes; those that differ are dropped."""
    variables, indexes, differing = {}, {}, set()
    for array in arrays:
        if not isinstance(array, xr.DataArray):
            continue
        for name, variable in array.coords.variables.items():
            if not set(variable.dims) <= set(dims):
                continue
            if name not in variables:
                variables[name] = variable
            elif name not in dims and not (variables[name] is variable or variables[name].equals(variable)):
                differing.add(name)
        for name, index in array.xindexes.items():
            if name in variables:
                indexes.setdefault(name, index)
    for name in differing:
        del variables[name]
    return variables, indexes


def _blockwise(call, data, along_band, bands, dtype):
    """Array whose blocks are made from the blocks of others, with a new first axis for bands."""
    # The gufuncs of dask concatenate blocks along such an axis, and copy even a single one.
    loops = max(each.ndim - along for each, along in zip(data, along_band, strict=True))
    arguments, first = [], {loops: bands} if bands is not None else {}
    for each, along in zip(data, along_band, strict=True):
        if along and isinstance(each, da.Array):
            # A lazily opened file has one band per chunk, but the kernel needs all bands.
            each = each.rechunk({-1: -1})
        axes = (*range(loops - each.ndim + along, loops), *(loops,) * along)
        whole = isinstance(each, np.ndarray) and each.ndim == along
        arguments += [each, None if whole else axes]
    known = any(loops in (axes or ()) for axes in arguments[1::2])
    sizes = {"adjust_chunks" if known else "new_axes": first}
    meta = np.empty((0,) * (loops + len(first)), dtype)
    return da.blockwise(call, (*first, *range(loops)), *arguments, dtype=dtype, meta=meta, **sizes)


class Reads(NamedTuple):
    """Window of an array that each cell of a result reads, by rows and columns; outside of the array it is NaN."""

    array: np.ndarray | da.Array  # shape (..., y, x)
    rows: tuple[np.ndarray, np.ndarray]
    columns: tuple[np.ndarray, np.ndarray]

    def window(self, rows, columns):
        """Slices that a block of the result reads."""
        return tuple(
            slice(int(start[block.start]), int(stop[block.stop - 1]))
            for (start, stop), block in ((self.rows, rows), (self.columns, columns))
        )


def margin_reads(array, rows, columns=None, offset=(0, 0), shape=None):
    """Reads of cells with a margin around them, NaN outside of the array."""
    columns = rows if columns is None else columns
    if (rows or columns) and array.dtype.kind != "f":
        # Integers have no NaN for missing values.
        array = array.astype(float)
    if shape is None:
        shape = array.shape[-2] - offset[0], array.shape[-1] - offset[1]
    cells = [first + np.arange(size) for first, size in zip(offset, shape, strict=True)]
    return Reads(array, *((at - depth, at + depth + 1) for at, depth in zip(cells, (rows, columns), strict=True)))


def windows(kernel, reads, shape, chunks=None, dtype=float, seams=((), ())):
    """Array whose blocks are made from windows of other arrays."""
    if chunks is None:
        whole = [slice(0, size) for size in shape[-2:]]
        return kernel(*whole, *(gather(each.array, each.window(*whole)) for each in reads))

    def ask(rows, columns):
        return (rows, columns), [each.window(rows, columns) for each in reads]

    arrays, token = [each.array for each in reads], tokenize(kernel, reads, shape, chunks)
    return array_from_windows(kernel, arrays, chunks, ask, token=token, leading=shape[:-2], dtype=dtype, seams=seams)


def along_first(array):
    """Entries of an array along its first axis, as views without copies of dask."""
    if isinstance(array, np.ndarray):
        return tuple(array)
    axes = tuple(range(array.ndim))
    meta = np.empty((0,) * (array.ndim - 1), array.dtype)
    return tuple(da.blockwise(_entry, axes[1:], array, axes, k, None, meta=meta) for k in range(array.shape[0]))


def _entry(chunks, k):
    # Along an axis missing in the result, dask passes a list of chunks.
    (chunk,) = chunks
    return chunk[k]


def in_blocks(kernel, reads, shape, size, dtype=float):
    """Array made in fixed blocks for any chunks, lazy if an input is; in memory, one block at a time."""
    sizes = tuple(tuple(np.diff([*range(0, length, size), length]).tolist()) for length in shape[-2:])
    if any(isinstance(each.array, da.Array) for each in reads):
        return windows(kernel, reads, shape, sizes, dtype)
    out = np.empty(shape, dtype)
    for block in product(*map(slices, sizes)):
        out[(..., *block)] = kernel(*block, *(gather(each.array, each.window(*block)) for each in reads))
    return out


def neighbourhood(kernel, array, depth, *, located=False):
    """Apply a kernel with a margin of cells, dims (y, x), lazily, with identical bits for any chunks."""
    array = array.transpose("y", "x")
    by_place = kernel if located else lambda rows, columns, block: kernel(block)
    data = windows(by_place, [margin_reads(array.data, depth)], array.shape, array.chunks)
    return xr.DataArray(data, dims=("y", "x"), coords=other_coordinates(array))


def other_coordinates(array):
    """Coordinates of a raster without dimensions y and x."""
    return {name: value for name, value in array.coords.items() if not {"y", "x"} & set(value.dims)}


def with_other_cells(array, data):
    """Raster of new cells with dimensions, name and attributes of another, without coordinates by cell."""
    kept = {name: each for name, each in array.coords.variables.items() if not {"y", "x"} & set(each.dims)}
    indexes = {name: index for name, index in array.xindexes.items() if name in kept}
    return grids.raster_of(xr.Variable(array.dims, data, array.attrs), kept, indexes, array.name)


def runs(cells, chunks):
    """Chunks of a sorted selection of cells, each of which selects from one chunk of the source."""
    chunk = np.minimum(np.searchsorted(np.cumsum(chunks), cells, side="right"), len(chunks) - 1)
    starts = np.flatnonzero(np.diff(chunk, prepend=-1))
    return tuple(np.diff([*starts, len(chunk)]).tolist())


def aligned(arrays):
    """Rasters with common coordinates, after a check that their grids agree; other arrays stay."""
    rasters = [array for array in arrays if isinstance(array, xr.DataArray) and {"y", "x"} <= set(array.dims)]
    if len(rasters) < 2:
        return list(arrays)
    if grids.on_same_coordinates(rasters):
        for one, other in combinations(rasters, 2):
            _check_scalars(one, other)
        return list(arrays)
    # Rasters without a CRS take the CRS of another one on the same cells.
    known = [array for array in rasters if array.odc.crs is not None]
    if 0 < len(known) < len(rasters):
        placed = {id(array): with_crs_of(array, known[0]) for array in rasters}
        arrays, rasters = [placed.get(id(array), array) for array in arrays], list(placed.values())
    placed = [(array, grids.geobox(array)) for array in rasters]
    for (one, own), (other, others) in combinations(placed, 2):
        if not grids.same_grid(own, others):
            raise ValueError(
                f"{one.name!r} and {other.name!r} have different grids, {grids.in_words(own)} and "
                f"{grids.in_words(others)}: {grids.onto_words(own, others)}"
            )
        _check_scalars(one, other)
    # xarray requires identical coordinates, but coordinates from other sources differ by rounding.
    place = {axis: rasters[0].coords[axis].variable for axis in ("y", "x")}
    return [array.assign_coords(place) if any(array is each for each in rasters[1:]) else array for array in arrays]


def _check_scalars(one, other):
    """Raise ValueError if a scalar coordinate such as sza differs."""
    known, others = one.coords.variables, other.coords.variables
    for name in set(known) & set(others) - {"spatial_ref"}:
        a, b = known[name], others[name]
        if a is not b and a.ndim == 0 and a.dtype.kind in "fiu" and not np.array_equal(a, b, equal_nan=True):
            raise ValueError(f"{name} is {float(a):g} in {one.name!r} and {float(b):g} in {other.name!r}")


def whole_reads(array, shape):
    """Reads of a whole array by every cell of a result."""
    rows, columns = ((np.zeros(size, int), np.full(size, n)) for size, n in zip(shape, array.shape[-2:], strict=True))
    return Reads(array, rows, columns)


def windows_by_band(kernels, reads, bands, shape, chunks=None):
    """Array made by `chunks.windows` with a different kernel for each group of bands, which are its chunks."""
    parts = []
    for kernel, group in zip(kernels, slices(bands), strict=True):
        of_group = [each._replace(array=each.array[group]) for each in reads]
        parts.append(windows(kernel, of_group, (group.stop - group.start, *shape), chunks))
    if chunks is not None:
        return da.concatenate(parts)
    return np.concatenate(parts) if len(parts) > 1 else parts[0]


def second_pass(array, first):
    """Copy of a lazy raster that is recomputed in a second pass, instead of being held in memory."""
    if array.chunks is None:
        return array
    return array.copy(data=bind(array.data, first, seed=first.name))


def by_band(values, main):
    """Raster of bands from a number or a raster for each, dims (band, y, x), lazy where one of them is."""
    for name, value in values.items():
        if np.ndim(value) and (not isinstance(value, xr.DataArray) or set(value.dims) != {"y", "x"}):
            got = f"dimensions {value.dims}" if isinstance(value, xr.DataArray) else type(value).__name__
            raise ValueError(f"{name} must be a number, or one raster (xarray.DataArray) over (y, x), got {got}")
    on_one_grid = iter(aligned([with_crs_of(value, main) for value in values.values() if np.ndim(value)]))
    rasters = [next(on_one_grid).astype(float) if np.ndim(value) else float(value) for value in values.values()]
    like = next(each for each in rasters if np.ndim(each))
    layers = [each if np.ndim(each) else xr.full_like(like, each) for each in rasters]
    plain = [each.transpose("y", "x").drop_vars(set(each.coords) - {"y", "x", "spatial_ref"}) for each in layers]
    names = xr.Variable("band", np.array(list(values), dtype=str))
    options = {"join": "exact", "coords": "minimal", "compat": "override", "combine_attrs": "drop"}
    return xr.concat(plain, dim="band", **options).assign_coords(band=names)


def layers_of(raster, names, what):
    """Layers of a raster for some bands, dims (y, x); a raster without bands serves all."""
    if not isinstance(raster, xr.DataArray) or {"y", "x"} - set(raster.dims):
        raise ValueError(f"the {what} is a raster (xarray.DataArray) over ([band], y, x), got {type(raster).__name__}")
    if "band" not in raster.dims:
        return [raster.drop_vars("band", errors="ignore")] * len(names)
    known = raster["band"].values.tolist()
    if missing := [name for name in names if name not in known]:
        raise ValueError(f"the {what} lacks band {', '.join(missing)}, it has {', '.join(map(str, known))}")
    return [raster.isel(band=known.index(name)) for name in names]


# Number and maximum size of cached arrays, 32 MB in total. A sampled ground property may depend on other samples.
_KEPT, _FEW = 8, 2**19


def apart(array):
    """Lazy array in one chunk whose values come from one task, separate from the tasks of other arrays."""
    # Otherwise the blocks of a sampled raster that are also used elsewhere would all stay in memory. (Copies of a graph
    # by dask lack tasks of rechunked arrays.)
    return all_apart([array])[0]


def all_apart(arrays):
    """Lazy arrays from one common task, which computes shared parts once."""
    names = "-".join(array.name for array in arrays)
    values = dask.delayed(_computed)(_Sealed(tuple(arrays), names), dask_key_name=f"apart-{names}")
    return [da.from_delayed(values[i], each.shape, dtype=each.dtype) for i, each in enumerate(arrays)]


class _Sealed:
    """Arrays that dask passes unchanged, unlike a dataclass, whose fields it inspects."""

    def __init__(self, arrays, name):
        self.arrays, self.name = arrays, name

    def __dask_tokenize__(self):
        return self.name


_known = Results(_KEPT, "samples of rasters")
_asked = Lock()


def _computed(sealed):
    """Values of arrays, computed once by all threads of a process."""
    if sum(array.size for array in sealed.arrays) > _FEW:
        return _compute_arrays(sealed)
    with _asked:
        found = _known.get(sealed.name)
        if mine := found is None:
            found = _known[sealed.name] = Future()
    if mine:
        try:
            found.set_result(_compute_arrays(sealed))
        except BaseException as error:
            with _asked:
                _known.pop(sealed.name, None)
            found.set_exception(error)
    return tuple(each.copy() for each in found.result())


def _compute_arrays(sealed):
    # This thread belongs to a scheduler; another scheduler in it would deadlock.
    return dask.compute(*sealed.arrays, scheduler="synchronous")


def found_client():
    """Current client of a cluster, or None; distributed, which is slow to import, is not imported."""
    distributed = sys.modules.get("distributed")
    if distributed is None:
        return None
    try:
        return distributed.get_client()
    except ValueError:
        return None
