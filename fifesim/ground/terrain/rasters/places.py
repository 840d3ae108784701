"""Places at which the sky of an elevation model is found, coarser than its cells, and where cells lie between them."""

from typing import NamedTuple

import numpy as np
from affine import Affine
from odc.geo.geobox import GeoBox

from fifesim.ground.terrain.between_places import bilinear
from fifesim.ground.terrain.lit_slopes import Sky
from fifesim.rasters import cf, projection
from fifesim.rasters import chunks as chunking
from fifesim.rasters import grid as grids


class Places(NamedTuple):
    """Evenly spaced rows and columns, counted in cells of an elevation model, and their spacing."""

    grid: GeoBox
    """Of the elevation."""
    rows: np.ndarray
    columns: np.ndarray
    step: tuple[float, float]

    @property
    def cell(self):
        """Spacing down and across. [m]"""
        return tuple(step * size for step, size in zip(self.step, grids.cell_size(self.grid), strict=True))

    @property
    def coarse(self):
        """Grid whose cells have the places as centres."""
        down, across = self.cell
        x, y = projection.transform_points(self.grid.affine, self.columns[0] + 0.5, self.rows[0] + 0.5)
        affine = Affine(across, 0.0, float(x) - across / 2, 0.0, -down, float(y) + down / 2)
        return GeoBox((self.rows.size, self.columns.size), affine, self.grid.crs)

    @property
    def cells(self):
        """The nearest rows and columns of the elevation."""
        return tuple(
            np.clip(np.round(at), 0, size - 1).astype(int)
            for at, size in zip((self.rows, self.columns), self.grid.shape, strict=True)
        )

    def between(self, offset, shape):
        """
        Where cells of the elevation lie between the places.

        Parameters
        ----------
        offset : (int, int)
            Row and column of the first of them.
        shape : (int, int)
            Rows and columns of them.

        Returns
        -------
        between : Between
        """
        axes = zip((self.rows, self.columns), offset, shape, strict=True)
        return Between(*(_between(at, first + np.arange(size)) for at, first, size in axes))


class Between(NamedTuple):
    """For each row and each column of cells the place before it, and the share of that after it."""

    rows: tuple[np.ndarray, np.ndarray]
    columns: tuple[np.ndarray, np.ndarray]

    def reads(self, layers):
        """
        What the cells read of values at the places.

        Parameters
        ----------
        layers : numpy.ndarray or dask.array.Array, shape (..., y, x)

        Returns
        -------
        reads : fifesim.rasters.chunks.Reads
        """
        sizes = layers.shape[-2:]
        spans = ((before, np.minimum(before + 2, size)) for (before, _), size in zip(self, sizes, strict=True))
        return chunking.Reads(layers, *spans)

    def values(self, layer, rows, columns):
        """
        Values of a block of cells, bilinear between the places.

        Parameters
        ----------
        layer : array, shape (y, x)
            What the block reads.
        rows, columns : slice
            Of cells.

        Returns
        -------
        values : array, shape (rows, columns)
        """
        (row, down), (column, across) = self
        row, column = row[rows] - row[rows.start], column[columns] - column[columns.start]
        return bilinear(layer, (row, down[rows]), (column, across[columns]))

    def sky(self, layers, rows, columns):
        """
        The sky of a block of cells.

        Parameters
        ----------
        layers : array, shape (4, y, x)
            What the block reads.
        rows, columns : slice
            Of cells.

        Returns
        -------
        sky : fifesim.ground.terrain.lit_slopes.Sky
        """
        (row, row_share), (column, column_share) = self
        row, column = row[rows] - row[rows.start], column[columns] - column[columns.start]
        return Sky(layers, row, row_share[rows], column, column_share[columns])


def places_of(grid, resolution):
    """
    Every so many cells, counted from the origin of the CRS, so that all windows share them.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox
        Of an elevation model.
    resolution : float
        Their spacing, to a whole number of cells. [m]

    Returns
    -------
    places : Places
    """
    found, steps = [], []
    for first, size, cell in zip(grids.lattice_position(grid), grid.shape, grids.cell_size(grid), strict=True):
        step = max(1, round(resolution / cell))
        at = np.arange((step // 2 - first) % step, size, step)
        found.append((at if at.size else np.array([size // 2])).astype(float))
        steps.append(float(step))
    return Places(grid, *found, tuple(steps))


def horizon_places(grid, horizon):
    """
    Those of a known horizon that lie on an elevation model, and one more on each side.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox
        Of the elevation.
    horizon : xarray.DataArray, dims (direction, y, x)
        [degree]

    Returns
    -------
    places : Places
    cut : (slice, slice)
        Rows and columns of the horizon.

    Raises
    ------
    ValueError
        If the horizon does not cover the elevation, or its directions are few or uneven.
    """
    _check_horizon(grid, horizon)
    return places_on(grid, grids.geobox(horizon))


def places_on(grid, coarse):
    """
    Places of a coarse grid that lie on an elevation model, and one more on each side.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox
        Of the elevation.
    coarse : odc.geo.geobox.GeoBox
        Whose cells have places as centres; it reaches further.

    Returns
    -------
    places : Places
    cut : (slice, slice)
        Rows and columns of the coarse grid.
    """
    positions, cut = _positions(grid, coarse), _around(grid, coarse)
    step = tuple(size / cell for size, cell in zip(grids.cell_size(coarse), grids.cell_size(grid), strict=True))
    return Places(grid, *(at[part] for at, part in zip(positions, cut, strict=True)), step), cut


def between_places(grid, offset, data, layers, places, geometry):
    """
    What gives a block of a kernel on slopes, and what that reads.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox
        Of the result.
    offset : (int, int)
        Rows and columns of the elevation before it.
    data, layers : numpy.ndarray or dask.array.Array
        Elevation, and the sky at places of it as `fifesim.ground.terrain.rasters.sky.sky_above` has it.
    places : fifesim.ground.terrain.rasters.places.Places
    geometry : fifesim.base.geometry.Geometry
        Of sun and sensor, from grid north.

    Returns
    -------
    of_block : callable
        ``of_block(kernel, rows, columns, elevation, layers, *others)`` calls ``kernel(*others, elevation, sky, cell,
        geometry)`` for two slices of the result.
    reads : list
        As `fifesim.rasters.chunks.windows` takes them, of elevation and layers.
    """
    cell, shape = grids.cell_size(grid), tuple(grid.shape)
    between = places.between(offset, shape)

    def of_block(kernel, rows, columns, elevation, layers, *rho):
        return kernel(*rho, elevation, between.sky(layers, rows, columns), cell, geometry)

    return of_block, [chunking.margin_reads(data, 1, offset=offset, shape=shape), between.reads(layers)]


def chunks_beside(dem, coarse):
    """
    Chunks of a coarse grid that end where those of the elevation in its midst do.

    Parameters
    ----------
    dem : xarray.DataArray, dims (y, x)
        Elevation; where it is not lazy, all of it is one chunk.
    coarse : odc.geo.geobox.GeoBox

    Returns
    -------
    chunks : (tuple of int, tuple of int)
    """
    grid, own = grids.geobox(dem), dem.chunks or tuple((size,) for size in dem.shape)
    chunks = []
    for at, cut, sizes in zip(_positions(grid, coarse), _around(grid, coarse), own, strict=True):
        inside = np.clip(np.round(at[cut]), 0, sum(sizes) - 1)
        beyond = cut.start, at.size - min(cut.stop, at.size)
        chunks.append(tuple(filter(None, (beyond[0], *chunking.runs(inside, sizes), beyond[1]))))
    return tuple(chunks)


def _between(places, cells):
    """For each cell the place before it and the share of that after it; beyond the outermost, on a straight line."""
    if places.size == 1:
        return np.zeros(cells.size, int), np.zeros(cells.size)
    before = np.clip(np.searchsorted(places, cells, side="right") - 1, 0, places.size - 2)
    return before, (cells - places[before]) / (places[before + 1] - places[before])


def _positions(grid, coarse):
    """Rows and columns of the elevation's cells at which the places of a coarse grid lie."""
    a, b = grid.affine, coarse.affine
    rows = (b.f + (np.arange(coarse.shape.y) + 0.5) * b.e - a.f) / a.e - 0.5
    columns = (b.c + (np.arange(coarse.shape.x) + 0.5) * b.a - a.c) / a.a - 0.5
    return np.round(rows, 6), np.round(columns, 6)


def _around(grid, coarse):
    """Slices of the places of a coarse grid that lie on the elevation, and one more on each side."""
    cuts = []
    for at, size in zip(_positions(grid, coarse), grid.shape, strict=True):
        first, last = np.searchsorted(at, (0, size - 1), side="right")
        cuts.append(slice(max(int(first) - 1, 0), int(last) + 1))
    return tuple(cuts)


def _check_horizon(grid, horizon):
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
