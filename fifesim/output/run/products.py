"""What a run computes of a scenario, block by block, and the order of the blocks."""

import zlib
from typing import NamedTuple

import dask.array as da
import numpy as np
import xarray as xr
from dask.base import tokenize

from fifesim.rasters import geozarr
from fifesim.rasters import grid as grids
from fifesim.rasters.windows import array_from_windows

# The report shows the cells below this many pixels across, in the middle: enough to see what a pixel averages. [pixel]
_DETAIL = 16

# The report shows terrain over this many pixels across at most, in the middle. [pixel]
_TERRAIN = 512

# Side of a chunk of a scene product, which is a file. [cell]
_SIDE = 1008


class Products(NamedTuple):
    """Lazy rasters of a run by name, and those of the scene, whose blocks are written to Zarr when they are made."""

    rasters: dict[str, xr.DataArray]
    scene: dict[str, xr.DataArray]
    arrays: dict[str, da.Array]


def products_of(tree, zarr_path=None):
    """
    Lazy arrays of a run, and where their blocks are.

    Parameters
    ----------
    tree : xarray.DataTree
        From `fifesim.scenario.simulation.simulate`.
    zarr_path : path, optional
        Where scene products are to be written.

    Returns
    -------
    products : Products
    """
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


def wanted_blocks(found, grid_chunks, cells):
    """
    Blocks of all products in the order to make them: by the chunk of the scene that they lie in.

    Parameters
    ----------
    found : Products
    grid_chunks : (tuple of int, tuple of int)
        Chunks of the scene over y and x.
    cells : odc.geo.geobox.GeoBox
        Of the scene.

    Returns
    -------
    wanted : list of (str, tuple of int)
    """
    edges = [np.cumsum(sizes) for sizes in grid_chunks]
    ranked = []
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
    """
    Zarr store of scene products, without their values.

    Parameters
    ----------
    path : pathlib.Path
    scene : mapping of str to xarray.DataArray, dims ([band], y, x)

    Notes
    -----
    In format 2: GDAL before 3.13 reads no shards, and in some releases no array of format 3.
    """
    dataset = xr.Dataset(dict(scene))
    written = dataset.map(lambda array: array.copy(data=da.zeros(array.shape, chunks=-1)), keep_attrs=True)
    for array in written.data_vars.values():
        chunks = (1,) * (array.ndim - 2) + (_SIDE, _SIDE)
        array.encoding = {"chunks": chunks, "grid_mapping": "spatial_ref"}
    written.attrs = geozarr.attributes(grids.geobox(dataset[next(iter(scene))]))
    written.to_zarr(path, compute=False, mode="w", zarr_format=2, consolidated=True)


def _middle(size, shown):
    first = max(size - shown, 0) // 2
    return slice(first, first + min(size, shown))


def _shown(terrain):
    """The part of terrain that the report shows."""
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
    """Row or column of the scene at a place of another grid."""
    a, b = grid.affine, cells.affine
    return (a.f + at * a.e - b.f) / b.e if axis == 0 else (a.c + at * a.a - b.c) / b.a


def _written(array, path, name):
    """Blocks that write a place of the store each, and give its checksum."""
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
    """
    Checksum of what a scene product holds in one place.

    Parameters
    ----------
    path : path
        Of the store.
    name : str
        Of the product.
    index : (int, int)
        Of the chunk, over y and x.

    Returns
    -------
    checksum : numpy.uint32
    """
    sink, place = _place(path, name, index)
    return np.uint32(zlib.crc32(np.ascontiguousarray(sink[place])))


def _place(path, name, index):
    """An array of a store, and the place of a chunk in it."""
    import zarr  # slow, and few runs write cells

    sink = zarr.open_array(str(path), path=name, mode="r+")
    sides = [slice(at * _SIDE, min((at + 1) * _SIDE, size)) for at, size in zip(index, sink.shape[-2:], strict=True)]
    return sink, (..., *sides)
