"""Products of a run: its rasters in blocks of equal size, and the blocks in the order of their computation."""

import numpy as np

from fifesim.grids import grid as grids

# The report shows the cells below this many pixels across, in the middle: enough to see what a pixel averages. [pixel]
_DETAIL = 16

# The report shows terrain over this many pixels across at most, in the middle. [pixel]
_TERRAIN = 512

# Side of a chunk of a scene product; each chunk is a file. [cell]
_SIDE = 1008

SCENE_PREFIX = "scene-"
"""Beginning of the names of scene products."""


def products_of(tree, scene=False):
    """Lazy rasters of a run by name, in blocks of equal size with all bands."""
    rasters = {"image": tree["image"]["dn"], **tree["truth"].data_vars}
    rasters["detail"] = _middle_cells(tree["scene"]["lai"], tree["image"]["dn"])
    if "terrain" in tree.children:
        terrain = _shown(tree["terrain"].to_dataset())
        rasters |= {f"terrain-{name}": array for name, array in terrain.data_vars.items()}
        rasters["level"] = _shown(tree["level"]["dn"])
    sides = {name: {axis: max(raster.chunksizes[axis]) for axis in ("y", "x")} for name, raster in rasters.items()}
    for name, raster in tree["scene"].data_vars.items() if scene else ():
        rasters[f"{SCENE_PREFIX}{name}"], sides[f"{SCENE_PREFIX}{name}"] = raster, {"y": _SIDE, "x": _SIDE}
    return {name: raster.chunk(dict.fromkeys(raster.dims, -1) | sides[name]) for name, raster in rasters.items()}


def wanted_blocks(rasters, lai):
    """Blocks of all products in the order of computation: by the chunk of the scene in which they are."""
    cells, edges, ranked = grids.geobox(lai), [np.cumsum(sizes) for sizes in lai.chunks], []
    for number, (name, raster) in enumerate(rasters.items()):
        to_cells = ~cells.affine * grids.geobox(raster).affine
        for index in np.ndindex(raster.data.numblocks):
            sides = zip(raster.chunks[-2:], index[-2:], strict=True)
            row, column = (sum(sizes[:at]) + sizes[at] / 2 for sizes, at in sides)
            column, row = to_cells * (column, row)
            place = tuple(int(np.searchsorted(*each, "right")) for each in zip(edges, (row, column), strict=True))
            ranked.append((place, number, index, name))
    return [(name, index) for _, _, index, name in sorted(ranked)]


def write_scene(path, scene):
    """Write the scene products as a Zarr store."""
    # In format 2: GDAL before 3.13 reads no shards, and in some releases no array of format 3.
    for array in scene.data_vars.values():
        chunks = (1,) * (array.ndim - 2) + (_SIDE, _SIDE)
        array.encoding = {"chunks": chunks, "grid_mapping": "spatial_ref"}
    scene.attrs = grids.geozarr_attributes(grids.geobox(scene[next(iter(scene.data_vars))]))
    scene.to_zarr(path, mode="w", zarr_format=2, consolidated=True)


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
