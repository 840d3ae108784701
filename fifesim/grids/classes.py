"""Evaluation by class of a raster: each class computes only its cells."""

import math
from functools import partial

import numpy as np
import xarray as xr

from fifesim.base.arrays import compiled
from fifesim.base.caches import cached
from fifesim.base.geometry import ANGLES
from fifesim.grids import chunks as chunking
from fifesim.grids import grid as grids

NO_CLASS = -1
"""Code of cells without a class."""


def check_codes(codes, table):
    """Codes of classes as int16, with -1 for NaN; unknown codes raise ValueError."""
    codes = np.asarray(codes)
    if codes.dtype.kind == "f":
        codes = np.where(np.isnan(codes), NO_CLASS, codes)
    wrong = ~np.isin(codes, [NO_CLASS, *table])
    if wrong.any():
        values, counts = np.unique(codes[wrong], return_counts=True)
        most = values[np.argsort(-counts, kind="stable")][:8]
        named = ", ".join(f"{value:g}" for value in sorted(most.tolist())) + (", ..." if values.size > 8 else "")
        raise ValueError(
            f"the cover map has codes without a class: {named}, in {wrong.sum()} of {codes.size} cells. Classes are "
            f"{_listed(table)}: add a CoverClass(..., code=) for each, or mask them with .where"
        )
    return codes.astype(np.int16)


def _listed(table):
    return ", ".join(map(str, table[:12])) + (", ..." if len(table) > 12 else "")


def cells_by_class(codes, table):
    """Ascending indices of the cells of each class."""
    order, ends = np.empty(codes.size, np.int64), np.zeros(len(table) + 2, np.int64)
    _sort(np.asarray(codes, np.int16), _numbers(tuple(table)), order, ends)
    ends = ends[: len(table)]
    return np.split(order[: ends[-1]], ends[:-1]) if len(table) else []


def numbers_of(codes, table):
    """Positions of the codes of cells in a table, its length for unknown codes, and which of them occur."""
    numbers = _numbers(tuple(table))[np.asarray(codes, np.int16)]
    return numbers, np.bincount(numbers.ravel(), minlength=len(table) + 1) > 0


@cached(16, "numbers of class codes")
def _numbers(table):
    """Lookup of positions in a table by code; the last element, for the code -1, is its length."""
    numbers = np.full(2**15 + 1, len(table), np.int16)
    numbers[list(table)] = np.arange(len(table))
    return numbers


@compiled
def _sort(codes, numbers, order, ends):
    """Fill in cells sorted by class, and add the end of each class to zeros; cells without a class come last."""
    for i in range(codes.size):
        ends[numbers[codes[i]] + 1] += 1
    for number in range(1, ends.size):
        ends[number] += ends[number - 1]
    # Each entry is the start of its class, and counts up to its end.
    for i in range(codes.size):
        number = numbers[codes[i]]
        order[ends[number]] = i
        ends[number] += 1


# Cells per batch, 2 MB of each raster, so that intermediate results stay in the processor cache.
_AT_ONCE = 2**18


def by_class(kernels, cover, *scene, bands=None):
    """Raster with a separate kernel for each class of cover, dims ([band], y, x), lazy where an input is."""
    # One task per chunk; results are identical to separate evaluation of each class.
    found, parts = {}, []
    distinct = list({id(each): each for each in kernels.values()}.values())
    groups = [next(i for i, one in enumerate(distinct) if one is each) for each in kernels.values()]
    for kernel, taken in distinct:
        keys = [_identity(each) for each in taken]
        found |= {key: each for key, each in zip(keys, taken, strict=True) if key not in found}
        parts.append((kernel, tuple(list(found).index(key) for key in keys)))
    rasters = list(found.values())
    banded = tuple("band" in each.dims for each in (*scene, *rasters))
    given = (cover, *scene, *rasters)
    plain = [grids.without(each, ANGLES) if isinstance(each, xr.DataArray) else each for each in given]
    kernel = partial(_of_classes, (tuple(kernels), groups), tuple(parts), banded, bands, len(scene))
    return chunking.pointwise(kernel, *plain, bands=bands)


def _identity(raster):
    """Key that identifies rasters without reading their cells, so that rasters shared by classes are passed once."""
    if raster.chunks is not None:
        return raster.dims, raster.data.name
    if raster.ndim < 2:
        return raster.dims, raster.shape, raster.values.tobytes()
    return raster.dims, raster.shape, raster.data.strides, raster.data.__array_interface__["data"]


def _of_classes(table, parts, banded, bands, first, cover, *blocks):
    """Evaluate a block of cells in runs: the cells of each kernel are gathered, evaluated and scattered back."""
    shape = np.broadcast_shapes(cover.shape, *(block.shape[:2] for block in blocks[:first]))
    blocks = [_flat(block, has_bands, shape) for block, has_bands in zip(blocks, banded, strict=True)]
    cover, out = np.broadcast_to(cover, shape).ravel(), np.empty((bands or 1, math.prod(shape)))
    for start in range(0, cover.size, _AT_ONCE):
        run = slice(start, start + _AT_ONCE)
        within, values = [(block[run] if varies else block, varies) for block, varies in blocks], out[:, run]
        numbers, needed = _kernels_of(cover[run], *table)
        if len(needed) == 1 and -1 not in needed:
            values[...] = _evaluated(parts[needed.pop()], within, first)
            continue
        values[...] = np.nan
        for cells, part in zip(cells_by_class(numbers, range(len(parts))), parts, strict=True):
            if cells.size:
                found = _evaluated(part, [(b[cells] if varies else b, varies) for b, varies in within], first)
                # Band by band, because numpy scatters several rows at once at half the speed.
                for band, of_band in zip(values, found if bands else [found], strict=True):
                    band[cells] = of_band
    return out.reshape(((bands,) if bands else ()) + shape)


def _kernels_of(cover, codes, groups):
    """Number of the kernel of each cell, -1 without a class, and the kernels that occur."""
    numbers, present = numbers_of(cover, codes) if cover.dtype == np.int16 else (None, [True])
    if present[-1]:
        numbers, present = numbers_of(check_codes(cover, codes), codes)
    of_kernels = np.array([*groups, -1], np.int16)
    needed = set(of_kernels[present].tolist())
    return (numbers if len(needed) == 1 else of_kernels[numbers]), needed


def _evaluated(part, blocks, first):
    """Evaluate a kernel on cells of the scene, which come first, and of its rasters."""
    kernel, taken = part
    return kernel(*(block for block, _ in (*blocks[:first], *(blocks[first + index] for index in taken))))


def _flat(block, has_bands, shape):
    """Block by cells, shape (n, [band]), and whether it varies by cell."""
    if block.ndim == int(has_bands):
        return block, False
    end = block.shape[-1:] if has_bands else ()
    return np.broadcast_to(block, shape + end).reshape(-1, *end), True
