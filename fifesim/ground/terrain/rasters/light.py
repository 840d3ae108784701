"""Terrain on labelled rasters: slope, horizon, sky and the light on a slope, from an elevation model."""

from dataclasses import replace

import dask.array as da
import numpy as np
import xarray as xr

from fifesim.base.geometry import fife_geometry
from fifesim.ground.terrain import light as lights
from fifesim.ground.terrain import slope as terrain
from fifesim.ground.terrain.rasters import sky as sky_raster
from fifesim.rasters import cf
from fifesim.rasters import chunks as chunking
from fifesim.rasters import grid as grids

# A numpy array beside a lazy one is cut into blocks of this many cells.
_BLOCK = 1024


def slope(dem):
    """
    Slope of the ground.

    Parameters
    ----------
    dem : xarray.DataArray, dims (y, x)
        [m]

    Returns
    -------
    slope : xarray.DataArray, dims (y, x)
        At every cell; one-sided at the edges and beside missing cells. [degree]

    Raises
    ------
    ValueError
        If the elevation is not in metres on a north-up grid in a projected CRS.

    See Also
    --------
    fifesim.ground.terrain.slope.slope_aspect
    """
    return _slope_or_aspect(dem, "slope", 0)


def aspect(dem):
    """
    Azimuth down the slope, clockwise from north.

    Parameters
    ----------
    dem : xarray.DataArray, dims (y, x)
        [m]

    Returns
    -------
    aspect : xarray.DataArray, dims (y, x)
        0 on level ground. [degree]

    Raises
    ------
    ValueError
        As in `slope`.

    See Also
    --------
    fifesim.ground.terrain.slope.slope_aspect
    """
    return _slope_or_aspect(dem, "aspect", 1)


def sky_view(dem, horizon=None):
    """
    Sky view factor Vd.

    Parameters
    ----------
    dem : xarray.DataArray, dims (y, x)
        [m]
    horizon : xarray.DataArray, dims (direction, y, x), optional
        From `horizon`, such as that of an elevation model that reaches further; by default that of ``dem``, in 32
        directions and 5 km far.

    Returns
    -------
    sky_view : xarray.DataArray, dims (y, x)
        [1]

    Raises
    ------
    ValueError
        As in `slope`, or if the horizon does not cover the elevation.

    Notes
    -----
    The part of the sky that is seen from a place is a vector that varies as slowly as the horizon; it is found at the
    horizon's resolution and interpolated, and multiplied by the normal of each cell's own slope.

    See Also
    --------
    fifesim.ground.terrain.slope.sky_view, fifesim.ground.terrain.slope.sky_vector
    """
    return _light(dem, horizon, None, "sky_view", lambda light: light[1])


def terrain_view(dem, horizon=None):
    """
    Terrain configuration factor Ct.

    Parameters
    ----------
    dem, horizon : xarray.DataArray
        As in `sky_view`.

    Returns
    -------
    terrain_view : xarray.DataArray, dims (y, x)
        [1]

    Raises
    ------
    ValueError
        As in `sky_view`.

    See Also
    --------
    fifesim.ground.terrain.slope.terrain_view
    """
    return _light(dem, horizon, None, "terrain_view", lambda light: (1 + light[0]) / 2 - light[1])


def illumination(dem, geometry=None, horizon=None):
    """
    Cosine of the solar zenith angle on the slope, 0 where the slope or the land around hides the sun.

    Parameters
    ----------
    dem : xarray.DataArray, dims (y, x)
        [m]
    geometry : fifesim.base.geometry.Geometry, optional
        By default that which the array carries, else the paper's.
    horizon : xarray.DataArray, dims (direction, y, x), optional
        As in `sky_view`.

    Returns
    -------
    illumination : xarray.DataArray, dims (y, x)
        [1]

    Raises
    ------
    ValueError
        As in `sky_view`; or, unless lazy, if the sun reaches no slope.

    See Also
    --------
    fifesim.ground.terrain.light.local_cosine, fifesim.ground.terrain.light.horizon_toward
    """
    geometry = cf.uniform_geometry(cf.given_geometry(geometry, dem), "illumination")
    return _light(dem, horizon, geometry, "illumination", lambda light: light[2])


def shadow(dem, geometry=None, horizon=None):
    """
    Cast and self shadow.

    Parameters
    ----------
    dem, geometry, horizon
        As in `illumination`.

    Returns
    -------
    shadow : xarray.DataArray, dims (y, x)
        1 in shadow, 0 in the sun. [1]

    Raises
    ------
    ValueError
        As in `illumination`.
    """
    geometry = cf.uniform_geometry(cf.given_geometry(geometry, dem), "shadow")
    return _light(dem, horizon, geometry, "shadow", lambda light: np.where(np.isnan(light[2]), np.nan, light[2] == 0))


def kt(reflectance, dem, *, direct_transmittance, transmittance_down, geometry, horizon=None):
    """
    Topographic correction factor Kt of each band.

    Parameters
    ----------
    reflectance : xarray.DataArray, dims (band, y, x)
        Of the land around, as on level ground. [1]
    dem : xarray.DataArray, dims (y, x)
        On the same cells, or more of them. [m]
    direct_transmittance, transmittance_down : array, shape (band,)
        Of the sunbeam, and of all light, from the sun to the ground. [1]
    geometry : fifesim.base.geometry.Geometry
    horizon : xarray.DataArray, dims (direction, y, x), optional
        As in `sky_view`.

    Returns
    -------
    kt : xarray.DataArray, dims (band, y, x)
        [1]

    Raises
    ------
    ValueError
        As in `terrain_reflectance`.

    See Also
    --------
    fifesim.ground.terrain.light.kt
    """
    direct, total = (np.reshape(each, (-1, 1, 1)) for each in (direct_transmittance, transmittance_down))

    def kernel(rho, seen, *place):
        cosine, vd, mu_s_local, _ = lights.slope_light(*place, seen)
        return lights.kt(vd, (1 + cosine) / 2 - vd, rho, mu_s_local, geometry.mu_s, direct, total)

    return _on_slopes(kernel, reflectance, dem, geometry, horizon, "kt", "kt: Eq. 4")


def terrain_reflectance(
    reflectance, dem, *, direct_transmittance, transmittance_down, geometry, horizon=None, upwelling=True
):
    """
    Reflectance factor of ground on slopes, against the irradiance of level ground.

    Parameters
    ----------
    reflectance : xarray.DataArray, dims (band, y, x)
        Of level ground. [1]
    dem : xarray.DataArray, dims (y, x)
        On the same cells, or more of them. [m]
    direct_transmittance, transmittance_down : array, shape (band,)
        Of the sunbeam, and of all light, from the sun to the ground. [1]
    geometry : fifesim.base.geometry.Geometry
    horizon : xarray.DataArray, dims (direction, y, x), optional
        As in `sky_view`.
    upwelling : bool, optional
        Whether with the factor of Eq. 5.

    Returns
    -------
    reflectance : xarray.DataArray, dims (band, y, x)
        Lazy where an input is; NaN where elevation is missing. [1]

    Raises
    ------
    ValueError
        If the elevation is not in metres, does not cover the reflectance or lies on other cells, or, unless lazy, the
        sun reaches no slope.

    Notes
    -----
    Slopes, the sun's and the view's local cosines are those of each cell. The horizon, and the sky that it leaves, are
    found at the resolution of the elevation's source and interpolated. Beside all at 3.33 m, on Kings Creek
    interpolated from 10 m, this moves Vd by 0.0003 rms and Kt of the red and near infrared by 0.0001 (sza 28.5); with
    30 m instead of 10 m, by 0.0016 and 0.0003, 0.01 at worst; where the edge of a shadow falls, by all of the beam.

    See Also
    --------
    fifesim.ground.terrain.light.slope_reflectance
    """
    cf.check_units(reflectance, "surface_reflectance")

    def kernel(rho, seen, *place):
        return lights.slope_reflectance(rho, *place, seen, direct_transmittance, transmittance_down, upwelling)

    said = f"terrain: Kt (Eq. 4){' and view cosine (Eq. 5)' if upwelling else ''}"
    return _on_slopes(kernel, reflectance, dem, geometry, horizon, "surface_reflectance", said)


def _slope_or_aspect(dem, name, which):
    grid = sky_raster.elevation_grid(dem)

    def kernel(block):
        return terrain.slope_aspect(block, *grids.cell_size(grid))[which]

    out = grids.place(chunking.neighbourhood(kernel, dem, 1), grid)
    return cf.label(out, name, source=dem, history=f"{name}: central differences", references=sky_raster.REFERENCE)


def _light(dem, horizon, geometry, name, pick):
    """One of the quantities that `slope_light` gives, at every cell."""
    grid = sky_raster.elevation_grid(dem)
    used = _from_grid_north(geometry or fife_geometry(), grid)
    dem = dem.transpose("y", "x")
    data, horizon = _lazy_together(dem.data, horizon)
    sky, between = sky_raster.sky_above(
        data, grid, sky_raster.source_resolution(dem), horizon, used, check=geometry is not None
    )
    cell, shape = grids.cell_size(grid), data.shape

    def kernel(rows, columns, block, layers):
        return pick(lights.slope_light(block, layers, *between.block(rows, columns, (0, 0)), *cell, used))

    reads = [chunking.margin_reads(data, 1), between.reads(sky, (0, 0), shape)]
    out = grids.place(xr.DataArray(chunking.windows(kernel, reads, shape, _chunks(data)), dims=("y", "x")), grid)
    out = out if geometry is None else cf.with_geometry(out, geometry)
    said = name if geometry is None else f"{name}: sza {geometry.sza:.2f}, saa {geometry.saa:.2f}"
    return cf.label(out, name, source=dem, history=said, references=sky_raster.REFERENCE)


def _on_slopes(kernel, reflectance, dem, geometry, horizon, name, said):
    """A band raster made from level ground's reflectance and the light on its slopes."""
    dem_grid, grid = sky_raster.elevation_grid(dem), grids.geobox(reflectance)
    offset = _offset(dem_grid, grid)
    reflectance, dem = reflectance.transpose("band", "y", "x"), dem.transpose("y", "x")
    rho, data, horizon = _lazy_together(reflectance.data, dem.data, horizon)
    seen = _from_grid_north(geometry, grid)
    sky, between = sky_raster.sky_above(data, dem_grid, sky_raster.source_resolution(dem), horizon, seen)
    cell, shape = grids.cell_size(grid), rho.shape

    def block_kernel(rows, columns, block, elevation, layers):
        return kernel(block, seen, elevation, layers, *between.block(rows, columns, offset), *cell)

    reads = [
        chunking.margin_reads(rho, 0),
        chunking.margin_reads(data, 1, offset=offset, shape=shape[1:]),
        between.reads(sky, offset, shape[1:]),
    ]
    out = chunking.windows(block_kernel, reads, shape, _chunks(rho))
    out = grids.place(reflectance.copy(data=out), grid)
    out = cf.with_geometry(out, geometry)
    return cf.label(out, name, source=reflectance, history=said, references=sky_raster.REFERENCE)


def _from_grid_north(geometry, grid):
    """Directions whose azimuths count from the north of the grid, as aspects and horizons do."""
    turn = grids.convergence(grid)
    return replace(geometry, saa=geometry.saa - turn, vaa=geometry.vaa - turn)


def _offset(dem_grid, grid):
    """Rows and columns of the elevation before the raster's first cell."""
    try:
        rows, columns = grids.lattice_offset(dem_grid, grid)
    except ValueError:
        raise ValueError(
            f"the dem lies on other cells ({grids.extent(dem_grid)}, {dem_grid.affine.a:g} m) than the raster "
            f"({grids.extent(grid)}, {grid.affine.a:g} m): bring it onto the raster's grid first"
        ) from None
    beyond = rows + grid.shape.y > dem_grid.shape.y or columns + grid.shape.x > dem_grid.shape.x
    if rows < 0 or columns < 0 or beyond:
        raise ValueError(f"the dem spans {grids.extent(dem_grid)} and does not cover the raster's {grids.extent(grid)}")
    return rows, columns


def _lazy_together(*arrays):
    """All arrays lazy where one is."""
    plain = [getattr(each, "data", None) if isinstance(each, xr.DataArray) else each for each in arrays]
    if not any(isinstance(each, da.Array) for each in plain):
        return arrays
    return [_chunked(each) for each in arrays]


def _chunked(array):
    if array is None or isinstance(array, da.Array):
        return array
    if isinstance(array, xr.DataArray):
        return array if array.chunks else array.chunk(dict.fromkeys(("y", "x"), _BLOCK))
    return da.from_array(array, chunks=(-1,) * (array.ndim - 2) + (_BLOCK, _BLOCK), name=False)


def _chunks(data):
    return data.chunks[-2:] if isinstance(data, da.Array) else None
