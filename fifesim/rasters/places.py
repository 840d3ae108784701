"""Arrays of kernels that are told where their cells lie."""

from itertools import product

import dask.array as da
import numpy as np
import xarray as xr
from dask.base import tokenize

from fifesim.rasters import grid as grids
from fifesim.rasters.windows import array_by_place, slices

# Edge of an automatic chunk, and tiles along it at most: 8 MB in double precision. [cell]
_CHUNK = 1008

_TILES_PER_CHUNK = 2

# Rows of a part of a tile: with the columns of a chunk 2 MB in double precision, which a processor's cache keeps.
_ROWS = 252


def tiles(kernel, grid, chunks=None, *, tile, dtype=float):
    """
    Array of a kernel that makes its cells from their place alone.

    Parameters
    ----------
    kernel : callable
        ``kernel(row, column, (rows, columns))`` gives the cells from a row and column of the grid on.
    grid : odc.geo.geobox.GeoBox
    chunks : mapping or int or "auto", optional
        As xarray takes it, over y and x; "auto" ends chunks where tiles end, so that none is made twice. Without it
        the whole array is made at once.
    tile : int
        Size of the fixed tiles that the kernel works by, counted from the origin of the CRS. [cell]
    dtype : dtype, optional
        Of what the kernel gives.

    Returns
    -------
    array : xarray.DataArray, dims (y, x)
    """
    if chunks is None:
        return grids.place(xr.DataArray(kernel(0, 0, tuple(grid.shape)), dims=("y", "x")), grid)
    normal = chunk_sizes(grid, chunks, tile=tile)
    lazy = xr.DataArray(array_by_place(kernel, normal, token=tokenize(kernel, normal), dtype=dtype), dims=("y", "x"))
    # xarray would take over dask's name.
    return grids.place(lazy.rename(None), grid)


def part_by_part(kernel, grid, *arrays, tile):
    """
    Array of such a kernel in memory, made in parts of tiles: what the kernel makes between takes no memory of its own.

    Parameters
    ----------
    kernel : callable
        As of `tiles`, or ``kernel(row, column, (rows, columns), *blocks)`` of what other arrays have in these cells.
    grid : odc.geo.geobox.GeoBox
    *arrays : numpy.ndarray, shape (y, x)
    tile
        As in `tiles`.

    Returns
    -------
    array : xarray.DataArray, dims (y, x)
    """
    out = np.empty(tuple(grid.shape))
    for rows, columns in product(*map(slices, _tile_chunks(grid, tile))):
        for first in range(rows.start, rows.stop, _ROWS):
            part = slice(first, min(first + _ROWS, rows.stop)), columns
            out[part] = kernel(first, columns.start, out[part].shape, *(each[part] for each in arrays))
    return grids.place(xr.DataArray(out, dims=("y", "x")), grid)


def chunk_sizes(grid, chunks, *, tile):
    """
    Sizes of the chunks of an array on a grid.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox
    chunks, tile
        As in `tiles`.

    Returns
    -------
    rows, columns : tuple of int
    """
    sizes = _tile_chunks(grid, tile) if chunks == "auto" else _chunk_tuple(chunks)
    return da.core.normalize_chunks(sizes, shape=tuple(grid.shape), dtype=float)


def located(kernel, array, *, tile=None):
    """
    Apply a kernel that must know where its block lies.

    Parameters
    ----------
    kernel : callable
        ``kernel(block, starts)`` gives an array like the block, whose first element lies at these indices of the whole.
    array : xarray.DataArray
    tile : int, optional
        As in `tiles`: what is in memory, over (y, x), is made `part_by_part`.

    Returns
    -------
    array : xarray.DataArray
        Float, lazy where the input is.
    """

    def call(block, block_info=None):
        return kernel(block, tuple(start for start, _ in block_info[0]["array-location"]))

    data = array.data
    if isinstance(data, da.Array):
        return array.copy(data=data.map_blocks(call, dtype=float, meta=np.empty((0,) * data.ndim)))
    if tile is None:
        return array.copy(data=kernel(data, (0,) * data.ndim))
    return part_by_part(
        lambda row, column, shape, block: kernel(block, (row, column)), grids.geobox(array), data, tile=tile
    )


def _tile_chunks(grid, tile):
    """Chunks of whole tiles, but for the borders of the grid."""
    step = min(_TILES_PER_CHUNK, max(_CHUNK // tile, 1)) * tile
    sizes = []
    for first, size in zip(grids.lattice_position(grid), grid.shape, strict=True):
        ends = np.arange((first // step + 1) * step, first + size, step) - first
        sizes.append(tuple(np.diff([0, *ends, size]).tolist()))
    return tuple(sizes)


def _chunk_tuple(chunks):
    if isinstance(chunks, dict):
        unknown = set(chunks) - {"y", "x"}
        if unknown:
            raise ValueError(f"chunks name the dimensions y and x, got {', '.join(map(str, sorted(unknown)))}")
        return tuple(-1 if chunks.get(axis) is None else chunks[axis] for axis in ("y", "x"))
    return (chunks, chunks)
