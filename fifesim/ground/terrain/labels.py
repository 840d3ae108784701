"""Slope, wetness and light of labelled elevation."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import dask.array as da
import numpy as np
import xarray as xr
from scipy import ndimage

from fifesim.base.arguments import Time
from fifesim.base.geometry import Geometry, fife_geometry
from fifesim.grids import cf, directions, projection
from fifesim.grids import chunks as chunking
from fifesim.grids import grid as grids
from fifesim.grids.chunks import apart
from fifesim.grids.directions import Directions, from_grid_north
from fifesim.grids.grid import as_carried, centres_of, with_crs_of
from fifesim.grids.inputs import Horizon
from fifesim.grids.source import one_layer
from fifesim.grids.windows import gather, lazy_together
from fifesim.ground.terrain import horizon as horizons
from fifesim.ground.terrain import sky_labels
from fifesim.ground.terrain.flint_hills import elevation_around, hills_elevation
from fifesim.ground.terrain.lit_slopes import slope_factor, slope_factor_and_reflectance, slope_light, slope_reflectance
from fifesim.ground.terrain.slope import bilinear, slope_aspect, steepness
from fifesim.ground.terrain.source_labels import REFERENCE, elevation_grid, look_at_altitude, source_resolution
from fifesim.ground.terrain.wetness import wetness_index

# The meridian convergence is computed at nodes with this spacing, and is linear in between. [m]
_NODES = 1000.0


def slope(dem: xr.DataArray) -> xr.DataArray:
    """
    Slope of the ground.

    Parameters
    ----------
    dem : xarray.DataArray, dims (y, x)
        [m]

    Returns
    -------
    slope : xarray.DataArray, dims (y, x)
        Slope from central differences; one-sided at edges and next to missing cells. [degree]

    Raises
    ------
    ValueError
        If the elevation is not in metres on a north-up grid in a projected CRS.

    See Also
    --------
    fifesim.terrain.aspect, fifesim.kt

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> dem = fifesim.flint_hills(grid, seed=7)
    >>> bool((dem.fifesim.slope() < 30).all())
    True
    """
    grid = elevation_grid(dem)

    def kernel(block):
        return steepness(block, *grids.cell_size(grid))

    return _labelled_slope(chunking.neighbourhood(kernel, dem, 1), dem, grid, "slope")


def aspect(dem: xr.DataArray) -> xr.DataArray:
    """
    Azimuth down the slope, clockwise from true north.

    Grid north differs from true north by the meridian convergence, which is added at each cell. Projections that do not
    preserve angles add a distortion, such as 0.2 degrees for EPSG:3035 at 30 degrees east.

    Parameters
    ----------
    dem : xarray.DataArray, dims (y, x)
        [m]

    Returns
    -------
    aspect : xarray.DataArray, dims (y, x)
        Named ``ground_slope_direction`` as in CF; 0 on level ground. The convergence is interpolated between nodes 1 km
        apart, within 0.001 degrees farther than 100 km from a pole. [degree]

    Raises
    ------
    ValueError
        As in `slope`.

    See Also
    --------
    fifesim.terrain.slope, fifesim.terrain.illumination

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> dem = fifesim.flint_hills(grid, seed=7)
    >>> aspect = dem.fifesim.aspect()
    >>> bool(((aspect >= 0) & (aspect < 360)).all())
    True
    """
    grid = elevation_grid(dem)
    crs, cell, first = grid.crs.to_wkt(), grids.cell_size(grid), grids.lattice_position(grid)

    def kernel(rows, columns, block):
        steep, from_grid_north = slope_aspect(block, *cell)
        turn = _convergence(crs, cell, first[0] + rows.start, first[1] + columns.start, steep.shape)
        return np.where(steep == 0, 0.0, (from_grid_north + turn) % 360)

    return _labelled_slope(chunking.neighbourhood(kernel, dem, 1, located=True), dem, grid, "aspect")


def _labelled_slope(raster, dem, grid, name):
    """Raster with its grid and the attributes of a quantity derived from elevation."""
    history = f"{name}: central differences"
    return cf.label(grids.place(raster, grid), name, source=dem, history=history, references=REFERENCE)


def _convergence(crs, cell, row, column, shape):
    """Meridian convergence of cells [degree], a function of their place on the lattice of the CRS alone."""
    positions, nodes = [], []
    for size, start, count in zip(cell, (row, column), shape, strict=True):
        step = max(round(_NODES / size), 1)
        at, inside = np.divmod(start + np.arange(count), step)
        positions.append((at - at[0], inside / step))
        nodes.append((at[0] + np.arange(at[-1] - at[0] + 2)) * step * size)
    south, east = nodes
    found = np.radians(projection.convergence_at(crs, *np.broadcast_arrays(east, -south[:, None])))
    # Sine and cosine pass over the jump from 180 to -180 degrees.
    return np.degrees(np.arctan2(*(bilinear(part, *positions) for part in (np.sin(found), np.cos(found)))))


_REFERENCE = "Beven and Kirkby (1979), doi:10.1080/02626667909491834"


def wetness(dem: xr.DataArray, *, resolution: float | None = None) -> xr.DataArray:
    """
    Topographic wetness index, at the resolution of the elevation source.

    Parameters
    ----------
    dem : xarray.DataArray, dims (y, x)
        [m]
    resolution : float, optional
        Spacing of the nodes at which the index is computed, a whole number of cells; by default the attribute
        ``source_resolution`` of ``dem``, else the cell size. The index is interpolated between nodes. [m]

    Returns
    -------
    wetness : xarray.DataArray, dims (y, x)
        Natural logarithm of the drained area per metre of contour over slope. Lazy if ``dem`` is, and independent of
        chunks. A window does not include water that flows in from outside. [ln m]

    Raises
    ------
    ValueError
        If the elevation is not in metres on a north-up grid in a projected CRS, or the resolution is not positive.

    Notes
    -----
    All nodes are in memory at the same time: 1.2 % of the number of cells for cells of 3.33 m and nodes of 30 m. A lazy
    elevation is computed twice, for nodes and for cells, to limit memory.

    See Also
    --------
    fifesim.terrain.slope, fifesim.landscape

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> dem = fifesim.flint_hills(grid, seed=7)
    >>> wetness = dem.fifesim.wetness()
    >>> wetness.attrs["long_name"]
    'topographic wetness index'
    """
    grid = elevation_grid(dem)
    places = sky_labels.places_of(grid, source_resolution(dem, resolution))
    data = dem.transpose(..., "y", "x").data
    between = places.between((0, 0), tuple(grid.shape))

    def block(rows, columns, elevation, index):
        found = between.values(index, rows, columns)
        np.copyto(found, np.nan, where=np.isnan(elevation))
        return found

    reads = [chunking.margin_reads(data, 0), between.reads(_at_places(data, places))]
    out = chunking.windows(block, reads, data.shape, data.chunks if isinstance(data, da.Array) else None)
    out = grids.place(xr.DataArray(out, dims=("y", "x")), grid)
    down, across = places.cell
    history = f"wetness: topographic index, at {down:g} x {across:g} m"
    return cf.label(out, "wetness", source=dem, history=history, references=_REFERENCE)


def _at_places(data, places):
    """Wetness index at the places, computed in one task because water crosses chunks."""
    rows, columns = places.cells

    def index(elevation):
        found = wetness_index(elevation, *places.cell)
        if np.isnan(found).all():
            return found
        # Cells next to a gap lie between known and unknown nodes.
        nearest = ndimage.distance_transform_edt(np.isnan(found), return_distances=False, return_indices=True)
        return found[tuple(nearest)]

    if not isinstance(data, da.Array):
        return index(np.asarray(data[np.ix_(rows, columns)], float))
    samples = apart(data[rows][:, columns])
    return samples.map_blocks(index, dtype=float, meta=np.empty((0, 0)))


class Sunlight(NamedTuple):
    """Ground below one direction of sun and sensor, and the transmittance of the air above it."""

    dem: xr.DataArray  # elevation on the cells of a reflectance, or on more of them, dims (y, x). [m]
    geometry: Geometry
    direct_transmittance: np.ndarray  # transmittance of the sunbeam down to the ground, shape (band,). [1]
    transmittance_down: np.ndarray  # transmittance of all light down to the ground, shape (band,). [1]
    horizon: xr.DataArray | None = None  # as in `sky_view`. [degree]


# History of results, and name of Kt.
_KT = "kt: Eq. 4", "kt"
_EQUATIONS = {True: "terrain: Kt (Eq. 4) and view cosine (Eq. 5)", False: "terrain: Kt (Eq. 4)"}


def kt_on_slopes(reflectance, light):
    """Topographic correction factor Kt [1] of each band, for a level reflectance (band, y, x) and its Sunlight."""
    level = reflectance.transpose("band", "y", "x")
    return labelled_slopes(_lit(slope_factor, level, light), level, light, *_KT)


def terrain_reflectance(reflectance, light, upwelling=True):
    """Reflectance factor of ground on slopes relative to the irradiance of level ground, dims (band, y, x). [1]"""
    # Slopes and the local cosines of sun and view are those at each cell. The horizon and the visible sky are computed
    # at the resolution of the source of the elevation, and interpolated.
    cf.check_units(reflectance, "surface_reflectance")
    level = reflectance.transpose("band", "y", "x")
    return labelled_slopes(_lit(slope_reflectance, level, light, upwelling), level, light, _EQUATIONS[upwelling])


def slope_kt_and_reflectance(reflectance, light, upwelling=True):
    """Results of `kt_on_slopes` and `terrain_reflectance` in one pass over the ground, equal to the bit."""
    cf.check_units(reflectance, "surface_reflectance")
    level = reflectance.transpose("band", "y", "x")
    kt, seen = chunking.along_first(_lit(slope_factor_and_reflectance, level, light, upwelling, leading=(2,)))
    return labelled_slopes(kt, level, light, *_KT), labelled_slopes(seen, level, light, _EQUATIONS[upwelling])


def _lit(kernel, level, light, *options, leading=()):
    """Array of a kernel on the slopes below the cells of a level reflectance."""

    def kernel_in_light(*cells):
        return kernel(*cells, light.direct_transmittance, light.transmittance_down, *options)

    return on_slopes(kernel_in_light, light.dem, light.horizon, light.geometry, level, leading=leading)


def labelled_slopes(data, level, light, history, name="surface_reflectance"):
    """Label a band raster made from the reflectance of level ground and the light on its slopes."""
    out = directions.with_geometry(grids.place(level.copy(data=data), grids.geobox(level)), light.geometry)
    return cf.label(out, name, source=level, history=history, references=REFERENCE)


def on_slopes(kernel, dem, horizon, geometry, reflectance=None, check=True, leading=()):
    """Array of a kernel on slopes, lazy where an input is."""
    dem = one_layer(dem if reflectance is None else with_crs_of(dem, reflectance), "dem")
    grid = elevation_grid(dem) if reflectance is None else grids.geobox(reflectance)
    level = None if reflectance is None else reflectance.data
    known = None if horizon is None else horizon.data
    level, data, known = lazy_together(level, dem.transpose(..., "y", "x").data, known)
    horizon = None if horizon is None else horizon.copy(data=known)
    of_block, reads = _light_on(grid, dem, data, horizon, geometry, check)
    of = data if level is None else level
    reads += [] if level is None else [chunking.margin_reads(level, 0)]
    chunks = None if isinstance(of, np.ndarray) else of.chunks[-2:]
    return chunking.windows(partial(of_block, kernel), reads, (*leading, *of.shape), chunks)


def light_on_slopes(dem, grid, geometry, horizon=None):
    """Elevation, sky, cell and geometry of the slopes of a grid for `slope_reflectance`, in memory."""
    dem = one_layer(dem, "dem")
    data = dem.transpose("y", "x").data
    of_block, reads = _light_on(grid, dem, data, horizon, geometry, True)
    return chunking.windows(partial(of_block, lambda *light: light), reads, tuple(grid.shape))


def _light_on(grid, dem, data, horizon, geometry, check):
    """Function for a block of a kernel on slopes, and its reads of elevation and sky."""
    dem_grid, turned = elevation_grid(dem), directions.from_grid_north(geometry, grid)
    offset = _offset(dem_grid, grid)
    layers, places = sky_labels.sky_above(data, dem_grid, source_resolution(dem), horizon, turned, check)
    return sky_labels.between_places(grid, offset, data, layers, places, turned)


def _offset(dem_grid, grid):
    """Row and column offset of the raster in the elevation."""
    try:
        rows, columns = grids.lattice_offset(dem_grid, grid)
    except ValueError:
        raise ValueError(
            f"the dem has other cells ({grids.extent(dem_grid)}, {dem_grid.affine.a:g} m) than the raster "
            f"({grids.extent(grid)}, {grid.affine.a:g} m): give fifesim.fine_dem(dem, raster.odc.geobox) for smaller "
            f"cells, dem.fifesim.aggregate({grid.affine.a:g}) for larger ones, or dem.rio.reproject_match(raster)"
        ) from None
    beyond = rows + grid.shape.y > dem_grid.shape.y or columns + grid.shape.x > dem_grid.shape.x
    if rows < 0 or columns < 0 or beyond:
        raise ValueError(f"the dem spans {grids.extent(dem_grid)} and does not cover the raster's {grids.extent(grid)}")
    return rows, columns


def sky_view(dem: xr.DataArray, horizon: Horizon | None = None) -> xr.DataArray:
    """
    Sky view factor Vd.

    Parameters
    ----------
    dem : xarray.DataArray, dims (y, x)
        [m]
    horizon : xarray.DataArray, dims (direction, y, x), optional
        Horizon of a larger elevation model, from `horizon`; by default the horizon of ``dem`` in 32 directions up to 5
        km.

    Returns
    -------
    sky_view : xarray.DataArray, dims (y, x)
        [1]

    Raises
    ------
    ValueError
        As in `fifesim.ground.terrain.labels.slope`, or if the horizon does not cover the elevation.

    Notes
    -----
    The visible sky is described by a vector that varies as slowly as the horizon. It is computed at the resolution of
    the horizon, interpolated, and multiplied with the surface normal of each cell.

    See Also
    --------
    fifesim.terrain.terrain_view, fifesim.horizon

    Examples
    --------
    >>> import fifesim
    >>> dem = fifesim.flint_hills(fifesim.fife_site(30, window=((0, 60), (0, 60))), seed=7)
    >>> bool((dem.fifesim.sky_view() <= 1).all())
    True
    """
    return _light(dem, horizon, None, "sky_view", lambda light: light.sky_view)


def terrain_view(dem: xr.DataArray, horizon: Horizon | None = None) -> xr.DataArray:
    """
    Share of land in the view of a slope, one less the sky view.

    Parameters
    ----------
    dem, horizon : xarray.DataArray
        As in `sky_view`.

    Returns
    -------
    terrain_view : xarray.DataArray, dims (y, x)
        Includes the land below the horizontal, which Ct of Eq. 4, (1 + cos S) / 2 - Vd, leaves out. [1]

    Raises
    ------
    ValueError
        As in `sky_view`.

    See Also
    --------
    fifesim.terrain.sky_view, fifesim.kt

    Examples
    --------
    >>> import fifesim
    >>> dem = fifesim.flint_hills(fifesim.fife_site(30, window=((0, 60), (0, 60))), seed=7)
    >>> bool((dem.fifesim.terrain_view() >= 0).all())
    True
    """
    return _light(dem, horizon, None, "terrain_view", lambda light: 1 - light.sky_view)


def illumination(
    dem: xr.DataArray,
    geometry: Directions | None = None,
    horizon: Horizon | None = None,
    *,
    time: Time | None = None,
) -> xr.DataArray:
    """
    Cosine of the solar zenith angle on the slope, 0 in self or cast shadow.

    Parameters
    ----------
    dem : xarray.DataArray, dims (y, x)
        [m]
    geometry : fifesim.base.geometry.Geometry, optional
        Direction of the sun; by default from the coordinates of the array, else from its time and place.
    horizon : xarray.DataArray, dims (direction, y, x), optional
        As in `sky_view`.
    time : str or datetime, optional
        Time for the position of the sun, instead of ``geometry``.

    Returns
    -------
    illumination : xarray.DataArray, dims (y, x)
        [1]

    Raises
    ------
    ValueError
        As in `sky_view`; or, unless lazy, if no slope is sunlit.

    See Also
    --------
    fifesim.kt, fifesim.terrain.shadow

    Examples
    --------
    >>> import fifesim
    >>> import numpy as np
    >>> dem = fifesim.flint_hills(fifesim.fife_site(30, window=((0, 60), (0, 60))), seed=7)
    >>> light = dem.fifesim.illumination()
    >>> bool(abs(float(light.mean()) - np.cos(np.radians(28.5))) < 0.02)
    True
    """
    return _light(dem, horizon, _sun(dem, geometry, time), "illumination", lambda light: light.mu_s_local)


def shadow(
    dem: xr.DataArray,
    geometry: Directions | None = None,
    horizon: Horizon | None = None,
    *,
    time: Time | None = None,
) -> xr.DataArray:
    """
    Cast and self shadow.

    Parameters
    ----------
    dem : xarray.DataArray, dims (y, x)
        Elevation on a UTM grid. [m]
    geometry, horizon, time
        As in `illumination`.

    Returns
    -------
    shadow : xarray.DataArray, dims (y, x)
        1 in shadow, 0 in the sun. [1]

    Raises
    ------
    ValueError
        As in `illumination`.

    Examples
    --------
    The sun of FIFE is too high for shadows on these hills:

    >>> import fifesim
    >>> dem = fifesim.flint_hills(fifesim.fife_site(30, window=((0, 60), (0, 60))), seed=7)
    >>> float(dem.fifesim.shadow().sum())
    0.0
    """
    return _light(dem, horizon, _sun(dem, geometry, time), "shadow", _shadow)


def _shadow(light):
    return np.where(np.isnan(light.mu_s_local), np.nan, light.mu_s_local == 0)


def _sun(dem, geometry, time):
    return directions.uniform_geometry(directions.given_geometry(geometry, dem, time), "a slope's light")


def _light(dem, horizon, geometry, name, of_light):
    """Raster of a function of `slope_light`."""
    grid = elevation_grid(dem)

    def kernel(elevation, sky, cell, seen):
        return of_light(slope_light(elevation, sky, cell, seen))

    data = on_slopes(kernel, dem, horizon, geometry or fife_geometry(), check=geometry is not None)
    out = grids.place(xr.DataArray(data, dims=("y", "x")), grid)
    out = out if geometry is None else directions.with_geometry(out, geometry)
    history = name if geometry is None else f"{name}: sza {geometry.sza:.2f}, saa {geometry.saa:.2f}"
    return cf.label(out, name, source=dem, history=history, references=REFERENCE)


# Distance at which elevations of the hills are independent, as their labels say. [m]
_RESOLUTION = 30.0


def light_on_hills(grid, around, seed, reach, geometry, altitude):
    """Elevation, sky, cell and geometry of hills for `slope_reflectance`, with the bits of `light_on_slopes`."""
    wide = grid.pad(1)
    northing, easting = centres_of(wide)
    data = look_at_altitude(hills_elevation(seed, northing, easting), altitude)
    carried, turned = as_carried(grid), from_grid_north(geometry, as_carried(grid))
    zenith, places = _horizon(around, seed, reach, as_carried(wide))
    layers = sky_labels.sky_under(zenith, data, places, turned)
    of_block, reads = sky_labels.between_places(carried, (1, 1), data, layers, places, turned)
    return chunking.windows(partial(of_block, lambda *light: light), reads, tuple(carried.shape))


def steepest(grid, seed):
    """Slope of the steepest cell of the hills on a coarse grid. [degree]"""
    land = np.pad(_land(grid, seed), 1, constant_values=np.nan)
    return float(steepness(land, *grids.cell_size(grid)).max())


def _land(grid, seed):
    return elevation_around(seed, grids.cell_size(grid), *grids.lattice_position(grid), tuple(grid.shape))


def _horizon(around, seed, reach, grid):
    """Horizon at the places around a grid, and the places. [degree]"""
    whole = sky_labels.places_of(as_carried(around), _RESOLUTION)
    places, cut = sky_labels.places_on(grid, as_carried(whole.coarse))
    useful = sky_labels.useful_reach(reach, whole)
    margin = horizons.horizon_margin(*whole.cell, useful)
    window = tuple(slice(part.start - wide, part.stop + wide) for part, wide in zip(cut, margin, strict=True))
    land = gather(_land(around, seed)[np.ix_(*whole.cells)], window)
    return horizons.horizon_zenith(land, *whole.cell, horizons.azimuths(sky_labels.DIRECTIONS), useful), places
