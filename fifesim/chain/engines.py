"""What one engine of the atmosphere costs beside another, in the case of a setup."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import xarray as xr

from fifesim.analysis.indices import normalized_difference
from fifesim.atmosphere.air.models import Atmosphere
from fifesim.atmosphere.schemes import coupling
from fifesim.atmosphere.schemes import engines as schemes
from fifesim.atmosphere.schemes.mixed_air import whole_scattering
from fifesim.base.annotations import Names, Numbers
from fifesim.base.bands import NEAR_INFRARED, RED, nearest
from fifesim.base.geometry import fife_geometry
from fifesim.base.kinds import described
from fifesim.chain.setup import Setup, reflectance_of
from fifesim.rasters import cf, directions
from fifesim.rasters import grid as grids
from fifesim.rasters.sites import fife_site, made_on_site
from fifesim.sensor.description.instruments import instrument as find_instrument

TYPICAL_LAI = 2.0  # of the surface that stands for all [m2 m-2]

_LONG_NAMES = {
    "path_reflectance": "reflectance of molecules and aerosol over a black ground, without gases",
    "transmittance_down": "total scattering transmittance from the sun to the ground",
    "transmittance_up": "total scattering transmittance from the ground to the sensor",
    "spherical_albedo": "spherical albedo of the atmosphere seen from below",
    "gas_transmittance": "transmittance of the absorbing gases, down and up",
}


def compare_engines(
    setup: Setup | None = None, *, reflectance: Numbers | None = None, engines: Names = ("5S", "successive-orders")
) -> xr.Dataset:
    """
    What the atmosphere of a setup does by several engines.

    Parameters
    ----------
    setup : Setup, optional
        Its air, directions, instrument, bands, leaves and background count; by default the paper's.
    reflectance : number or sequence of float, shape (band,), optional
        Of an even surface; by default that of the setup's canopy of leaf area 2. [1]
    engines : sequence of str, optional
        Of those of `Atmosphere`.

    Returns
    -------
    terms : xarray.Dataset, dims (engine, band)
        Path reflectance, transmittances, spherical albedo, and ``toa_reflectance`` of the surface; ``ndvi`` of it by
        engine where there are a red and a near infrared band. [1]

    Raises
    ------
    ValueError
        If an engine is unknown, sun or view vary or are out of its range, or the reflectance is not one for each band.

    See Also
    --------
    fifesim.atmosphere.schemes.engines.band_terms, fifesim.atmosphere.schemes.coupling.apparent_reflectance

    Examples
    --------
    >>> from fifesim import Atmosphere, Setup, compare_engines
    >>> haze = Setup(atmosphere=Atmosphere(visibility=8), bands=("TM3", "TM4"))
    >>> compare_engines(haze, engines=["5S"])["toa_reflectance"].dims
    ('engine', 'band')
    """
    setup, air, bands, geometry = _case(setup)
    surface = _surface(setup, air, reflectance, len(bands))
    responses = tuple(band.response for band in bands)
    names = [engines] if isinstance(engines, str) else list(engines)
    airs = [replace(air, engine=engine) for engine in names]
    found = [schemes.band_terms(each, responses, geometry.sza, geometry.vza, geometry.raa).uniform for each in airs]
    values = {name: np.array([terms[name] for terms in found]) for name in _LONG_NAMES}
    toa = np.array([coupling.apparent_reflectance(surface, **terms) for terms in found])
    data = {name: (("engine", "band"), each, _attributes(_LONG_NAMES[name])) for name, each in values.items()}
    data["surface_reflectance"] = "band", surface, cf.attributes("surface_reflectance")
    data["toa_reflectance"] = ("engine", "band"), toa, cf.attributes("toa_reflectance")
    wavelength = [band.wavelength for band in bands]
    red, near_infrared = (nearest(wavelength, window) for window in (RED, NEAR_INFRARED))
    if red is not None and near_infrared is not None:
        ndvi = normalized_difference(toa[:, near_infrared], toa[:, red])
        data["ndvi"] = "engine", ndvi, cf.attributes("ndvi")
    coords = {
        "engine": names,
        "band": [band.name for band in bands],
        "wavelength": ("band", wavelength, cf.attributes("wavelength")),
    }
    return directions.with_geometry(xr.Dataset(data, coords, {"atmosphere": air.text}), geometry)


def engine_error(setup=None):
    """
    How far the engine of a setup is from successive orders, quickly.

    Parameters
    ----------
    setup : Setup, optional

    Returns
    -------
    error : dict of str to float
        By band: apparent reflectance of the setup's canopy of leaf area 2 over that of successive orders, less 1, at
        the mean wavelength of the band and without gases. Beside `compare_engines` within .5 %. [1]

    Raises
    ------
    ValueError
        If the engine is 6S, or sun or view vary or are out of its range.

    See Also
    --------
    fifesim.atmosphere.schemes.engines.scattering, fifesim.atmosphere.schemes.mixed_air.whole_scattering
    """
    setup, air, bands, geometry = _case(setup)
    surface = _surface(setup, air, None, len(bands))
    wavelength = np.array([band.response.center for band in bands])
    increasing = np.argsort(wavelength)
    views = geometry.sza, np.array([geometry.vza]), np.array([geometry.raa])
    toa = []
    for scattering in (schemes.scattering, whole_scattering):
        light = scattering(air, wavelength[increasing], *views)
        down, up = light.transmittance_down, light.transmittance_up
        terms = light.reflectance, down, up, light.spherical_albedo, 1.0
        toa.append(np.ravel(coupling.apparent_reflectance(surface[increasing], *terms)))
    error = dict(zip(increasing.tolist(), (toa[0] / toa[1] - 1).tolist(), strict=True))
    return {band.name: error[number] for number, band in enumerate(bands)}


def _case(setup):
    """Setup, air, bands and uniform directions."""
    setup = Setup() if setup is None else setup
    if not isinstance(setup, Setup):
        raise TypeError(f"setup must be a fifesim.Setup, got {setup!r}: see fifesim.Setup")
    air = Atmosphere() if setup.atmosphere is None else setup.atmosphere
    geometry = fife_geometry() if setup.geometry is None else setup.geometry
    bands = find_instrument(setup.instrument).select(setup.bands)
    return setup, air, bands, directions.uniform_geometry(geometry, "a comparison of engines")


def _surface(setup, air, reflectance, n_bands):
    """Reflectance of the surface in each band, shape (band,)."""
    if reflectance is None:
        # One cell, under the same light for all engines.
        cell = fife_site(30, window=((0, 1), (0, 1)))
        lai = grids.place(xr.DataArray([[TYPICAL_LAI]], dims=("y", "x"), attrs=made_on_site(cell)), cell)
        level = replace(setup, atmosphere=replace(air, engine="5S"), dem=None, horizon=None)
        return reflectance_of(level, lai).values.ravel()
    surface = np.asarray(reflectance, float)
    if surface.shape not in ((), (n_bands,)) or not np.all((surface >= 0) & (surface <= 1)):
        raise ValueError(
            f"reflectance must be one number from 0 to 1, or {n_bands}, one for each band, got "
            f"{described(reflectance)}: leave it out to have that of a canopy"
        )
    return np.broadcast_to(surface, n_bands)


def _attributes(long_name):
    return {"long_name": long_name, "units": "1"}
