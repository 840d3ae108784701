"""Elevation on labelled rasters: models of any resolution and CRS, their coverage of a grid, and synthetic hills."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import dask.array as da
import numpy as np
import xarray as xr
from affine import Affine
from odc.geo.geobox import GeoBox

from fifesim.base.arguments import Chunks, WholeNumber
from fifesim.base.lattice import check_seed
from fifesim.base.messages import warn
from fifesim.grids import cf, windows
from fifesim.grids import grid as grids
from fifesim.grids.inputs import FileOrRaster
from fifesim.grids.projection import lies_in_words
from fifesim.grids.sites import made_on_site, on_fife_site
from fifesim.ground.terrain.flint_hills import hills_elevation
from fifesim.ground.terrain.slope import terrace_step
from fifesim.ground.terrain.source_labels import check_cover, likely_unit, model_under
from fifesim.ground.terrain.spline import block_means

# Relief with a larger mean slope, of cells of about this size, is rare. [degree], [m]
_STEEP, _SLOPE_SCALE = 20.0, 30.0

# Land is rougher, apart from level water; hills in kilometres have less. [degree]
_SMOOTH = 0.03
# Elevation of the highest mountain. [km]
_SUMMIT = 9.0
# The FIFE site lies at 310 to 450 m. [m]
_SITE_ELEVATION = 400.0


def warn_of_relief(model, unit_is_given):
    """Warn of terraces of whole numbers, and of elevations that are likely in another unit, in the middle of a grid."""
    middle, around = [np.array([size // 2]) for size in model.grid.shape], 200
    window = model.reads(*model.positions(*middle))
    values = model.read(*(slice(part.start - around, part.stop + around) for part in window), fill=False)
    step = terrace_step(values / model.source.factor)
    if step is not None:
        warn(
            f"the elevations of {model.source.name} are whole numbers that lie in terraces, with a vertical resolution "
            f"of {step * model.source.factor:g} m: slope and aspect will show the terraces' edges"
        )
    if unit_is_given or not np.isfinite(values).any():
        return
    name, slope = model.source.name, _mean_slope(values, model.cell_size())
    low, high = np.nanmin(values), np.nanmax(values)
    unit = likely_unit(low, high, _SITE_ELEVATION) if on_fife_site(model.grid) else None
    if unit is not None:
        warn(
            f"{name} has elevations of {low:.4g} to {high:.4g} m, but the FIFE site lies at {_SITE_ELEVATION:g} m: "
            f"give vertical_units={unit!r}, or vertical_units='m' if they are metres"
        )
    elif 0 < slope < _SMOOTH and max(-low, high) < _SUMMIT:
        warn(
            f"the mean slope of {name} is {slope:.2g} degrees at {_SLOPE_SCALE:g} m, and its elevations are {low:.3g} "
            f"to {high:.3g} m: if they are kilometres, give vertical_units='km'; if metres, vertical_units='m'"
        )
    elif slope > _STEEP:
        warn(
            f"the mean slope of {name} is {slope:.1f} degrees at {_SLOPE_SCALE:g} m, which only high "
            "mountains have: if its elevations are feet or decimetres, give vertical_units='ft' or 'dm'; if they are "
            "metres, give vertical_units='m'"
        )


def _mean_slope(values, sizes):
    """Mean slope of elevations averaged to cells of about 30 m, NaN for too few cells. [degree]"""
    counts = [max(1, round(_SLOPE_SCALE / size)) for size in sizes]
    rows, columns = (size // count * count for size, count in zip(values.shape, counts, strict=True))
    means = block_means(values[:rows, :columns], *counts)
    if min(means.shape) < 2:
        return np.nan
    down, across = np.gradient(means, *(count * size for count, size in zip(counts, sizes, strict=True)))
    slopes = np.degrees(np.arctan(np.hypot(down, across)))
    known = np.isfinite(slopes)
    return float(slopes[known].mean()) if known.any() else np.nan


def fine_dem(
    path_or_raster: FileOrRaster,
    grid: GeoBox,
    *,
    method: Literal["lowpass", "linear"] = "lowpass",
    fill: float | None = None,
    vertical_units: str | None = None,
    chunks: Chunks | None = None,
    allow_remote: bool = False,
) -> xr.DataArray:
    """
    Resample an elevation model to a grid by low-pass or linear interpolation.

    Parameters
    ----------
    path_or_raster : str, path or xarray.DataArray
        Elevation model in any CRS and orientation: a raster file or an array. From several bands, the one described as
        elevation is used. It should extend beyond the grid.
    grid : odc.geo.geobox.GeoBox
        Grid of the ground cells.
    method : {"lowpass", "linear"}, optional
        "lowpass" is a quintic spline, which is smooth but overshoots next to a step. "linear" stays between the
        elevations of the four nearest source cells, but its slope changes abruptly between them.
    fill : float, optional
        Maximum distance from known elevations for interpolating gaps and extrapolating beyond the edge. [m]
    vertical_units : str, optional
        Units of the elevations if they are not metres, such as "ft" or "us-ft". Takes precedence over the file.
    chunks : mapping or int or "auto", optional
        Chunks of a lazy result. The result is also lazy if the raster is.
    allow_remote : bool, optional
        Take addresses, and formats that lead to other files: only for what you trust.

    Returns
    -------
    dem : xarray.DataArray, dims (y, x)
        Elevation. The attribute ``source_resolution`` is the mean cell size of the model, after block averaging [m].
        [m]

    Raises
    ------
    ValueError
        If the model does not cover the grid, has gaps, has no CRS, has undeclared units other than metres, or needs a
        datum transformation of unknown accuracy. If elevations on or around the grid are below -500 m or above 9000 m,
        such as undeclared missing values; a lazy raster is checked when it is computed.

    Warns
    -----
    UserWarning
        If elevations are integers that form terraces, or isolated values of 0 m. Without given ``vertical_units``, also
        if the mean slope at 30 m is above 20 degrees, or below 0.03 degrees with elevations below 9 m, or if elevations
        on the FIFE site agree with its 400 m in another unit. A lazy raster is only checked for 0 m.

    Notes
    -----
    Both methods recover planes exactly. "lowpass" recovers waves longer than five source cells within 1e-3 of their
    amplitude, "linear" within a fifth. Next to a step, "lowpass" overshoots by up to 13 % of its height. Source cells
    smaller than two thirds of the grid cells are first averaged. The vertical datum is not changed.

    See Also
    --------
    fifesim.terrain.source_dem, fifesim.flint_hills, fifesim.kt

    Examples
    --------
    >>> import fifesim
    >>> coarse = fifesim.flint_hills(fifesim.fife_site(30, window=((0, 40), (0, 40))), seed=7)
    >>> grid = fifesim.fife_site(10, window=((30, 90), (30, 90)))
    >>> dem = fifesim.fine_dem(coarse, grid)
    >>> dem.shape, dem.attrs["units"]
    ((60, 60), 'm')
    """
    model = replace(model_under(grid, path_or_raster, fill, vertical_units, allow_remote), linear=method == "linear")
    if not isinstance(model.source.cells, da.Array):
        check_cover(model)
        warn_of_relief(model, vertical_units is not None)
    out = model.raster(chunks)
    how = "linear" if model.linear else "quintic spline"
    history = f"fine_dem: {model.source.name}, cells of {model.resolution:.4g} m, {how}"
    return cf.label(out, "dem", history=history, source_resolution=model.resolution)


def known_dem(path_or_raster, grid, chunks=None, fill=None, vertical_units=None):
    """Elevation on a grid as from `fine_dem`, NaN where the model has none."""
    model = replace(model_under(grid, path_or_raster, fill, vertical_units), covers=False)
    return cf.label(model.raster(chunks), "dem", history=f"fine_dem: {model.source.name}")


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
    Elevation model around a grid, at about the resolution of the source; for horizons.

    Parameters
    ----------
    path_or_raster, grid, fill, vertical_units, allow_remote
        As in `fine_dem`.
    margin : float
        Requested distance beyond the grid on each side. [m]
    chunks : mapping or int or "auto", optional
        Chunks of a lazy result. The extent of the model is determined immediately.

    Returns
    -------
    dem : xarray.DataArray, dims (y, x)
        Elevation up to the margin or the end of the model, NaN where unknown; in memory unless chunked. The cell size
        is a whole multiple of the grid cell size, aligned with the grid corner. [m]
    reach : dict of str to float
        Distance up to which the elevation is known without gaps along the entire ``north``, ``east``, ``south`` and
        ``west`` side of the grid, limited to the margin. [m]

    Raises
    ------
    ValueError
        As in `fine_dem`, except that gaps are allowed if some elevation is known.

    Examples
    --------
    >>> import fifesim
    >>> coarse = fifesim.flint_hills(fifesim.fife_site(30, window=((0, 40), (0, 40))), seed=7)
    >>> grid = fifesim.fife_site(10, window=((30, 90), (30, 90)))
    >>> around = fifesim.terrain.source_dem(coarse, grid, margin=300)
    >>> around[0].shape
    (40, 40)
    """
    model = model_under(grid, path_or_raster, fill, vertical_units, allow_remote)
    coarse, around = _coarse_grid(grid, model.resolution, margin)
    if isinstance(model.source.cells, da.Array):
        model = model.reading(model.source.cells.compute())
    model = replace(model, grid=coarse, covers=False)
    values = model(0, 0, tuple(coarse.shape)) if chunks is None else None
    known = np.isfinite(values) if values is not None else model.known(*map(np.arange, coarse.shape))
    if not known.any():
        source = model.source
        raise ValueError(
            f"{source.name} does not reach the grid, which spans {grids.extent(grid)}: it spans "
            f"{lies_in_words(source.affine, source.shape, source.crs)}"
        )
    reach = _reach(known, around, grids.cell_size(coarse))
    kept = _with_data(known, around)
    if values is None:
        # Many horizons read each chunk.
        dem = replace(model, grid=coarse[kept]).raster(chunks, held=True)
    else:
        dem = grids.place(xr.DataArray(values[kept], dims=("y", "x")), coarse[kept])
    history = f"source_dem: {model.source.name}, cells of {model.resolution:.4g} m, {margin:g} m around the grid"
    return cf.label(dem, "dem", history=history, source_resolution=model.resolution), reach


def _coarse_grid(grid, resolution, margin):
    """Grid of multiples of the cells of a grid that covers it and a margin, and rows and columns of the margin."""
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
    """Slices without the empty rows and columns of the margin."""
    parts = []
    for axis, margin in enumerate(around):
        found = np.flatnonzero(known.any(axis=1 - axis))
        size = known.shape[axis]
        parts.append(slice(min(int(found[0]), margin), max(int(found[-1]) + 1, size - margin)))
    return tuple(parts)


# Chunks of "auto" are of some of these. [cell]
_TILE = 504

# Coarser cells do not resolve the valleys. [m]
_LARGEST_CELL = 100.0

_REFERENCE = "terrain after the statistics of Kings Creek, Konza Prairie (USGS 3DEP)"


def flint_hills(grid: GeoBox, seed: WholeNumber = 0, *, chunks: Chunks | None = None) -> xr.DataArray:
    """
    Synthetic elevation model of the dissected Flint Hills.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox
        Grid of the ground cells.
    seed : int, optional
        In [0, 2**63).
    chunks : mapping or int or "auto", optional
        Makes the result lazy.

    Returns
    -------
    dem : xarray.DataArray, dims (y, x)
        Elevation, which depends only on seed, easting and northing: a window equals a slice of the whole for any
        chunks, and cells of another size show the same hills. [m]

    Raises
    ------
    ValueError
        If the grid or the seed is invalid, or cells are larger than 100 m and do not resolve the valleys.
    TypeError
        If the seed is not an integer.

    See Also
    --------
    fifesim.fine_dem, fifesim.terrain.slope, fifesim.kt

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> dem = fifesim.flint_hills(grid, seed=7)
    >>> dem.shape, dem.attrs["units"]
    ((90, 90), 'm')
    """
    grids.check_grid(grid)
    seed = check_seed(seed)
    if max(grids.cell_size(grid)) > _LARGEST_CELL:
        raise ValueError(
            f"cells must be at most {_LARGEST_CELL:g} m for the valleys to show, got "
            f"{max(grids.cell_size(grid)):g} m: make the terrain on smaller cells and .coarsen() it"
        )
    northing, easting = (grids.coordinates(grid)[axis].values for axis in ("y", "x"))

    def cells(row, column, shape):
        return hills_elevation(seed, northing[row : row + shape[0]], easting[column : column + shape[1]])

    dem = windows.tiles(cells, grid, chunks, tile=_TILE)
    made = {"rng_seed": str(seed), "source_resolution": 30.0, "references": _REFERENCE} | made_on_site(grid)
    return cf.label(dem, "dem", history=f"flint_hills: seed {seed}", **made)
