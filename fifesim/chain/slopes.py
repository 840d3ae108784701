"""Slopes below the air: what Kt and the reflectance of slopes need of the atmosphere is handed to them here."""

from __future__ import annotations

import xarray as xr

from fifesim.atmosphere.air.models import Atmosphere
from fifesim.atmosphere.schemes import engines
from fifesim.base.annotations import Time
from fifesim.chain.carried import air_bands_and_geometry, as_bands_of
from fifesim.ground.terrain.rasters import lit_slopes
from fifesim.ground.terrain.rasters.dem import beside_altitude
from fifesim.rasters import directions
from fifesim.rasters.annotations import Horizon
from fifesim.rasters.dates import by_date
from fifesim.rasters.directions import Directions
from fifesim.sensor.description.annotations import InstrumentLike


@by_date
def kt(
    reflectance: xr.DataArray,
    dem: xr.DataArray,
    *,
    horizon: Horizon | None = None,
    atmosphere: Atmosphere | None = None,
    geometry: Directions | None = None,
    time: Time | None = None,
    instrument: InstrumentLike | None = None,
) -> xr.DataArray:
    """
    Topographic correction factor Kt: what terrain does to the irradiance in each band.

    Parameters
    ----------
    reflectance : xarray.DataArray, dims (band, y, x)
        Of level ground, from `surface_reflectance` without a dem. [1]
    dem : xarray.DataArray, dims (y, x)
        As in `surface_reflectance`. [m]
    horizon : xarray.DataArray, dims (direction, y, x), optional
        As in `surface_reflectance`. [degree]
    atmosphere, geometry, time, instrument : optional
        As in `to_toa`.

    Returns
    -------
    kt : xarray.DataArray, dims (band, y, x)
        Lazy where an input is. [1]

    Raises
    ------
    ValueError
        As in `surface_reflectance`.

    References
    ----------
    [Friedl1995]_, Eq. 4; [Dubayah1992]_

    See Also
    --------
    fifesim.ground.terrain.light.topographic_factor

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> dem = fifesim.flint_hills(grid, seed=7)
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM4"])
    >>> kt = rho.fifesim.kt(dem)
    >>> kt.dims, bool(abs(kt.mean() - 1) < 0.1)
    (('band', 'y', 'x'), True)
    """
    reflectance = as_bands_of(reflectance, instrument, "surface_reflectance")
    light = sunlight(dem, *air_bands_and_geometry(reflectance, atmosphere, geometry, instrument, time), "kt")
    return lit_slopes.kt_on_slopes(directions.dated(reflectance, time), horizon=horizon, **light)


def kt_and_reflectance(level, dem, horizon=None, upwelling=True):
    """
    What terrain makes of the reflectance of level ground, in one pass: what `kt` and `surface_reflectance` give.

    Parameters
    ----------
    level : xarray.DataArray, dims (band, y, x)
        From `surface_reflectance` without a dem, below one direction of sun and sensor. [1]
    dem, horizon, upwelling
        As in `surface_reflectance`.

    Returns
    -------
    kt, reflectance : xarray.DataArray, dims (band, y, x)
        Lazy where an input is. [1]

    Raises
    ------
    ValueError
        As in `surface_reflectance`.
    """
    air = air_bands_and_geometry(level, None, None, None)
    light = sunlight(dem, *air, "surface_reflectance on slopes")
    return lit_slopes.kt_and_reflectance(level, upwelling=upwelling, horizon=horizon, **light)


def sunlight(dem, atmosphere, bands, geometry, what):
    """
    What Kt needs below one direction of sun and sensor: of the same elevation, a graph has the sky above it once.

    Parameters
    ----------
    dem : xarray.DataArray, dims (y, x)
        [m]
    atmosphere : fifesim.atmosphere.air.models.Atmosphere
    bands : sequence of fifesim.base.bands.Band
    geometry : fifesim.base.geometry.Geometry or xarray.Dataset
    what : str
        What it is for, to be named where sun or sensor have several directions.

    Returns
    -------
    light : dict
        Arguments of `fifesim.ground.terrain.rasters.lit_slopes.terrain_reflectance`.

    Raises
    ------
    ValueError
        If sun or sensor have several directions.
    """
    geometry = directions.uniform_geometry(geometry, what)
    terms = engines.band_terms(atmosphere, bands, geometry.sza, geometry.vza, geometry.raa)
    down, direct = terms.transmittance_down, terms.direct_transmittance_down
    dem = beside_altitude(dem, atmosphere.altitude)
    return {"dem": dem, "geometry": geometry, "transmittance_down": down, "direct_transmittance": direct}
