"""Elevation on labelled rasters: a model of any resolution and CRS on the fine grid, or around it."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import NamedTuple

import dask.array as da
import numpy as np
import xarray as xr
from affine import Affine
from odc.geo.geobox import GeoBox

from fifesim.base.annotations import Chunks
from fifesim.ground.terrain.rasters.cover import check_cover, known_cells, known_elevation, warn_of_relief
from fifesim.ground.terrain.rasters.model import TILE, Model, model_under
from fifesim.ground.terrain.rasters.source import placement
from fifesim.rasters import cf, places
from fifesim.rasters import chunks as chunking
from fifesim.rasters import grid as grids
from fifesim.rasters.annotations import FileOrRaster
from fifesim.rasters.whereabouts import lies_in_words


def fine_dem(
    path_or_raster: FileOrRaster,
    grid: GeoBox,
    *,
    fill: float | None = None,
    vertical_units: str | None = None,
    chunks: Chunks | None = None,
    allow_remote: bool = False,
) -> xr.DataArray:
    """
    Elevation model on a grid, by low-pass interpolation.

    Parameters
    ----------
    path_or_raster : str, path or xarray.DataArray
        A raster file, or what rioxarray has opened, in any CRS and orientation; its first band is elevation. It should
        reach past the grid.
    grid : odc.geo.geobox.GeoBox
        Of ground cells.
    fill : float, optional
        Distance from known elevation up to which holes are interpolated, and the model is carried on past its edge. [m]
    vertical_units : str, optional
        Of the elevations, where they are not metres: "ft", "us-ft" and others; wins over what the file says.
    chunks : mapping or int or "auto", optional
        Makes the result lazy, as it is without where the raster is.
    allow_remote : bool, optional
        Take addresses, and formats that lead to other files: only for what you trust.

    Returns
    -------
    dem : xarray.DataArray, dims (y, x)
        With the mean size of the model's cells, or of the blocks that they are averaged to, as attribute
        ``source_resolution``. [m]

    Raises
    ------
    ValueError
        If the model does not cover the grid, has holes, no CRS, or other units than metres that are not given, or needs
        a change of datum whose accuracy is unknown. If the part that is read, on the grid and around it, holds heights
        below -500 m or above 9000 m, such as undeclared marks of missing data. For a lazy raster this is known when
        computed.

    Warns
    -----
    UserWarning
        If elevations lie in terraces of whole numbers, are 0 m where all others are far from it, or have a mean slope
        above 20 degrees at 30 m while ``vertical_units`` is not given. A lazy raster is checked for 0 m only.

    Notes
    -----
    Wavelengths above five cells of the source are recovered within 1e-3 of their amplitude, planes exactly. Cells of
    the source less than two thirds of the grid's are averaged first. Heights keep their vertical datum.

    See Also
    --------
    fifesim.ground.terrain.spline.spline_coefficients, fifesim.ground.terrain.spline.spline_grid

    Examples
    --------
    >>> import fifesim
    >>> coarse = fifesim.flint_hills(fifesim.fife_site(30, window=((0, 40), (0, 40))), seed=7)
    >>> grid = fifesim.fife_site(10, window=((30, 90), (30, 90)))
    >>> dem = fifesim.fine_dem(coarse, grid)
    >>> dem.shape, dem.attrs["units"]
    ((60, 60), 'm')
    """
    model = model_under(grid, path_or_raster, fill, vertical_units, allow_remote)
    if isinstance(model.source.cells, da.Array):
        out = _from_lazy(model, grid, "auto" if chunks is None else chunks)
    else:
        check_cover(model, grid)
        warn_of_relief(model, grid, vertical_units is not None)
        out = places.tiles(partial(known_elevation, model, model.tiles()), grid, chunks, tile=TILE)
    history = f"fine_dem: {model.source.name}, cells of {model.resolution:.4g} m, quintic spline"
    return cf.label(out, "dem", history=history, source_resolution=model.resolution)


def source_dem(
    path_or_raster: FileOrRaster,
    grid: GeoBox,
    margin: float,
    *,
    fill: float | None = None,
    vertical_units: str | None = None,
    chunks: Chunks | None = None,
    allow_remote: bool = False,
) -> tuple[xr.DataArray, dict[str, float]]:
    """
    Elevation model around a grid, at about its own resolution; for horizons.

    Parameters
    ----------
    path_or_raster, grid, fill, vertical_units, allow_remote
        As in `fine_dem`.
    margin : float
        Distance from the grid that is wanted on each side. [m]
    chunks : mapping or int or "auto", optional
        Makes the result lazy; where the model ends is looked up at once.

    Returns
    -------
    dem : xarray.DataArray, dims (y, x)
        In memory without chunks. Its cells are whole multiples of the grid's, from the grid's corner; it reaches up to
        the margin and as far as the model does. NaN where unknown. [m]
    reach : dict of str to float
        How far the elevation is known without a gap beside all of the ``north``, ``east``, ``south`` and ``west`` side
        of the grid, up to the margin. [m]

    Raises
    ------
    ValueError
        As in `fine_dem`, but not for what the model lacks, unless that is all.

    Examples
    --------
    >>> import fifesim
    >>> coarse = fifesim.flint_hills(fifesim.fife_site(30, window=((0, 40), (0, 40))), seed=7)
    >>> grid = fifesim.fife_site(10, window=((30, 90), (30, 90)))
    >>> around = fifesim.source_dem(coarse, grid, margin=300)
    >>> around[0].shape
    (40, 40)
    """
    model = model_under(grid, path_or_raster, fill, vertical_units, allow_remote)
    coarse, around = _coarse_grid(grid, model.resolution, margin)
    if isinstance(model.source.cells, da.Array):
        model = model.reading(model.source.cells.compute())
    model = replace(model, place=placement(model.source, coarse))
    values = model.elevation(model.tiles(), 0, 0, tuple(coarse.shape)) if chunks is None else None
    known = known_cells(model, coarse.shape) if values is None else np.isfinite(values)
    if not known.any():
        source = model.source
        raise ValueError(
            f"{source.name} does not reach the grid, which spans {grids.extent(grid)}: it spans "
            f"{lies_in_words(source.affine, source.shape, source.crs)}"
        )
    reach = _reach(known, around, grids.cell_size(coarse))
    kept = _with_data(known, around)
    data = _in_chunks(model, coarse[kept], kept, chunks) if values is None else values[kept]
    dem = grids.place(xr.DataArray(data, dims=("y", "x")), coarse[kept])
    history = f"source_dem: {model.source.name}, cells of {model.resolution:.4g} m, {margin:g} m around the grid"
    return cf.label(dem, "dem", history=history, source_resolution=model.resolution), reach


def _in_chunks(model, grid, kept, chunks):
    """Lazy elevation of a part of a model's grid. Horizons read chunks many times, which are made once for all."""
    make_tile, (first_row, first_column) = model.tiles(), (part.start for part in kept)

    def kernel(rows, columns):
        shape = rows.stop - rows.start, columns.stop - columns.start
        return model.elevation(make_tile, first_row + rows.start, first_column + columns.start, shape)

    return chunking.windows(kernel, [], tuple(grid.shape), places.chunk_sizes(grid, chunks, tile=TILE))


class _TileReads(NamedTuple):
    """What each chunk reads of a lazy source: the window of it that the chunk's tiles read."""

    array: da.Array
    model: Model

    def window(self, rows, columns):
        return self.model.tile_window(rows, columns)


def _from_lazy(model, grid, chunks):
    without = model.reading(None)

    def kernel(rows, columns, cells):
        down, across = without.tile_window(rows, columns)
        known = without.reading(cells, (down.start, across.start))
        shape = rows.stop - rows.start, columns.stop - columns.start
        return known_elevation(known, known.tiles(), rows.start, columns.start, shape)

    sizes = places.chunk_sizes(grid, chunks, tile=TILE)
    out = chunking.windows(kernel, [_TileReads(model.source.cells, without)], tuple(grid.shape), sizes)
    return grids.place(xr.DataArray(out, dims=("y", "x")), grid)


def _coarse_grid(grid, resolution, margin):
    """Grid of whole multiples of a grid's cells that covers it and a margin, and the rows and columns of the margin."""
    if not margin >= 0:
        raise ValueError(f"the margin must be 0 m or more, got {margin:g}")
    sizes = grids.cell_size(grid)
    counts = [max(1, round(resolution / size)) for size in sizes]
    down, across = (count * size for count, size in zip(counts, sizes, strict=True))
    rows, columns = int(np.ceil(margin / down)), int(np.ceil(margin / across))
    inner = [-(-size // count) for size, count in zip(grid.shape, counts, strict=True)]
    affine = Affine(across, 0, grid.affine.c - columns * across, 0, -down, grid.affine.f + rows * down)
    return GeoBox((inner[0] + 2 * rows, inner[1] + 2 * columns), affine, grid.crs), (rows, columns)


def _reach(known, around, sizes):
    (rows, columns), (down, across) = around, sizes
    inner = known[rows : known.shape[0] - rows, columns : known.shape[1] - columns]
    sides = {
        "north": (known[:rows, columns : columns + inner.shape[1]][::-1], down),
        "east": (known[rows : rows + inner.shape[0], columns + inner.shape[1] :].T, across),
        "south": (known[rows + inner.shape[0] :, columns : columns + inner.shape[1]], down),
        "west": (known[rows : rows + inner.shape[0], :columns].T[::-1], across),
    }
    return {
        side: float(np.logical_and.accumulate(strip.all(axis=1)).sum() * cell) for side, (strip, cell) in sides.items()
    }


def _with_data(known, around):
    """Slices without the rows and columns of the margin that are empty."""
    parts = []
    for axis, margin in enumerate(around):
        found = np.flatnonzero(known.any(axis=1 - axis))
        size = known.shape[axis]
        parts.append(slice(min(int(found[0]), margin), max(int(found[-1]) + 1, size - margin)))
    return tuple(parts)
