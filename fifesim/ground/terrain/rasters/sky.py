"""The horizon of labelled elevation, and the part of the sky that it leaves, at the resolution of its source."""

from functools import partial
from typing import NamedTuple

import dask.array as da
import numpy as np
import xarray as xr
from affine import Affine
from odc.geo.geobox import GeoBox

from fifesim.ground.terrain import horizon as horizons
from fifesim.ground.terrain import light as lights
from fifesim.ground.terrain import slope as terrain
from fifesim.rasters import cf
from fifesim.rasters import chunks as chunking
from fifesim.rasters import grid as grids

DIRECTIONS = 32
REACH = 5000.0  # [m]

# Where a model does not say at what distance its elevations are independent. [m]
_SOURCE_RESOLUTION = 30.0

REFERENCE = "Dozier and Frew (1990), doi:10.1109/36.58986"


def horizon(dem, *, directions=DIRECTIONS, reach=REACH, resolution=None, beside=None):
    """
    Horizon of the land around, at the resolution of the elevation's source.

    Parameters
    ----------
    dem : xarray.DataArray, dims (y, x)
        Missing cells, and all beyond the raster, count as open. [m]
    directions : int, optional
        Number of azimuths, from north on.
    reach : float, optional
        Greatest distance of terrain that counts. [m]
    resolution : float, optional
        Spacing of the cells at which the horizon is found, as a whole number of cells; by default the attribute
        ``source_resolution`` of ``dem``, else 30 m. [m]
    beside : xarray.DataArray, dims (y, x), optional
        A lazy elevation model that ``dem`` lies around. A lazy result then has a chunk for each of its.

    Returns
    -------
    horizon : xarray.DataArray, dims (direction, y, x)
        Zenith angle; its places are cells of ``dem``, the same in every window. [degree]

    Raises
    ------
    ValueError
        As in `slope`; or if directions or reach are too few or short.

    See Also
    --------
    fifesim.ground.terrain.horizon.horizon_zenith
    """
    grid = elevation_grid(dem)
    azimuths = horizons.azimuths(directions)
    places = _places(grid, source_resolution(dem, resolution))
    data = dem.transpose("y", "x").data
    samples, chunks = _samples(data, grid, places)
    cell = _cell(grid, places)
    horizons.horizon_margin(*cell, reach)
    useful = _useful_reach(reach, cell, samples.shape[1:])
    reads = chunking.margin_reads(samples[0], *horizons.horizon_margin(*cell, useful))
    if chunks is not None and beside is not None and beside.chunks is not None:
        chunks = _chunks_beside(beside.transpose("y", "x"), _coarse_grid(grid, places))

    def kernel(rows, columns, block):
        return horizons.horizon_zenith(block, *cell, azimuths, useful)

    out = chunking.windows(kernel, [reads], (len(azimuths), *samples.shape[1:]), chunks)
    names = {"direction": xr.DataArray(azimuths, dims="direction", attrs={"units": "degree", "long_name": "azimuth"})}
    out = grids.place(xr.DataArray(out, dims=("direction", "y", "x"), coords=names), _coarse_grid(grid, places))
    said = f"horizon: {directions} directions, {reach:g} m far, at {cell[0]:g} x {cell[1]:g} m"
    return cf.label(out, "horizon", source=dem, history=said, references=REFERENCE)


class _Places(NamedTuple):
    """Where the sky is found: rows and columns counted in the elevation's cells, and their spacing."""

    rows: np.ndarray
    columns: np.ndarray
    step: tuple[float, float]

    def cells(self, shape):
        """The nearest cells of the elevation."""
        return tuple(np.clip(np.round(at), 0, size - 1).astype(int) for at, size in zip(self[:2], shape, strict=True))


class Between(NamedTuple):
    """For each row and each column of the elevation, the place before it and the share of that after it."""

    rows: tuple[np.ndarray, np.ndarray]
    columns: tuple[np.ndarray, np.ndarray]

    def reads(self, layers, offset, shape):
        """
        What cells of the elevation read of values at the places.

        Parameters
        ----------
        layers : numpy.ndarray or dask.array.Array, shape (..., y, x)
        offset : (int, int)
            Row and column of the elevation that the first cell lies on.
        shape : (int, int)
            Rows and columns of cells.

        Returns
        -------
        reads : fifesim.rasters.chunks.Reads
        """
        spans = []
        for (before, _), first, size, length in zip(self, offset, shape, layers.shape[-2:], strict=True):
            low = before[first : first + size]
            spans.append((low, np.minimum(low + 2, length)))
        return chunking.Reads(layers, *spans)

    def block(self, rows, columns, offset):
        """
        The same for a block of cells and of what it reads, as `illumination.slope_light` takes it.

        Parameters
        ----------
        rows, columns : slice
            Of cells.
        offset : (int, int)
            As in `reads`.

        Returns
        -------
        rows, columns : (array of int, array)
        """
        found = []
        for (before, share), part, first in zip(self, (rows, columns), offset, strict=True):
            cells = slice(part.start + first, part.stop + first)
            found.append((before[cells] - before[cells.start], share[cells]))
        return found


def sky_above(data, grid, resolution, horizon, geometry, check=True):
    """
    The part of the sky that is seen from an elevation model.

    Parameters
    ----------
    data : numpy.ndarray or dask.array.Array, shape (y, x)
        Elevation. [m]
    grid : odc.geo.geobox.GeoBox
        Its cells.
    resolution : float
        Spacing of the places where the sky is found. [m]
    horizon : xarray.DataArray, dims (direction, y, x), or None
        A known one, at whose places it is found instead. [degree]
    geometry : fifesim.base.geometry.Geometry
        Of the sun.
    check : bool, optional
        Refuse a sun that shines nowhere, where nothing is lazy.

    Returns
    -------
    layers : numpy.ndarray or dask.array.Array, shape (4, y, x)
        Vector of `terrain.sky_vector` and tangent of the horizon toward the sun, at some places. [1]
    between : Between
        Where the cells lie between them.

    Raises
    ------
    ValueError
        If the horizon does not cover the elevation, or the sun reaches no slope.
    """
    places = _places(grid, resolution) if horizon is None else _horizon_places(grid, horizon)
    samples, chunks = _samples(data, grid, places)
    reads = [chunking.margin_reads(samples[1:], 0)]
    if horizon is None:
        cell, directions = _cell(grid, places), horizons.azimuths(DIRECTIONS)
        reach = _useful_reach(REACH, cell, samples.shape[1:])
        reads.append(chunking.margin_reads(samples[0], *horizons.horizon_margin(*cell, reach)))
        find = partial(horizons.horizon_tangent, cell_y=cell[0], cell_x=cell[1], directions=directions, reach=reach)
    else:
        directions, find = horizon["direction"].values.astype(float), horizons.tangent
        cut = _around(grid, grids.geobox(horizon))
        reads.append(chunking.margin_reads(horizon.transpose("direction", "y", "x").data[(slice(None), *cut)], 0))

    def kernel(rows, columns, gradient, block):
        tangents = find(block)
        vector = terrain.sky_vector(tangents, directions, *gradient)
        return np.concatenate([vector, lights.horizon_toward(tangents, directions, geometry.saa)[None]])

    layers = chunking.windows(kernel, reads, (4, *samples.shape[1:]), chunks)
    if check and not isinstance(layers, da.Array):
        _check_sun(samples[1:], layers[3], geometry)
    return layers, Between(*(_between(at, size) for at, size in zip(places[:2], data.shape, strict=True)))


def _samples(data, grid, places):
    """Elevation and gradient at some places, shape (3, y, x), and the chunks of a lazy result."""
    cells, size = places.cells(data.shape), grids.cell_size(grid)

    def kernel(rows, columns, block):
        i, j = (at[part] - at[part.start] + 1 for at, part in zip(cells, (rows, columns), strict=True))
        return np.stack([block[np.ix_(i, j)], *terrain.gradient(block, *size, i, j)])

    known = chunking.margin_reads(data, 1).array
    reads = chunking.Reads(known, *((each - 1, each + 2) for each in cells))
    chunks = None
    if isinstance(data, da.Array):
        chunks = tuple(chunking.runs(at, sizes) for at, sizes in zip(cells, data.chunks, strict=True))
    return chunking.windows(kernel, [reads], (3, *map(len, cells)), chunks), chunks


def _places(grid, resolution):
    """Every so many cells, counted from the origin of the CRS, so that all windows share them."""
    found, steps = [], []
    for first, size, cell in zip(grids.lattice_position(grid), grid.shape, grids.cell_size(grid), strict=True):
        step = max(1, round(resolution / cell))
        at = np.arange((step // 2 - first) % step, size, step)
        found.append((at if at.size else np.array([size // 2])).astype(float))
        steps.append(float(step))
    return _Places(*found, tuple(steps))


def _cell(grid, places):
    return tuple(step * cell for step, cell in zip(places.step, grids.cell_size(grid), strict=True))


def _useful_reach(reach, cell, shape):
    """No further than the raster's diagonal, beyond which all is open, and no less than a cell."""
    diagonal = np.hypot(*(size * length for size, length in zip(shape, cell, strict=True)))
    return max(min(reach, float(diagonal)), *cell)


def _coarse_grid(grid, places):
    a, (down, across) = grid.affine, _cell(grid, places)
    x, y = grids.transform_points(a, places.columns[0] + 0.5, places.rows[0] + 0.5)
    shape = places.rows.size, places.columns.size
    return GeoBox(shape, Affine(across, 0.0, float(x) - across / 2, 0.0, -down, float(y) + down / 2), grid.crs)


def _chunks_beside(dem, coarse):
    """Chunks of a coarse grid that end where those of the elevation in its midst do."""
    grid = grids.geobox(dem)
    positions = _coarse_positions(grid, coarse)[0]
    chunks = []
    for at, cut, sizes in zip(positions, _around(grid, coarse), dem.chunks, strict=True):
        inside = np.clip(np.round(at[cut]), 0, sum(sizes) - 1)
        beyond = cut.start, at.size - min(cut.stop, at.size)
        chunks.append(tuple(filter(None, (beyond[0], *chunking.runs(inside, sizes), beyond[1]))))
    return tuple(chunks)


def _coarse_positions(grid, coarse):
    """Rows and columns of the elevation's cells at which the places of a coarse grid lie."""
    a, b = grid.affine, coarse.affine
    rows = (b.f + (np.arange(coarse.shape.y) + 0.5) * b.e - a.f) / a.e - 0.5
    columns = (b.c + (np.arange(coarse.shape.x) + 0.5) * b.a - a.c) / a.a - 0.5
    return [np.round(each, 6) for each in (rows, columns)], (b.e / a.e, b.a / a.a)


def _around(grid, coarse):
    """Slices of the places of a coarse grid that lie on the elevation, and one more on each side."""
    cuts = []
    for at, size in zip(_coarse_positions(grid, coarse)[0], grid.shape, strict=True):
        first, last = np.searchsorted(at, (0, size - 1), side="right")
        cuts.append(slice(max(int(first) - 1, 0), int(last) + 1))
    return cuts


def _horizon_places(grid, horizon):
    _check_horizon(grid, horizon)
    coarse = grids.geobox(horizon)
    positions, step = _coarse_positions(grid, coarse)
    return _Places(*(at[cut] for at, cut in zip(positions, _around(grid, coarse), strict=True)), step)


def _between(places, size):
    """For each cell the place before it and the share of that after it; beyond the outermost, on a straight line."""
    cells = np.arange(size)
    if places.size == 1:
        return np.zeros(size, int), np.zeros(size)
    before = np.clip(np.searchsorted(places, cells, side="right") - 1, 0, places.size - 2)
    return before, (cells - places[before]) / (places[before + 1] - places[before])


def elevation_grid(dem):
    """
    Grid of an elevation model.

    Parameters
    ----------
    dem : xarray.DataArray, dims (y, x)
        [m]

    Returns
    -------
    grid : odc.geo.geobox.GeoBox

    Raises
    ------
    ValueError
        If its units are not metres, it marks missing cells by a number, or it does not lie north up in a projected CRS
        in metres.
    TypeError
        If it is no DataArray.
    """
    if not isinstance(dem, xr.DataArray):
        raise TypeError(f"a dem is an xarray.DataArray, got {dem!r}: bring it onto the grid with fifesim.fine_dem")
    cf.check_units(dem, "dem")
    grid = grids.geobox(dem)
    nodata = dem.rio.nodata
    if nodata is not None and np.isfinite(nodata):
        raise ValueError(
            f"the dem marks missing cells as {nodata:g}, which would be taken for an elevation: "
            "open it with masked=True, or bring it onto the grid with fifesim.fine_dem"
        )
    return grid


def source_resolution(dem, given=None):
    """
    Distance from which on elevations are independent.

    Parameters
    ----------
    dem : xarray.DataArray
    given : float, optional
        Wins over the attribute ``source_resolution``, without which it is 30 m. [m]

    Returns
    -------
    resolution : float
        [m]

    Raises
    ------
    ValueError
        If it is not positive.
    """
    found = float(dem.attrs.get("source_resolution", _SOURCE_RESOLUTION) if given is None else given)
    if not 0 < found < np.inf:
        raise ValueError(f"the resolution of an elevation's source must be positive metres, got {found:g}")
    return found


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


def _check_sun(gradient, toward_sun, geometry):
    """Somewhere the sun must shine."""
    east, north, up = lights.direction_vector(geometry.sza, geometry.saa)
    facing = up - gradient[0] * east - gradient[1] * north > 0
    lit = facing & (toward_sun * np.hypot(east, north) <= up)
    if np.isfinite(gradient).any() and not lit.any():
        raise ValueError(
            f"the sun (sza {geometry.sza:g}, {geometry.saa:.1f} from grid north) is below the horizon of every slope: "
            "no light falls on this terrain"
        )
