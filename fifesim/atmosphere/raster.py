"""The atmosphere on labelled rasters: surface reflectance to the top of the atmosphere, and back."""

import numpy as np
import xarray as xr

from fifesim.atmosphere.adjacency import raster as adjacency_raster
from fifesim.atmosphere.schemes import coupling, engines, lookup
from fifesim.base.geometry import ANGLES
from fifesim.rasters import cf, chunks, directions, swaths

_REFERENCE = "Tanre et al. (1990), doi:10.1080/01431169008955048"


def to_toa(reflectance, atmosphere, bands, geometry, *, elevation=None, adjacency=False, surroundings=None):
    """
    Apparent reflectance at the top of the atmosphere.

    Parameters
    ----------
    reflectance : xarray.DataArray, dims (band, y, x)
        Surface reflectance factor. [1]
    atmosphere : fifesim.atmosphere.air.models.Atmosphere
    bands : sequence of fifesim.base.bands.Band
        One for each band of the raster.
    geometry : fifesim.base.geometry.Geometry, or xarray.Dataset of angles on the cells
    elevation : xarray.DataArray, dims (y, x), optional
        Of the ground on the cells, 0 to 4000, in the place of the atmosphere's one altitude. [m]
    adjacency : bool, optional
        Whether light that the surroundings reflect is scattered into the view of a cell.
    surroundings : number, sequence or xarray.DataArray, optional
        Reflectance around the scene, for adjacency; by default the scene's mean. [1]

    Returns
    -------
    reflectance : xarray.DataArray, dims (band, y, x)
        [1]

    Raises
    ------
    ValueError
        If the units are wrong, sun or sensor stand lower than the model holds, or adjacency is asked for where the
        geometry or the altitude varies.

    See Also
    --------
    fifesim.atmosphere.schemes.coupling.apparent_reflectance,
    fifesim.atmosphere.schemes.coupling.inhomogeneous_reflectance
    """
    cf.check_quantity(reflectance, "surface_reflectance")
    said = ("toa_reflectance", "to_toa")
    return _carry(*said, reflectance, atmosphere, bands, geometry, elevation, adjacency, surroundings)


def to_surface(reflectance, atmosphere, bands, geometry, *, elevation=None, adjacency=False, surroundings=None):
    """
    Surface reflectance from that at the top of the atmosphere; the inverse of `to_toa`.

    Parameters
    ----------
    reflectance : xarray.DataArray, dims (band, y, x)
        At the top of the atmosphere. [1]
    atmosphere, bands, geometry, elevation, adjacency, surroundings
        As in `to_toa`.

    Returns
    -------
    reflectance : xarray.DataArray, dims (band, y, x)
        Negative where noise or a wrong atmosphere makes it so. [1]

    Raises
    ------
    ValueError
        As in `to_toa`.

    See Also
    --------
    fifesim.atmosphere.schemes.coupling.corrected_reflectance
    """
    cf.check_quantity(reflectance, "toa_reflectance")
    said = ("surface_reflectance", "to_surface")
    return _carry(*said, reflectance, atmosphere, bands, geometry, elevation, adjacency, surroundings)


def diffuse_fraction(atmosphere, bands, geometry):
    """
    Share of skylight in the irradiance of level ground.

    Parameters
    ----------
    atmosphere : fifesim.atmosphere.air.models.Atmosphere
    bands : sequence of fifesim.base.bands.Band, length (band,)
    geometry : fifesim.base.geometry.Geometry or xarray.Dataset

    Returns
    -------
    diffuse_fraction : array, shape (band,), or xarray.DataArray, dims (band, y, x)
        The latter where the sun varies. [1]

    See Also
    --------
    fifesim.atmosphere.schemes.lookup.varying_diffuse_fraction
    """
    varies = directions.varying(geometry)
    if "sza" not in varies:
        # In 5S what comes down does not know the view: the run is the one that `to_toa` asks for.
        known = atmosphere.engine == "5S" and not varies and geometry.vza <= engines.LARGEST_ZENITH
        view = (geometry.vza, geometry.raa) if known else (0.0, 0.0)
        return engines.band_terms(atmosphere, tuple(bands), geometry.sza, *view).diffuse_fraction

    def kernel(sza):
        return lookup.varying_diffuse_fraction(sza, atmosphere=atmosphere, bands=tuple(bands))

    return chunks.pointwise(kernel, geometry.sza, bands=len(bands))


def _carry(name, verb, reflectance, atmosphere, bands, geometry, elevation, adjacency, surroundings):
    reflectance = adjacency_raster.banded(reflectance)
    if surroundings is not None and not adjacency:
        raise ValueError("surroundings matter with adjacency=True only: give both, or leave surroundings out")
    _check_cells(reflectance, geometry, elevation, adjacency)
    plain = reflectance.drop_vars(["band", *ANGLES], errors="ignore")
    if adjacency:
        out = _with_adjacency(verb, plain, atmosphere, bands, geometry, elevation, surroundings)
    elif elevation is None and not directions.varying(geometry):
        out = _uniform(verb, plain, atmosphere, bands, geometry)
    else:
        out = _varying(verb, plain, atmosphere, bands, geometry, elevation)
    if reflectance.dtype == np.float32:
        out = out.astype(np.float32)
    if "band" in reflectance.coords:
        out = out.assign_coords(band=reflectance["band"])
    out = directions.with_geometry(swaths.placed_as(out, reflectance), geometry)
    text = f"{verb}: {atmosphere.engine}{' with adjacency' if adjacency else ''}, {atmosphere.text}"
    return cf.label(out, name, source=reflectance, history=text, atmosphere=atmosphere.text, references=_REFERENCE)


def _check_cells(reflectance, geometry, elevation, adjacency):
    """Refuse what lies on a map, where the light is that of a scan: both would be spread over each other."""
    if "line" not in reflectance.dims:
        return
    rasters = {name: geometry[name] for name in directions.varying(geometry)} | {"elevation": elevation}
    on_map = [name for name, each in rasters.items() if each is not None and not set(each.dims) <= set(swaths.DIMS)]
    if adjacency or on_map:
        what = "adjacency" if adjacency else f"{', '.join(on_map)} by (y, x)"
        raise ValueError(
            f"{what} does not fit the lines and samples of a scan: put it onto a map with .grid_swath(grid)"
        )


def _uniform(verb, reflectance, atmosphere, bands, geometry):
    terms = engines.band_terms(atmosphere, tuple(bands), geometry.sza, geometry.vza, geometry.raa)
    kernel = coupling.apparent_reflectance if verb == "to_toa" else coupling.corrected_reflectance
    per_band = (xr.DataArray(values, dims="band") for values in terms.uniform.values())
    return chunks.pointwise(kernel, reflectance, *per_band)


def _varying(verb, reflectance, atmosphere, bands, geometry, elevation):
    if atmosphere.engine == "6S":
        raise ValueError(
            "engine='6S' runs for one geometry and one altitude: average the angles and leave elevation out, "
            "or use engine='successive-orders'"
        )
    if elevation is None:
        altitude = xr.DataArray(atmosphere.altitude)
    else:
        cf.check_quantity(elevation, "dem")
        altitude = elevation / 1000

    options = {"atmosphere": atmosphere, "bands": tuple(bands), "to_surface": verb == "to_surface"}

    def kernel(rho, *places):
        return lookup.varying_reflectance(rho, *places, **options)

    return chunks.pointwise(kernel, reflectance, altitude, *directions.angles(geometry), bands=len(bands))


def _with_adjacency(verb, reflectance, atmosphere, bands, geometry, elevation, surroundings):
    if elevation is not None or directions.varying(geometry):
        what = "elevation" if elevation is not None else "rasters of " + ", ".join(directions.varying(geometry))
        raise ValueError(f"adjacency takes one geometry and one altitude, got {what}: leave one of the two out")
    terms = engines.band_terms(atmosphere, tuple(bands), geometry.sza, geometry.vza, geometry.raa)
    if verb == "to_toa":
        return adjacency_raster.apparent_reflectance_of_scene(reflectance, terms, geometry.vza, surroundings)
    return adjacency_raster.corrected_reflectance_of_scene(reflectance, terms, geometry.vza, surroundings)
