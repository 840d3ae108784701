"""Horizon and sky of labelled elevation at the resolution of its source."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import dask.array as da
import numpy as np
import xarray as xr
from affine import Affine
from odc.geo.geobox import GeoBox

from fifesim.grids import cf, projection
from fifesim.grids import chunks as chunking
from fifesim.grids import grid as grids
from fifesim.ground.terrain import horizon as horizons
from fifesim.ground.terrain.horizon import sky_vector
from fifesim.ground.terrain.lit_slopes import Sky
from fifesim.ground.terrain.slope import along_normal, bilinear, direction_vector, gradient
from fifesim.ground.terrain.source_labels import REFERENCE, elevation_grid, source_resolution


class Places(NamedTuple):
    """Evenly spaced rows and columns, in cells of an elevation model, and their spacing."""

    grid: GeoBox  # grid of the elevation
    rows: np.ndarray
    columns: np.ndarray
    step: tuple[float, float]

    @property
    def cell(self):
        """Spacing down and across. [m]"""
        return tuple(step * size for step, size in zip(self.step, grids.cell_size(self.grid), strict=True))

    @property
    def coarse(self):
        """Grid whose cell centres are the places."""
        down, across = self.cell
        x, y = projection.transform_points(self.grid.affine, self.columns[0] + 0.5, self.rows[0] + 0.5)
        affine = Affine(across, 0.0, float(x) - across / 2, 0.0, -down, float(y) + down / 2)
        return GeoBox((self.rows.size, self.columns.size), affine, self.grid.crs)

    @property
    def cells(self):
        """Rows and columns of the nearest cells of the elevation."""
        return tuple(
            np.clip(np.round(at), 0, size - 1).astype(int)
            for at, size in zip((self.rows, self.columns), self.grid.shape, strict=True)
        )

    def between(self, offset, shape):
        """Positions of cells of the elevation between the places."""
        axes = zip((self.rows, self.columns), offset, shape, strict=True)
        return Between(*(_between(at, first + np.arange(size)) for at, first, size in axes))


class Between(NamedTuple):
    """For each row and column of cells, the previous place and the weight of the next one."""

    rows: tuple[np.ndarray, np.ndarray]
    columns: tuple[np.ndarray, np.ndarray]

    def reads(self, layers):
        """Reads of the cells from values at the places."""
        sizes = layers.shape[-2:]
        spans = ((before, np.minimum(before + 2, size)) for (before, _), size in zip(self, sizes, strict=True))
        return chunking.Reads(layers, *spans)

    def values(self, layer, rows, columns):
        """Values of a block of cells, bilinear between the places, shape (rows, columns)."""
        (row, down), (column, across) = self
        row, column = row[rows] - row[rows.start], column[columns] - column[columns.start]
        return bilinear(layer, (row, down[rows]), (column, across[columns]))

    def sky(self, layers, rows, columns):
        """Sky of a block of cells."""
        (row, row_share), (column, column_share) = self
        row, column = row[rows] - row[rows.start], column[columns] - column[columns.start]
        return Sky(layers, row, row_share[rows], column, column_share[columns])


def places_of(grid, resolution):
    """Regular places on an elevation model, counted from the origin of the CRS, so that all windows share them."""
    found, steps = [], []
    for first, size, cell in zip(grids.lattice_position(grid), grid.shape, grids.cell_size(grid), strict=True):
        step = max(1, round(resolution / cell))
        at = np.arange((step // 2 - first) % step, size, step)
        found.append((at if at.size else np.array([size // 2])).astype(float))
        steps.append(float(step))
    return Places(grid, *found, tuple(steps))


def places_on(grid, coarse):
    """Places of a coarse grid on an elevation model, with one more on each side, and their slices."""
    positions, cut = _positions(grid, coarse)
    step = tuple(size / cell for size, cell in zip(grids.cell_size(coarse), grids.cell_size(grid), strict=True))
    return Places(grid, *(at[part] for at, part in zip(positions, cut, strict=True)), step), cut


def between_places(grid, offset, data, layers, places, geometry):
    """Function for a block of a kernel on slopes, and its reads."""
    cell, shape = grids.cell_size(grid), tuple(grid.shape)
    between = places.between(offset, shape)

    def of_block(kernel, rows, columns, elevation, layers, *rho):
        return kernel(*rho, elevation, between.sky(layers, rows, columns), cell, geometry)

    return of_block, [chunking.margin_reads(data, 1, offset=offset, shape=shape), between.reads(layers)]


def chunks_beside(dem, coarse):
    """Chunks of a coarse grid whose ends inside the elevation are the ends of its chunks."""
    grid, own = grids.geobox(dem), dem.chunks or tuple((size,) for size in dem.shape)
    chunks = []
    for at, cut, sizes in zip(*_positions(grid, coarse), own, strict=True):
        inside = np.clip(np.round(at[cut]), 0, sum(sizes) - 1)
        beyond = cut.start, at.size - min(cut.stop, at.size)
        chunks.append(tuple(filter(None, (beyond[0], *chunking.runs(inside, sizes), beyond[1]))))
    return tuple(chunks)


def _between(places, cells):
    """Index of the place before each cell and the weight of the next, extrapolated beyond the outermost places."""
    if places.size == 1:
        return np.zeros(cells.size, int), np.zeros(cells.size)
    before = np.clip(np.searchsorted(places, cells, side="right") - 1, 0, places.size - 2)
    return before, (cells - places[before]) / (places[before + 1] - places[before])


def _positions(grid, coarse):
    """Rows and columns of the elevation at the places of a coarse grid, and slices of those on it and one more."""
    a, b = grid.affine, coarse.affine
    rows = (b.f + (np.arange(coarse.shape.y) + 0.5) * b.e - a.f) / a.e - 0.5
    columns = (b.c + (np.arange(coarse.shape.x) + 0.5) * b.a - a.c) / a.a - 0.5
    positions, cuts = (np.round(rows, 6), np.round(columns, 6)), []
    for at, size in zip(positions, grid.shape, strict=True):
        first, last = np.searchsorted(at, (0, size - 1), side="right")
        cuts.append(slice(max(int(first) - 1, 0), int(last) + 1))
    return positions, tuple(cuts)


def horizon_places(grid, horizon):
    """Places of a known horizon on an elevation model, with one more on each side, and their slices of the horizon."""
    cf.check_units(horizon, "horizon")
    found = grids.geobox(horizon)
    directions = horizon["direction"].values.astype(float)
    if directions.size < 16 or not np.allclose(np.diff(directions), 360 / directions.size):
        raise ValueError(f"a horizon has at least 16 evenly spaced directions, got {directions.tolist()}")
    a, b, (down, across) = grid.boundingbox, found.boundingbox, grids.cell_size(found)
    covers = b.left - a.left < across and a.right - b.right < across and b.bottom - a.bottom < down
    if found.crs != grid.crs or not (covers and a.top - b.top < down):
        raise ValueError(
            f"the horizon spans {grids.extent(found)} in {found.crs} and does not cover the dem's "
            f"{grids.extent(grid)} in {grid.crs}: take it from a dem that reaches further"
        )
    return places_on(grid, found)


# Places of a part of the sky along each side.
_PART = 512

DIRECTIONS = 32
HORIZON_REACH = 5000.0  # [m]


def horizon(
    dem: xr.DataArray,
    *,
    directions: int = DIRECTIONS,
    reach: float = HORIZON_REACH,
    resolution: float | None = None,
    beside: xr.DataArray | None = None,
) -> xr.DataArray:
    """
    Horizon of the surrounding terrain, at the resolution of the elevation source.

    Parameters
    ----------
    dem : xarray.DataArray, dims (y, x)
        Elevation. The view is open across missing cells and beyond the raster. [m]
    directions : int, optional
        Number of azimuths, from north on.
    reach : float, optional
        Maximum distance of the terrain. [m]
    resolution : float, optional
        Spacing of the nodes at which the horizon is computed, a whole number of cells; by default the attribute
        ``source_resolution`` of ``dem``, else the cell size. [m]
    beside : xarray.DataArray, dims (y, x), optional
        Elevation model inside ``dem``. A lazy result then has the same number of chunks, or one if this model is in
        memory.

    Returns
    -------
    horizon : xarray.DataArray, dims (direction, y, x)
        Zenith angle of the horizon. The nodes are cells of ``dem``, the same in every window. [degree]

    Raises
    ------
    ValueError
        As in `slope`; or if `directions` or `reach` is too small.

    See Also
    --------
    fifesim.terrain.sky_view, fifesim.terrain.terrain_view, fifesim.terrain.shadow

    Examples
    --------
    >>> import fifesim
    >>> dem = fifesim.flint_hills(fifesim.fife_site(30, window=((0, 60), (0, 60))), seed=7)
    >>> horizon = dem.fifesim.horizon(directions=16, reach=1000)
    >>> horizon.dims, horizon.sizes["direction"]
    (('direction', 'y', 'x'), 16)
    """
    places = places_of(elevation_grid(dem), source_resolution(dem, resolution))
    azimuths = horizons.azimuths(directions)
    samples, chunks = _samples(dem.transpose("y", "x").data, places)
    horizons.horizon_margin(*places.cell, reach)  # type: ignore[call-arg]
    useful = useful_reach(reach, places)
    reads = chunking.margin_reads(samples[0], *horizons.horizon_margin(*places.cell, useful))  # type: ignore[call-arg]
    if chunks is not None and beside is not None:
        chunks = chunks_beside(beside.transpose("y", "x"), places.coarse)

    def kernel(rows, columns, block):
        return horizons.horizon_zenith(block, *places.cell, azimuths, useful)

    out = chunking.windows(kernel, [reads], (len(azimuths), *samples.shape[1:]), chunks)
    names = {"direction": xr.DataArray(azimuths, dims="direction", attrs={"units": "degree", "long_name": "azimuth"})}
    out = grids.place(xr.DataArray(out, dims=("direction", "y", "x"), coords=names), places.coarse)
    down, across = places.cell
    history = f"horizon: {directions} directions, {reach:g} m far, at {down:g} x {across:g} m"
    return cf.label(out, "horizon", source=dem, history=history, references=REFERENCE)


def sky_above(data, grid, resolution, horizon, geometry, check=True):
    """Sky vector and horizon toward the sun at places of an elevation model, shape (4, y, x) [1], and the places."""
    places, cut = (places_of(grid, resolution), None) if horizon is None else horizon_places(grid, horizon)
    samples, chunks = _samples(data, places)
    if horizon is None:
        directions, reach = horizons.azimuths(DIRECTIONS), useful_reach(HORIZON_REACH, places)
        known = chunking.margin_reads(samples[0], *horizons.horizon_margin(*places.cell, reach))
        cell_y, cell_x = places.cell
        find = partial(horizons.horizon_tangent, cell_y=cell_y, cell_x=cell_x, directions=directions, reach=reach)
    else:
        directions, find = horizon["direction"].values.astype(float), horizons.tangent
        known = chunking.margin_reads(horizon.transpose("direction", "y", "x").data[(slice(None), *cut)], 0)

    def kernel(rows, columns, own, block):
        return _layers(find(block), directions, own, geometry)

    reads = [chunking.margin_reads(samples[1:], 0), known]
    shape = (4, *samples.shape[1:])
    # In memory by parts, because the horizons of all directions take several times the memory of the result.
    parts = chunks is None
    layers = (
        chunking.in_blocks(kernel, reads, shape, _PART) if parts else chunking.windows(kernel, reads, shape, chunks)
    )
    if check and not isinstance(layers, da.Array):
        _check_sun(samples[1:], layers[3], geometry)
    return layers, places


def sky_under(zenith, data, places, geometry):
    """Sky vector and horizon toward the sun at places in memory, below a known horizon, shape (4, y, x). [1]"""
    samples, _ = _samples(data, places)
    layers = _layers(horizons.tangent(zenith), horizons.azimuths(len(zenith)), samples[1:], geometry)
    _check_sun(samples[1:], layers[3], geometry)
    return layers


def _layers(tangents, directions, own, geometry):
    """Sky vector, and tangent of the horizon toward the sun."""
    vector = sky_vector(tangents, directions, *own)
    return np.concatenate([vector, horizons.horizon_toward(tangents, directions, geometry.saa)[None]])


def _samples(data, places):
    """Elevation and gradient at some places, shape (3, y, x), and the chunks of a lazy result."""
    cells, size = places.cells, grids.cell_size(places.grid)

    def kernel(rows, columns, block):
        i, j = (at[part] - at[part.start] + 1 for at, part in zip(cells, (rows, columns), strict=True))
        return np.stack([block[np.ix_(i, j)], *gradient(block, *size, i, j)])

    known = chunking.margin_reads(data, 1).array
    reads = chunking.Reads(known, *((each - 1, each + 2) for each in cells))
    chunks = None
    if isinstance(data, da.Array):
        chunks = tuple(chunking.runs(at, sizes) for at, sizes in zip(cells, data.chunks, strict=True))
    return chunking.windows(kernel, [reads], (3, *map(len, cells)), chunks), chunks


def useful_reach(reach, places):
    """Reach limited to the diagonal of the raster, beyond which all is open, and at least one cell. [m]"""
    (down, across), rows, columns = places.cell, places.rows.size, places.columns.size
    return max(min(reach, float(np.hypot(rows * down, columns * across))), down, across)


def _check_sun(own, toward_sun, geometry):
    """Raise ValueError if the sun is below the horizon everywhere."""
    sun = direction_vector(geometry.sza, geometry.saa)
    lit = (along_normal(sun, *own) > 0) & (toward_sun * np.hypot(sun.x, sun.y) <= sun.z)
    if np.isfinite(own).any() and not lit.any():
        raise ValueError(
            f"the sun (sza {geometry.sza:g}, {geometry.saa:.1f} from grid north) is below the horizon of every slope: "
            "no light falls on this terrain"
        )
