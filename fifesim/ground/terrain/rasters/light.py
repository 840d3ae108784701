"""Terrain on labelled rasters: sky, horizon and the light on a slope, from an elevation model."""

from __future__ import annotations

import numpy as np
import xarray as xr

from fifesim.base.annotations import Time
from fifesim.base.geometry import fife_geometry
from fifesim.ground.terrain import sky as skies
from fifesim.ground.terrain.lit_slopes import slope_light
from fifesim.ground.terrain.rasters.dem import REFERENCE, elevation_grid
from fifesim.ground.terrain.rasters.lit_slopes import on_slopes
from fifesim.rasters import cf, directions
from fifesim.rasters import grid as grids
from fifesim.rasters.annotations import Horizon
from fifesim.rasters.directions import Directions


def sky_view(dem: xr.DataArray, horizon: Horizon | None = None) -> xr.DataArray:
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
        As in `fifesim.ground.terrain.rasters.slopes.slope`, or if the horizon does not cover the elevation.

    Notes
    -----
    The part of the sky that is seen from a place is a vector that varies as slowly as the horizon; it is found at the
    horizon's resolution and interpolated, and multiplied by the normal of each cell's own slope.

    See Also
    --------
    fifesim.ground.terrain.sky.sky_factor, fifesim.ground.terrain.sky.sky_vector

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
    fifesim.ground.terrain.sky.terrain_view

    Examples
    --------
    >>> import fifesim
    >>> dem = fifesim.flint_hills(fifesim.fife_site(30, window=((0, 60), (0, 60))), seed=7)
    >>> bool((dem.fifesim.terrain_view() >= 0).all())
    True
    """
    return _light(dem, horizon, None, "terrain_view", lambda light: skies.terrain_view(light.sky_view, light.cosine))


def illumination(
    dem: xr.DataArray,
    geometry: Directions | None = None,
    horizon: Horizon | None = None,
    *,
    time: Time | None = None,
) -> xr.DataArray:
    """
    Cosine of the solar zenith angle on the slope, 0 where the slope or the land around hides the sun.

    Parameters
    ----------
    dem : xarray.DataArray, dims (y, x)
        [m]
    geometry : fifesim.base.geometry.Geometry, optional
        By default that which the array carries, else of the sun at its time and place.
    horizon : xarray.DataArray, dims (direction, y, x), optional
        As in `sky_view`.
    time : str or datetime, optional
        In the place of ``geometry``.

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
    fifesim.ground.terrain.slope.along_normal, fifesim.ground.terrain.horizon.horizon_toward

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
    The sun of FIFE stands too high for shadows on these hills:

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
    """What a function makes of `slope_light`, at every cell."""
    grid = elevation_grid(dem)

    def kernel(elevation, sky, cell, seen):
        return of_light(slope_light(elevation, sky, cell, seen))

    data = on_slopes(kernel, dem, horizon, geometry or fife_geometry(), check=geometry is not None)
    out = grids.place(xr.DataArray(data, dims=("y", "x")), grid)
    out = out if geometry is None else directions.with_geometry(out, geometry)
    said = name if geometry is None else f"{name}: sza {geometry.sza:.2f}, saa {geometry.saa:.2f}"
    return cf.label(out, name, source=dem, history=said, references=REFERENCE)
