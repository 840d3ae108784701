"""The spectral terms of an atmosphere, labelled."""

from __future__ import annotations

import numpy as np
import xarray as xr

from fifesim.atmosphere.air import gases
from fifesim.atmosphere.air.models import Atmosphere
from fifesim.atmosphere.schemes import engines
from fifesim.atmosphere.schemes.terms import on_wavelengths, spectral_nodes
from fifesim.base.geometry import fife_geometry
from fifesim.rasters import cf, directions
from fifesim.rasters.directions import Directions

_LONG_NAMES = {
    "path_reflectance": "reflectance of molecules and aerosol over a black ground, without gases",
    "molecules_reflectance": "reflectance of the molecules alone over a black ground, without gases",
    "transmittance_down": "total scattering transmittance from the sun to the ground",
    "transmittance_up": "total scattering transmittance from the ground to the sensor",
    "direct_transmittance_down": "transmittance of the sunbeam, without gases",
    "direct_transmittance_up": "direct transmittance from the ground to the sensor, without gases",
    "spherical_albedo": "spherical albedo of the atmosphere seen from below",
    "molecules_optical_depth": "vertical optical depth of the molecules",
    "aerosol_optical_depth": "vertical optical depth of the aerosol",
    "gas_transmittance": "transmittance of the absorbing gases from the sun to the ground and to the sensor",
}


def spectrum(atmosphere: Atmosphere | None = None, geometry: Directions | None = None) -> xr.Dataset:
    """
    What an atmosphere does to light, wavelength by wavelength.

    Parameters
    ----------
    atmosphere : Atmosphere, optional
        By default midlatitude summer, continental aerosol, 45 km visibility.
    geometry : fifesim.base.geometry.Geometry, optional
        Of sun and sensor; by default the paper's.

    Returns
    -------
    spectrum : xarray.Dataset, dims (wavelength) and (gas, wavelength)
        Path reflectance, transmittances, spherical albedo, optical depths and the transmittance of each gas, at the
        841 wavelengths of the gas tables, 0.4 to 2.5 um. [1]

    Raises
    ------
    ValueError
        If sun or sensor stand too low, or vary, if the engine is 6S, which knows bands only, or if the aerosol is one's
        own whose tables are shorter.

    See Also
    --------
    fifesim.atmosphere.schemes.engines.band_terms

    Examples
    --------
    Water vapour takes nothing at 0.865 um, and more than half of the light at 0.94 um:

    >>> from fifesim import atmosphere
    >>> light = atmosphere.spectrum()
    >>> light.gas_transmittance.sel(wavelength=[0.865, 0.94]).round(2).values.tolist()
    [1.0, 0.44]
    """
    atmosphere = Atmosphere() if atmosphere is None else atmosphere
    geometry = directions.uniform_geometry(fife_geometry() if geometry is None else geometry, "spectrum")
    for name in ("sza", "vza"):
        engines.check_zenith(name, getattr(geometry, name))
    wavelength = gases.table_wavelengths()
    engines.check_aerosol(atmosphere, "the spectrum", wavelength[0], wavelength[-1])
    nodes = spectral_nodes(wavelength[0], wavelength[-1])
    views = np.array([geometry.vza]), np.array([geometry.raa])
    light = on_wavelengths(engines.scattering(atmosphere, nodes, geometry.sza, *views), nodes, wavelength)
    air_mass = 1 / geometry.mu_s + 1 / geometry.mu_v
    by_gas = [gases.gas_transmittance(wavelength, atmosphere, air_mass, gases=(gas,)) for gas in gases.GASES]
    values = {
        "path_reflectance": light.reflectance,
        "molecules_optical_depth": atmosphere.rayleigh_optical_depth(wavelength),
        "aerosol_optical_depth": atmosphere.aerosol_optical_depth(wavelength),
        "gas_transmittance": np.prod(by_gas, axis=0),
    }
    values = {name: values.get(name, getattr(light, name, None)).reshape(-1) for name in _LONG_NAMES}
    found = {
        name: ("wavelength", array, {"long_name": _LONG_NAMES[name], "units": "1"}) for name, array in values.items()
    }
    each = ("gas", "wavelength"), np.stack(by_gas).reshape(len(gases.GASES), -1)
    found["transmittance_of_gas"] = (*each, {"long_name": "transmittance of each gas, two ways", "units": "1"})
    coords = {"wavelength": ("wavelength", wavelength, cf.attributes("wavelength")), "gas": list(gases.GASES)}
    return directions.with_geometry(xr.Dataset(found, coords, {"atmosphere": atmosphere.text}), geometry)
