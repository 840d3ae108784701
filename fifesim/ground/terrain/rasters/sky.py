"""The horizon of labelled elevation, and the part of the sky that it leaves, at the resolution of its source."""

from __future__ import annotations

from functools import partial

import dask.array as da
import numpy as np
import xarray as xr

from fifesim.ground.terrain import horizon as horizons
from fifesim.ground.terrain.light import direction_vector
from fifesim.ground.terrain.rasters.dem import REFERENCE, elevation_grid, source_resolution
from fifesim.ground.terrain.rasters.places import chunks_beside, horizon_places, places_of
from fifesim.ground.terrain.sky import sky_vector
from fifesim.ground.terrain.slope import along_normal, gradient
from fifesim.rasters import cf
from fifesim.rasters import chunks as chunking
from fifesim.rasters import grid as grids

DIRECTIONS = 32
REACH = 5000.0  # [m]


def horizon(
    dem: xr.DataArray,
    *,
    directions: int = DIRECTIONS,
    reach: float = REACH,
    resolution: float | None = None,
    beside: xr.DataArray | None = None,
) -> xr.DataArray:
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
        An elevation model that ``dem`` lies around. A lazy result then has a chunk for each of its, one if it is not
        lazy.

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
    horizons.horizon_margin(*places.cell, reach)
    useful = useful_reach(reach, places)
    reads = chunking.margin_reads(samples[0], *horizons.horizon_margin(*places.cell, useful))
    if chunks is not None and beside is not None:
        chunks = chunks_beside(beside.transpose("y", "x"), places.coarse)

    def kernel(rows, columns, block):
        return horizons.horizon_zenith(block, *places.cell, azimuths, useful)

    out = chunking.windows(kernel, [reads], (len(azimuths), *samples.shape[1:]), chunks)
    names = {"direction": xr.DataArray(azimuths, dims="direction", attrs={"units": "degree", "long_name": "azimuth"})}
    out = grids.place(xr.DataArray(out, dims=("direction", "y", "x"), coords=names), places.coarse)
    down, across = places.cell
    said = f"horizon: {directions} directions, {reach:g} m far, at {down:g} x {across:g} m"
    return cf.label(out, "horizon", source=dem, history=said, references=REFERENCE)


def sky_above(data, grid, resolution, horizon, geometry, check=True):
    """
    The part of the sky that is seen from places of an elevation model.

    Parameters
    ----------
    data : numpy.ndarray or dask.array.Array, shape (y, x)
        Elevation. [m]
    grid : odc.geo.geobox.GeoBox
        Its cells.
    resolution : float
        Spacing of the places. [m]
    horizon : xarray.DataArray, dims (direction, y, x), or None
        A known one, at whose places the sky is found instead. [degree]
    geometry : fifesim.base.geometry.Geometry
        Of the sun.
    check : bool, optional
        Refuse a sun that shines nowhere, where nothing is lazy.

    Returns
    -------
    layers : numpy.ndarray or dask.array.Array, shape (4, y, x)
        Those of `fifesim.ground.terrain.lit_slopes.Sky`. [1]
    places : fifesim.ground.terrain.rasters.places.Places

    Raises
    ------
    ValueError
        If the horizon does not cover the elevation, or the sun reaches no slope.
    """
    places, cut = (places_of(grid, resolution), None) if horizon is None else horizon_places(grid, horizon)
    samples, chunks = _samples(data, places)
    if horizon is None:
        directions, reach = horizons.azimuths(DIRECTIONS), useful_reach(REACH, places)
        known = chunking.margin_reads(samples[0], *horizons.horizon_margin(*places.cell, reach))
        cell_y, cell_x = places.cell
        find = partial(horizons.horizon_tangent, cell_y=cell_y, cell_x=cell_x, directions=directions, reach=reach)
    else:
        directions, find = horizon["direction"].values.astype(float), horizons.tangent
        known = chunking.margin_reads(horizon.transpose("direction", "y", "x").data[(slice(None), *cut)], 0)

    def kernel(rows, columns, own, block):
        return _layers(find(block), directions, own, geometry)

    reads = [chunking.margin_reads(samples[1:], 0), known]
    layers = chunking.windows(kernel, reads, (4, *samples.shape[1:]), chunks)
    if check and not isinstance(layers, da.Array):
        _check_sun(samples[1:], layers[3], geometry)
    return layers, places


def sky_under(zenith, data, places, geometry):
    """
    The part of the sky that is seen from places of an elevation model in memory, under a known horizon.

    Parameters
    ----------
    zenith : array, shape (direction, y, x)
        Of the horizon at the places. [degree]
    data : array, shape (y, x)
        Elevation. [m]
    places : fifesim.ground.terrain.rasters.places.Places
    geometry : fifesim.base.geometry.Geometry
        Of the sun.

    Returns
    -------
    layers : array, shape (4, y, x)
        As of `sky_above`. [1]

    Raises
    ------
    ValueError
        If the sun reaches no slope.
    """
    samples, _ = _samples(data, places)
    layers = _layers(horizons.tangent(zenith), horizons.azimuths(len(zenith)), samples[1:], geometry)
    _check_sun(samples[1:], layers[3], geometry)
    return layers


def _layers(tangents, directions, own, geometry):
    """Vector of the sky, and tangent of the horizon toward the sun."""
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
    """
    Distance of terrain that counts: no further than the raster's diagonal, beyond which all is open, nor less than a
    cell.

    Parameters
    ----------
    reach : float
        Asked for. [m]
    places : fifesim.ground.terrain.rasters.places.Places

    Returns
    -------
    reach : float
        [m]
    """
    (down, across), rows, columns = places.cell, places.rows.size, places.columns.size
    return max(min(reach, float(np.hypot(rows * down, columns * across))), down, across)


def _check_sun(own, toward_sun, geometry):
    """Somewhere the sun must shine."""
    sun = direction_vector(geometry.sza, geometry.saa)
    lit = (along_normal(sun, *own) > 0) & (toward_sun * np.hypot(sun.x, sun.y) <= sun.z)
    if np.isfinite(own).any() and not lit.any():
        raise ValueError(
            f"the sun (sza {geometry.sza:g}, {geometry.saa:.1f} from grid north) is below the horizon of every slope: "
            "no light falls on this terrain"
        )
