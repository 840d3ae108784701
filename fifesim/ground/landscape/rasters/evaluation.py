"""What differs by class of cover, on labelled rasters: each class is evaluated on its own cells alone."""

import math
from functools import partial

import numpy as np

from fifesim.base.geometry import ANGLES
from fifesim.ground.landscape.compression import cells_by_class, check_codes, numbers_of
from fifesim.rasters import chunks as chunking

# Cells that are evaluated at once, 2 MB of each raster: what is made between stays in a processor's cache.
_AT_ONCE = 2**18


def by_class(kernels, cover, *scene, bands=None):
    """
    A raster of which each class of cover has its own kernel.

    Parameters
    ----------
    kernels : dict of int to (callable, sequence of xarray.DataArray)
        Of each code: ``kernel(*cells)`` gives values of shape ([band], n) from n cells of the scene and of the rasters
        beside it. What has bands has them as last axis; what is no raster is given as it is. Classes that have the same
        one, of the same identity, are evaluated together.
    cover : xarray.DataArray, dims (y, x)
        Codes; -1 and NaN give NaN.
    *scene : xarray.DataArray, dims (y, x)
        Rasters that all kernels take first.
    bands : int, optional
        Of the result.

    Returns
    -------
    array : xarray.DataArray, dims ([band], y, x)
        Lazy where an input is; one task for a chunk, and the same bits as of each class alone.

    Raises
    ------
    ValueError
        If the rasters lie on different grids; when computed, if a cell has another code.
    """
    found, parts = {}, []
    distinct = list({id(each): each for each in kernels.values()}.values())
    groups = [next(i for i, one in enumerate(distinct) if one is each) for each in kernels.values()]
    for kernel, taken in distinct:
        keys = [_identity(each) for each in taken]
        found |= {key: each for key, each in zip(keys, taken, strict=True) if key not in found}
        parts.append((kernel, tuple(list(found).index(key) for key in keys)))
    rasters = list(found.values())
    banded = tuple("band" in each.dims for each in (*scene, *rasters))
    plain = [each.drop_vars(ANGLES, errors="ignore") for each in (cover, *scene, *rasters)]
    kernel = partial(_of_classes, (tuple(kernels), groups), tuple(parts), banded, bands, len(scene))
    return chunking.pointwise(kernel, *plain, bands=bands)


def _identity(raster):
    """What tells rasters apart without a look at their cells: those that classes share are handed over once."""
    if raster.chunks is not None:
        return raster.dims, raster.data.name
    if raster.ndim < 2:
        return raster.dims, raster.shape, raster.values.tobytes()
    return raster.dims, raster.shape, raster.data.strides, raster.data.__array_interface__["data"]


def _of_classes(table, parts, banded, bands, first, cover, *blocks):
    """A block of cells, run by run: those of each kernel are put together, evaluated and put back."""
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
                # Band by band: numpy puts cells of several rows at once back at half the speed.
                for band, of_band in zip(values, found if bands else [found], strict=True):
                    band[cells] = of_band
    return out.reshape(((bands,) if bands else ()) + shape)


def _kernels_of(cover, codes, groups):
    """Number of the kernel of each cell, -1 where there is no class, and which of these numbers there are."""
    numbers, present = numbers_of(cover, codes) if cover.dtype == np.int16 else (None, [True])
    if present[-1]:
        numbers, present = numbers_of(check_codes(cover, codes), codes)
    of_kernels = np.array([*groups, -1], np.int16)
    needed = set(of_kernels[present].tolist())
    return (numbers if len(needed) == 1 else of_kernels[numbers]), needed


def _evaluated(part, blocks, first):
    """What a kernel gives of cells of the scene, which comes first, and of the rasters that it takes."""
    kernel, taken = part
    return kernel(*(block for block, _ in (*blocks[:first], *(blocks[first + index] for index in taken))))


def _flat(block, has_bands, shape):
    """A block by cells, shape (n, [band]), and whether it is by cells at all."""
    if block.ndim == int(has_bands):
        return block, False
    end = block.shape[-1:] if has_bands else ()
    return np.broadcast_to(block, shape + end).reshape(-1, *end), True
