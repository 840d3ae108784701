"""Atmosphere on labelled rasters: surface reflectance to apparent reflectance and back, and spectral terms."""

from __future__ import annotations

from functools import partial

import numpy as np
import xarray as xr

from fifesim.atmosphere import adjacency_labels, coupling, engines, gases, lookup
from fifesim.atmosphere.coupling import on_wavelengths, spectral_nodes
from fifesim.atmosphere.models import Atmosphere
from fifesim.base.geometry import ANGLES, Geometry, fife_geometry
from fifesim.grids import cf, chunks, directions, swaths
from fifesim.grids import grid as grids

LONG_NAMES = {
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


def spectrum(atmosphere: Atmosphere | None = None, geometry: Geometry | None = None) -> xr.Dataset:
    """
    Spectral terms of an atmosphere: path reflectance, transmittances, spherical albedo and optical depths.

    Parameters
    ----------
    atmosphere : Atmosphere, optional
        By default midlatitude summer, continental aerosol, 45 km visibility.
    geometry : fifesim.base.geometry.Geometry, optional
        Directions of sun and sensor; by default as in the paper.

    Returns
    -------
    spectrum : xarray.Dataset, dims (wavelength) and (gas, wavelength)
        Path reflectance, transmittances, spherical albedo, optical depths and the transmittance of each gas, at the
        841 wavelengths of the gas tables, 0.4 to 2.5 um. [1]

    Raises
    ------
    ValueError
        If sun or sensor are too low or vary, or if the tables of a user-defined aerosol do not cover the wavelengths.

    See Also
    --------
    fifesim.atmosphere.compare_engines, fifesim.to_toa

    Examples
    --------
    Water vapour absorbs nothing at 0.865 um, and more than half of the light at 0.94 um:

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
    values = {name: values.get(name, getattr(light, name, None)).reshape(-1) for name in LONG_NAMES}
    each_gas = np.stack(by_gas).reshape(len(gases.GASES), -1)
    found = {name: ("wavelength", each, {"long_name": LONG_NAMES[name], "units": "1"}) for name, each in values.items()}
    attrs = {"long_name": "transmittance of each gas, two ways", "units": "1"}
    found["transmittance_of_gas"] = ("gas", "wavelength"), each_gas, attrs
    coords = {"wavelength": ("wavelength", wavelength, cf.attributes("wavelength")), "gas": list(gases.GASES)}
    return directions.with_geometry(xr.Dataset(found, coords, {"atmosphere": atmosphere.text}), geometry)


EQUATION_SOURCE = "Tanre et al. (1990), doi:10.1080/01431169008955048"


def toa_from_surface(
    reflectance, atmosphere, bands, geometry, *, elevation=None, adjacency=False, surroundings=None, made=None
):
    """Apparent reflectance at the top of the atmosphere from labelled surface reflectance, dims (band, y, x). [1]"""
    cf.check_quantity(reflectance, "surface_reflectance")
    scene = reflectance, atmosphere, bands, geometry, elevation, adjacency, surroundings
    return _carry("toa_reflectance", "to_toa", *scene, made)


def surface_from_toa(reflectance, atmosphere, bands, geometry, *, elevation=None, adjacency=False, surroundings=None):
    """Surface reflectance from labelled apparent reflectance, the inverse of `toa_from_surface`, dims (band, y,
    x). [1]"""
    cf.check_quantity(reflectance, "toa_reflectance")
    scene = reflectance, atmosphere, bands, geometry, elevation, adjacency, surroundings
    return _carry("surface_reflectance", "to_surface", *scene)


def diffuse_fraction(atmosphere, bands, geometry):
    """Diffuse fraction of the irradiance of level ground, shape (band,), or dims (band, y, x) for varying sun. [1]"""
    varies = directions.varying(geometry)
    if "sza" not in varies:
        # In 5S the downward light does not depend on the view, so the cached run of `toa_from_surface` is used.
        known = atmosphere.engine == "5S" and not varies and geometry.vza <= engines.LARGEST_ZENITH
        view = (geometry.vza, geometry.raa) if known else (0.0, 0.0)
        return engines.band_terms(atmosphere, tuple(bands), geometry.sza, *view).diffuse_fraction
    kernel = partial(lookup.varying_diffuse_fraction, atmosphere=atmosphere, bands=tuple(bands))
    return chunks.pointwise(kernel, geometry.sza, bands=len(bands))


def _carry(name, verb, reflectance, atmosphere, bands, geometry, elevation, adjacency, surroundings, made=None):
    reflectance = adjacency_labels.banded(reflectance)
    if surroundings is not None and not adjacency:
        raise ValueError("surroundings have an effect only with adjacency=True: give both, or leave surroundings out")
    _check_cells(reflectance, geometry, elevation, adjacency)
    if isinstance(surroundings, xr.DataArray) and "band" in surroundings.dims:
        surroundings = adjacency_labels.same_bands(surroundings, reflectance)
    plain = grids.without(reflectance, ("band", *ANGLES))
    to_toa, by_cell = verb == "to_toa", directions.varying(geometry)
    if adjacency and (elevation is not None or by_cell):
        what = "elevation" if elevation is not None else "rasters of " + ", ".join(by_cell)
        raise ValueError(f"adjacency needs a single geometry and altitude, got {what}: remove one of them")
    if elevation is not None or by_cell:
        out = _varying(to_toa, plain, atmosphere, bands, geometry, elevation)
    else:
        out = _uniform(to_toa, plain, atmosphere, bands, geometry, adjacency, surroundings, made)
    if reflectance.dtype == np.float32:
        out = out.astype(np.float32)
    names = {"band": reflectance.coords.variables["band"]} if "band" in reflectance.coords else {}
    out = swaths.placed_as(out, reflectance, names | directions.coordinates_of(geometry))
    text = f"{verb}: {atmosphere.engine}{' with adjacency' if adjacency else ''}, {atmosphere.text}"
    return cf.label(out, name, source=reflectance, history=text, atmosphere=atmosphere.text, references=EQUATION_SOURCE)


def _check_cells(reflectance, geometry, elevation, adjacency):
    """Raise ValueError if a swath is combined with rasters of angles or elevation on a map, or with adjacency."""
    if "line" not in reflectance.dims:
        return
    rasters = {name: geometry[name] for name in directions.varying(geometry)} | {"elevation": elevation}
    on_map = [name for name, each in rasters.items() if each is not None and not set(each.dims) <= set(swaths.DIMS)]
    if adjacency or on_map:
        what = "adjacency" if adjacency else f"{', '.join(on_map)} by (y, x)"
        raise ValueError(
            f"{what} does not fit the lines and samples of a scan: put it onto a map with .grid_swath(grid)"
        )


def _varying(to_toa, reflectance, atmosphere, bands, geometry, elevation):
    """Reflectance through an atmosphere whose geometry or altitude varies from cell to cell."""
    if elevation is None:
        altitude = xr.DataArray(atmosphere.altitude)
    else:
        cf.check_quantity(elevation, "dem")
        altitude = elevation / 1000

    kernel = partial(lookup.varying_reflectance, atmosphere=atmosphere, bands=tuple(bands), to_surface=not to_toa)
    return chunks.pointwise(kernel, reflectance, altitude, *directions.angles(geometry), bands=len(bands))


def _uniform(to_toa, reflectance, atmosphere, bands, geometry, adjacency, surroundings, made):
    """Reflectance through an atmosphere with one geometry and one altitude."""
    terms = engines.band_terms(atmosphere, tuple(bands), geometry.sza, geometry.vza, geometry.raa)
    if adjacency:
        through = adjacency_labels.corrected_reflectance_of_scene
        through = adjacency_labels.apparent_reflectance_of_scene if to_toa else through
        return through(reflectance, terms, geometry.vza, surroundings)
    if made is not None:
        return reflectance.copy(data=made(terms).data)
    kernel = coupling.apparent_reflectance if to_toa else coupling.corrected_reflectance
    return chunks.pointwise(kernel, reflectance, *(xr.Variable("band", each) for each in terms.uniform.values()))
