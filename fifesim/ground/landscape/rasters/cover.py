"""The cover of a landscape on labelled rasters: drawn in patches, or a user's own map."""

from pathlib import Path

import numpy as np
import xarray as xr

from fifesim.base.foreign import in_a_line
from fifesim.ground.landscape.class_text import read_table, table_text
from fifesim.ground.landscape.compression import NO_CLASS, check_codes
from fifesim.ground.landscape.cover import patch_classes
from fifesim.rasters import cf, places
from fifesim.rasters import chunks as chunking
from fifesim.rasters import grid as grids
from fifesim.rasters.packed import unpacked
from fifesim.rasters.sites import made_on_site
from fifesim.rasters.warp import file_onto_grid, raster_onto_grid

# Chunks of "auto" are of some of these. [cell]
_TILE = 1008


def drawn_cover(grid, patches, table, seed, chunks=None):
    """
    Classes of a landscape in patches.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox
    patches : Patches
    table : sequence of CoverClass
    seed : int
    chunks : mapping or int or "auto", optional
        Makes the result lazy.

    Returns
    -------
    cover : xarray.DataArray of int16, dims (y, x)
        Codes.

    Raises
    ------
    ValueError
        If patches are smaller than a cell.
    """
    cell = min(grids.cell_size(grid))
    if patches.size < cell:
        raise ValueError(
            f"the size of patches must be at least a cell of {cell:g} m, got {patches.size:g} m: "
            "give it in metres, not km"
        )
    shares = patches.shares_of([each.name for each in table])
    codes = np.array([each.code for each in table], np.int16)
    northing, easting = (grids.coordinates(grid)[axis].values for axis in ("y", "x"))

    def cells(row, column, shape):
        place = northing[row : row + shape[0]], easting[column : column + shape[1]]
        return patch_classes(patches, shares, seed, *place, codes)

    said = f"landscape: {patches.pattern} of {patches.size:g} m, seed {seed}"
    cover = places.tiles(cells, grid, chunks, tile=_TILE, dtype=np.int16)
    return _labelled(cover, table, said, rng_seed=str(seed), **made_on_site(grid))


def cover_map(path_or_raster, grid, table, chunks=None, *, allow_remote=False):
    """
    A user's own map of classes on a grid.

    Parameters
    ----------
    path_or_raster : str, path or xarray.DataArray
        Whole numbers, in any CRS and orientation.
    grid : odc.geo.geobox.GeoBox
        Cells no larger than the map's have the nearest class, larger ones the most frequent.
    table : sequence of CoverClass
    chunks : mapping or int, optional
        Makes the result lazy.
    allow_remote : bool, optional
        As in `fifesim.open_lai`.

    Returns
    -------
    cover : xarray.DataArray of int16, dims (y, x)
        Codes, -1 where the map has no data.

    Raises
    ------
    ValueError
        As in `fifesim.open_lai`; when computed, if the map has a code without a class.
    """
    if isinstance(path_or_raster, xr.DataArray):
        name = in_a_line(str(path_or_raster.name or "raster"), 150)
        found = raster_onto_grid(unpacked(_one_layer(path_or_raster)), grid, chunks, classes=True)
    else:
        name = in_a_line(Path(path_or_raster).name, 150)
        found = file_onto_grid(path_or_raster, grid, chunks, allow_remote, classes=True)
    codes = tuple(each.code for each in table)
    cover = grids.place(chunking.pointwise(check_codes, found, dtype=np.int16, table=codes), grid)
    if cover.chunks is None and not (cover.values != NO_CLASS).any():
        raise ValueError(
            f"the map of cover {name} has no data on the grid, which spans {grids.extent(grid)}: look at its nodata "
            "value with gdalinfo -stats"
        )
    return _labelled(cover, table, f"landscape: cover of {name}")


def classes_of(cover):
    """
    Table of the classes that a raster of cover carries.

    Parameters
    ----------
    cover : xarray.DataArray
        From `drawn_cover` or `cover_map`.

    Returns
    -------
    table : tuple of CoverClass

    Raises
    ------
    ValueError
        If it carries none.
    """
    if "classes" not in cover.attrs:
        raise ValueError(
            "the cover does not say what its classes are: make the landscape with fifesim.landscape(grid, "
            "cover=raster, classes=...)"
        )
    return read_table(cover.attrs["classes"])


def _one_layer(raster):
    raster = raster.squeeze([name for name in raster.dims if raster.sizes[name] == 1 and name == "band"], drop=True)
    if raster.ndim != 2:
        raise ValueError(f"a map of cover has rows and columns, got dimensions {raster.dims}: select one layer")
    return raster


def _labelled(cover, table, history, **provenance):
    flags = {"flag_values": np.array([each.code for each in table], np.int16)}
    flags |= {"flag_meanings": " ".join(each.name for each in table), "_FillValue": np.int16(NO_CLASS)}
    return cf.label(cover, "cover", history=history, classes=table_text(table), **flags, **provenance)
