"""
Products of a run: the blocks to compute in their order, and finished blocks saved on disk.

The default run saves 332 blocks of 72 kB. To save and load one takes 0.4 ms of processor time. A Zarr array for each
block, with the codec crc32c, takes 3.9 ms: 9 % of the run. One Zarr array for all blocks of a raster takes 1.0 ms, but
its chunks are of one size, and it reads a block that is missing as its fill value.
"""

import io
import os
import zlib
from pathlib import Path
from typing import NamedTuple

import dask.array as da
import numpy as np
import xarray as xr
from dask.base import tokenize

from fifesim.grids import grid as grids
from fifesim.grids.windows import array_from_windows
from fifesim.output.identity import NotThisRun

# The report shows the cells below this many pixels across, in the middle: enough to see what a pixel averages. [pixel]
_DETAIL = 16

# The report shows terrain over this many pixels across at most, in the middle. [pixel]
_TERRAIN = 512

# Side of a chunk of a scene product; each chunk is a file. [cell]
_SIDE = 1008


class Products(NamedTuple):
    """Lazy rasters of a run by name, and the scene products, whose blocks are written to Zarr directly."""

    rasters: dict[str, xr.DataArray]
    scene: dict[str, xr.DataArray]
    arrays: dict[str, da.Array]


def products_of(tree, zarr_path=None):
    """Lazy arrays of a run, and the place of their blocks."""
    rasters = {"image": tree["image"]["dn"], **tree["truth"].data_vars}
    rasters["detail"] = _middle_cells(tree["scene"]["lai"], tree["image"]["dn"])
    if "terrain" in tree.children:
        terrain = _shown(tree["terrain"].to_dataset())
        rasters |= {f"terrain-{name}": array for name, array in terrain.data_vars.items()}
        rasters["level"] = _shown(tree["level"]["dn"])
    arrays = {name: _one_chunk_of_bands(raster.data) for name, raster in rasters.items()}
    scene = {str(name): array for name, array in tree["scene"].data_vars.items()} if zarr_path else {}
    arrays |= {f"scene-{name}": _written(array.data, zarr_path, name) for name, array in scene.items()}
    return Products(rasters, scene, arrays)


def wanted_blocks(found, lai):
    """Blocks of all products in the order of computation: by the chunk of the scene in which they are."""
    cells, edges, ranked = grids.geobox(lai), [np.cumsum(sizes) for sizes in lai.chunks], []
    for number, (name, array) in enumerate(found.arrays.items()):
        raster = found.rasters.get(name)
        grid = cells if raster is None else grids.geobox(raster)
        for index in np.ndindex(array.numblocks):
            if raster is None:
                middle = [(index[axis] + 0.5) * _SIDE for axis in (0, 1)]
            else:
                middle = [
                    _cell(grid, cells, axis, sum(sizes[:at]) + sizes[at] / 2)
                    for axis, (sizes, at) in enumerate(zip(array.chunks[-2:], index[-2:], strict=True))
                ]
            place = tuple(int(np.searchsorted(edge, at, side="right")) for edge, at in zip(edges, middle, strict=True))
            ranked.append((place, number, index, name))
    return [(name, index) for _, _, index, name in sorted(ranked)]


def make_scene_store(path, scene):
    """Create the Zarr store of scene products without values."""
    # In format 2: GDAL before 3.13 reads no shards, and in some releases no array of format 3.
    dataset = xr.Dataset(dict(scene))
    written = dataset.map(lambda array: array.copy(data=da.zeros(array.shape, chunks=-1)), keep_attrs=True)
    for array in written.data_vars.values():
        chunks = (1,) * (array.ndim - 2) + (_SIDE, _SIDE)
        array.encoding = {"chunks": chunks, "grid_mapping": "spatial_ref"}
    written.attrs = grids.geozarr_attributes(grids.geobox(dataset[next(iter(scene))]))
    written.to_zarr(path, compute=False, mode="w", zarr_format=2, consolidated=True)


def _middle(size, shown):
    first = max(size - shown, 0) // 2
    return slice(first, first + min(size, shown))


def _shown(terrain):
    """Part of the terrain that the report shows."""
    return terrain.isel({axis: _middle(terrain.sizes[axis], _TERRAIN) for axis in ("y", "x")})


def _middle_cells(lai, image):
    """LAI of the cells below some pixels in the middle of the image."""
    sizes = zip(("y", "x"), *map(grids.cell_size, (grids.geobox(lai), grids.geobox(image))), strict=True)
    cut = {}
    for axis, cell, pixel in sizes:
        part = _middle(image.sizes[axis], _DETAIL)
        cut[axis] = slice(round(part.start * pixel / cell), round(part.stop * pixel / cell))
    return lai.isel(cut)


def _one_chunk_of_bands(array):
    return array.rechunk(dict.fromkeys(range(array.ndim - 2), -1))


def _cell(grid, cells, axis, at):
    """Row or column of the scene at a place in another grid."""
    a, b = grid.affine, cells.affine
    return (a.f + at * a.e - b.f) / b.e if axis == 0 else (a.c + at * a.a - b.c) / b.a


def _written(array, path, name):
    """Blocks that write their part of the store, and return its checksum."""
    array = _one_chunk_of_bands(array)
    sizes = [tuple(min(_SIDE, size - start) for start in range(0, size, _SIDE)) for size in array.shape[-2:]]

    def ask(rows, columns):
        return (rows.start, columns.start), [tuple(slice(p.start * _SIDE, p.stop * _SIDE) for p in (rows, columns))]

    counts = tuple((1,) * len(each) for each in sizes)

    def write(row, column, block):
        sink, place = _place(path, name, (row, column))
        sink[place] = block[..., : place[1].stop - place[1].start, : place[2].stop - place[2].start]
        return np.array([[chunk_checksum(path, name, (row, column))]])

    return array_from_windows(
        write, [array], counts, ask, token=tokenize("scene", str(path), name, array.name), dtype=np.uint32
    )


def chunk_checksum(path, name, index):
    """Checksum of a chunk of a scene product in the store."""
    sink, place = _place(path, name, index)
    return np.uint32(zlib.crc32(np.ascontiguousarray(sink[place])))


def _place(path, name, index):
    """Array of a store, and the slices of a chunk in it."""
    import zarr  # slow, and few runs write cells

    sink = zarr.open_array(str(path), path=name, mode="r+")
    sides = [slice(at * _SIDE, min((at + 1) * _SIDE, size)) for at, size in zip(index, sink.shape[-2:], strict=True)]
    return sink, (..., *sides)


SUFFIX = ".npy"

# A block is followed by its checksum. [byte]
_CHECKSUM = 4


def save_block(folder, name, index, block):
    """Save a block atomically."""
    path = _path(folder, name, index)
    path.parent.mkdir(parents=True, exist_ok=True)
    partial_path = path.with_suffix(".partial")
    # numpy does not report why a file cannot be written.
    content = io.BytesIO()
    np.save(content, block)
    with content.getbuffer() as whole:
        checksum = _checksum(whole)
    content.write(checksum)
    try:
        partial_path.write_bytes(content.getbuffer())
        os.replace(partial_path, path)
    except OSError as error:
        partial_path.unlink(missing_ok=True)
        raise OSError(error.errno, error.strerror, str(path)) from error


def saved_blocks(folder, name, array):
    """Indices of the saved blocks of an array whose files are intact, with the right shape and type."""
    return {index for index in np.ndindex(array.numblocks) if _is_whole(_path(folder, name, index), array, index)}


def saved_block(folder, name, index):
    """Load a saved block."""
    return _load(_path(folder, name, index))


def saved_array(folder, name, array):
    """Array whose blocks are read from disk, in chunks of rows of blocks, which are far fewer tasks."""
    leading, (down, across) = array.shape[:-2], array.chunks[-2:]
    numbers = {start: number for number, start in enumerate(np.cumsum((0, *down)).tolist())}

    def row_of_blocks(number):
        paths = (_path(folder, name, (*(0 for _ in leading), number, column)) for column in range(len(across)))
        return np.concatenate([_load(path) for path in paths], axis=-1)

    return array_from_windows(
        row_of_blocks,
        [],
        (down, (sum(across),)),
        lambda rows, columns: ((numbers[rows.start],), ()),
        token=f"saved-{folder}-{name}",
        leading=leading,
        dtype=array.dtype,
    )


def has_blocks(unfinished, error):
    """Whether a run stopped by an error can be resumed: not after invalid input, nor without blocks."""
    hopeless = isinstance(error, ValueError | TypeError) and not isinstance(error, NotThisRun)
    return not hopeless and any((unfinished / "blocks").glob(f"*/*{SUFFIX}"))


def _path(folder, name, index):
    return Path(folder) / name / ("-".join(f"{number:05d}" for number in index) + SUFFIX)


def _checksum(content):
    return zlib.crc32(content).to_bytes(_CHECKSUM, "little")


def _load(path):
    """Load a block and check its checksum."""
    content = Path(path).read_bytes()
    if _checksum(content[:-_CHECKSUM]) != content[-_CHECKSUM:]:
        raise OSError(f"{path} has changed since it was written: run with --resume to make it again")
    return np.load(io.BytesIO(content), allow_pickle=False)


def _is_whole(path, array, index):
    try:
        block = _load(path)
    except (OSError, ValueError, EOFError):
        return False
    shape = tuple(sizes[number] for sizes, number in zip(array.chunks, index, strict=True))
    return block.shape == shape and block.dtype == array.dtype
